// MirrorServer: a scene to any number of replicas elsewhere, over a ZeroMQ ROUTER socket (PROTOCOL.md, "Mirror").
//
// Invariant: a change set is encoded once, whoever follows. A peer gets a keyframe, then frames without a gap; one
// that is slow gets those it missed merged into one; none can hold up the scene (unless allowed to) or the others.
// Memory is bounded by the options and one more copy of the scene, whatever peers do: keyframes, hashes to compare and
// repairs come from a replica of the server's own, so the scene's thread does nothing for a peer that joins.
// A failure of one of its threads (no memory, say) ends the server, not the process: the next apply() returns why.
// Threading: apply() and service() on the scene's thread; peers and the replica on threads of their own.

// Example:
//     #include <rtsg/sync/mirror_server.h>
//     rtsg::Scene scene;
//     const auto server = rtsg::MirrorServer::start(scene, "tcp://*:5570");
//     if (!server) return;  // server.error() says why
//     for (int frame = 0; frame < 600; ++frame) {
//         scene.newFrame(frame / 60.0);  // sent by the server's threads
//         (*server)->service();  // what peers ask for is carried out here
//     }
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <rtsg/core/scene.h>
#include <rtsg/sync/mirror_keys.h>
#include <rtsg/sync/mirror_request.h>
#include <rtsg/sync/stream_mode.h>

namespace rtsg {

namespace mirror {
class RequestOrder;
struct Submission;
struct Verdict;
struct Writers;
}  // namespace mirror

struct MirrorServerOptions {
    std::string creator = "rtsg";
    /// What the head says of the stream, and how values are coded. For Mode::lossy, serve a LossyScene's scene. With
    /// Mode::input, peers that ask for it get what came into each frame, where the scene can tell, and run the cascade
    /// themselves; others get the changes. It makes the scene record its inputs.
    StreamMode mode;
    /// With keys, peers are authenticated and the traffic is encrypted.
    std::optional<MirrorKeys> keys;
    /// Allows an endpoint that other machines reach without keys.
    bool insecure = false;
    std::size_t maximumPeers = 64;
    /// Different parts of the scene that are followed at once by peers that ask for parts (each costs its memory
    /// again).
    std::size_t maximumParts = 8;
    /// Places of shapes (each path to one counts, and each group on the way) in a scene whose parts by region are
    /// followed, some 250 bytes each. Where there are more, regions are refused.
    std::size_t maximumPlaces = std::size_t{1} << 22;
    /// The session that this server goes on with, as resumeSession() found it; 0: a new one. `before`: the sets that
    /// led to the scene's present state, oldest first, for peers that are in one of the states between.
    std::uint64_t epoch = 0;
    std::vector<std::shared_ptr<const ChangeSet>> before;
    /// Frames kept for peers that resume, bytes.
    std::uint64_t history = std::uint64_t{64} << 20;
    /// To each peer, at most; 0: any. A peer may ask for less.
    std::uint64_t mostBytesPerSecond = 0;
    /// What peers may send to the scene if the keys do not say it of theirs.
    MirrorUpstream upstream = MirrorUpstream::none;
    /// How long peers that ask for MirrorWhenSlow::block may hold up a frame; after that they count as coalesce.
    std::chrono::milliseconds blockFor{0};
    /// A peer is pinged after this much silence, and forgotten after `peerTimeout` without a sign of it.
    std::chrono::milliseconds heartbeat{1500}, peerTimeout{10000};
};

struct MirrorServerStatistics {
    std::size_t peers = 0, mostPeers = 0;  // now, and at most at once so far
    std::uint64_t frames = 0;              // change sets published
    std::uint64_t bytes = 0;               // sent, all peers, records only
    std::uint64_t snapshots = 0;           // keyframes begun to be sent
    std::uint64_t resumed = 0;             // peers that came back and needed no keyframe
    std::uint64_t merged = 0;              // frames that reached a slow peer as part of another
    std::uint64_t garbage = 0;             // messages that made no sense, and connections that never became any
    std::uint64_t refused = 0;             // peers turned away
    std::uint64_t lost = 0;                // peers forgotten after silence
    std::uint64_t repairs = 0;             // differing nodes sent again, in how many records
    std::uint64_t questions = 0;           // about hashes, answered
    std::uint64_t requests = 0;            // from upstream, carried out or refused
    std::uint64_t coded = 0;   // frames encoded a second time, with predicted values, as somebody takes those
    std::uint64_t stalls = 0;  // snapshots that the scene's thread had to take
    /// The least advanced peer's acknowledged state, and the scene's. Acknowledgements may wait for a heartbeat where
    /// there is credit enough; drain() asks for them.
    std::uint64_t acknowledged = 0, sequence = 0;
};

struct EncodedRecord;  // encoded_record.h
class RecordLog;

class MirrorServer : public Subscriber {
  public:
    /// Binds, attaches to the scene's bus and begins to serve. `endpoint`: tcp://127.0.0.1:* picks a free port.
    /// `scene` must outlive the server.
    static Result<std::unique_ptr<MirrorServer>> start(Scene& scene, const std::string& endpoint,
                                                       MirrorServerOptions options = {});
    /// Says goodbye to the peers and waits for their answers, about a second at most.
    ~MirrorServer() override;

    /// Where it listens, the port filled in.
    const std::string& endpoint() const;
    std::uint64_t epoch() const;
    MirrorServerStatistics statistics() const;
    /// What went wrong since the last call (garbage received, peers refused), at most a hundred.
    std::vector<Diagnostic> takeDiagnostics();

    /// Carries out what peers have sent, between frames. Call it once a frame, and now and then while the scene stands
    /// still. Pointers of peers that are gone let go of what they held. Takes a snapshot if the server's replica could
    /// not keep up and was given up (statistics: stalls). Events wait for the next frame, and with them what was asked
    /// after them by the same peer or of the same nodes (250 ms at most), so that the later one counts.
    void service();

    /// Sleeps until then, or until there is something for service() to do, or a signal has come: for a scene that rests
    /// (Scene::restsUntil()). Peers hear of its time with each frame: one now and then, if only an empty one.
    void wait(std::chrono::steady_clock::time_point until);
    /// The same for who waits elsewhere: readable when there is something to do, until service().
    int callDescriptor() const;

    /// service() asks it what peers that may send events have asked a player of a log for, as LogPlayer::command(); its
    /// text goes back to them. Without one they are told that there is nothing to be played; with one, edits and events
    /// are refused, as the log's states are what they were.
    using Controller = std::function<std::string(std::string_view)>;
    void onControl(Controller controller);

    // ---- of a scene that is a replica itself: see MirrorRelay --------------------------------------------------
    /// From now on service() checks what peers have sent, and instead of carrying it out hands it to `forward`, which
    /// returns the request's number there.
    using Forward = std::function<Result<std::uint64_t>(MirrorRequest)>;
    void forwardRequests(Forward forward);
    /// What became of such a request.
    void answer(const MirrorVerdict& verdict);
    /// The same for what onControl() answers elsewhere. `forward` says whether a reply will come.
    using ForwardCommand = std::function<bool(std::string_view)>;
    void forwardCommands(ForwardCommand forward);
    /// The next reply: they come in the order of the commands.
    void answerCommand(std::string reply);
    /// Whether the scene's own origin is lost: peers are told at once, and again with every ping.
    void setOriginLost(bool lost);
    /// The state that the scene starts over with does not follow from the one before, as states between were missed:
    /// peers are told when they join it. To be called before the scene is reset.
    void noteOriginMissed();

    /// From now on peers get a frame, and the verdicts on what they asked for in it, only when a log has it: if this
    /// process is killed, none of them is ahead of the log. What is returned is for LogRecorder::onAcknowledged() of a
    /// recorder of the same scene; it may outlive the server. Frames wait `atMost` so long, as a disk may hang.
    std::function<void(std::uint64_t start, std::uint64_t state)> sendWhatIsLogged(
        std::chrono::milliseconds atMost = std::chrono::milliseconds(1000));

    /// From now on every frame goes into this log too, as the bytes that peers get, and to them when it is there, as
    /// above. Keyframes are made by the server's own replica. The log begins with the scene's present state
    /// (RecordLog::start()); the server lets go of it when it ends.
    void recordTo(std::shared_ptr<RecordLog> log, std::chrono::milliseconds atMost = std::chrono::milliseconds(1000));

    /// Waits until all peers have acknowledged the scene's state; false if `timeout` passes first.
    bool drain(std::chrono::milliseconds timeout);

    Result<> apply(const Scene& scene, const ChangeSet& changes) override;
    std::string subscriberName() const override;

  private:
    struct Shared;
    struct Encoder;
    class Io;
    MirrorServer(Scene& scene, std::shared_ptr<Shared> shared);
    void encodeAndPost(const ChangeSet& changes, bool requested);
    void encodePredicted(const ChangeSet& changes, EncodedRecord& record);
    void encodeInput(const ChangeSet& changes, EncodedRecord& record);
    void waitForThoseWhoBlock();
    void tell(std::vector<mirror::Verdict> verdicts);
    void pass(const std::vector<mirror::Submission>& submissions);
    void letGo(std::uint64_t client);

    Scene& scene_;
    std::shared_ptr<Shared> shared_;
    std::unique_ptr<Encoder> encoder_;
    std::unique_ptr<Io> io_;
    std::shared_ptr<RecordLog> log_;
    Forward forward_;
    ForwardCommand forwardCommand_;
    Controller controller_;
    std::map<std::uint64_t, std::pair<std::uint64_t, std::uint64_t>> forwarded_;  // to client and request
    std::deque<std::pair<std::string, std::uint64_t>> forwardedCommands_;         // of which peer and session
    std::unique_ptr<mirror::Writers> writers_;
    std::unique_ptr<mirror::RequestOrder> order_;
    std::vector<std::uint64_t> leaving_;  // clients that are gone, while something that they asked for waits
    Attachment attachment_;
};

}  // namespace rtsg
