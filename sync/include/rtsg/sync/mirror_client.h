// MirrorClient: keeps a replica scene in step with a MirrorServer's (PROTOCOL.md, "Mirror").
//
// Invariant: the replica is always in a state that the origin had. After every frame its hash is compared with the
// origin's; if they differ, that is counted and reported, and a new snapshot repairs it. Lost connections, gaps and
// restarts of the server heal by themselves, by resuming where possible, else by a snapshot (Scene::reset).
// Threading: everything on the replica's thread, inside poll(); ZeroMQ does the waiting.
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

struct MirrorClientOptions {
    std::string name = "rtsg";
    std::optional<MirrorKeys> keys;
    /// How much the server may send ahead of what poll() has applied, bytes.
    std::uint64_t window = std::uint64_t{8} << 20;
    /// Longest record accepted, bytes.
    std::uint64_t maxRecord = std::uint64_t{1} << 32;
    /// Without a sign of the server for this long, the client introduces itself again.
    std::chrono::milliseconds timeout{2500};
};

struct MirrorStatistics {
    std::uint64_t frames = 0;       // change sets applied, snapshots included
    std::uint64_t snapshots = 0;    // of these, whole states
    std::uint64_t gaps = 0;         // frames found missing
    std::uint64_t bytes = 0;        // of records received
    std::uint64_t divergences = 0;  // states with another hash than the origin's
    std::uint64_t garbage = 0;      // messages that made no sense
    std::uint64_t restarts = 0;     // times the server was found to be another run
    std::uint64_t sequence = 0;     // state of the replica
    Hash128 hash, originHash;       // of that state: computed here, and as the origin gave it
    /// The two hashes are the same and there is a state. False as well if the server's types are others than ours.
    bool equal = false;
};

class MirrorClient {
  public:
    /// `replica` must be fresh (or only ever fed by a client) and outlive the client; its behaviours are switched off.
    /// Succeeds whether or not a server is there yet.
    static Result<std::unique_ptr<MirrorClient>> connect(Scene& replica, const std::string& endpoint,
                                                         MirrorClientOptions options = {});
    ~MirrorClient();

    /// Applies what has come; if nothing has, waits up to `timeout` for it. Returns the number of change sets applied.
    std::size_t poll(std::chrono::milliseconds timeout = std::chrono::milliseconds(0));
    /// There is a connection and the replica is in the newest state heard of.
    bool inStep() const;
    const MirrorStatistics& statistics() const;
    /// What went wrong since the last call, at most a hundred.
    std::vector<Diagnostic> takeDiagnostics();
    /// The server said why it will not have us; empty otherwise.
    const std::string& refusal() const;
    /// The server said goodbye, and nothing has been heard of one since.
    bool serverLeft() const;

  private:
    class Impl;
    explicit MirrorClient(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
