// Origin: the process with the scene that all others follow: its frames, its server, and its log.
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include <rtsg/core/replica.h>
#include <rtsg/core/scene.h>
#include <rtsg/sync/log.h>
#include <rtsg/sync/lossy_scene.h>
#include <rtsg/sync/mirror_server.h>

#include "network.h"

namespace rtsg::simulation {

/// What the origin is like; drawn by the seed.
struct OriginSettings {
    StreamMode mode;
    MirrorUpstream upstream = MirrorUpstream::edits;
    std::uint64_t history = 0;  // bytes
    std::size_t maximumPeers = 64;
    bool logs = false, plain = false;
    LogOptions log;
    std::uint32_t movers = 0;
    Nanoseconds interval = 0;
};

/// The hashes that the served scene had in each state. After a crash a state may come again with another one.
class Witness : public Subscriber {
  public:
    Result<> apply(const Scene& scene, const ChangeSet& changes) override;
    std::string subscriberName() const override { return "witness"; }
    bool saw(std::uint64_t state, const Hash128& hash) const;

  private:
    std::map<std::uint64_t, std::vector<Hash128>> hashes_;
};

class Origin : public Process {
  public:
    Origin(World& world, System& system, Network& network, OriginSettings settings, std::filesystem::path file);
    ~Origin() override { die(false); }

    static constexpr const char* kEndpoint = "origin";
    /// Begins anew, or goes on from the log. Error: an invariant does not hold, and which.
    Result<> start(std::uint64_t seed);
    /// A frame of the application, with its edits.
    void frame(Random random, double time);
    /// Carries out what has come.
    void poll();
    void die(bool isSilent);
    void close();
    void losePower();
    /// Whether the log, read now, leads to the last state that it has acknowledged.
    Result<> checkLog() const;
    bool isRunning() const { return server_ != nullptr; }
    Scene& scene() { return *scene_; }
    const Scene& served() const { return lossy_ ? lossy_->scene() : *scene_; }
    MirrorServer& server() { return *server_; }
    const OriginSettings& settings() const { return settings_; }
    std::uint64_t durable() const { return durable_; }

    Witness witness;
    Nanoseconds startAt = 0, diskTakes = 0;
    std::uint32_t lineage = 0;  // grows when it does not go on with what it had
    std::string problem;        // why it does not start
    std::uint64_t resumedAt = 0, resumed = 0, frames = 0;

  private:
    /// Writes the log, and notes what is in it.
    struct Log : Subscriber {
        explicit Log(Origin& of) : origin(of) {}
        Origin& origin;
        std::unique_ptr<LogWriter> writer;
        Result<> apply(const Scene& scene, const ChangeSet& changes) override;
        std::string subscriberName() const override { return "log"; }
    };
    void build(std::uint64_t seed);
    Result<bool> resume(MirrorServerOptions& options, LogOptions& log);
    Result<> checkResumed(const Scene& scene, std::uint64_t states) const;
    /// Writes what has come to the log, and lets the peers have it.
    void write();

    World& world_;
    System& system_;
    Network& network_;
    const OriginSettings settings_;
    const std::filesystem::path file_;
    std::unique_ptr<Scene> scene_;
    std::unique_ptr<LossyScene> lossy_;
    std::unique_ptr<Log> log_;
    std::unique_ptr<MirrorServer> server_;
    Attachment witnessing_, logging_;
    std::function<void(std::uint64_t, std::uint64_t)> acknowledge_;
    std::unique_ptr<Replica> logged_;  // what the log is written from, as LogRecorder does it
    Nanoseconds writesAt_ = kNever;
    std::uint64_t durable_ = 0;       // the last state that a killed process leaves
    std::uint64_t flushedState_ = 0;  // the last one that a loss of power leaves
    bool isOnLog_ = false;            // the log has had a state
    Nanoseconds busyUntil_ = 0;
};

}  // namespace rtsg::simulation
