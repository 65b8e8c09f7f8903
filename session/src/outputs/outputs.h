// Outputs: makes pictures and sound of every frame of a scene, in step with it, and saves its last state.
//
// A picture and a block of sound are made on a thread of their own while the next frame runs, and frame() waits for
// those of the frame before. Invariant: for T seconds at F pictures a second these are the pictures at k / F < T, and
// sound is T long to the sample; OutputReport says what is missing.
// Threading: the scene's thread.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <fmt/format.h>

#include <rtsg/audio/sound_renderer.h>
#include <rtsg/core/worker.h>
#include <rtsg/session/output_maker.h>
#include <rtsg/session/provenance.h>

namespace rtsg {

/// The error for a picture that an interruption ended.
inline std::unexpected<Diagnostic> notWritten(const std::string& file) {
    return fail("interrupted: the picture was not written", {}, file);
}

/// What makers have in common that draw and hear a world itself, in step with its scene or live.
class WorldOutputs : public OutputMaker {
  public:
    bool failed() const override { return failed_; }

  protected:
    WorldOutputs(WorldOnDemand& world, const OutputOptions& arguments);
    /// Errors: options of node types that the scene has not; a wrong tessellation.
    static Result<> check(WorldOnDemand& world, const OutputOptions& arguments, const Resources& resources);
    /// True if nodes of plug-ins draw, or voice, which have to do so on the scene's thread.
    Result<bool> attachLight(const Resources& resources, ImageOptions image);
    Result<bool> attachSound(const ListenOptions& options);
    Result<ListenOptions> hearing(const Resources& resources, bool live) const;
    /// At the end: the sound, in the requested length, in its own file or the film; a stretch gets `comment`.
    Result<> finishSound(const std::string& comment = {});
    /// `held`: the last picture stays for so many more.
    Result<> finishPictures(std::uint64_t held = 0);
    Result<> finishScene();
    Result<> leaveUnwritten();
    /// The signal that ended the run does not end the last outputs.
    void finishDespiteInterruption() { afterInterruption_ = arguments_.context.interrupted(); }

    WorldOnDemand& source_;
    Scene& scene_;
    OutputOptions arguments_;
    std::unique_ptr<LightRenderer> light_;  // null until a picture must be made
    std::unique_ptr<SoundRenderer> sound_;
    std::atomic<bool> failed_{false}, afterInterruption_{false}, abandoned_{false};
    // For the threads that draw and hear while they do, otherwise for the scene's.
    PictureFiles files_;
    OutputReport report_;
};

class Outputs final : public WorldOutputs {
  public:
    /// The world must outlive this, and its scene must be in its first state. `resources`: what urls may open.
    static Result<std::unique_ptr<Outputs>> attach(WorldOnDemand& world, const OutputOptions& arguments,
                                                   const Resources& resources);
    ~Outputs() override;

    Scene& scene() { return scene_; }

    /// First waits for the outputs of the frame before.
    Result<> frame() override;
    Result<> finish() override;
    OutputReport report() const override;

  private:
    Outputs(WorldOnDemand& world, const OutputOptions& arguments) : WorldOutputs(world, arguments) {}
    /// Outputs to be made of one state.
    struct Job {
        std::shared_ptr<const WorldState> state;
        std::string name;  // of the state: its number and hash
        bool picture = false;
        double until = 0;  // pictures up to this time, seconds from the start
    };
    Result<> next(bool picture, double until);
    void begin(Job job);
    void keepWhatIs();
    Result<> pictureWhatWasBefore(double t);
    Result<> ready();
    Result<> make(const Job& job);
    Result<> lastPicture();
    bool pictureIsDue(double t) const;
    double elapsed() { return elapsed_.at(scene_.now()); }
    /// Seconds from the start to the next picture.
    double nextPicture() const { return static_cast<double>(number_) / arguments_.picturesPerSecond; }
    std::string numbersFrom(double next) const;
    bool isWanted() const { return !arguments_.only || number_ >= arguments_.only->first; }
    Result<> write(Picture picture, const std::string& state);
    /// Of the scene's present state.
    std::string nameOfState() const { return fmt::format("{} {}", scene_.sequence(), scene_.hash().hex()); }
    Provenance provenance(std::string options, std::string state) const;

    Resources resources_;
    ElapsedTime elapsed_;
    std::shared_ptr<const WorldState> before_;  // the last state before the scene started over
    std::string nameBefore_;

    // Belongs to the worker while it has a job, otherwise to the scene's thread.
    std::uint64_t number_ = 0;  // of the next picture
    Result<> result_;           // the first failure

    Worker worker_{"rtsg outputs"};  // last: its jobs use the others
};

}  // namespace rtsg
