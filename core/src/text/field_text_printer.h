// The parts of printing values that the writers use, too.
//
// Threading: none of its own.
#pragma once

#include <charconv>
#include <cmath>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>

#include <rtsg/core/field_text.h>

namespace rtsg::detail {

/// At least this many characters are there for a number.
constexpr std::size_t kLongestNumber = 32;

/// The shortest text that reads back to the same bits; in JSON null if the value is not finite. Returns behind its end.
template <class S>
char* printNumber(char* to, S number, TextSyntax syntax) {
    if constexpr (std::is_floating_point_v<S>)
        if (syntax == TextSyntax::json && !std::isfinite(number)) {
            constexpr std::string_view none = "null";
            return to + none.copy(to, none.size());
        }
    return std::to_chars(to, to + kLongestNumber, number).ptr;
}

/// Calls `take(numbers, count, each)` with all numbers of an MF value of numbers, of which so many make an element.
/// False, and nothing happens, for other types.
template <class Take>
bool withNumbers(const Value& value, const Take& take) {
    switch (value.type()) {
#define RTSG_X(suffix, T, S)                                                                                           \
    case FieldType::MF##suffix: {                                                                                      \
        const Array<T>& array = value.as<Array<T>>();                                                                  \
        take(reinterpret_cast<const S*>(array.data()), array.size() * (sizeof(T) / sizeof(S)), sizeof(T) / sizeof(S)); \
        return true;                                                                                                   \
    }
        RTSG_X(Int32, std::int32_t, std::int32_t)
        RTSG_X(Float, float, float)
        RTSG_X(Double, double, double)
        RTSG_X(Vec2f, Vec2f, float)
        RTSG_X(Vec3f, Vec3f, float)
        RTSG_X(Vec4f, Vec4f, float)
        RTSG_X(Vec2d, Vec2d, double)
        RTSG_X(Vec3d, Vec3d, double)
        RTSG_X(Color, Color, float)
        RTSG_X(ColorRGBA, ColorRGBA, float)
        RTSG_X(Rotation, Rotation, float)
#undef RTSG_X
        default:
            return false;
    }
}

/// The first number of a value that is not finite: no reader of documents takes its text.
std::optional<double> firstNotFinite(const Value& value);

/// Appends one element of an MF value (nothing else), as appendFieldText would.
void appendArrayElement(std::string& out, const Value& array, std::size_t index, TextSyntax syntax);

}  // namespace rtsg::detail
