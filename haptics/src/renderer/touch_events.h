// TouchEvents: contact as events of the scene, so that it is recorded, mirrored and replayed like a pointer's.
//
// Threading: the scene's thread.
#pragma once

#include <optional>

#include <rtsg/core/device_input.h>
#include <rtsg/core/scene.h>
#include <rtsg/haptics/haptic_tick.h>

namespace rtsg::haptics {

class TouchEvents {
  public:
    explicit TouchEvents(const HapticOptions& options) : pointer_(options.pointer), pressAt_(options.pressAt) {}

    /// `strongest`: the tick with the largest force since the last call; `last`: the last one.
    void send(Scene& scene, const HapticTick& strongest, const HapticTick& last);

  private:
    struct Pushed {
        NodeId shape, body;
        Array<Vec3f> forces, torques;  // that the body had without the hand
    };
    void point(Scene& scene, const HapticTick& tick, bool presses);
    void leave(Scene& scene);
    void sayForce(Scene& scene, NodeId shape, const Vec3d& force);
    void pushBody(Scene& scene, const HapticTick& tick);
    void letGo(Scene& scene);

    const int pointer_;
    const double pressAt_;
    std::optional<PointerInput> sent_;
    std::optional<NodeId> felt_;  // the shape whose force was said last
    Vec3d said_{0};               // N; a hand that rests sends nothing
    std::optional<Pushed> pushed_;
};

}  // namespace rtsg::haptics
