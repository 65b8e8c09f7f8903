// HapticRenderer: renders a world to the sense of touch: a hand feels its surfaces, a thousand times a second.
//
// It is a subscriber like light and sound, on the same world and the same BVH. Its thread takes the newest state, asks
// the device for the position of the hand, finds how far a small ball (the proxy) can follow the hand, and gives the
// device the force that pulls the hand back. The scene never waits for it. Contact is an event of the scene: the proxy
// is a pointing device, so TouchSensors react, logs and mirrors have it, and replays need no device. Invariants: the
// force is finite and at most maxForce; surfaces at rest give no energy. Threading: the scene's thread; touch() on any
// one thread while no device is started. Source: ISO/IEC 19775-1 V4.0 20.4.4 (effects of contact); the paper's section
// 8 names haptics as future work.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <rtsg/haptics/haptic_device.h>
#include <rtsg/haptics/haptic_tick.h>
#include <rtsg/renderers/world_renderer.h>

namespace rtsg {

struct HapticReport {
    std::string scheduling;                      // "SCHED_FIFO", or the reason why it is not used
    std::uint64_t ticks = 0, missed = 0;         // missed: ticks that began later than their successor should have
                                                 // begun
    std::uint64_t unknown = 0;                   // ticks without a hand position
    double medianSeconds = 0, worstSeconds = 0;  // of the computation in a tick
    double largestForce = 0;                     // N
    std::uint64_t contacts = 0;                  // how often contact began
    std::string failure;                         // why it no longer works; empty while it does
    Diagnostics diagnostics;
};

class HapticRenderer final : public WorldRenderer {
  public:
    explicit HapticRenderer(SharedWorld& world, HapticOptions options = {});
    ~HapticRenderer() override;
    std::string subscriberName() const override { return "haptics"; }

    using WorldRenderer::renderFrame;
    const HapticOptions& options() const;
    /// Converts a position in the device's space to the world.
    Vec3d inWorld(const Vec3d& position) const;
    /// Brings the surfaces up to date; forces are computed on the haptic thread.
    Result<> renderFrame() override;

    /// Computes one tick with the world's newest state, for programs with their own clock. `hand` is in world
    /// coordinates, in metres. A position that is not finite, or 10¹² metres away, counts as unknown.
    HapticTick touch(const Vec3d& hand, double seconds);
    /// Starts the thread. Precondition: attached, and no thread is started. Error: the thread cannot be started.
    Result<> start(std::unique_ptr<HapticDevice> device);
    /// Ends it.
    HapticReport stop();
    HapticReport report() const;
    /// The last tick.
    HapticTick latest() const;
    /// Whether the device has finished, or there is none.
    bool hasEnded() const;
    /// Sends contacts since the last call as events of the scene: the proxy as a pointer; the force to MetadataFloats
    /// named "force" in a touched TouchSensor's metadata; and the opposite force to `forces` of the RigidBody that the
    /// shape belongs to.
    void sendEvents();
    /// The ticks since the last call, if HapticOptions::keepsTicks is set.
    std::vector<HapticTick> takeTicks();

  protected:
    std::shared_ptr<const void> freezeTables() override;
    Result<> follow(const Scene& scene, const ChangeSet& changes, const InstanceDelta& delta) override;

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
