// Upstream: edits and events from a replica to its origin, and the answers (PROTOCOL.md, "Upstream").
//
// Invariant: a request is carried out at most once and answered, whatever happens to the connection within an epoch.
// All of it is checked before any of it is done. The memory that a peer can make the server use is bounded.
// Threading: carryOut on the scene's thread, everything else on the sockets'.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <rtsg/core/scene.h>
#include <rtsg/sync/mirror_keys.h>
#include <rtsg/sync/mirror_request.h>

#include "edit_history.h"
#include "held_pointers.h"
#include "node_locks.h"
#include "sockets/message.h"

namespace rtsg::mirror {

/// From this number on, node numbers are a submission's own, for the nodes that it creates.
constexpr std::uint32_t kFirstProvisional = std::uint32_t{1} << 31;
/// The most bytes of submissions, of all peers, that may wait for the scene's thread.
constexpr std::uint64_t kMaxSubmitted = std::uint64_t{16} << 20;

struct Submission {
    std::uint64_t client = 0, request = 0;
    MirrorUpstream permission = MirrorUpstream::none;
    std::vector<std::byte> record;
    bool noTypes = false;  // type and field numbers are the server's; described types are its own
    std::string author{};  // the peer's name, then a slash and the name of whoever it asks for
};

struct Verdict {
    std::uint64_t client = 0, request = 0;
    std::uint64_t state = 0;                                       // the state that has its effect
    std::string refusal;                                           // empty if it was done
    std::vector<std::pair<std::uint32_t, std::uint32_t>> created;  // provisional and real numbers
    std::string kept{};                                            // what undo or redo left unchanged, and why

    void write(ByteBuffer& out, std::uint64_t session) const;
    bool read(wire::Reader& in);  // stands behind the session
};

/// The origin's data about peers that write to its scene.
struct Writers {
    HeldPointers pointers;
    EditHistory history;
    NodeLocks locks;
};

/// Checks a submission. Returns the request, with provisional numbers for its new nodes, or why it is refused.
Result<MirrorRequest> examine(Scene& scene, const Submission& submission);
/// Call it on the scene's thread, between frames.
Verdict carryOut(Scene& scene, const Submission& submission, Writers& writers);
/// The nodes and fields that a request concerns. A malformed one, which will be refused, touches nothing.
struct RequestTouch {
    bool eventsAlone = true;
    std::vector<NodeId> nodes;
};
RequestTouch touchOf(const Submission& submission);

/// A submission that comes in parts.
struct Assembly {
    std::uint64_t request = 0, size = 0;
    std::vector<std::byte> bytes;
    /// Returns true when it is complete. `problem` says why a part was refused.
    bool add(std::uint64_t request, std::uint64_t size, std::uint64_t offset, std::span<const std::byte> part,
             const char*& problem);
};

/// The requests seen of each client, so that one that is repeated after a cut is not done twice.
class RequestLedger {
  public:
    enum class Standing : std::uint8_t { fresh, pending, answered };
    /// `verdict` is that of an answered request; null if the answer is so old that it was forgotten.
    Standing standing(std::uint64_t client, std::uint64_t request, const Verdict*& verdict);
    /// Returns false if too many requests of the client wait.
    bool begin(std::uint64_t client, std::uint64_t request);
    void answer(const Verdict& verdict);
    void clear() { clients_.clear(); }

  private:
    struct Client {
        std::uint64_t used = 0, forgotten = 0;  // the highest number whose answer is no longer kept
        std::set<std::uint64_t> pending;
        std::deque<Verdict> answers;
    };
    std::map<std::uint64_t, Client> clients_;
    std::uint64_t uses_ = 0;
};

}  // namespace rtsg::mirror
