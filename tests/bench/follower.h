// Follower: a scene's flattener and any number of ray worlds, each stage timed apart, for benches.
//
// All worlds follow the same delta in turn, so that noise of the machine hits all alike.
// Threading: the scene's thread; worlds build with one thread, so that CPU time is work.
#pragma once

#include <memory>
#include <vector>

#include <rtsg/core/scene.h>
#include <rtsg/renderers/flattener.h>
#include <rtsg/renderers/light_tracer.h>
#include <rtsg/renderers/ray_world.h>

namespace rtsg::bench {

class Follower final : public Subscriber {
  public:
    /// `tracer`, if any, follows too, untimed.
    explicit Follower(const std::vector<RayWorld::Options>& worlds, LightTracer* tracer = nullptr);

    Result<> apply(const Scene& scene, const ChangeSet& changes) override;

    Flattener& flattener() { return flattener_; }
    const RayWorld& world(std::size_t index) const { return *worlds_[index]; }
    /// What world `index` takes to follow costs too much for every frame: from now on it stands still. It is not up to
    /// date until catchUp().
    void pause(std::size_t index) { paused_[index] = true; }

    /// CPU seconds of the last change set, without the clock's own.
    double flattenSeconds() const { return flatten_; }
    double worldSeconds(std::size_t index) const { return seconds_[index]; }
    bool paused(std::size_t index) const { return paused_[index]; }
    /// All of the last apply(), clocks included: to be taken off a frame's time.
    double allSeconds() const { return all_; }

  private:
    Flattener flattener_;
    std::vector<std::unique_ptr<RayWorld>> worlds_;
    std::vector<bool> paused_;
    std::vector<double> seconds_;
    LightTracer* tracer_;
    double flatten_ = 0, all_ = 0;
};

/// What reading cpuSeconds() costs, which every figure taken with it contains once.
double cpuClockSeconds();

}  // namespace rtsg::bench
