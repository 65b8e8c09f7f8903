// MirrorClient: keeps a replica scene in step with the scene of a MirrorServer (PROTOCOL.md, "Mirror").
//
// Invariant: the replica is always in a state that the origin had. After every frame its hash is compared with the
// origin's. If they differ, both sides compare hashes of ranges of nodes and then of fields until the differing ones
// are found. Only those are sent again, as a change set from the state to itself. The client recovers by itself from
// lost connections, gaps and restarts of the server: it resumes where it can, and otherwise takes a snapshot
// (Scene::reset).
// Threading: all work is done on the replica's thread inside poll(), and messages wait. On another thread connect()
// fails, and poll() only reports the mistake.

// Example:
//     #include <rtsg/sync/mirror_client.h>
//     rtsg::Scene replica;
//     const auto client = rtsg::MirrorClient::connect(replica, "tcp://localhost:5570");
//     if (!client) return;
//     while (!(*client)->serverLeft()) {
//         (*client)->poll(std::chrono::milliseconds(20));  // brings the replica to the origin's newest state
//         for (const rtsg::Diagnostic& d : (*client)->takeDiagnostics()) std::cerr << d.format() << '\n';
//     }
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <rtsg/core/scene.h>
#include <rtsg/sync/encoded_record.h>
#include <rtsg/sync/mirror_keys.h>
#include <rtsg/sync/mirror_request.h>
#include <rtsg/sync/replay.h>

namespace rtsg {

class Transport;

struct MirrorClientOptions {
    /// The author of this client's requests, in logs and for undo. With keys, the server's key file may name another
    /// author. Empty: "peer-" and a new number for each client. At most 200 bytes.
    std::string name{};
    std::optional<MirrorKeys> keys;
    /// How many bytes the server may send ahead of what poll() has applied.
    std::uint64_t window = std::uint64_t{8} << 20;
    /// The longest record accepted, in bytes. A longer one is refused as soon as it is announced.
    std::uint64_t maxRecord = kMaxPayload;
    /// After this long without a sign of the server the client says hello again.
    std::chrono::milliseconds timeout{2500};
    MirrorWhenSlow whenSlow = MirrorWhenSlow::coalesce;
    /// Asks for the inputs of frames rather than their results, and runs the cascade here. This takes few bytes and as
    /// much work as at the origin. Hashes are compared; changes are sent where inputs are not enough or the server does
    /// not offer them. Excludes `latency`, `parts` and `aspects`. The application's deterministic behaviours must be
    /// registered.
    bool inputs = false;
    /// If the link carries less than the scene makes, frames are merged so that what arrives is at most this old,
    /// beside the link's delay and the time of one frame. 0: every frame is sent, however late, until a whole window
    /// waits. For MirrorWhenSlow::coalesce and nearFirst.
    std::chrono::milliseconds maxLag{250};
    /// The most bytes a second that the server may send; 0 for no limit.
    std::uint64_t maxBytesPerSecond = 0;
    /// The most frames a second; frames in between are merged. 0 for all.
    double framesPerSecond = 0;
    /// Follows only these subtrees (DEF names, or # and a node's number), with the nodes on the way to them. Empty: the
    /// whole scene. Or follows one region, `region:[NAME,|x,y,z,]radius[,margin]` in metres: what is that near to a
    /// node, a point or the bound viewpoint as it moves. Things leave when they are farther away by that share of the
    /// radius (.1 by default). The state hash is then that of a scene that has just this part; the server computes the
    /// same.
    std::vector<std::string> parts;  // 1,024 at most
    /// Follows only fields of these aspects, and fields that refer to nodes. Empty: all fields.
    std::vector<Aspect> aspects;
    /// How often a few thousand nodes are hashed from memory and compared with the origin's. This finds memory that was
    /// changed behind the replica's back, which the running hash does not show. 0: never.
    std::chrono::milliseconds scrub{5000};
    /// Holds frames back until this long after the origin published them, so that they appear as evenly as they were
    /// made. 0: frames are applied when they arrive.
    std::chrono::milliseconds latency{0};
    /// Called from poll() for everything that was found to differ from the origin, once its node and field are known.
    std::function<void(const Divergence&)> onDivergence;
    /// Called from poll() when states were missed (MirrorStatistics::holes), before the next state is applied.
    std::function<void()> onMissed;
    /// How messages travel, and by which clock. Null: ZeroMQ and the system's.
    std::shared_ptr<Transport> transport{};
};

struct MirrorStatistics {
    std::uint64_t frames = 0;          // change sets applied, with snapshots, without repairs
    std::uint64_t snapshots = 0;       // those of `frames` that were whole states
    std::uint64_t inputs = 0;          // those of `frames` that were computed here from their inputs
    std::uint64_t gaps = 0;            // frames found missing
    std::uint64_t bytes = 0;           // of records received
    std::uint64_t messages = 0;        // of all kinds, read
    std::uint64_t divergences = 0;     // times that the replica was found to differ from the origin
    std::uint64_t repairs = 0;         // divergences that were repaired without a snapshot
    std::uint64_t questions = 0;       // questions asked to find the differing nodes
    std::uint64_t garbage = 0;         // messages that made no sense
    std::uint64_t restarts = 0;        // times that the server turned out to be another run
    std::uint64_t sequence = 0;        // state of the replica
    std::uint64_t originSequence = 0;  // the newest state that the origin is known to have had
    Hash128 hash, originHash;          // of that state: computed here, and given by the origin
    /// True if there is a state and the two hashes are the same. Always false if the server's types are not ours.
    bool equal = false;
    // The clock, in seconds. clockOffset: the server's steady clock minus ours, exact to half the delay. delay: the
    // shortest recent round trip. jitter: the mean deviation of frames' transit times (RFC 3550).
    double clockOffset = 0, delay = 0, jitter = 0;
    std::uint64_t clockSamples = 0;
    std::uint64_t late = 0;  // frames that came after they were due to be shown
    /// Age of the frames when they were applied, seconds since the origin published them: the last one, and the
    /// greatest.
    double lag = 0, maximumLag = 0;
    /// `holes`: times that the origin was out of reach and went on without us, so that the next state does not follow
    /// from the last one. `missed`: seconds from when it was last heard to that next state. Jumps of a log's player do
    /// not count.
    std::uint64_t holes = 0;
    double missed = 0;
};

class MirrorClient {
  public:
    /// `replica` must be fresh, or fed by clients only, and must outlive the client. Its behaviours are switched off.
    /// Succeeds whether or not a server is there yet. Errors: called on another thread than the replica's; an invalid
    /// endpoint, key or name.
    static Result<std::unique_ptr<MirrorClient>> connect(Scene& replica, const std::string& endpoint,
                                                         MirrorClientOptions options = {});
    ~MirrorClient();

    /// Applies what has come. If nothing has, waits up to `timeout` for it, or until a signal comes. Returns the number
    /// of change sets applied. On another thread than the replica's it only waits and reports a diagnostic, because the
    /// replica would refuse frames.
    std::size_t poll(std::chrono::milliseconds timeout = std::chrono::milliseconds(0));
    /// Calls `heard` from poll() after each step of the replica, with the received record where others in this program
    /// can use it. A RecordLog or a RecordQueue takes steps from here without the replica's bus. Repairs are no steps,
    /// as they lead to no new state. An empty function switches this off.
    void onStep(std::function<void(const RecordStep&)> heard);
    /// For callers that wait by other means, on any thread: call poll() when one of the descriptors is readable or when
    /// `most` has passed.
    struct Waiting {
        std::array<int, 2> descriptors{-1, -1};
        std::chrono::milliseconds maximum{0};
    };
    Waiting waiting() const;
    /// From now on poll() also returns early when this descriptor is readable; -1 for none.
    void wakeBy(int descriptor);
    /// True if there is a connection and the replica is in the newest state heard of. A relay must also be connected to
    /// its origin.
    bool inStep() const;
    /// True while records arrive, even if one takes long. A state will be here in a while, however slow the link is.
    bool receiving() const;
    const MirrorStatistics& statistics() const;
    /// The diagnostics since the last call, at most a hundred.
    std::vector<Diagnostic> takeDiagnostics();
    /// Why the server refuses this client, or the client the stream; empty if neither does. See turnedAway().
    const std::string& refusal() const;
    /// True if the server refuses this client for now. The client asks again and again.
    bool turnedAway() const;
    /// True if there is no connection, if nothing was heard for longer than a heartbeat and .4 s, or if the server is a
    /// relay that has lost its own origin.
    bool originLost() const;
    /// True if the server said goodbye and has not welcomed this client since.
    bool serverLeft() const;

    // ---- upstream -------------------------------------------------------------------------------------------
    /// Sends edits and input events to the origin. The origin puts them in order, carries them out in the order of a
    /// ChangeSet, and answers with a verdict; their effect comes back like any change. A request is carried out at most
    /// once, even if the connection is cut meanwhile. Returns the request's number. Error, at once: the request is
    /// longer than 1 MiB.
    Result<std::uint64_t> submit(std::vector<Change> changes);
    /// Sends a request of any kind, in the same way.
    Result<std::uint64_t> submit(MirrorRequest request);
    Result<std::uint64_t> submitEvent(NodeId node, FieldIndex field, Value value);
    Result<std::uint64_t> submitEdit(NodeId node, FieldIndex field, Value value);
    /// undo() takes back this client's last edit, except values that others have changed since (MirrorVerdict::kept);
    /// redo() does it again. Only edits are taken back, not what events led to.
    Result<std::uint64_t> undo();
    Result<std::uint64_t> redo();
    /// Nobody else may change these nodes (fields, events to them, names, routes; not the nodes below them) for the
    /// time of `lease`, or until the same nodes are locked with a lease of 0. Error, at once: over the limits of
    /// MirrorRequest.
    Result<std::uint64_t> lock(std::vector<NodeId> nodes, std::chrono::milliseconds lease);
    /// Returns a number for a node that a request creates. It is valid inside that request only.
    NodeId newNode();
    /// The verdicts since the last call, in the order in which the origin received the requests.
    std::vector<MirrorVerdict> takeVerdicts();
    /// Asks a server that plays a log to pause, play, step, seek and so on (LogPlayer::command()). Returns false if
    /// there is no connection or the command is over 200 bytes. One reply comes for each command, unless the connection
    /// is lost; it is not sent again.
    bool control(std::string_view command);
    /// The replies in order: the player's status, or "refused: " and the reason.
    std::vector<std::string> takeReplies();
    /// Number of requests that have no answer yet.
    std::size_t unanswered() const;

    // ---- presentation ---------------------------------------------------------------------------------------
    /// The value to show now. With a latency and a later frame in store it lies between the replica's value and that
    /// frame's, by time (rotations take the shorter arc); otherwise it is the replica's. The replica itself is never
    /// between two states. The Value is empty if the replica does not have the node, or the field cannot be read.
    Value presented(NodeId node, FieldIndex field) const;

  private:
    class Impl;
    explicit MirrorClient(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
