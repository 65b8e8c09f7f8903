// Replicas on threads of their own, and what flows to many of them: for the benches of the mirror.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <string>
#include <thread>

#include <rtsg/sync/mirror_client.h>

namespace rtsg::bench {

inline constexpr const char* kAnyPort = "tcp://127.0.0.1:*";

/// A replica on a thread of its own.
class Follower {
  public:
    explicit Follower(std::string endpoint, MirrorClientOptions options = {});
    ~Follower();
    /// The state it is in, with the origin's hash; 0 before, and where the hash differs.
    std::uint64_t reached() const { return reached_; }
    /// When it came there: nanoseconds of the steady clock.
    std::int64_t reachedAt() const { return at_; }
    /// Frames, those merged into one counted once.
    std::uint64_t applied() const { return applied_; }
    bool waitFor(std::uint64_t state, std::chrono::seconds patience = std::chrono::seconds(60)) const;
    /// Stops reading, as a process does that is stopped.
    void pause(bool paused);
    /// Tells the thread to end; does not wait for it.
    void stop();
    /// Once it has ended.
    MirrorStatistics finish();

  private:
    void run();

    std::string endpoint_;
    MirrorClientOptions options_;
    std::atomic<bool> stop_{false}, paused_{false};
    std::atomic<std::uint64_t> reached_{0}, applied_{0};
    std::atomic<std::int64_t> at_{0};
    MirrorStatistics statistics_;
    std::thread thread_;
};

struct Flow {
    double changesPerSecond = 0, bytesPerFrame = 0, framesPerSecond = 0;
    double cpuSeconds = 0;  // of all that the process did, for each frame
    bool good = false;
};

/// The rate at which followers get the frames of a scene that makes so many a second.
struct Paced {
    double framesPerSecond = 0;  // that each got, merged ones counted once; the mean
    double cpuSeconds = 0;       // of all that the process did, for each frame that a follower got
    double bytesPerFrame = 0;    // that a follower got
    bool good = false;           // as Flow's
};
Paced paced(int transforms, double hertz, int frames, int followers);

/// All transforms move in every frame; `followers` of them are waited for, at most 16 frames under way. `stopped` more
/// stop reading meanwhile. good: all of them ended with the origin's hash, and none ever had another.
Flow flow(const std::string& endpoint, int transforms, int frames, int followers, int stopped = 0,
          const MirrorClientOptions& clients = {});

}  // namespace rtsg::bench
