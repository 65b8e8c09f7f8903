// OutputsBehind: pictures and sound of every frame of a live scene, made on a thread of their own.
//
// The scene waits for nothing: its frames are queued (FrameQueue), and a second scene goes through them at the pace of
// the outputs, which may end long after the scene did. Invariant: what is made is what it would have been made of the
// scene itself, frame by frame, on a machine that is never late.
// Threading: all calls on the scene's thread; the outputs have theirs.
#pragma once

#include <atomic>
#include <memory>
#include <string>
#include <thread>

#include <rtsg/core/scene.h>
#include <rtsg/sync/frame_queue.h>

#include "outputs.h"

namespace rtsg::app {

class OutputsBehind {
  public:
    /// Begins with the scene's present state. The scene must outlive this.
    OutputsBehind(Scene& scene, OutputArguments arguments, Resources resources);
    /// What waits is not made any more.
    ~OutputsBehind();
    OutputsBehind(const OutputsBehind&) = delete;
    OutputsBehind& operator=(const OutputsBehind&) = delete;

    /// The outputs have failed: there is no sense in going on. finish() says why.
    bool failed() const { return failed_; }
    /// No more frames will come: makes what waits, with a progress bar, and writes what is written at the end.
    /// Interruption ends it early; what was made until then is written.
    Result<> finish();

    /// After finish(); null if there was no first state.
    const Outputs* outputs() const { return outputs_.get(); }
    /// The most scene time, seconds, that the outputs ever were behind the scene.
    double mostBehind() const { return mostBehind_; }

  private:
    void run();
    Result<> follow();

    OutputArguments arguments_;
    Resources resources_;
    FrameQueue queue_;
    Attachment attachment_;
    // The thread's own until it has ended.
    std::unique_ptr<Scene> copy_;
    std::unique_ptr<Outputs> outputs_;
    Result<> result_;
    std::atomic<double> mostBehind_{0};
    std::atomic<bool> failed_{false}, ended_{false}, abandoned_{false};
    std::thread thread_;
};

}  // namespace rtsg::app
