// The table of field types (size, name, whether shared), and copying, comparing and destroying values.
#include <rtsg/core/value.h>

#include <algorithm>

namespace rtsg {

namespace {

template <class T>
constexpr std::uint8_t kComponents = 1;
template <>
constexpr std::uint8_t kComponents<String> = 0;
template <>
constexpr std::uint8_t kComponents<Image> = 0;
template <>
constexpr std::uint8_t kComponents<CustomValue> = 0;
template <>
constexpr std::uint8_t kComponents<NodeId> = 0;
template <>
constexpr std::uint8_t kComponents<Color> = 3;
template <>
constexpr std::uint8_t kComponents<ColorRGBA> = 4;
template <>
constexpr std::uint8_t kComponents<Vec2f> = 2;
template <>
constexpr std::uint8_t kComponents<Vec2d> = 2;
template <>
constexpr std::uint8_t kComponents<Vec3f> = 3;
template <>
constexpr std::uint8_t kComponents<Vec3d> = 3;
template <>
constexpr std::uint8_t kComponents<Vec4f> = 4;
template <>
constexpr std::uint8_t kComponents<Vec4d> = 4;
template <>
constexpr std::uint8_t kComponents<Rotation> = 4;
template <>
constexpr std::uint8_t kComponents<Matrix3f> = 9;
template <>
constexpr std::uint8_t kComponents<Matrix3d> = 9;
template <>
constexpr std::uint8_t kComponents<Matrix4f> = 16;
template <>
constexpr std::uint8_t kComponents<Matrix4d> = 16;

template <class T>
constexpr bool kShared = std::is_same_v<T, String> || std::is_same_v<T, Image> || std::is_same_v<T, CustomValue>;

#define RTSG_X(suffix, type)                                                                                  \
    FieldTypeInfo{"SF" #suffix, sizeof(type), alignof(type), kShared<type>, sizeof(type), kComponents<type>}, \
        FieldTypeInfo{"MF" #suffix, sizeof(void*), alignof(void*), true, sizeof(type), kComponents<type>},
constexpr FieldTypeInfo kInfos[] = {RTSG_FIELD_TYPES(RTSG_X)};
#undef RTSG_X
static_assert(std::size(kInfos) == kFieldTypeCount);

using Header = detail::ArrayHeader;

/// Every shared type is one pointer to a header, whatever its elements.
Header* headerAt(const void* storage) {
    Header* header = nullptr;
    std::memcpy(&header, storage, sizeof(header));
    return header;
}

bool equalArrays(FieldType element, const Header* a, const Header* b) {
    if (a == b) return true;
    const std::uint64_t size = a ? a->size : 0;
    if (size != (b ? b->size : 0)) return false;
    if (size == 0) return true;
    const auto* x = reinterpret_cast<const std::byte*>(a + 1);
    const auto* y = reinterpret_cast<const std::byte*>(b + 1);
    const FieldTypeInfo& i = info(element);
    if (!i.shared) return std::memcmp(x, y, size * i.elementSize) == 0;
    for (std::uint64_t k = 0; k < size; ++k)
        if (!equalStorage(element, x + k * i.elementSize, y + k * i.elementSize)) return false;
    return true;
}

/// The type of the elements of a shared type's array. Strings, and values of types
/// from outside, count as bytes: SFBool has that size and no sharing.
FieldType elementOf(FieldType type) {
    if (type == FieldType::SFString || type == FieldType::SFCustom) return FieldType::SFBool;
    if (type == FieldType::SFImage) return FieldType::SFInt32;
    return sf(type);
}

}  // namespace

const FieldTypeInfo& info(FieldType type) {
    return kInfos[static_cast<unsigned>(type)];
}

bool fieldTypeFromName(std::string_view name, FieldType& out) {
    const auto found = std::ranges::find(kInfos, name, &FieldTypeInfo::name);
    if (found == std::end(kInfos) || found->name.ends_with("Custom")) return false;
    out = static_cast<FieldType>(found - std::begin(kInfos));
    return true;
}

Value::Value(const Value& other) noexcept : type_(other.type_) {
    std::memcpy(inline_, other.inline_, sizeof(inline_));
    if (owns()) detail::retain(headerAt(inline_));
}

void Value::dropOwned() noexcept {
    detail::release(headerAt(inline_));
}

Value Value::zero(FieldType type) {
    switch (type) {
#define RTSG_X(suffix, T)       \
    case FieldType::SF##suffix: \
        return Value(T());      \
    case FieldType::MF##suffix: \
        return Value(Array<T>());
        RTSG_FIELD_TYPES(RTSG_X)
#undef RTSG_X
    }
    return {};
}

Value Value::fromStorage(FieldType type, const void* storage) {
    switch (type) {
#define RTSG_X(suffix, T)                              \
    case FieldType::SF##suffix:                        \
        return Value(*static_cast<const T*>(storage)); \
    case FieldType::MF##suffix:                        \
        return Value(*static_cast<const Array<T>*>(storage));
        RTSG_FIELD_TYPES(RTSG_X)
#undef RTSG_X
    }
    return {};
}

bool operator==(const Value& a, const Value& b) noexcept {
    return a.type_ == b.type_ && equalStorage(a.type_, a.storage(), b.storage());
}

void copyStorage(FieldType type, void* target, const void* source) {
    const FieldTypeInfo& i = info(type);
    if (i.shared) {
        detail::retain(headerAt(source));  // before the release: both may be the same array
        detail::release(headerAt(target));
    }
    std::memmove(target, source, i.size);
}

void destroyStorage(FieldType type, void* target) {
    const FieldTypeInfo& i = info(type);
    if (i.shared) detail::release(headerAt(target));
    std::memset(target, 0, i.size);
}

bool equalStorage(FieldType type, const void* a, const void* b) {
    const FieldTypeInfo& i = info(type);
    if (i.shared) return equalArrays(elementOf(type), headerAt(a), headerAt(b));
    return std::memcmp(a, b, i.size) == 0;
}

}  // namespace rtsg
