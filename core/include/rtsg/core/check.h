// Checks for programmer errors: a broken precondition ends the program at once and says where, what, and both values.
//
// They are never used for bad input, which gives a Result or a diagnostic. The checks stay in release builds; each
// costs one comparison, so they stand where a wrong call would otherwise read memory out of bounds. Threading: any.
//     RTSG_CHECK_LT(field, type.fields.size());
//       ->  scene_edits.cpp:12: check failed: field < type.fields.size(): 9 < 4
#pragma once

#include <cstddef>
#include <source_location>
#include <string>
#include <string_view>
#include <type_traits>

namespace rtsg::detail {

/// Prints the sentence on stderr and aborts.
[[noreturn]] void checkFailed(std::string_view expression, std::string_view values,
                              std::source_location where) noexcept;

template <class T>
std::string checkText(const T& value) {
    if constexpr (std::is_same_v<T, bool>)
        return value ? "true" : "false";
    else if constexpr (std::is_null_pointer_v<T>)
        return "null";
    else if constexpr (std::is_convertible_v<const T&, std::string_view>)
        return '"' + std::string(std::string_view(value)) + '"';
    else if constexpr (std::is_pointer_v<T>)
        return value ? "a pointer" : "null";
    else if constexpr (std::is_enum_v<T>)
        return std::to_string(static_cast<std::underlying_type_t<T>>(value));
    else if constexpr (std::is_arithmetic_v<T>)
        return std::to_string(value);
    else
        return checkText(value.value);  // NodeId, TypeIndex
}

}  // namespace rtsg::detail

#define RTSG_CHECK_RELATION_(a, relation, b)                                                                         \
    do {                                                                                                             \
        const auto& rtsgCheckA_ = (a);                                                                               \
        const auto& rtsgCheckB_ = (b);                                                                               \
        if (!(rtsgCheckA_ relation rtsgCheckB_)) [[unlikely]]                                                        \
            ::rtsg::detail::checkFailed(                                                                             \
                #a " " #relation " " #b,                                                                             \
                ::rtsg::detail::checkText(rtsgCheckA_) + " " #relation " " + ::rtsg::detail::checkText(rtsgCheckB_), \
                std::source_location::current());                                                                    \
    } while (false)

#define RTSG_CHECK_EQ(a, b) RTSG_CHECK_RELATION_(a, ==, b)
#define RTSG_CHECK_NE(a, b) RTSG_CHECK_RELATION_(a, !=, b)
#define RTSG_CHECK_LT(a, b) RTSG_CHECK_RELATION_(a, <, b)
#define RTSG_CHECK_LE(a, b) RTSG_CHECK_RELATION_(a, <=, b)
