// OutputsBehind: makes pictures and sound of every frame of a live scene on a thread of its own.
//
// A second scene goes through the queued steps at the pace of the outputs, which may end long after the scene did.
// Invariant: the outputs are, frame by frame, what they would be of the scene itself on a machine that is never late.
// Threading: all calls on the scene's thread; the outputs have their own.
#pragma once

#include <atomic>
#include <memory>

#include "outputs/outputs.h"
#include "outputs/queued_outputs.h"

namespace rtsg {

class OutputsBehind final : public QueuedOutputs {
  public:
    /// Begins with the scene's present state.
    OutputsBehind(const Scene& scene, const OutputOptions& arguments, const Resources& resources);
    /// Pictures and sound that still wait are not made.
    ~OutputsBehind() override;

    bool failed() const override { return worker_.idle() && !ended(); }
    /// Call it after the last frame: makes what waits, with a progress bar, and the files that are written at the end.
    /// An interruption ends it early; what was made by then is written, unless an end was stated.
    Result<> finish() override;
    OutputReport report() const override;

  private:
    Result<> follow() override;
    Result<> ended() const { return result("pictures and sound ended"); }

    // Used by the thread only until it has ended.
    std::unique_ptr<Scene> copy_;
    std::unique_ptr<WorldOnDemand> world_;
    std::unique_ptr<Outputs> outputs_;
    std::atomic<double> maxBehind_{0};
};

}  // namespace rtsg
