// MirrorServer: serves a scene to any number of remote replicas (PROTOCOL.md, "Mirror").
//
// Invariant: a change set is encoded once for all peers. A peer gets a keyframe and then frames without a gap. A slow
// peer gets the frames that it missed merged into one, and cannot hold up the other peers, or the scene unless options
// allow it. Memory is bounded by the options and one more copy of the scene, whatever peers do. Keyframes, hashes and
// repairs come from a replica of the server's own, so a peer that joins costs the scene's thread nothing. A failure of
// one of its threads (no memory, say) ends the server and not the process; the next apply() returns the reason.
// Threading: apply() and service() on the scene's thread. The peers and the replica have threads of their own.

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
#include <filesystem>
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

class Listener;
class Transport;

struct MirrorServerOptions {
    std::string creator = "rtsg";
    /// The mode of the stream and the coding of values, as its head states them. For Mode::lossy serve the scene of a
    /// LossyScene. With Mode::input, peers that ask for it get the input of each frame, where the scene knows it, and
    /// run the cascade themselves; others get changes. Mode::input makes the scene record its inputs.
    StreamMode mode;
    /// With keys, peers are authenticated and the traffic is encrypted.
    std::optional<MirrorKeys> keys;
    /// The file of `keys`; empty: none. When it changes, its list of clients is read again: those that it no longer has
    /// are sent away.
    std::filesystem::path keyFile;
    /// Allows an endpoint that other machines can reach, without keys.
    bool insecure = false;
    std::size_t maximumPeers = 64;
    /// The most different parts of the scene that peers may follow at once. Each takes its part of the memory again.
    std::size_t maximumParts = 8;
    /// The most places of shapes, some 250 bytes each, in a scene whose regions are followed. Each path to a shape
    /// counts, and each group on the way. With more, regions are refused.
    std::size_t maximumIndexed = std::size_t{1} << 22;
    /// `epoch`: the session to go on with, as resumeSession() found it; 0 for a new one. `before`: the sets that led to
    /// the scene's present state, oldest first, for peers that are in a state between.
    std::uint64_t epoch = 0;
    std::vector<std::shared_ptr<const ChangeSet>> before;
    /// Bytes of frames that are kept for peers that resume.
    std::uint64_t history = std::uint64_t{64} << 20;
    /// The most bytes a second to each peer; 0 for no limit. A peer may ask for less.
    std::uint64_t maxBytesPerSecond = 0;
    /// What peers may send to the scene if their keys have no permission of their own.
    MirrorUpstream upstream = MirrorUpstream::none;
    /// How long peers with MirrorWhenSlow::block may hold up a frame. After that they count as coalesce.
    std::chrono::milliseconds blockFor{0};
    /// A peer is pinged after `heartbeat` of silence, and forgotten after `peerTimeout` without a sign of it.
    std::chrono::milliseconds heartbeat{1500}, peerTimeout{10000};
    /// How messages travel, and by which clock. Null: ZeroMQ and the system's.
    std::shared_ptr<Transport> transport{};
};

struct MirrorServerStatistics {
    std::size_t peers = 0, maxPeers = 0;  // now, and the most at once so far
    std::uint64_t frames = 0;             // change sets published
    std::uint64_t bytes = 0;              // of records sent to all peers
    std::uint64_t snapshots = 0;          // keyframes that began to be sent
    std::uint64_t resumed = 0;            // peers that came back and needed no keyframe
    std::uint64_t merged = 0;             // frames that reached a slow peer merged with others
    std::uint64_t garbage = 0;            // messages that made no sense, and connections that sent no valid one
    std::uint64_t refused = 0;            // peers turned away
    std::uint64_t lost = 0;               // peers forgotten after silence
    std::uint64_t repairs = 0;            // differing nodes sent again, in how many records
    std::uint64_t questions = 0;          // questions about hashes that were answered
    std::uint64_t requests = 0;           // from upstream, carried out or refused
    std::uint64_t coded = 0;   // frames encoded a second time with predicted values, for peers that take them
    std::uint64_t stalls = 0;  // snapshots that the scene's thread had to take
    /// `acknowledged`: the state that the slowest peer has acknowledged. `sequence`: the scene's state.
    /// Acknowledgements may be late by a heartbeat while there is credit enough; drain() asks for them.
    std::uint64_t acknowledged = 0, sequence = 0;
};

struct EncodedRecord;  // encoded_record.h
class RecordLog;

class MirrorServer : public Subscriber {
  public:
    /// Binds, attaches to the scene's bus and begins to serve. With `endpoint` tcp://127.0.0.1:* the system picks a
    /// free port. `scene` must outlive the server.
    static Result<std::unique_ptr<MirrorServer>> start(Scene& scene, const std::string& endpoint,
                                                       MirrorServerOptions options = {});
    /// Says goodbye to the peers and waits for their answers, about a second at most.
    ~MirrorServer() override;

    /// The address where it listens, with the port filled in.
    const std::string& endpoint() const;
    std::uint64_t epoch() const;
    MirrorServerStatistics statistics() const;
    /// The diagnostics since the last call (garbage received, peers refused), at most a hundred.
    std::vector<Diagnostic> takeDiagnostics();

    /// Carries out, between frames, what peers have sent. Call it once a frame, and now and then while the scene rests.
    /// Pointers of peers that are gone release what they held. Takes a snapshot if the server's replica fell behind and
    /// was given up (stalls in the statistics). Events wait for the next frame. Later requests of the same peer, or for
    /// the same nodes, wait with them (at most 250 ms), so that the later one counts.
    void service();

    /// Sleeps until that time, until service() has something to do, or until a signal comes. Meant for a scene that
    /// rests (Scene::restsUntil()). Peers learn the scene's time from frames, so make one now and then, even an empty
    /// one.
    void wait(std::chrono::steady_clock::time_point until);
    /// The same for callers that wait elsewhere: the descriptor becomes readable when there is something to do, and
    /// stays so until service().
    int callDescriptor() const;

    /// Sets the function that answers commands for a player (LogPlayer::command()), which peers with the permission for
    /// events send. service() calls it, and its text is the reply. Without a controller, peers are told that there is
    /// nothing to play. With one, edits and events are refused, as the states of a log cannot change.
    using Controller = std::function<std::string(std::string_view)>;
    void onControl(Controller controller);

    /// Serves peers that come by this listener, too.
    void admit(std::unique_ptr<Listener> listener);

    // ---- for a scene that is a replica itself: see MirrorRelay -------------------------------------------------
    /// From now on service() checks requests and hands them to `forward` instead of carrying them out. `forward`
    /// returns the number that the request has at the origin.
    using Forward = std::function<Result<std::uint64_t>(MirrorRequest)>;
    void forwardRequests(Forward forward);
    /// Passes on the verdict for a forwarded request.
    void answer(const MirrorVerdict& verdict);
    /// The same for commands, instead of onControl(). `forward` returns whether a reply will come.
    using ForwardCommand = std::function<bool(std::string_view)>;
    void forwardCommands(ForwardCommand forward);
    /// Passes on the next reply. Replies come in the order of the commands.
    void answerCommand(std::string reply);
    /// Says whether the scene's own origin is lost. Peers are told at once, and again with every ping.
    void setOriginLost(bool lost);
    /// Call it before the scene is reset to a state that does not follow from the one before, because states were
    /// missed. Peers are told when they join that state.
    void noteOriginMissed();

    /// From now on peers get a frame, and the verdicts of its requests, only when a log has the frame. So no peer is
    /// ahead of the log if this process is killed. Give the result to LogRecorder::onAcknowledged() of a recorder of
    /// the same scene; it may outlive the server. A frame waits at most `atMost`, because a disk may hang.
    std::function<void(std::uint64_t start, std::uint64_t state)> sendWhatIsLogged(
        std::chrono::milliseconds atMost = std::chrono::milliseconds(1000));

    /// From now on every frame goes into this log too, in the bytes that peers get, and peers get it once it is in the
    /// log, as above. The server's own replica makes the keyframes. The log begins with the scene's present state
    /// (RecordLog::start()). The server releases the log when it ends.
    void recordTo(std::shared_ptr<RecordLog> log, std::chrono::milliseconds atMost = std::chrono::milliseconds(1000));

    /// Waits until all peers have acknowledged the scene's state. False if `timeout` passes first.
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
    void notify(std::vector<mirror::Verdict> verdicts);
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
    std::map<std::uint64_t, std::pair<std::uint64_t, std::uint64_t>> forwarded_;  // client and request
    std::deque<std::pair<std::string, std::uint64_t>> forwardedCommands_;         // client and session
    std::unique_ptr<mirror::Writers> writers_;
    std::unique_ptr<mirror::RequestOrder> order_;
    std::vector<std::uint64_t> leaving_;  // clients that are gone while a request of theirs waits
    Attachment attachment_;
};

}  // namespace rtsg
