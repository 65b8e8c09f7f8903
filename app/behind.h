// OutputsBehind: pictures and sound of every frame of a live scene, made on a thread of their own.
//
// The scene waits for nothing: its steps are queued (RecordQueue), and a second scene goes through them at the pace of
// the outputs, which may end long after the scene did. Invariant: what is made is what it would have been made of the
// scene itself, frame by frame, on a machine that is never late.
// Threading: all calls on the scene's thread; the outputs have theirs.
#pragma once

#include <atomic>
#include <memory>
#include <thread>

#include <rtsg/core/scene.h>
#include <rtsg/sync/record_queue.h>

#include "outputs.h"

namespace rtsg::app {

class OutputsBehind final : public OutputMaker {
  public:
    /// Begins with the scene's present state.
    OutputsBehind(const Scene& scene, OutputArguments arguments, Resources resources);
    /// Pictures and sound that wait are not made any more.
    ~OutputsBehind() override;

    /// The scene's next step. That it cannot be kept, the thread finds out.
    void step(const RecordStep& step) { (void)queue_.add(step); }
    std::uint64_t encoded() const { return queue_.encoded(); }
    /// There is nothing to do: step() has told.
    Result<> frame() override { return {}; }
    bool failed() const override { return failed_; }
    /// No more frames will come: makes what waits, with a progress bar, and writes what is written at the end.
    /// Interruption ends it early; what was made until then is written, unless an end was stated.
    Result<> finish() override;
    OutputReport report() const override;

  private:
    void run();
    Result<> follow();

    OutputArguments arguments_;
    Resources resources_;
    RecordQueue queue_;
    // The thread's own until it has ended.
    std::unique_ptr<Scene> copy_;
    std::unique_ptr<WorldOnDemand> world_;
    std::unique_ptr<Outputs> outputs_;
    Result<> result_;
    std::atomic<double> mostBehind_{0};
    std::atomic<bool> failed_{false}, ended_{false}, abandoned_{false};
    std::thread thread_;
};

}  // namespace rtsg::app
