// LiveOutputs: pictures and sound of a scene that does not wait for them. Each has its own thread and takes the newest
// state (SharedWorld::latest()), so states are merged.
//
// Invariant: a picture is of one whole state. It is taken at times k / F if the one before is done by then; otherwise
// it is skipped and counted. Files are numbered without gaps. Sound is as long as the scene's time, and places follow
// the newest state. If that time goes back (a log that is played again), both go on as if that took no time. With
// --listen device the sound is played instead. One flattening and one BVH serve all.
// Threading: all calls on the scene's thread. Call frame() now and then, so that states are handed over.
#pragma once

#include <atomic>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

#include <rtsg/core/worker.h>
#include <rtsg/renderers/path_preview.h>

#include "outputs/outputs.h"

namespace rtsg {

class LiveOutputs final : public WorldOutputs {
  public:
    /// The world must outlive this, and its scene must be in its first state.
    static Result<std::unique_ptr<LiveOutputs>> attach(WorldOnDemand& world, const OutputOptions& arguments,
                                                       const Resources& resources);
    ~LiveOutputs() override;

    Result<> frame() override;
    bool rests() const override;
    /// Completes the picture in progress, hears the last state, and pictures it if only one picture was asked for.
    Result<> finish() override;
    OutputReport report() const override;

  private:
    LiveOutputs(WorldOnDemand& world, const OutputOptions& arguments);
    Result<> start(const Resources& resources);
    void follow(const std::function<Result<>(const WorldState&, bool)>& present);
    void noteTime();
    double elapsedAt(const WorldState& state, std::size_t& stretch) const;
    double dueAt(double elapsed) const;
    double lastDueAt(double elapsed) const;
    Result<> presentHere(bool last);
    Result<> takePicture(const WorldState& state, bool last);
    Result<Picture> draw(const WorldState& state);
    Result<Picture> preview(const WorldState& state);
    Result<> hear(const WorldState& state);
    Result<> hearTo(const WorldState& state);
    void fail(const Result<>& why);
    void noteThrown();
    /// How many threads still follow the scene.
    int running() const { return int{!drawing_.idle()} + int{!hearing_.idle()}; }
    void report(std::atomic<bool>& whatIsTrue);
    Result<> write();
    std::uint64_t heardAt(double elapsed) const;

    SharedWorld& world_;
    PathPreview preview_;  // with --denoise: of the samples of light_'s last picture, which is refined_
    Picture refined_;
    bool picturesHere_ = false, soundHere_ = false;  // on the scene's thread, where node renderers draw and voice
    std::unique_ptr<LiveSound> device_;

    // Used by the threads only until they have ended.
    OutputReport::Live live_;
    double nextPicture_ = 0;  // k of the next time k / F
    std::size_t stretchPictured_ = 0, stretchHeard_ = 0;
    std::vector<std::pair<double, std::uint64_t>> heard_;  // length of the sound, and the state of which it was made
    double soundAt_, soundWritten_ = 0;  // the scene time that it has reached, and its length in seconds

    std::atomic<bool> ending_{false};           // set after afterInterruption_
    std::atomic<std::uint64_t> lastMoment_{0};  // valid after ending_
    mutable std::mutex mutex_;
    std::condition_variable news_;  // signals a new state of the scene, and the end
    // Guarded by mutex_: how often there was a new state, and the threads that have waited since the last one.
    std::uint64_t newsReported_ = 0;
    int resting_ = 0;
    Result<> problem_;  // the first one
    ElapsedTime time_;
    double elapsed_ = 0;  // from time_ when last looked at
    /// The starts from which times are counted: before time went back for the first time, for the second, and so on.
    std::vector<double> starts_;

    std::uint64_t stateNow_;  // guarded by mutex_
    // For the scene's thread: the first state of this stretch, and the number of states before it.
    std::uint64_t firstState_, statesBefore_ = 0;
    // Last: they use the others.
    Worker drawing_{"rtsg pictures"}, hearing_{"rtsg listen"};
};

}  // namespace rtsg
