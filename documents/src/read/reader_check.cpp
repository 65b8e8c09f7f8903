// Checks values against the tables: numbers out of range, axes without length, unknown words, incomplete groups.
#include <algorithm>
#include <cmath>
#include <limits>

#include "reader_common.h"

namespace rtsg::detail {

namespace {

/// Values above the standard's range that have a meaning here: a very bright surface is a lamp (docs/color.md).
bool mayExceed(const FieldDef& field) {
    return field.type == FieldType::SFColor && field.name == "emissiveColor";
}

template <class S>
std::string outOfRange(const FieldDef& field, const S* numbers, std::size_t count) {
    S low = numbers[0], high = numbers[0];
    for (std::size_t i = 1; i < count; ++i) {
        low = std::min(low, numbers[i]);
        high = std::max(high, numbers[i]);
    }
    // Authors write 1.5708 for half pi.
    const auto slack = [](double bound) { return std::isinf(bound) ? 0 : 1e-5 * std::abs(bound); };
    const double minimum = field.min - slack(field.min), maximum = field.max + slack(field.max);
    const auto lowest = static_cast<double>(low);
    const bool below = field.exclusiveMin ? !(lowest > minimum) : lowest < minimum;
    if (!below && (static_cast<double>(high) <= maximum || mayExceed(field))) return {};
    const auto text = [](auto number) { return printFieldText(Value(number)); };
    std::string range = field.exclusiveMin ? "(" : "[";
    range += std::isinf(field.min) ? "-inf" : text(static_cast<float>(field.min));
    range += ", " + (std::isinf(field.max) ? std::string("inf)") : text(static_cast<float>(field.max)) + "]");
    return text(below ? low : high) + " is outside the range " + range + " of " + field.name;
}

std::string axisComplaint(const Rotation* rotations, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) {
        const Rotation& r = rotations[i];
        const double length = std::sqrt(double(r.x) * r.x + double(r.y) * r.y + double(r.z) * r.z);
        if (length == 0 && r.angle != 0) return "the axis of rotation " + printFieldText(Value(r)) + " has no length";
        constexpr double tolerance = 0.01;  // authors round; 0.577 0.577 0.577 is meant to be a unit vector
        if (length != 0 && std::abs(length - 1) > tolerance)
            return "the axis of rotation " + printFieldText(Value(r)) + " is not of unit length";
    }
    return {};
}

/// Values that the standard has not, and that mean something here.
bool isKnownBesides(const FieldDef& field, std::string_view word) {
    return field.type == FieldType::SFString && field.name == "mode" &&
           (word == "WORLDSPACENORMAL" || word == "WORLDSPACEREFLECTIONVECTOR");
}

std::string wordComplaint(const FieldDef& field, const String* words, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) {
        if (std::ranges::find(field.allowed, words[i].view()) != field.allowed.end() ||
            isKnownBesides(field, words[i].view()))
            continue;
        std::string known;
        for (const std::string& word : field.allowed)
            if (!word.empty()) known.append(known.empty() ? "" : ", ").append(word);
        // Code that reads a single word takes the default for a word that it does not know.
        std::string text = "'";
        text.append(words[i].view()).append("' is none of the values of ").append(field.name);
        text.append(" (").append(known).append(")");
        if (field.type == FieldType::SFString)
            text.append(": taken as ").append(field.defaultValue.as<String>().view());
        return text;
    }
    return {};
}

/// The elements of a value: itself, or its array's.
template <class T>
std::span<const T> elements(const Value& value) {
    return isMF(value.type()) ? value.as<Array<T>>().span() : std::span<const T>(&value.as<T>(), 1);
}

}  // namespace

std::string tidyComment(std::string_view text) {
    constexpr std::string_view space = " \t\r\n";
    const std::size_t first = text.find_first_not_of(space);
    if (first == text.npos) return {};
    std::string result(text.substr(first, text.find_last_not_of(space) + 1 - first));
    std::erase(result, '\r');
    return result;
}

std::string valueComplaint(const FieldDef& field, const Value& value) {
    const FieldType element = sf(value.type());
    if (element == FieldType::SFRotation) {
        const auto rotations = elements<Rotation>(value);
        return axisComplaint(rotations.data(), rotations.size());
    }
    if (element == FieldType::SFString) {
        if (field.allowed.empty()) return {};
        const auto words = elements<String>(value);
        return wordComplaint(field, words.data(), words.size());
    }
    if (std::isinf(field.min) && std::isinf(field.max)) return {};
    switch (element) {
#define RTSG_CASE(suffix, T, S)                                                                         \
    case FieldType::SF##suffix: {                                                                       \
        const auto all = elements<T>(value);                                                            \
        if (all.empty()) return {};                                                                     \
        return outOfRange(field, reinterpret_cast<const S*>(all.data()), all.size_bytes() / sizeof(S)); \
    }
        RTSG_CASE(Int32, std::int32_t, std::int32_t)
        RTSG_CASE(Float, float, float)
        RTSG_CASE(Double, double, double)
        RTSG_CASE(Time, Time, double)
        RTSG_CASE(Color, Color, float)
        RTSG_CASE(ColorRGBA, ColorRGBA, float)
        RTSG_CASE(Vec2f, Vec2f, float)
        RTSG_CASE(Vec2d, Vec2d, double)
        RTSG_CASE(Vec3f, Vec3f, float)
        RTSG_CASE(Vec3d, Vec3d, double)
        RTSG_CASE(Vec4f, Vec4f, float)
        RTSG_CASE(Vec4d, Vec4d, double)
#undef RTSG_CASE
        default:
            return {};
    }
}

}  // namespace rtsg::detail
