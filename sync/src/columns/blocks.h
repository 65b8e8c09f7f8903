// Block numbers within a frame or keyframe (PROTOCOL.md, "Changes"), shared by encoder and decoder.
#pragma once

#include <cstdint>

namespace rtsg::wire {

enum Block : std::uint8_t {
    kDescriptions = 0,  // built-in types at their first use
    kTypes = 1,         // defineType
    kCreate = 2,        // createNode
    kLinks = 3,         // setField of SFNode and MFNode, insertChild, removeChild, in order
    kValues = 4,        // setField of one field index and type: a column
    kNames = 5,         // setName
    kRoutes = 6,        // addRoute, removeRoute, in order
    kDestroy = 7,       // destroyNode
    kEvents = 8,        // event, in order
    kAuthors = 9,       // authors of the changes from outside
    kBlockEnd = 10,
    kDeflated = 14,  // other blocks, deflated
    kFiller = 15,    // lengthens a record whose set takes much memory (budget.h); readers skip it
};

/// The version of scene records; others are refused.
constexpr std::uint16_t kSceneVersion = 1;

// Tags of rows.
constexpr unsigned kSetOne = 0, kSetMany = 1, kInsert = 2, kRemove = 3, kLinkExternal = 4;
constexpr unsigned kRouteRemove = 1, kRouteExternal = 2, kRouteIs = 4;
constexpr unsigned kValueExternal = 1;

}  // namespace rtsg::wire
