// A first look at a JSON text: whether its brackets match, where commas are missing or too many, and which objects have
// attributes behind other members, so that a reader can go through the text once and forget what is behind it.
//
// Invariant: linear in the text; memory grows with how deep brackets are nested, with the late objects and the long
// arrays, not with the text. Threading: one thread; others may help it within a long array of numbers.
#pragma once

#include <cstdint>
#include <vector>

#include <rtsg/core/diagnostic.h>

#include "text/splitting.h"
#include "text_feed.h"

namespace rtsg::detail {

constexpr std::uint64_t kLongArray = 1 << 14;

/// Offsets count from the feed's begin().
struct JsonOutline {
    /// The starts of objects in which a "@member" stands behind a member that is an object or an array; ascending.
    std::vector<std::uint64_t> late;
    /// Arrays of more than kLongArray bytes without strings and brackets within; ascending.
    struct Plain {
        std::uint64_t begin, end;  // of the brackets
    };
    std::vector<Plain> plain;
    /// The place where reading ends: the end of the text, or the first place that is not well-formed JSON.
    std::uint64_t end = 0;
    bool complete = true;
};

/// Reports faults. `release` says that text is not needed again once it has been looked at.
JsonOutline outlineJson(TextFeed& text, bool release, Diagnostics& diagnostics, const Splitting& splitting);

}  // namespace rtsg::detail
