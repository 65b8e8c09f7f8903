// Conversion of values between the units of a document and those of the standard.
#include "units.h"

#include <array>
#include <charconv>
#include <cmath>

#include "value_numbers.h"

namespace rtsg::detail {

namespace {

/// Calls `convert(number)` for each number of the value that counts in the unit: of a rotation, the angle alone.
template <class Convert>
void forEachNumber(Value& value, const Convert& convert) {
    constexpr std::size_t kRotation = 4;
    const bool anglesAlone = sf(value.type()) == FieldType::SFRotation;
    changeNumbers(value, [&](auto numbers) {
        for (std::size_t i = anglesAlone ? kRotation - 1 : 0; i < numbers.size(); i += anglesAlone ? kRotation : 1)
            convert(numbers[i]);
    });
}

template <class S>
S scaled(S number, double factor) {
    return static_cast<S>(static_cast<double>(number) * factor);
}

/// The shortest decimal of which `scaled` makes `number`.
template <class S>
S unscaled(S number, double factor) {
    const double quotient = static_cast<double>(number) / factor;
    if (!std::isfinite(quotient)) return number;
    for (int digits = 1; digits <= (sizeof(S) == 4 ? 9 : 17); ++digits) {
        std::array<char, 40> text{};
        const auto end =
            std::to_chars(text.data(), text.data() + text.size(), quotient, std::chars_format::scientific, digits - 1);
        S candidate{};
        std::from_chars(text.data(), end.ptr, candidate);
        if (scaled(candidate, factor) == number) return candidate;
    }
    return static_cast<S>(quotient);
}

/// -1 for "none" or "automatic" is no length.
bool isSentinel(const FieldDef* field, const Value& value) {
    return field && value == field->defaultValue &&
           ((value.holds<float>() && value.as<float>() < 0) || (value.holds<Vec3f>() && value.as<Vec3f>().x < 0));
}

}  // namespace

void Units::set(std::string_view category, double factor) {
    if (category == "length") length_ = factor;
    if (category == "angle") angle_ = factor;
    if (category == "mass") mass_ = factor;
    if (category == "force") force_ = factor;
}

double Units::factor(Unit unit) const {
    switch (unit) {
        case Unit::length:
        case Unit::speed:
        case Unit::acceleration:
            return length_;
        case Unit::angle:
        case Unit::angularRate:
            return angle_;
        case Unit::mass:
            return mass_;
        case Unit::force:
            return force_;
        case Unit::area:
            return length_ * length_;
        case Unit::torque:
            return force_ * length_;
        case Unit::none:
            break;
    }
    return 1;
}

/// An SFRotation is an angle everywhere (ISO/IEC 19775-1 V4.0, 5.3); for other values the tables give the unit of their
/// field.
double Units::factorOf(const FieldDef* field, const Value& value) const {
    if (areStandard() || (field && isSentinel(field, value))) return 1;
    if (sf(value.type()) == FieldType::SFRotation) return angle_;
    return field ? factor(field->unit) : 1;
}

void Units::toStandard(const FieldDef* field, Value& value) const {
    if (const double by = factorOf(field, value); by != 1)
        forEachNumber(value, [&](auto& number) { number = scaled(number, by); });
}

void Units::fromStandard(const FieldDef* field, Value& value) const {
    if (const double by = factorOf(field, value); by != 1)
        forEachNumber(value, [&](auto& number) { number = unscaled(number, by); });
}

}  // namespace rtsg::detail
