// The numbers that a value is made of, whatever its type: one after the other, to be looked at or changed in place.
// Also how many elements it has.
//
// Integers, and matrices, which no unit and no rounding concerns, have none here. Threading: pure functions.
#pragma once

#include <cstddef>
#include <span>
#include <type_traits>

#include <rtsg/core/value.h>

namespace rtsg::detail {

/// How many elements a list has; 1 for values that are no lists.
inline std::size_t elementsIn(const Value& value) {
    if (!isMF(value.type())) return 1;
    const auto* const header = *static_cast<const ArrayHeader* const*>(value.storage());
    return header ? header->size : 0;
}

/// Calls `visit` with the type of an element and that of its numbers, float or double; not at all for other types.
template <class Visit>
void visitNumberTypes(FieldType type, const Visit& visit) {
    const auto as = [&]<class T, class S>() { visit(std::type_identity<T>(), std::type_identity<S>()); };
    switch (sf(type)) {
        case FieldType::SFFloat:
            return as.template operator()<float, float>();
        case FieldType::SFVec2f:
            return as.template operator()<Vec2f, float>();
        case FieldType::SFVec3f:
            return as.template operator()<Vec3f, float>();
        case FieldType::SFVec4f:
            return as.template operator()<Vec4f, float>();
        case FieldType::SFColor:
            return as.template operator()<Color, float>();
        case FieldType::SFColorRGBA:
            return as.template operator()<ColorRGBA, float>();
        case FieldType::SFRotation:
            return as.template operator()<Rotation, float>();
        case FieldType::SFDouble:
            return as.template operator()<double, double>();
        case FieldType::SFTime:
            return as.template operator()<Time, double>();
        case FieldType::SFVec2d:
            return as.template operator()<Vec2d, double>();
        case FieldType::SFVec3d:
            return as.template operator()<Vec3d, double>();
        case FieldType::SFVec4d:
            return as.template operator()<Vec4d, double>();
        default:
            return;
    }
}

/// `see(std::span<const float or double>)`.
template <class See>
void seeNumbers(const Value& value, const See& see) {
    visitNumberTypes(value.type(), [&]<class T, class S>(std::type_identity<T>, std::type_identity<S>) {
        const std::span<const T> all = value.holds<T>() ? std::span(&value.as<T>(), 1) : value.as<Array<T>>().span();
        see(std::span(reinterpret_cast<const S*>(all.data()), all.size() * (sizeof(T) / sizeof(S))));
    });
}

/// `change(std::span<float or double>)`. An array that others hold as well is copied.
template <class Change>
void changeNumbers(Value& value, const Change& change) {
    visitNumberTypes(value.type(), [&]<class T, class S>(std::type_identity<T>, std::type_identity<S>) {
        const auto numbers = [&](T* first, std::size_t count) {
            change(std::span(reinterpret_cast<S*>(first), count * (sizeof(T) / sizeof(S))));
        };
        if (value.holds<T>()) {
            T one = value.as<T>();
            numbers(&one, 1);
            value = Value(one);
        } else {
            Array<T> all = value.as<Array<T>>();
            if (all.empty()) return;
            value = Value();  // leaves it the sole owner, if nobody else is
            numbers(all.mutableData(), all.size());
            value = Value(std::move(all));
        }
    });
}

}  // namespace rtsg::detail
