// MirrorServer: a scene to any number of replicas elsewhere, over a ZeroMQ ROUTER socket (PROTOCOL.md, "Mirror").
//
// Invariant: a change set is encoded once, whoever follows. A peer gets a keyframe, then frames without a gap; one
// that is slow gets those it missed merged into one; none can hold up the scene or the others. Memory is bounded by
// the options, whatever peers do.
// Threading: apply() and service() on the scene's thread; everything to do with peers on a thread of its own.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <rtsg/core/scene.h>
#include <rtsg/sync/mirror_keys.h>

namespace rtsg {

struct MirrorServerOptions {
    std::string creator = "rtsg";
    /// With keys, peers are authenticated and the traffic is encrypted.
    std::optional<MirrorKeys> keys;
    /// Allows an endpoint that other machines reach without keys.
    bool insecure = false;
    std::size_t maximumPeers = 64;
    /// Frames kept for peers that resume, bytes.
    std::uint64_t history = std::uint64_t{64} << 20;
    /// A peer is pinged after this much silence, and forgotten after `peerTimeout` without a sign of it.
    std::chrono::milliseconds heartbeat{500}, peerTimeout{10000};
};

struct MirrorServerStatistics {
    std::size_t peers = 0;
    std::uint64_t frames = 0;     // change sets published
    std::uint64_t bytes = 0;      // sent, all peers, records only
    std::uint64_t snapshots = 0;  // keyframes begun to be sent
    std::uint64_t resumed = 0;    // peers that came back and needed no keyframe
    std::uint64_t merged = 0;     // frames that reached a slow peer as part of another
    std::uint64_t garbage = 0;    // messages that made no sense, and connections that never became any
    std::uint64_t refused = 0;    // peers turned away
    std::uint64_t lost = 0;       // peers forgotten after silence
    /// The least advanced peer's acknowledged state, and the scene's.
    std::uint64_t acknowledged = 0, sequence = 0;
};

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

    /// A late joiner may need a snapshot that only the scene's thread can take; publishing does that on the way. Call
    /// this now and then while the scene stands still.
    void service();
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

    Scene& scene_;
    std::shared_ptr<Shared> shared_;
    std::unique_ptr<Encoder> encoder_;
    std::unique_ptr<Io> io_;
    Attachment attachment_;
};

}  // namespace rtsg
