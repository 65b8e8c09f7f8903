// Outputs: carries out --render, --listen and --save for a scene that something else runs: a file, a mirror or a log.
//
// Outputs makes all due pictures and all sound on the scene's thread. OutputsBehind (behind.h) does so on a thread of
// its own, however late. LiveOutputs (live_outputs.h) takes the newest states at the machine's own pace. Invariant:
// pictures are taken at even distances of scene time if the file's name has a place for a number (%04d) or is a .mp4 or
// .gif; otherwise one is taken at the end. For T seconds at F pictures a second these are the pictures at k / F < T,
// and sound is T long to the sample; OutputReport says what is missing. If the scene's time goes back (a log that is
// played again), outputs go on as if that took no time.
// Threading: the scene's thread.
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

inline constexpr double kRounding = 1e-6;  // seconds: doubles of times since 1970 are exact to a quarter of it

/// Writes the present state as a document.
Result<> saveScene(const Scene& scene, const std::string& file, Existing existing);

/// Scene time since a start. If it goes back (a log that is played again), that takes no time.
class ElapsedTime {
  public:
    explicit ElapsedTime(double start = 0) : start_(start), last_(start) {}
    /// Seconds since the start, when the scene's time is `now`.
    double at(double now) {
        if (now < last_) start_ -= last_ - now;
        last_ = now;
        return now - start_;
    }
    /// The start from which time is now counted.
    double start() const { return start_; }

  private:
    double start_, last_;
};

/// The error for a picture that an interruption ended.
inline std::unexpected<Diagnostic> notWritten(const std::string& file) {
    return fail("interrupted: the picture was not written", {}, file);
}

/// Says on standard error if the sound was made softer.
void tellGain(const ListenReport& report);

/// Writes the sound, in the requested length, to its own file or into the film. Returns its length in seconds.
Result<double> writeSound(SoundRenderer& sound, const OutputArguments& arguments, PictureFiles& pictures);
/// The picture files that the arguments ask for.
PictureFiles pictureFiles(const OutputArguments& arguments);

/// Runs all steps, even if one fails. Returns the first error; further ones are printed.
Result<> allOf(std::initializer_list<std::function<Result<>()>> steps);

/// True if the picture before the first wanted one is made, too, from which things have moved while the shutter is
/// open.
bool leadsIn(const OutputArguments& arguments);

class OutputMaker {
  public:
    virtual ~OutputMaker() = default;
    OutputMaker() = default;
    OutputMaker(const OutputMaker&) = delete;
    OutputMaker& operator=(const OutputMaker&) = delete;

    /// Call it when every set of the scene's present time has arrived: it makes the outputs that are due. It may be
    /// called again at the same time, and while nothing arrives.
    virtual Result<> frame() = 0;
    /// True if frame() has nothing to do until something comes.
    virtual bool rests() const { return true; }
    /// True if it no longer follows the scene, so going on is useless. finish() tells the reason.
    virtual bool failed() const = 0;
    /// Makes the rest, and writes the files that are written at the end. If all was cut short
    /// (OutputArguments::isCutShort()) that is an error, and only numbered pictures are written.
    virtual Result<> finish() = 0;
    /// Valid after finish().
    virtual OutputReport report() const = 0;
};

class Outputs final : public OutputMaker {
  public:
    /// The world must outlive this, and its scene must be in its first state. `resources`: what urls may open. Throws
    /// like keepResources().
    static Result<std::unique_ptr<Outputs>> attach(WorldOnDemand& world, const OutputArguments& arguments,
                                                   const Resources& resources);
    ~Outputs() override;

    Scene& scene() { return scene_; }

    /// First waits for the outputs of the frame before.
    Result<> frame() override;
    bool failed() const override { return failed_; }
    Result<> finish() override;
    OutputReport report() const override;

  private:
    Outputs(WorldOnDemand& world, const OutputArguments& arguments)
        : world_(world), scene_(world.scene()), arguments_(arguments), files_(pictureFiles(arguments_)) {}
    /// Outputs to be made of one state.
    struct Job {
        std::shared_ptr<const WorldState> state;
        bool picture = false;
        double until = 0;  // pictures up to this time, seconds from the start
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
    double nextPicture() const { return static_cast<double>(number_) / arguments_.picturesPerSecond; }
    std::string numbersFrom(double next) const;
    bool isWanted() const { return !arguments_.only || number_ >= arguments_.only->first; }
    Result<> write(Picture picture);

    WorldOnDemand& world_;
    Scene& scene_;
    OutputArguments arguments_;
    Resources resources_;
    std::unique_ptr<LightRenderer> light_;  // null until a picture must be made
    std::unique_ptr<SoundRenderer> sound_;
    ElapsedTime elapsed_;
    std::shared_ptr<const WorldState> before_;  // the last state before the scene started over
    std::atomic<bool> failed_{false}, afterInterruption_{false}, abandoned_{false};

    // Belongs to the worker while it has a job, otherwise to the scene's thread.
    PictureFiles files_;
    std::uint64_t number_ = 0;  // of the next picture
    OutputReport report_;
    Result<> result_;  // the first failure

    std::mutex mutex_;
    std::condition_variable changed_;
    std::optional<Job> job_;
    bool stop_ = false;
    std::thread worker_;  // runs from the first job on
};

}  // namespace rtsg::app
