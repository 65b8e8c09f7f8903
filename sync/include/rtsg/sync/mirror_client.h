// MirrorClient: keeps a replica scene in step with a MirrorServer's (PROTOCOL.md, "Mirror").
//
// Invariant: the replica is always in a state that the origin had. After every frame its hash is compared with the
// origin's; if they differ, both sides compare hashes of ranges of nodes, then of fields, until the culprits are named,
// and only these are sent again (a change set from the state to itself). Lost connections, gaps and restarts of the
// server heal by themselves, by resuming where possible, else by a snapshot (Scene::reset).
// Threading: everything on the replica's thread, inside poll(); ZeroMQ does the waiting. connect() fails on another,
// and poll() does nothing there but to say so.

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

struct MirrorClientOptions {
    /// The author of what it asks for, in logs and for undo; with keys, the server's key file may say another. Empty:
    /// "peer-" and a number that is new with each client. 200 bytes at most.
    std::string name{};
    std::optional<MirrorKeys> keys;
    /// How much the server may send ahead of what poll() has applied, bytes.
    std::uint64_t window = std::uint64_t{8} << 20;
    /// Longest record accepted, bytes. A longer one is refused as soon as it is announced.
    std::uint64_t maxRecord = kMaxPayload;
    /// Without a sign of the server for this long, the client introduces itself again.
    std::chrono::milliseconds timeout{2500};
    MirrorWhenSlow whenSlow = MirrorWhenSlow::coalesce;
    /// Asks for what comes into the frames rather than for what follows from it, and runs the cascade here: few bytes,
    /// the work of the origin. Checked by the hash; changes come where that does not do, or the server does not offer
    /// it. Not with `latency`, `parts` or `aspects`. The application's deterministic behaviours must be registered.
    bool inputs = false;
    /// On a link that carries less than the scene makes, frames come merged into one so that what arrives is at most so
    /// old, beside the link's delay and the time that one frame takes. 0: every frame comes, however late, until a
    /// whole window waits. For MirrorWhenSlow::coalesce and nearFirst.
    std::chrono::milliseconds maxLag{250};
    /// What the server may send at most, bytes a second; 0: any.
    std::uint64_t mostBytesPerSecond = 0;
    /// At most so many frames a second, those in between merged; 0: all.
    double framesPerSecond = 0;
    /// Only these subtrees (DEF names, or # and a node's number), with the nodes on the way to them; none: everything.
    /// Or, alone, a region: `region:[NAME,|x,y,z,]radius[,margin]` in metres, what is that near to a node, a point or
    /// the bound viewpoint, as it moves; it leaves when it is farther by that share of the radius (.1 unless said).
    /// The state hash is then that of a scene that holds just this; the server computes the same.
    std::vector<std::string> parts;  // 1,024 at most
    /// Only fields of these aspects, and those that refer to nodes; none: all.
    std::vector<Aspect> aspects;
    /// Memory that changes behind the replica's back shows in no running hash: every so often a few thousand nodes are
    /// compared with the origin's from what is stored. 0: never.
    std::chrono::milliseconds scrub{5000};
    /// Frames are held back until this long after the origin published them, so that they come as evenly as they were
    /// made. 0: applied as they come.
    std::chrono::milliseconds latency{0};
    /// Called from poll() for everything that was found to differ from the origin, once it has a name.
    std::function<void(const Divergence&)> onDivergence;
    /// Called from poll() when states were missed (MirrorStatistics::holes), before the one that follows is applied.
    std::function<void()> onMissed;
};

struct MirrorStatistics {
    std::uint64_t frames = 0;          // change sets applied, snapshots included, repairs not
    std::uint64_t snapshots = 0;       // of these, whole states
    std::uint64_t inputs = 0;          // of these, computed here from what came into them
    std::uint64_t gaps = 0;            // frames found missing
    std::uint64_t bytes = 0;           // of records received
    std::uint64_t messages = 0;        // of all kinds, read
    std::uint64_t divergences = 0;     // times that the replica was found to differ from the origin
    std::uint64_t repairs = 0;         // of these, put right without a snapshot
    std::uint64_t questions = 0;       // asked to find out where
    std::uint64_t garbage = 0;         // messages that made no sense
    std::uint64_t restarts = 0;        // times the server was found to be another run
    std::uint64_t sequence = 0;        // state of the replica
    std::uint64_t originSequence = 0;  // the newest state that the origin is known to have had
    Hash128 hash, originHash;          // of that state: computed here, and as the origin gave it
    /// The two hashes are the same and there is a state. False as well if the server's types are others than ours.
    bool equal = false;
    // Clock, seconds: the server's steady clock less ours, as good as half the delay; the shortest round trip lately;
    // the mean deviation of frames' transit times (as RFC 3550 has it).
    double clockOffset = 0, delay = 0, jitter = 0;
    std::uint64_t clockSamples = 0;
    std::uint64_t late = 0;  // frames that came after the time they were to be shown at
    /// Age of frames when they were applied, seconds since the origin published them: the last one's, and the most.
    double lag = 0, mostLag = 0;
    /// Times that the origin was out of reach and went on without us: the state that came next does not follow from the
    /// one before. `missed`: seconds from when it was last heard to that state. Where a player jumps nothing is missed.
    std::uint64_t holes = 0;
    double missed = 0;
};

class MirrorClient {
  public:
    /// `replica` must be fresh (or only ever fed by a client) and outlive the client; its behaviours are switched off.
    /// Succeeds whether or not a server is there yet. Errors: of another thread than the replica's; an endpoint, keys
    /// or a name that cannot be.
    static Result<std::unique_ptr<MirrorClient>> connect(Scene& replica, const std::string& endpoint,
                                                         MirrorClientOptions options = {});
    ~MirrorClient();

    /// Applies what has come; if nothing has, waits up to `timeout` for it, or until a signal comes. Returns the number
    /// of change sets applied. On another thread than the replica's it only waits, as the replica would refuse each
    /// frame: a diagnostic says so.
    std::size_t poll(std::chrono::milliseconds timeout = std::chrono::milliseconds(0));
    /// Calls `heard` from poll() after each step of the replica, whose state it led to, with the record as it came
    /// where others here can use it: for a RecordLog or a RecordQueue, which spare the replica's bus. Repairs are no
    /// steps, as what led to the state came before. None: an empty function.
    void onStep(std::function<void(const RecordStep&)> heard);
    /// What whoever waits by other means, on whatever thread, waits for until poll() is called again: that one of the
    /// descriptors is readable, or that so long has passed.
    struct Waiting {
        std::array<int, 2> descriptors{-1, -1};
        std::chrono::milliseconds most{0};
    };
    Waiting waiting() const;
    /// From now on poll() returns early as well when this descriptor is readable; none: -1.
    void wakeBy(int descriptor);
    /// There is a connection, at a relay one of its own too, and the replica is in the newest state heard of.
    bool inStep() const;
    /// The server sends records, or one whose parts take long to come: a state will be here in a while, however slow
    /// the link is.
    bool receiving() const;
    const MirrorStatistics& statistics() const;
    /// What went wrong since the last call, at most a hundred.
    std::vector<Diagnostic> takeDiagnostics();
    /// The server said why it will not have us; empty otherwise.
    const std::string& refusal() const;
    /// The server said that it will not have us for now; it is asked again and again.
    bool turnedAway() const;
    /// There is no connection, nothing has been heard for more than a heartbeat and .4 s, or the server is a relay that
    /// says so of its own origin.
    bool originLost() const;
    /// The server said goodbye, and has not welcomed us since.
    bool serverLeft() const;

    // ---- upstream -------------------------------------------------------------------------------------------
    /// Sends edits and input events to the origin, which orders them, carries them out in the order of a ChangeSet and
    /// answers with a verdict; their effect comes back like any change. A request is carried out at most once, also if
    /// the connection is cut meanwhile. Fails at once if it is longer than 1 MiB.
    Result<std::uint64_t> submit(std::vector<Change> changes);
    /// The same of requests of all kinds.
    Result<std::uint64_t> submit(MirrorRequest request);
    Result<std::uint64_t> submitEvent(NodeId node, FieldIndex field, Value value);
    Result<std::uint64_t> submitEdit(NodeId node, FieldIndex field, Value value);
    /// Takes back what this client's author did last, as far as nobody has changed it since (MirrorVerdict::kept); does
    /// it again. Of edits; what events led to stays.
    Result<std::uint64_t> undo();
    Result<std::uint64_t> redo();
    /// Nobody else may change these nodes for so long (fields, events to them, names, routes; not the nodes below
    /// them), or until it is asked again with 0. Fails at once beyond the limits of MirrorRequest.
    Result<std::uint64_t> lock(std::vector<NodeId> nodes, std::chrono::milliseconds lease);
    /// A number for a node that a request creates, for use inside that request.
    NodeId newNode();
    /// Answers since the last call, in the order of the requests' arrival at the origin.
    std::vector<MirrorVerdict> takeVerdicts();
    /// Asks a server that plays a log to pause, play, step, seek and so on (LogPlayer::command()); over 200 bytes are
    /// refused. Not repeated where the connection is lost; false if there is none, else one reply comes.
    bool control(std::string_view command);
    /// What came of them, in order: the player's status, or "refused: " and why.
    std::vector<std::string> takeReplies();
    /// Requests without an answer yet.
    std::size_t unanswered() const;

    // ---- presentation ---------------------------------------------------------------------------------------
    /// The value to show now: with a latency and a later frame in store, between the replica's and that frame's, by
    /// time (rotations along the shorter arc); else the replica's. The replica itself is never between two states. What
    /// the replica does not have (any more), or cannot be read, gives an empty Value.
    Value presented(NodeId node, FieldIndex field) const;

  private:
    class Impl;
    explicit MirrorClient(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
