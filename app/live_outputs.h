// LiveOutputs: pictures and sound of a scene that does not wait for them: each on a thread of its own, of the newest
// state there is (SharedWorld::latest()), states merged.
//
// Invariant: a picture is of one whole state, taken at times k / F if the one before is made by then, else skipped and
// counted; files are numbered without holes. Sound is as long as the scene's time: places follow the newest state. If
// that time goes back (a log that is played again) they go on, as if that took no time. With --listen device it is
// played instead. One flattening and one BVH serve all. Threading: all calls on the scene's thread, which must call
// frame() now and then for states to be handed over.
#pragma once

#include <atomic>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "outputs.h"

namespace rtsg::app {

class LiveOutputs final : public OutputMaker {
  public:
    /// The world must outlive this, and its scene be in its first state. Throws as keepResources().
    static Result<std::unique_ptr<LiveOutputs>> attach(WorldOnDemand& world, const OutputArguments& arguments,
                                                       const Resources& resources);
    ~LiveOutputs() override;

    Result<> frame() override;
    bool failed() const override { return failed_; }
    /// The picture under way is completed; the last state is heard, and pictured if only one was asked for.
    Result<> finish() override;
    OutputReport report() const override;

  private:
    LiveOutputs(WorldOnDemand& world, const OutputArguments& arguments);
    Result<> start(const Resources& resources);
    void follow(const std::function<Result<>(const WorldState&, bool)>& present);
    void followUntilTheEnd(const std::function<Result<>(const WorldState&, bool)>& present);
    void noteTime();
    double elapsedAt(const WorldState& state, std::size_t& stretch) const;
    double dueAt(double elapsed) const;
    double lastDueAt(double elapsed) const;
    Result<> takePicture(const WorldState& state, bool last);
    Result<> hear(const WorldState& state);
    Result<> hearTo(const WorldState& state);
    void fail(const Result<>& why);
    Result<> write();
    std::uint64_t heardAt(double elapsed) const;

    Scene& scene_;
    const OutputArguments arguments_;
    SharedWorld& world_;
    std::unique_ptr<LightRenderer> light_;
    std::unique_ptr<SoundRenderer> sound_;
    std::unique_ptr<LiveSound> device_;
    PictureFiles files_;

    // The threads' own until they have ended.
    OutputReport report_;
    OutputReport::Live live_;
    double nextPicture_ = 0;  // k of the next time k / F
    std::size_t stretchPictured_ = 0, stretchHeard_ = 0;
    std::vector<std::pair<double, std::uint64_t>> heard_;  // how long sound was then, and of which state it was made
    double soundAt_, soundMade_ = 0;                       // the scene time it has come to; its seconds

    std::atomic<bool> failed_{false}, ending_{false}, abandoned_{false};
    std::atomic<bool> afterInterruption_{false};  // set before ending_
    std::atomic<std::uint64_t> lastMoment_{0};    // once ending_
    std::atomic<int> running_{0};
    mutable std::mutex mutex_;
    std::condition_variable news_;  // of the scene's state
    Result<> problem_;              // the first
    ElapsedTime time_;
    double elapsed_ = 0;  // of time_, when it was last looked at
    /// The starts from which times are counted: before time went back for the first time, for the second, and so on.
    std::vector<double> starts_;

    std::uint64_t stateNow_;  // guarded by mutex_
    // The scene's thread's: of this stretch, and how many states there were before it.
    std::uint64_t firstState_, statesBefore_ = 0;
    std::vector<std::jthread> threads_;
};

/// In step with the scene, or live, as the arguments say.
Result<std::unique_ptr<OutputMaker>> makeOutputs(WorldOnDemand& world, const OutputArguments& arguments,
                                                 const Resources& resources);

}  // namespace rtsg::app
