#include "follower.h"

#include "bench.h"

namespace rtsg::bench {

namespace {

RayWorld::Options oneThread(RayWorld::Options options) {
    options.buildThreads = 1;
    return options;
}

}  // namespace

Follower::Follower(RayWorld::Options options, LightTracer* tracer) : world_(oneThread(options)), tracer_(tracer) {}

Result<> Follower::apply(const Scene& scene, const ChangeSet& changes) {
    const double start = threadSeconds(), clock = cpuClockSeconds();
    const InstanceDelta& delta = flattener_.apply(scene, changes);
    delta_ = &delta;
    const double flattened = threadSeconds();
    world_.apply(delta);
    const double done = threadSeconds();
    flatten_ = flattened - start - clock;
    update_ = done - flattened - clock;
    Result<> result;
    if (tracer_) result = tracer_->apply(scene, changes, delta);
    all_ = threadSeconds() - start;
    return result;
}

}  // namespace rtsg::bench
