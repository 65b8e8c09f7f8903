// Follower: one flattener and one ray world that follow a scene, each stage timed apart, for benches.
//
// Threading: the scene's thread, in which the world builds too, but for what it does in the background.
#pragma once

#include <rtsg/core/scene.h>
#include <rtsg/renderers/flattener.h>
#include <rtsg/renderers/light_tracer.h>
#include <rtsg/renderers/ray_world.h>

namespace rtsg::bench {

class Follower final : public Subscriber {
  public:
    /// `tracer`, if any, follows too, untimed.
    explicit Follower(RayWorld::Options options = {}, LightTracer* tracer = nullptr);

    Result<> apply(const Scene& scene, const ChangeSet& changes) override;

    const RayWorld& world() const { return world_; }
    /// Of the last change set; valid until the next.
    const InstanceDelta& delta() const { return *delta_; }
    /// CPU seconds of the scene's thread in the last change set, without the clock's own.
    double flattenSeconds() const { return flatten_; }
    double worldSeconds() const { return update_; }
    /// All of the last apply(), clocks included: to be taken off a frame's time.
    double allSeconds() const { return all_; }

  private:
    Flattener flattener_;
    RayWorld world_;
    LightTracer* tracer_;
    const InstanceDelta* delta_ = nullptr;
    double flatten_ = 0, update_ = 0, all_ = 0;
};

}  // namespace rtsg::bench
