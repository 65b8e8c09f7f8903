// X3D's field types, one more type for all custom ones, their C++ representations, and Value: one value of any of them.
//
// Invariant: `mf(sf(t)) == t` for every MF type; a Value is 24 bytes and copying it never copies elements.
// Source: ISO/IEC 19775-1 V4.0 clause 5. Matrices are stored in the order the file gives them (row by row).
// Threading: values are immutable and may be shared between threads.

// Example:
//     #include <rtsg/core/value.h>
//     rtsg::Array<rtsg::Vec3f> points{{0, 0, 0}, {1, 0, 0}};
//     const rtsg::Value value = points;  // shares the elements
//     points.mutableData()[1].x = 2;  // its own copy from here on
//     if (value.holds<rtsg::Array<rtsg::Vec3f>>())
//         std::cout << value.as<rtsg::Array<rtsg::Vec3f>>()[1].x;  // still 1
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <string>
#include <string_view>

#include <glm/glm.hpp>

#include <rtsg/core/array.h>

namespace rtsg {

using Vec2f = glm::vec2;
using Vec2d = glm::dvec2;
using Vec3f = glm::vec3;
using Vec3d = glm::dvec3;
using Vec4f = glm::vec4;
using Vec4d = glm::dvec4;

/// RGB in [0, 1].
struct Color {
    float r = 0, g = 0, b = 0;
    friend bool operator==(const Color&, const Color&) = default;
};
struct ColorRGBA {
    float r = 0, g = 0, b = 0, a = 0;
    friend bool operator==(const ColorRGBA&, const ColorRGBA&) = default;
};
/// Axis (unit length expected, not enforced here) and angle in radians, right-handed.
struct Rotation {
    float x = 0, y = 0, z = 1, angle = 0;
    friend bool operator==(const Rotation&, const Rotation&) = default;
};
/// Seconds since 1970-01-01 00:00 UTC, or whatever epoch the driving clock uses.
struct Time {
    double seconds = 0;
    friend bool operator==(const Time&, const Time&) = default;
};
/// N*N elements, row by row as in the file.
template <class S, int N>
struct SquareMatrix {
    std::array<S, static_cast<std::size_t>(N) * N> elements = identity();
    static constexpr std::array<S, static_cast<std::size_t>(N) * N> identity() {
        std::array<S, static_cast<std::size_t>(N) * N> result{};
        for (int i = 0; i < N; ++i) result[static_cast<std::size_t>(i * N + i)] = S(1);  // NOLINT: N <= 4
        return result;
    }
    friend bool operator==(const SquareMatrix&, const SquareMatrix&) = default;
};
using Matrix3f = SquareMatrix<float, 3>;
using Matrix3d = SquareMatrix<double, 3>;
using Matrix4f = SquareMatrix<float, 4>;
using Matrix4d = SquareMatrix<double, 4>;

/// SFImage as in the file: width, height, components, then one integer a pixel, lower left first.
struct Image {
    Array<std::int32_t> words;
    int width() const { return words.size() < 3 ? 0 : words[0]; }
    int height() const { return words.size() < 3 ? 0 : words[1]; }
    int components() const { return words.size() < 3 ? 0 : words[2]; }
    friend bool operator==(const Image&, const Image&) = default;
};

/// A value of a custom type, which custom_field.h makes and reads. The type's name and layout are part of it, so that
/// programs that lack the type keep the value. An empty one has no type; no field of a node has such a value.
struct CustomValue {
    Array<char> box;
    friend bool operator==(const CustomValue&, const CustomValue&) = default;
};

/// Names a node; 0 is no node (NULL). Numbers are never used again within a session.
struct NodeId {
    std::uint32_t value = 0;
    explicit operator bool() const { return value != 0; }
    friend bool operator==(const NodeId&, const NodeId&) = default;
    friend auto operator<=>(const NodeId&, const NodeId&) = default;
};

// clang-format off
/// SF and MF alternate: the MF type is the SF type plus one. The numbers are part of the wire format.
enum class FieldType : std::uint8_t {
    SFBool, MFBool, SFInt32, MFInt32, SFFloat, MFFloat, SFDouble, MFDouble, SFTime, MFTime,
    SFString, MFString, SFNode, MFNode, SFColor, MFColor, SFColorRGBA, MFColorRGBA, SFImage, MFImage,
    SFVec2f, MFVec2f, SFVec2d, MFVec2d, SFVec3f, MFVec3f, SFVec3d, MFVec3d, SFVec4f, MFVec4f,
    SFVec4d, MFVec4d, SFRotation, MFRotation, SFMatrix3f, MFMatrix3f, SFMatrix3d, MFMatrix3d,
    SFMatrix4f, MFMatrix4f, SFMatrix4d, MFMatrix4d,
    SFCustom, MFCustom,  // FieldDef::custom says which type it is
};
// clang-format on
constexpr int kFieldTypeCount = 44;

constexpr bool isMF(FieldType type) {
    return (static_cast<unsigned>(type) & 1u) != 0;
}
constexpr FieldType sf(FieldType type) {
    return static_cast<FieldType>(static_cast<unsigned>(type) & ~1u);
}
constexpr FieldType mf(FieldType type) {
    return static_cast<FieldType>(static_cast<unsigned>(type) | 1u);
}

// clang-format off: X(FieldType suffix, C++ element type)
#define RTSG_FIELD_TYPES(X) \
    X(Bool, bool) X(Int32, std::int32_t) X(Float, float) X(Double, double) X(Time, ::rtsg::Time) \
    X(String, ::rtsg::String) X(Node, ::rtsg::NodeId) X(Color, ::rtsg::Color) X(ColorRGBA, ::rtsg::ColorRGBA) \
    X(Image, ::rtsg::Image) X(Vec2f, ::rtsg::Vec2f) X(Vec2d, ::rtsg::Vec2d) X(Vec3f, ::rtsg::Vec3f) \
    X(Vec3d, ::rtsg::Vec3d) X(Vec4f, ::rtsg::Vec4f) X(Vec4d, ::rtsg::Vec4d) X(Rotation, ::rtsg::Rotation) \
    X(Matrix3f, ::rtsg::Matrix3f) X(Matrix3d, ::rtsg::Matrix3d) X(Matrix4f, ::rtsg::Matrix4f) \
    X(Matrix4d, ::rtsg::Matrix4d) X(Custom, ::rtsg::CustomValue)
// clang-format on

/// FieldTypeOf<Vec3f>::value == SFVec3f; FieldTypeOf<Array<Vec3f>>::value == MFVec3f.
template <class T>
struct FieldTypeOf;
#define RTSG_X(suffix, type)                                      \
    template <>                                                   \
    struct FieldTypeOf<type> {                                    \
        static constexpr FieldType value = FieldType::SF##suffix; \
    };                                                            \
    template <>                                                   \
    struct FieldTypeOf<Array<type>> {                             \
        static constexpr FieldType value = FieldType::MF##suffix; \
    };
RTSG_FIELD_TYPES(RTSG_X)
#undef RTSG_X

/// How a type is stored in a node's block: plain bytes, or one pointer to a shared array.
struct FieldTypeInfo {
    std::string_view name;  // "SFVec3f"
    std::uint8_t size;      // bytes in the node's block (8 for shared types)
    std::uint8_t alignment;
    bool shared;               // String, Image, CustomValue and every MF type
    std::uint8_t elementSize;  // bytes of one element (the SF size)
    std::uint8_t components;   // numbers in one element; 0 for String, Image, Node, Custom
};
const FieldTypeInfo& info(FieldType type);
/// Finds one of X3D's types. Returns false if `name` is no field type.
bool fieldTypeFromName(std::string_view name, FieldType& out);

namespace detail {
constexpr std::uint64_t bit(FieldType t) {
    return std::uint64_t{1} << static_cast<unsigned>(t);
}
// SF types above 16 bytes live in a one-element array.
constexpr std::uint64_t kBoxed = bit(FieldType::SFVec3d) | bit(FieldType::SFVec4d) | bit(FieldType::SFMatrix3f) |
                                 bit(FieldType::SFMatrix3d) | bit(FieldType::SFMatrix4f) | bit(FieldType::SFMatrix4d);
constexpr std::uint64_t kOwns =
    kBoxed | bit(FieldType::SFString) | bit(FieldType::SFImage) | bit(FieldType::SFCustom) | 0xAAAAAAAAAAAAAAAAull;
}  // namespace detail

/// Copies 1, 4, 8, 12 or 16 bytes, the sizes of plain field types; faster than memcpy when the size is not constant.
[[gnu::always_inline]] inline void copyPlain(void* target, const void* source, std::size_t size) noexcept {
    switch (size) {
        case 1:
            std::memcpy(target, source, 1);
            break;
        case 4:
            std::memcpy(target, source, 4);
            break;
        case 8:
            std::memcpy(target, source, 8);
            break;
        case 12:
            std::memcpy(target, source, 12);
            break;
        default:
            std::memcpy(target, source, 16);
            break;
    }
}

/// One value of any field type.
class Value {
  public:
    Value() noexcept = default;  // SFBool FALSE
    template <class T>
        requires requires { FieldTypeOf<T>::value; }
    Value(T value) : type_(FieldTypeOf<T>::value) {
        if constexpr (sizeof(T) <= sizeof(inline_)) {
            new (inline_) T(std::move(value));
        } else {
            new (inline_) Array<T>{value};
        }
    }
    Value(const Value& other) noexcept;
    Value(Value&& other) noexcept : type_(other.type_) {
        std::memcpy(inline_, other.inline_, sizeof(inline_));
        other.type_ = FieldType::SFBool;
    }
    Value& operator=(const Value& other) noexcept {
        if (this != &other) {
            Value copy(other);
            *this = std::move(copy);
        }
        return *this;
    }
    Value& operator=(Value&& other) noexcept {
        if (this != &other) {
            if (owns()) dropOwned();
            type_ = other.type_;
            std::memcpy(inline_, other.inline_, sizeof(inline_));
            other.type_ = FieldType::SFBool;
        }
        return *this;
    }
    ~Value() {
        if (owns()) dropOwned();
    }

    /// The type's default: zero, empty, NULL, the identity, or `0 0 1 0` for rotations.
    static Value zero(FieldType type);
    /// Reads the block representation (`info(type).size` bytes) at `storage`.
    static Value fromStorage(FieldType type, const void* storage);
    /// Becomes the value at `storage`, of a type without shared data. Precondition: `size == info(type).size`.
    void setPlain(FieldType type, const void* storage, std::size_t size) noexcept {
        if (type_ != type) {
            if (owns()) dropOwned();
            type_ = type;
        }
        copyPlain(inline_, storage, size);
    }

    FieldType type() const noexcept { return type_; }
    template <class T>
    bool holds() const noexcept {
        return FieldTypeOf<T>::value == type_;
    }
    /// Precondition: holds<T>().
    template <class T>
    const T& as() const noexcept {
        return *static_cast<const T*>(storage());
    }
    /// The block representation, `info(type()).size` bytes; for shared types a pointer to the header.
    const void* storage() const noexcept {
        return boxed() ? static_cast<const void*>(*reinterpret_cast<detail::ArrayHeader* const*>(inline_) + 1)
                       : static_cast<const void*>(inline_);
    }
    /// Compares bits: NaN equals the same NaN, and 0 differs from -0.
    friend bool operator==(const Value& a, const Value& b) noexcept;

  private:
    bool owns() const noexcept { return detail::kOwns >> static_cast<unsigned>(type_) & 1u; }
    bool boxed() const noexcept { return detail::kBoxed >> static_cast<unsigned>(type_) & 1u; }
    void dropOwned() noexcept;

    alignas(8) std::byte inline_[16] = {};
    FieldType type_ = FieldType::SFBool;
};
static_assert(sizeof(Value) == 24);

/// Copies, destroys or compares a value of any type in block representation.
void copyStorage(FieldType type, void* target, const void* source);
void destroyStorage(FieldType type, void* target);
bool equalStorage(FieldType type, const void* a, const void* b);

}  // namespace rtsg
