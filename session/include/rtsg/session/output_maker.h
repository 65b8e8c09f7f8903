// OutputMaker: makes pictures, sound and files of a scene that something else runs: a file, a mirror or a log.
//
// makeOutputs() makes all of them in step with the scene, or live, of the newest state, at the machine's own pace;
// followOutputs() on a thread of their own, of every step, however late, or as tiles for a program that joins them.
// Invariant: pictures are taken at even distances of scene time if their file holds several, otherwise one is taken at
// the end. If the scene's time goes back (a log that is played again), outputs go on as if that took no time.
// Threading: the scene's thread.

// Example:
//     #include <rtsg/session/output_maker.h>
//     #include <rtsg/session/running_scene.h>
//     rtsg::RunningScene running("hall.x3dv", rtsg::Resources::ofFile("hall.x3dv"));
//     if (!running.load()) return;
//     rtsg::OutputOptions options;
//     options.render = "hall%04d.png";  // five a second
//     options.listen = "hall.wav";
//     options.seconds = 2;
//     std::unique_ptr<rtsg::OutputMaker> outputs;
//     running.run({.seconds = 2}, "running", [&](std::uint64_t, const rtsg::ChangeSet&) {
//         if (outputs) return outputs->frame().has_value();
//         auto made = rtsg::makeOutputs(running.world(), options, running.resources());
//         if (made) outputs = std::move(*made);
//         return outputs && outputs->frame();
//     });
//     if (outputs && !outputs->finish()) std::cout << "not all of it was made\n";
#pragma once

#include <cstdint>
#include <functional>
#include <initializer_list>
#include <memory>
#include <string>

#include <rtsg/session/output_options.h>
#include <rtsg/session/output_report.h>
#include <rtsg/session/world_on_demand.h>
#include <rtsg/sync/record_queue.h>

namespace rtsg {

inline constexpr double kRounding = 1e-6;  // seconds: doubles of times since 1970 are exact to a quarter of it

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
    /// For those that want every step (wantsSteps()): call it with each.
    virtual void step(const Scene& scene, const RecordStep& step) { (void)scene, (void)step; }
    virtual bool wantsSteps() const { return false; }
    /// Number of steps encoded here, because no usable record came.
    virtual std::uint64_t encoded() const { return 0; }
    /// True if it no longer follows the scene, so going on is useless. finish() tells the reason.
    virtual bool failed() const = 0;
    /// Makes the rest, and writes the files that are written at the end. If all was cut short
    /// (OutputOptions::isCutShort()) that is an error, and only numbered pictures are written.
    virtual Result<> finish() = 0;
    /// Valid after finish().
    virtual OutputReport report() const = 0;
};

/// Makes outputs in step with the scene, or live, as the options say. The world must outlive them, and its scene must
/// be in its first state. `resources`: what urls may open.
Result<std::unique_ptr<OutputMaker>> makeOutputs(WorldOnDemand& world, const OutputOptions& options,
                                                 const Resources& resources);
/// Makes tiles, or outputs of every step; from the scene's present state on. They want steps.
Result<std::unique_ptr<OutputMaker>> followOutputs(const Scene& scene, const OutputOptions& options,
                                                   const Resources& resources);

/// Writes the present state as a document.
Result<> saveScene(const Scene& scene, const std::string& file, Existing existing, const SessionContext& context = {});

/// Says if the sound was made softer.
void reportGain(const ListenReport& report, const SessionContext& context);

/// Draws a copy of the scene as `render` would, apart from the exposure. `scene` itself gets no subscriber. Errors:
/// those of LightRenderer::picture(); a scene that cannot be copied.
Result<Picture> pictureOf(const Scene& scene, const OutputOptions& options, const Resources& resources);

/// Runs all steps, even if one fails. Returns the first error; further ones are reported.
Result<> allOf(const SessionContext& context, std::initializer_list<std::function<Result<>()>> steps);

/// True if the picture before the first wanted one is made, too, from which things have moved while the shutter is
/// open.
bool leadsIn(const OutputOptions& options);

}  // namespace rtsg
