// LogPlayer: a log played in time, with what a player has: pause, step, rate, seek, loop.
//
// Invariant: the scene is always in a state of the log; played forward it goes through every one, each as it was
// recorded. A seek comes to subscribers as one set, or, where it begins at a keyframe, as a snapshot. Times are those
// of Replayer::time(): a log of several sessions is played through all of them. Threading: one thread, which owns the
// scene.

// Example:
//     #include <rtsg/sync/log_player.h>
//     const auto player = rtsg::LogPlayer::open("hall.rlog");
//     if (!player) return;
//     std::cout << *(*player)->command("rate 2") << '\n';
//     if (const auto played = (*player)->advance(.5); !played) return;  // one second of the log
//     std::cout << (*player)->time() << " of " << (*player)->length() << " s\n";
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

#include <rtsg/sync/replay.h>

namespace rtsg {

class LogPlayer {
  public:
    /// In the first state, playing, once through.
    static Result<std::unique_ptr<LogPlayer>> open(const std::filesystem::path& file);

    Scene& scene() { return replayer_->scene(); }
    /// Says what of the log was found to be damaged or missing.
    const Replayer& replayer() const { return *replayer_; }
    /// Seconds since the log's start: of the playback, and of the last state.
    double time() const { return clock_; }
    double length() const { return length_; }
    double rate() const { return rate_; }
    bool paused() const { return paused_; }
    bool loops() const { return loop_; }
    bool ended() const { return ended_ && !loop_; }

    void pause(bool on) { paused_ = on; }
    /// Precondition: 0 < rate <= 1000.
    void setRate(double rate) { rate_ = rate; }
    void setLoop(bool on) { loop_ = on; }
    /// States that have become due after so many seconds of the player's own time. At most a quarter of a second's work
    /// at once; the clock then waits. Errors: as Replayer::step(); playing on goes on at the next keyframe.
    Result<> advance(double seconds);
    /// To the last state not after `time`, 0 to length().
    Result<> seek(double time);
    /// The next `states`; pauses.
    Result<> step(std::uint64_t states);

    /// "pause", "play", "step [N]", "rate R", "seek T", "loop on", "loop off", "status", from whoever may say so.
    /// Returns status(); errors say what would be understood.
    Result<std::string> command(std::string_view text);
    /// {"t":…,"length":…,"state":…,"paused":…,"rate":…,"loop":…}
    std::string status() const;

  private:
    explicit LogPlayer(std::unique_ptr<Replayer> replayer) : replayer_(std::move(replayer)) {}
    Result<bool> one();
    double reached() const { return replayer_->time() - start_; }

    std::unique_ptr<Replayer> replayer_;
    double start_ = 0, length_ = 0, clock_ = 0, rate_ = 1;
    bool paused_ = false, loop_ = false, ended_ = false;
};

}  // namespace rtsg
