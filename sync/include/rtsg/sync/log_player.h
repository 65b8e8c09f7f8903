// LogPlayer: plays a log in time, with the controls of a player: pause, step, rate, seek, loop.
//
// Invariant: the scene is always in a state of the log. Forward play goes through every state, as it was recorded.
// Subscribers get a seek as one set, or as a snapshot if it begins at a keyframe. Times are those of Replayer::time(),
// so a log of several sessions is played through all of them.
// Threading: one thread, which owns the scene.

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
    /// Opens the log in its first state, playing, without a loop.
    static Result<std::unique_ptr<LogPlayer>> open(const std::filesystem::path& file);

    Scene& scene() { return replayer_->scene(); }
    /// It says what was damaged or missing in the log.
    const Replayer& replayer() const { return *replayer_; }
    /// The position of the playback, and the time of the last state; seconds since the log's start.
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
    /// Steps to the states that are due after so many seconds of the player's own time. A call works for at most a
    /// quarter of a second; the player's clock then waits. Errors: as for Replayer::step(); after an error, play
    /// continues at the next keyframe.
    Result<> advance(double seconds);
    /// Seconds of the player's own time until advance() has something to do; infinite if it is paused, or at its end.
    double dueIn();
    /// Goes to the last state that is not after `time`, which is from 0 to length().
    Result<> seek(double time);
    /// Pauses, and steps forward by `states` states.
    Result<> step(std::uint64_t states);

    /// Carries out "pause", "play", "step [N]", "rate R", "seek T", "loop on", "loop off" or "status". Returns
    /// status(). Errors list the known commands. The caller checks who may send them.
    Result<std::string> command(std::string_view text);
    /// {"t":…,"length":…,"state":…,"paused":…,"rate":…,"loop":…}
    std::string status() const;

  private:
    explicit LogPlayer(std::unique_ptr<Replayer> replayer) : replayer_(std::move(replayer)) {}
    Result<bool> one();
    double reached() const { return replayer_->time() - start_; }
    /// Of the next state, whose scene time is given. Another session may begin with an earlier one; it follows at once.
    double timeOf(double next);

    std::unique_ptr<Replayer> replayer_;
    double start_ = 0, length_ = 0, clock_ = 0, rate_ = 1;
    bool paused_ = false, loop_ = false, ended_ = false;
};

}  // namespace rtsg
