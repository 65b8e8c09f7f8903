// Carries out --render, --listen and --save for a scene that something drives: a file, a mirror or a log.
//
// Outputs makes every picture that is due and all of the sound, on the scene's thread; OutputsBehind (behind.h) the
// same on a thread of its own, however late; LiveOutputs (live_outputs.h) of the newest state, at the machine's own
// pace. Invariant: pictures are taken at even distances of scene time if the file's name holds a place for a number
// (%04d) or is a .mp4 or .gif; else one is taken at the end. For T seconds at F pictures a second these are the
// pictures at k / F < T, and sound is T long to the sample; OutputReport says what is missing. If the scene's time goes
// back (a log that is played again) they go on from there, as if that took no time. Threading: the scene's thread.
#pragma once

#include <atomic>
#include <condition_variable>
#include <functional>
#include <initializer_list>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <rtsg/audio/sound_renderer.h>

#include "output_arguments.h"
#include "output_report.h"
#include "world_on_demand.h"

namespace rtsg::app {

inline constexpr double kRounding = 1e-6;  // seconds: times since 1970 are exact to a quarter of that

/// The present state as a document.
Result<> saveScene(const Scene& scene, const std::string& file, Existing existing);

/// Scene time from a start on. If it goes back (a log that is played again), that takes no time.
class ElapsedTime {
  public:
    explicit ElapsedTime(double start = 0) : start_(start), last_(start) {}
    /// Seconds, now that the scene's time is `now`.
    double at(double now) {
        if (now < last_) start_ -= last_ - now;
        last_ = now;
        return now - start_;
    }
    /// The start from which time is counted now.
    double start() const { return start_; }

  private:
    double start_, last_;
};

/// The error for a picture that an interruption ended.
inline std::unexpected<Diagnostic> notWritten(const std::string& file) {
    return fail("interrupted: the picture was not written", {}, file);
}

/// A line on standard error if the sound had to be made softer.
void tellGain(const ListenReport& report);

/// Writes what was heard, as long as was asked for, into a file of its own or into the film. Returns its length in
/// seconds.
Result<double> writeSound(SoundRenderer& sound, const OutputArguments& arguments, PictureFiles& pictures);
/// The files that arguments ask for.
PictureFiles pictureFiles(const OutputArguments& arguments);

/// Does one after the other; what fails costs the others nothing. The first error, if there is more than one the others
/// are printed.
Result<> allOf(std::initializer_list<std::function<Result<>()>> steps);

class OutputMaker {
  public:
    virtual ~OutputMaker() = default;
    OutputMaker() = default;
    OutputMaker(const OutputMaker&) = delete;
    OutputMaker& operator=(const OutputMaker&) = delete;

    /// Every set of the scene's present instant has come: makes what is due. Calling it again at the same instant, and
    /// now and then while nothing comes, does no harm.
    virtual Result<> frame() = 0;
    /// It follows no longer: there is no sense in going on. finish() says why.
    virtual bool failed() const = 0;
    /// Makes what is still to be made, and writes what is written at the end, unless all was cut short
    /// (OutputArguments::isCutShort(), an error then): numbered pictures alone are there.
    virtual Result<> finish() = 0;
    /// After finish().
    virtual OutputReport report() const = 0;
};

class Outputs final : public OutputMaker {
  public:
    /// The world must outlive this, and its scene be in its first state. `resources`: what urls may open. Throws as
    /// keepResources().
    static Result<std::unique_ptr<Outputs>> attach(WorldOnDemand& world, const OutputArguments& arguments,
                                                   const Resources& resources);
    ~Outputs() override;

    Scene& scene() { return scene_; }

    /// Waits for what the frame before has asked for.
    Result<> frame() override;
    bool failed() const override { return failed_; }
    Result<> finish() override;
    OutputReport report() const override;

  private:
    Outputs(WorldOnDemand& world, const OutputArguments& arguments)
        : world_(world), scene_(world.scene()), arguments_(arguments), files_(pictureFiles(arguments_)) {}
    /// The outputs that are to be made of one state.
    struct Job {
        std::shared_ptr<const WorldState> state;
        bool picture = false;
        double until = 0;  // seconds from the start: pictures up to there
    };
    Result<> next(bool picture, double until);
    void begin(Job job);
    void keepWhatIs();
    Result<> pictureWhatWasBefore(double t);
    Result<> ready();
    void work();
    Result<> make(const Job& job);
    Result<> attachLight();
    Result<> lastPicture();
    Result<> leaveUnwritten();
    bool pictureIsDue(double t) const;
    double elapsed() { return elapsed_.at(scene_.now()); }
    /// Seconds from the start to the next picture.
    double nextPicture() const {
        return static_cast<double>(report_.pictureStates.size()) / arguments_.picturesPerSecond;
    }

    WorldOnDemand& world_;
    Scene& scene_;
    OutputArguments arguments_;
    Resources resources_;
    std::unique_ptr<LightRenderer> light_;  // null until there is a picture to make
    std::unique_ptr<SoundRenderer> sound_;
    ElapsedTime elapsed_;
    std::shared_ptr<const WorldState> before_;  // the last state before the scene started over
    std::atomic<bool> failed_{false}, afterInterruption_{false}, abandoned_{false};

    // The worker's while it has a job, else the scene's thread's.
    PictureFiles files_;
    OutputReport report_;
    Result<> result_;  // the first that failed

    std::mutex mutex_;
    std::condition_variable changed_;
    std::optional<Job> job_;
    bool stop_ = false;
    std::thread worker_;  // from the first job on
};

}  // namespace rtsg::app
