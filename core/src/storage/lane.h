// Lane: what one thread notes while it works on a frame. The scene's own thread has one that is part of Scene::State;
// others have theirs for as long as parts of a cascade run side by side (side_by_side.cpp), and their notes are joined
// in the order in which one thread would have made them. The seal gives most of what a lane wrote to the
// thread that ran it, which has the nodes at hand.
//
// Threading: one thread at a time.
#pragma once

#include <span>
#include <string>
#include <utility>
#include <vector>

#include <rtsg/core/scene.h>

#include "written_fields.h"

namespace rtsg {

struct RouteGroup;

/// Two that threads write at a time share no cache lines, nor pairs of them, which processors fetch together.
struct alignas(128) Scene::Lane {
    // ---- writing: entries go into `entryRoom`; those from `pieceBegin` on are in no piece yet ----
    WrittenFields::Chunk entryRoom;
    WrittenField *nextEntry = nullptr, *entryEnd = nullptr, *pieceBegin = nullptr;
    // The entry among those sealed last that the next write repeats if this frame is like the last one, and the end of
    // these.
    WrittenField *expected = nullptr, *expectedEnd = nullptr;
    std::uint32_t touched = 0;      // aspectBit()s of fields written since the last seal
    bool writingExternally = true;  // false while the cascade runs
    std::uint32_t slotOf(const WrittenField* entry) const {
        return entryRoom.slot + static_cast<std::uint32_t>(entry - entryRoom.entries);
    }

    // ---- the cascade ----
    struct Emission {
        NodeId node;
        FieldIndex field;
        std::uint64_t linkEdits;  // when it was made; the pointers hold as long as that is so
        Node* at;
        RouteGroup* group;  // null if only the listener hears of it
    };
    /// Notes an event of the field that the group is of. Not inlined: callers then need no stack frame.
    [[gnu::noinline]] void emit(Node& node, RouteGroup& group, std::uint64_t linkEdits);
    using Sleeper = std::pair<double, NodeId>;
    std::vector<Emission> emissions;
    std::vector<FieldEvent> heard;  // since the last seal, of fields that have listeners
    std::vector<NodeId> woken, nextActive;
    std::vector<NodeId> watchers;    // those that wait until anything has moved
    std::vector<NodeId> late;        // Behaviour::last, set aside until all others have come to rest
    std::vector<Sleeper> goToSleep;  // from this tick
    bool askedForTransform = false;  // by the onTime that runs
    std::uint64_t work = 0;          // events delivered and times told, and in units like these what long values cost

    // ---- of lanes beside the scene's ----
    bool isBeside = false;
    std::uint32_t laneNumber = 0;  // from 1 on; 0 is the scene's
    std::vector<Emission> ticked;  // sent by this tick, and yet to go along routes
    bool tickedAsLaidOut = false;  // as when the routes' stretches were laid out
    struct Warning {
        const Node* node;
        std::string text;
    };
    struct Noted {
        WrittenFields::Piece piece;
        std::uint32_t slot;
    };
    /// How long the lists were at some moment.
    struct Mark {
        std::size_t pieces = 0, emissions = 0, heard = 0, woken = 0, moved = 0, complaints = 0;
    };
    std::vector<Noted> pieces;
    std::vector<NodeId> moved;  // whose places others have asked for
    std::vector<Warning> complaints;
    std::vector<Mark> marks;
};

}  // namespace rtsg
