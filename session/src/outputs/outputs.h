// Outputs: makes pictures and sound of every frame of a scene, in step with it, and saves its last state.
//
// A picture and a block of sound are made on a thread of their own while the next frame runs, and frame() waits for
// those of the frame before. Invariant: for T seconds at F pictures a second these are the pictures at k / F < T, and
// sound is T long to the sample; OutputReport says what is missing.
// Threading: the scene's thread.
#pragma once

#include <atomic>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <fmt/format.h>

#include <rtsg/audio/sound_renderer.h>
#include <rtsg/session/output_maker.h>
#include <rtsg/session/provenance.h>

namespace rtsg {

/// The error for a picture that an interruption ended.
inline std::unexpected<Diagnostic> notWritten(const std::string& file) {
    return fail("interrupted: the picture was not written", {}, file);
}

/// Writes the sound, in the requested length, to its own file or into the film. Returns its length in seconds. A
/// stretch gets `comment`.
Result<double> writeSound(SoundRenderer& sound, const OutputOptions& arguments, PictureFiles& pictures,
                          const std::string& comment = {});
/// The picture files that the arguments ask for.
PictureFiles pictureFiles(const OutputOptions& arguments);

class Outputs final : public OutputMaker {
  public:
    /// The world must outlive this, and its scene must be in its first state. `resources`: what urls may open.
    static Result<std::unique_ptr<Outputs>> attach(WorldOnDemand& world, const OutputOptions& arguments,
                                                   const Resources& resources);
    ~Outputs() override;

    Scene& scene() { return scene_; }

    /// First waits for the outputs of the frame before.
    Result<> frame() override;
    bool failed() const override { return failed_; }
    Result<> finish() override;
    OutputReport report() const override;

  private:
    Outputs(WorldOnDemand& world, const OutputOptions& arguments)
        : world_(world), scene_(world.scene()), arguments_(arguments), files_(pictureFiles(arguments_)) {}
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
    Result<> write(Picture picture, const std::string& state);
    /// Of the scene's present state.
    std::string nameOfState() const { return fmt::format("{} {}", scene_.sequence(), scene_.hash().hex()); }
    Provenance provenance(std::string options, std::string state) const;

    WorldOnDemand& world_;
    Scene& scene_;
    OutputOptions arguments_;
    Resources resources_;
    std::unique_ptr<LightRenderer> light_;  // null until a picture must be made
    std::unique_ptr<SoundRenderer> sound_;
    ElapsedTime elapsed_;
    std::shared_ptr<const WorldState> before_;  // the last state before the scene started over
    std::string nameBefore_;
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

}  // namespace rtsg
