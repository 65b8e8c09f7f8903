// QueuedOutputs: outputs that follow every step of a scene on a thread of their own.
//
// Steps are queued (RecordQueue), so the scene does not wait. Threading: all calls on the scene's thread; follow() on
// the other one.
#pragma once

#include <functional>
#include <memory>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include <rtsg/core/scene.h>
#include <rtsg/core/worker.h>
#include <rtsg/session/output_maker.h>
#include <rtsg/sync/record_queue.h>

namespace rtsg {

class QueuedOutputs : public OutputMaker {
  public:
    /// Queues the scene's next step. If it cannot be kept, the thread reports it.
    void step(const Scene&, const RecordStep& step) override { (void)queue_.add(step); }
    bool wantsSteps() const override { return true; }
    std::uint64_t encoded() const override { return queue_.encoded(); }
    /// There is nothing to do, because step() has queued the frame.
    Result<> frame() override { return {}; }

  protected:
    /// Begins with the scene's present state.
    QueuedOutputs(const Scene& scene, const OutputOptions& arguments, const Resources& resources)
        : arguments_(arguments), resources_(resources) {
        (void)queue_.add(scene.snapshot());
    }
    /// Runs follow() on the thread. Whoever derives from this stops the worker before its own members go.
    void start(std::function<void()> wake) {
        worker_.run([this] { result_ = follow(); }, std::move(wake));
    }
    virtual Result<> follow() = 0;
    /// Takes the copy to the state of its set. Error: it is not what the origin was then.
    static Result<> applyTo(Scene& copy, const std::shared_ptr<const ChangeSet>& set) {
        if (set->isSnapshot() && copy.sequence() != 0)
            if (auto ok = copy.reset(); !ok) return ok;
        if (auto ok = copy.apply(set); !ok) return ok;
        if (copy.hash() != set->hash) return fail(fmt::format("the copy differs in state {}", copy.sequence()));
        return {};
    }
    /// Of follow(), once the worker is idle. `what` has ended, if follow() has thrown.
    Result<> result(std::string_view what) const {
        const Result<> thrown = worker_.failure(what);
        return thrown ? result_ : thrown;
    }

    const OutputOptions arguments_;
    const Resources resources_;
    RecordQueue queue_;
    Worker worker_{"rtsg outputs"};

  private:
    Result<> result_;  // the thread's until it has ended
};

}  // namespace rtsg
