#include "follower.h"

#include "bench.h"

namespace rtsg::bench {

double cpuClockSeconds() {
    static const double cost = [] {
        std::vector<double> times;
        for (int i = 0; i < 1000; ++i) {
            const double start = cpuSeconds();
            times.push_back(cpuSeconds() - start);
        }
        return median(times);
    }();
    return cost;
}

Follower::Follower(const std::vector<RayWorld::Options>& worlds, LightTracer* tracer)
    : paused_(worlds.size()), seconds_(worlds.size()), tracer_(tracer) {
    for (RayWorld::Options options : worlds) {
        options.buildThreads = 1;
        worlds_.push_back(std::make_unique<RayWorld>(options));
    }
}

Result<> Follower::apply(const Scene& scene, const ChangeSet& changes) {
    const double start = cpuSeconds(), clock = cpuClockSeconds();
    const InstanceDelta& delta = flattener_.apply(scene, changes);
    double before = cpuSeconds();
    flatten_ = before - start - clock;
    for (std::size_t i = 0; i < worlds_.size(); ++i) {
        if (!paused_[i]) worlds_[i]->apply(delta);
        const double after = cpuSeconds();
        seconds_[i] = paused_[i] ? 0 : after - before - clock;
        before = after;
    }
    Result<> result;
    if (tracer_) result = tracer_->apply(scene, changes, delta);
    all_ = cpuSeconds() - start;
    return result;
}

}  // namespace rtsg::bench
