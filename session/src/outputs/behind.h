// OutputsBehind: makes pictures and sound of every frame of a live scene on a thread of its own.
//
// The scene does not wait: its steps are queued (RecordQueue), and a second scene goes through them at the pace of the
// outputs, which may end long after the scene did.
// Invariant: the outputs are, frame by frame, what they would be of the scene itself on a machine that is never late.
// Threading: all calls on the scene's thread; the outputs have their own.
#pragma once

#include <atomic>
#include <memory>
#include <thread>

#include <rtsg/core/scene.h>
#include <rtsg/sync/record_queue.h>

#include "outputs/outputs.h"

namespace rtsg {

class OutputsBehind final : public OutputMaker {
  public:
    /// Begins with the scene's present state.
    OutputsBehind(const Scene& scene, OutputOptions arguments, Resources resources);
    /// Pictures and sound that still wait are not made.
    ~OutputsBehind() override;

    /// Queues the scene's next step. If it cannot be kept, the thread reports it.
    void step(const Scene&, const RecordStep& step) override { (void)queue_.add(step); }
    bool wantsSteps() const override { return true; }
    std::uint64_t encoded() const override { return queue_.encoded(); }
    /// There is nothing to do, because step() has queued the frame.
    Result<> frame() override { return {}; }
    bool failed() const override { return failed_; }
    /// Call it after the last frame: makes what waits, with a progress bar, and the files that are written at the end.
    /// An interruption ends it early; what was made by then is written, unless an end was stated.
    Result<> finish() override;
    OutputReport report() const override;

  private:
    void run();
    Result<> follow();

    OutputOptions arguments_;
    Resources resources_;
    RecordQueue queue_;
    // Used by the thread only until it has ended.
    std::unique_ptr<Scene> copy_;
    std::unique_ptr<WorldOnDemand> world_;
    std::unique_ptr<Outputs> outputs_;
    Result<> result_;
    std::atomic<double> maxBehind_{0};
    std::atomic<bool> failed_{false}, ended_{false}, abandoned_{false};
    std::thread thread_;
};

}  // namespace rtsg
