// What travels from a replica to its origin: edits and events, and the answers (PROTOCOL.md, "Upstream").
//
// Invariant: a request is carried out at most once and answered, whatever becomes of the connection within an epoch. It
// is checked wholly before anything of it is done. What a peer can make the server keep is bounded.
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

/// Node numbers from here on are a submission's own: the nodes that it creates.
constexpr std::uint32_t kFirstProvisional = std::uint32_t{1} << 31;
/// Submissions that may wait for the scene's thread, bytes of all peers.
constexpr std::uint64_t kMostSubmitted = std::uint64_t{16} << 20;

struct Submission {
    std::uint64_t client = 0, request = 0;
    MirrorUpstream permission = MirrorUpstream::none;
    std::vector<std::byte> record;
    bool noTypes = false;  // numbers of types and fields are the server's; those of types that it describes, its own
    std::string author{};  // the peer's name, and behind a stroke that of whoever it asks for
};

struct Verdict {
    std::uint64_t client = 0, request = 0;
    std::uint64_t state = 0;                                       // by which its effect is there
    std::string refusal;                                           // empty: done
    std::vector<std::pair<std::uint32_t, std::uint32_t>> created;  // provisional and real numbers
    std::string kept{};                                            // what undo or redo left as it was, and why

    void write(ByteBuffer& out, std::uint64_t session) const;
    bool read(wire::Reader& in);  // behind the session
};

/// What the origin keeps of those who write to its scene.
struct Writers {
    HeldPointers pointers;
    EditHistory history;
    NodeLocks locks;
};

/// A submission that may be carried out, with numbers of its own for the nodes that it creates; or why it may not be.
Result<MirrorRequest> examine(Scene& scene, const Submission& submission);
/// On the scene's thread, between frames.
Verdict carryOut(Scene& scene, const Submission& submission, Writers& writers);
/// What a request is about. One that is malformed, and will be refused, touches nothing.
struct RequestTouch {
    bool eventsAlone = true;
    std::vector<NodeId> nodes;
};
RequestTouch touchOf(const Submission& submission);

/// A submission that comes in parts.
struct Assembly {
    std::uint64_t request = 0, size = 0;
    std::vector<std::byte> bytes;
    /// True when it is complete. `problem` says why a part was refused.
    bool add(std::uint64_t request, std::uint64_t size, std::uint64_t offset, std::span<const std::byte> part,
             const char*& problem);
};

/// Which requests of which clients have been seen, so that one that is repeated after a cut is not done twice.
class RequestLedger {
  public:
    enum class Standing : std::uint8_t { fresh, pending, answered };
    /// `verdict`: of one that was answered; null if that is so long ago that it is forgotten.
    Standing standing(std::uint64_t client, std::uint64_t request, const Verdict*& verdict);
    /// False when as many of the client's wait as may.
    bool begin(std::uint64_t client, std::uint64_t request);
    void answer(const Verdict& verdict);
    void clear() { clients_.clear(); }

  private:
    struct Client {
        std::uint64_t used = 0, forgotten = 0;  // the highest number whose answer is not kept any more
        std::set<std::uint64_t> pending;
        std::deque<Verdict> answers;
    };
    std::map<std::uint64_t, Client> clients_;
    std::uint64_t uses_ = 0;
};

}  // namespace rtsg::mirror
