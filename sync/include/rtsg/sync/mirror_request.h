// MirrorRequest: what a peer asks of the origin. MirrorVerdict: the origin's answer.
//
// Invariant: a request is carried out at most once and always answered, even if the connection is cut meanwhile.
// docs/many-writers.md says who wins when several peers write. Threading: values.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include <rtsg/core/change.h>

namespace rtsg {

/// What happens to a peer that falls behind by more than its window.
enum class MirrorWhenSlow : std::uint8_t {
    coalesce,   // it gets the frames that it missed merged into one
    block,      // the scene waits for it, as long as the server allows
    resync,     // it gets a keyframe and starts over
    nearFirst,  // merged; views, sounds and what is near the viewer come first, far values at most a second later
};

struct MirrorRequest {
    enum class Kind : std::uint8_t {
        changes,  // edits and events, carried out in the order of a ChangeSet
        undo,     // takes back this author's last edit, except values that others have changed since
        redo,     // does again what this author took back last
        lock,     // nobody else may change these nodes for a while
    };
    /// The most nodes in one lock, and the longest lease before the lock must be asked for again.
    static constexpr std::size_t kMaxLocked = 1024;
    static constexpr std::chrono::milliseconds kLongestLease{60000};

    Kind kind = Kind::changes;
    std::vector<Change> changes;         // for Kind::changes
    std::vector<NodeId> nodes;           // for Kind::lock
    std::chrono::milliseconds lease{0};  // for Kind::lock; 0 releases the nodes
    /// The author, when a client such as a relay passes on the requests of others. The origin puts the client's own
    /// name in front. At most 200 bytes.
    std::string author{};
};

/// The origin's answer to a request.
struct MirrorVerdict {
    std::uint64_t request = 0;
    std::string refusal;      // the reason for a refusal; empty if the request was carried out
    std::uint64_t state = 0;  // the state that has the effect; the replica has reached it already
    std::vector<std::pair<NodeId, NodeId>> created;  // numbers of newNode(), and the numbers that the nodes got
    std::string kept{};                              // for undo and redo: what was left unchanged, and why
};

}  // namespace rtsg
