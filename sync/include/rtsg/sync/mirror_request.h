// MirrorRequest and MirrorVerdict: what those who follow a scene ask of its origin, and what came of it.
//
// Invariant: a request is carried out at most once and answered, also if the connection is cut meanwhile. Rules of who
// wins where several write: docs/many-writers.md. Threading: values.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include <rtsg/core/change.h>

namespace rtsg {

/// What becomes of a peer that falls behind by more than its window.
enum class MirrorWhenSlow : std::uint8_t {
    coalesce,   // it gets the frames that it missed merged into one
    block,      // the scene waits for it, as long as the server allows
    resync,     // it gets a keyframe and starts over
    nearFirst,  // merged, views, sounds and what is near the viewer first; what is far waits, for at most a second
};

struct MirrorRequest {
    enum class Kind : std::uint8_t {
        changes,  // edits and events, carried out in the order of a ChangeSet
        undo,     // takes back what this author did last, as far as nobody has changed it since
        redo,     // does again what this author has taken back last
        lock,     // nobody else changes these nodes for a while
    };
    /// Nodes of one request, and the longest time that they may be kept for somebody without being asked again.
    static constexpr std::size_t kMostLocked = 1024;
    static constexpr std::chrono::milliseconds kLongestLease{60000};

    Kind kind = Kind::changes;
    std::vector<Change> changes;         // of Kind::changes
    std::vector<NodeId> nodes;           // of Kind::lock
    std::chrono::milliseconds lease{0};  // of Kind::lock; 0 lets go of them
    /// Whose wish it is, for clients that pass on what others ask, as relays do; the origin puts the client's own name
    /// before it. At most 200 bytes.
    std::string author{};
};

/// What the origin made of a request.
struct MirrorVerdict {
    std::uint64_t request = 0;
    std::string refusal;                             // why it was not carried out; empty if it was
    std::uint64_t state = 0;                         // the state with its effect, in which the replica is already
    std::vector<std::pair<NodeId, NodeId>> created;  // numbers of newNode() and what they have become
    std::string kept{};                              // undo, redo: what was left as it is, and why
};

}  // namespace rtsg
