// Field types of one's own: SFQuantity and MFQuantity beside SFVec3f and MFVec3f.
//
// A type is a name, a layout (so many numbers of one kind, or bytes), and functions for its text, for what scripts see
// and for values in between. All share FieldType::SFCustom and MFCustom; FieldDef::custom says which a field has.
// Invariant: values are equal if their bits are, and so are hashes, here and where the type is not known: what shall
// count as equal must get the same bits from `normalised`. Name and layout travel in each value; where the functions
// are missing, its text is its numbers, or 0x and its bytes. Threading: values and types are constant. The registry
// locks; functions may be called by several threads at once. Source: RTSG paper 3.1 (users define new field types,
// after OpenInventor).

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

    /// Bytes of a value; 0: any number.
    std::size_t size() const { return count * (of == Of::bytes ? 1u : of == Of::float64 ? 8u : 4u); }
    friend bool operator==(const CustomLayout&, const CustomLayout&) = default;
};

/// The name and the layout: what others must know to keep values.
class CustomType {
  public:
    /// `name`: "SFQuantity" or "MFQuantity", letters, digits and _, of at most 64 behind SF, the first a capital.
    /// Errors: no such name; it is one of X3D's; a layout beyond its bounds.
    static Result<std::shared_ptr<const CustomType>> make(std::string_view name, CustomLayout layout);
    /// Null if the value has none, or is malformed.
    static std::shared_ptr<const CustomType> of(const CustomValue& value);
    /// Of what somebody else has sent: null as above. `box` is CustomValue::box.
    static std::shared_ptr<const CustomType> ofBox(std::string_view box);

    /// "Quantity".
    std::string_view name() const { return std::string_view(head_).substr(kNameAt); }
    const CustomLayout& layout() const { return layout_; }
    /// What each value begins with.
    std::string_view head() const { return head_; }

    CustomValue zero() const;
    bool holds(const CustomValue& value) const;
    /// Errors: not as many as the layout says. Little-endian; these are not `normalised`.
    Result<CustomValue> value(std::span<const std::byte> bits) const;
    /// Numbers of the layout's kind, or bytes. Errors: not as many; one that is no integer of 32 bits, or no byte,
    /// where these are wanted.
    Result<CustomValue> value(std::span<const double> numbers) const;

    friend bool operator==(const CustomType& a, const CustomType& b) { return a.head_ == b.head_; }

  private:
    static constexpr std::size_t kNameAt = 4;  // behind what it is made of, how many (2 bytes), the name's length
    std::string head_;
    CustomLayout layout_;
};

/// Behind the type's name.
std::span<const std::byte> customBits(const CustomValue& value);
/// The same as numbers: those of the layout, or bytes from 0 to 255.
std::vector<double> customNumbers(const CustomValue& value);

/// What a type can do; all may be missing. An exception counts as if the function were missing, or as an error.
struct CustomFunctions {
    /// A text for people, as "3.5 m"; both or none. It is used where `parse` makes the same bits of it again; else the
    /// numbers are written.
    std::function<std::string(const CustomValue& value)> print;
    std::function<Result<CustomValue>(const CustomType& type, std::string_view text)> parse;
    /// One value for all that count as equal; errors: there is none. Called for what files, scripts, Python and feeds
    /// say.
    std::function<Result<CustomValue>(const CustomType& type, const CustomValue& value)> normalised;
    /// Between two values, 0 < t < 1, for mirrors that play out smoothly. Without: the earlier one.
    std::function<CustomValue(const CustomValue& a, const CustomValue& b, double t)> between;
    /// Scripts see the text; else the number or an array of them, and of bytes the text in any case.
    bool scriptsSeeText = false;
};

/// From now on this process knows the type: files and tables may name it. Again with the same layout: functions that
/// are given take the place of those before. Errors: those of CustomType::make; there is one with another layout.
Result<std::shared_ptr<const CustomType>> registerFieldType(std::string_view name, CustomLayout layout,
                                                            CustomFunctions functions = {});
/// The registry as it is, to be brought back if what registers fails half-way.
class FieldTypeRegistry;
std::shared_ptr<const FieldTypeRegistry> fieldTypeRegistry();
void restoreFieldTypes(std::shared_ptr<const FieldTypeRegistry> before);
/// As long as it lives, this thread finds these types by name as well, before those that are registered: a scene has
/// types of a stream, and declarations that name them.
class FieldTypesInScope {
  public:
    explicit FieldTypesInScope(std::vector<std::shared_ptr<const CustomType>> types);
    ~FieldTypesInScope();
    FieldTypesInScope(const FieldTypesInScope&) = delete;
    FieldTypesInScope& operator=(const FieldTypesInScope&) = delete;

  private:
    std::vector<std::shared_ptr<const CustomType>> outer_;
};
/// As long as it lives, this thread prints values as numbers: what is written is for programs that may lack the type.
class CustomNumbersOnly {
  public:
    CustomNumbersOnly();
    ~CustomNumbersOnly();
    CustomNumbersOnly(const CustomNumbersOnly&) = delete;
    CustomNumbersOnly& operator=(const CustomNumbersOnly&) = delete;

  private:
    bool outer_;
};
/// One that is registered; null if there is none. `name`: "SFQuantity" or "MFQuantity".
std::shared_ptr<const CustomType> findFieldType(std::string_view name);
/// X3D's as well as registered ones. False if there is none of that name.
bool fieldTypeFromName(std::string_view name, FieldType& type, std::shared_ptr<const CustomType>& custom);

/// The text of `print`; none where the numbers are to be written.
std::optional<std::string> customText(const CustomValue& value);
/// Whether the type has a text of its own.
bool hasCustomText(const CustomType& type);
/// Errors: what `parse` says; it makes a value of another type; the type has no text.
Result<CustomValue> customFromText(const CustomType& type, std::string_view text);
/// The numbers without a text: "3.5 1", or "0x0aff". Not of JSON, where numbers are arrays.
std::string customDefaultText(const CustomValue& value);
/// Errors: what `normalised` says.
Result<CustomValue> normalisedCustom(const CustomType& type, CustomValue value);
/// `a` where the type has nothing in between.
CustomValue customBetween(const CustomValue& a, const CustomValue& b, double t);
bool scriptsSeeText(const CustomType& type);

/// "SFVec3f", "MFQuantity".
std::string fieldTypeName(FieldType type, const CustomType* custom);
/// The same of a value; an empty list of a type from outside does not know which.
std::string typeNameOf(const Value& value);
/// Value::zero, also of types from outside.
Value zeroOf(FieldType type, const CustomType* custom);
namespace detail {
bool areOfType(const Value& value, const CustomType* custom);
}
/// Whether the value is of this type. Precondition: `custom` is there where the type is from outside.
inline bool isOfType(const Value& value, FieldType type, const CustomType* custom) {
    return value.type() == type && (sf(type) != FieldType::SFCustom || detail::areOfType(value, custom));
}
/// Whether two fields, or declarations of them, have one type.
template <class A, class B>
bool haveOneType(const A& a, const B& b) {
    return a.type == b.type && (sf(a.type) != FieldType::SFCustom || (a.custom && b.custom && *a.custom == *b.custom));
}

}  // namespace rtsg
