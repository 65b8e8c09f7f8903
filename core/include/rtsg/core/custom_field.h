// Field types of applications: SFQuantity and MFQuantity beside SFVec3f and MFVec3f.
//
// A type is a name, a layout (a number of bytes, or of numbers of one kind), and functions for its text, for its value
// in scripts and for interpolation. All such types share FieldType::SFCustom and MFCustom; FieldDef::custom says which
// one a field has. Invariant: two values are equal if their bits are equal, and so are their hashes, also where the
// type is unknown. Values that shall count as equal must therefore get the same bits from `normalised`. Name and layout
// travel in each value; where the functions are missing, the text of a value is its numbers, or 0x and its bytes.
// Threading: values and types are constant. The registry locks; functions may be called by several threads at once.
// Source: RTSG paper 3.1 (users define new field types, after OpenInventor).

// Example:
//     #include <rtsg/core/custom_field.h>
//     auto type = rtsg::registerFieldType("SFQuantity", {rtsg::CustomLayout::Of::float64, 2}).value();
//     const double numbers[] = {3.5, 1};
//     const rtsg::Value value = type->value(numbers).value();
//     std::cout << rtsg::customNumbers(value.as<rtsg::CustomValue>())[0];
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <rtsg/core/diagnostic.h>
#include <rtsg/core/value.h>

namespace rtsg {

struct CustomLayout {
    enum class Of : std::uint8_t { bytes, int32, float32, float64 };
    Of of = Of::float64;
    std::uint16_t count = 1;  // numbers in a value, 1 to 1024; of bytes 0 to 1024, where 0 is any number of them

    /// The size of a value in bytes; 0: any size.
    std::size_t size() const { return count * (of == Of::bytes ? 1u : of == Of::float64 ? 8u : 4u); }
    friend bool operator==(const CustomLayout&, const CustomLayout&) = default;
};

/// The name and the layout: all that others must know to keep values of the type.
class CustomType {
  public:
    /// `name` is "SFQuantity" or "MFQuantity": SF or MF, a capital, then letters, digits and _, at most 64 characters
    /// after SF. Errors: another kind of name; the name of an X3D type; a layout outside its bounds.
    static Result<std::shared_ptr<const CustomType>> make(std::string_view name, CustomLayout layout);
    /// The type of a value; null if the value has none or is malformed.
    static std::shared_ptr<const CustomType> of(const CustomValue& value);
    /// The same for bytes that somebody else has sent; `box` is CustomValue::box.
    static std::shared_ptr<const CustomType> ofBox(std::string_view box);

    /// For example "Quantity".
    std::string_view name() const { return std::string_view(head_).substr(kNameAt); }
    const CustomLayout& layout() const { return layout_; }
    /// The bytes with which each value begins.
    std::string_view head() const { return head_; }

    CustomValue zero() const;
    bool holds(const CustomValue& value) const;
    /// Makes a value of little-endian bytes, without `normalised`. Errors: another number of bytes than the layout
    /// says.
    Result<CustomValue> value(std::span<const std::byte> bits) const;
    /// Makes a value of numbers of the layout's kind, or of bytes. Errors: another number of them than the layout says;
    /// a number that does not fit an int32 or a byte where the layout has these.
    Result<CustomValue> value(std::span<const double> numbers) const;

    friend bool operator==(const CustomType& a, const CustomType& b) { return a.head_ == b.head_; }

  private:
    static constexpr std::size_t kNameAt = 4;  // the offset behind the kind, the count (2 bytes) and the length of the
                                               // name
    std::string head_;
    CustomLayout layout_;
};

/// The bytes of the value, without the name and the layout before them.
std::span<const std::byte> customBits(const CustomValue& value);
/// The same as numbers: those of the layout, or bytes as 0 to 255.
std::vector<double> customNumbers(const CustomValue& value);

/// The functions of a type; all may be missing. If one throws, it counts as missing, or as an error.
struct CustomFunctions {
    /// The text for people, such as "3.5 m", and its parser; a type has both or neither. The text is used where `parse`
    /// makes the same bits of it again; otherwise the numbers are written.
    std::function<std::string(const CustomValue& value)> print;
    std::function<Result<CustomValue>(const CustomType& type, std::string_view text)> parse;
    /// Returns the same bits for all values that count as equal. Errors: the value is not valid. It is called for
    /// values from files, scripts, Python and feeds.
    std::function<Result<CustomValue>(const CustomType& type, const CustomValue& value)> normalised;
    /// Interpolates between two values, 0 < t < 1, for mirrors that play out smoothly. Without it the earlier value
    /// holds.
    std::function<CustomValue(const CustomValue& a, const CustomValue& b, double t)> between;
    /// True: scripts see the text. False: they see a number or an array of numbers, but the text for types of bytes.
    bool scriptsSeeText = false;
};

/// Makes the type known to this process, so that files and tables may name it. If the type is registered already with
/// the same layout, the functions that are given here replace the earlier ones. Errors: those of CustomType::make; the
/// type is registered with another layout.
Result<std::shared_ptr<const CustomType>> registerFieldType(std::string_view name, CustomLayout layout,
                                                            CustomFunctions functions = {});
/// A copy of the registry, which restoreFieldTypes() brings back if a registration of several types fails half-way.
class FieldTypeRegistry;
std::shared_ptr<const FieldTypeRegistry> fieldTypeRegistry();
void restoreFieldTypes(std::shared_ptr<const FieldTypeRegistry> before);
/// While it lives, this thread also finds these types by name, before those that are registered: for scenes that have
/// types from a stream, and declarations that name them.
class FieldTypesInScope {
  public:
    explicit FieldTypesInScope(std::vector<std::shared_ptr<const CustomType>> types);
    ~FieldTypesInScope();
    FieldTypesInScope(const FieldTypesInScope&) = delete;
    FieldTypesInScope& operator=(const FieldTypesInScope&) = delete;

  private:
    std::vector<std::shared_ptr<const CustomType>> outer_;
};
/// While it lives, this thread prints values as numbers, for programs that may lack the type.
class CustomNumbersOnly {
  public:
    CustomNumbersOnly();
    ~CustomNumbersOnly();
    CustomNumbersOnly(const CustomNumbersOnly&) = delete;
    CustomNumbersOnly& operator=(const CustomNumbersOnly&) = delete;

  private:
    bool outer_;
};
/// Returns a registered type; null if there is none. `name` is "SFQuantity" or "MFQuantity".
std::shared_ptr<const CustomType> findFieldType(std::string_view name);
/// Finds X3D's types as well as registered ones. Returns false if there is none of that name.
bool fieldTypeFromName(std::string_view name, FieldType& type, std::shared_ptr<const CustomType>& custom);

/// The text of `print`; nothing where the numbers are to be written.
std::optional<std::string> customText(const CustomValue& value);
/// Whether the type has a text of its own.
bool hasCustomText(const CustomType& type);
/// Errors: those of `parse`; a value of another type; the type has no text.
Result<CustomValue> customFromText(const CustomType& type, std::string_view text);
/// The numbers as text: "3.5 1", or "0x0aff". JSON is different: it has numbers as arrays.
std::string customDefaultText(const CustomValue& value);
/// Errors: those of `normalised`.
Result<CustomValue> normalisedCustom(const CustomType& type, CustomValue value);
/// Returns `a` if the type cannot interpolate.
CustomValue customBetween(const CustomValue& a, const CustomValue& b, double t);
bool scriptsSeeText(const CustomType& type);

/// For example "SFVec3f" or "MFQuantity".
std::string fieldTypeName(FieldType type, const CustomType* custom);
/// The same for a value. An empty MFCustom value does not know its type.
std::string typeNameOf(const Value& value);
/// Value::zero for all types, custom ones included.
Value zeroOf(FieldType type, const CustomType* custom);
namespace detail {
bool areOfType(const Value& value, const CustomType* custom);
}
/// Whether the value is of this type. Precondition: `custom` is not null if `type` is SFCustom or MFCustom.
inline bool isOfType(const Value& value, FieldType type, const CustomType* custom) {
    return value.type() == type && (sf(type) != FieldType::SFCustom || detail::areOfType(value, custom));
}
/// Whether two fields, or declarations of fields, have the same type.
template <class A, class B>
bool haveOneType(const A& a, const B& b) {
    return a.type == b.type && (sf(a.type) != FieldType::SFCustom || (a.custom && b.custom && *a.custom == *b.custom));
}

}  // namespace rtsg
