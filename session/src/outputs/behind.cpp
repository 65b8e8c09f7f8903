// Plays the queued frames in a copy of the scene, to which the outputs are attached.
#include "outputs/behind.h"

#include <algorithm>
#include <chrono>
#include <thread>

#include <fmt/format.h>

#include <rtsg/session/load_scene.h>

namespace rtsg {

OutputsBehind::OutputsBehind(const Scene& scene, const OutputOptions& arguments, const Resources& resources)
    : QueuedOutputs(scene, arguments, resources) {
    start([this] { queue_.close(); });
}

OutputsBehind::~OutputsBehind() {
    worker_.stop();
}

Result<> OutputsBehind::follow() {
    copy_ = std::make_unique<Scene>();  // a scene belongs to the thread that makes it
    Scene& copy = *copy_;
    reportFailuresAtTheEnd(copy);  // finish() tells the reason
    copy.setBehavioursEnabled(false);
    for (;;) {
        if (worker_.stops()) return {};
        auto set = std::make_shared<ChangeSet>();
        const auto taken = queue_.take(*set, std::chrono::seconds(1));
        if (!taken) return std::unexpected(taken.error());
        if (*taken == RecordQueue::Taken::ended || (arguments_.context.interrupted() && outputs_)) break;
        if (*taken == RecordQueue::Taken::nothingYet) continue;
        // The previous time is complete when a set of a later time comes. Inlines that it loaded came as sets of their
        // own.
        if (outputs_ && set->time != copy.now() && !outputs_->frame()) break;  // finish() tells the reason
        if (auto ok = applyTo(copy, set); !ok) return ok;
        if (!outputs_) {
            world_ = std::make_unique<WorldOnDemand>(copy, resources_, arguments_.context);
            auto attached = Outputs::attach(*world_, arguments_, resources_);
            if (!attached) return std::unexpected(attached.error());
            outputs_ = std::move(*attached);
        }
        maxBehind_ = std::max(maxBehind_.load(), queue_.secondsBehind());
    }
    if (outputs_) (void)outputs_->frame();  // of the last time; finish() tells the reason if it fails
    const Result<> result = outputs_ ? outputs_->finish() : Result<>();
    arguments_.context.report(copy.diagnostics());
    return result;
}

Result<> OutputsBehind::finish() {
    queue_.close();
    const std::uint64_t waiting = queue_.waiting();
    const auto progress = waiting > 0 ? arguments_.context.progress("making what is still to be made") : nullptr;
    while (!worker_.idle()) {
        if (progress) progress(waiting - std::min(waiting, queue_.waiting()), waiting + 1);
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    if (progress) progress(1, 1);
    return ended();
}

OutputReport OutputsBehind::report() const {
    OutputReport report = outputs_ ? outputs_->report() : OutputReport();
    report.maxBehind = maxBehind_;
    return report;
}

}  // namespace rtsg
