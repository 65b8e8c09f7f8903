// HapticRenderer: the touch of a world: a hand feels its surfaces, a thousand times a second.
//
// A subscriber like light and sound, on the same world and the same BVH. Its thread takes the newest state, asks the
// device where the hand is, finds how far a small ball (the proxy) can follow it, and gives the device the force that
// draws the hand back. The scene never waits for it. Contact is an event of the scene: the proxy is a pointing device,
// so TouchSensors answer, logs and mirrors have it, and replays need no device.
// Invariants: the force is finite and at most maxForce; surfaces at rest give no energy. Threading: the scene's thread;
// but touch() on any one thread while no device is started.
// Source: ISO/IEC 19775-1 V4.0 20.4.4 (what contact does); the paper's section 8 names haptics as future work.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <rtsg/haptics/haptic_device.h>
#include <rtsg/haptics/haptic_tick.h>
#include <rtsg/renderers/world_renderer.h>

namespace rtsg {

struct HapticReport {
    std::string scheduling;                      // "SCHED_FIFO", or why not
    std::uint64_t ticks = 0, missed = 0;         // missed: those that began later than the one after them should have
    std::uint64_t unknown = 0;                   // ticks without a hand
    double medianSeconds = 0, worstSeconds = 0;  // of the work of a tick
    double largestForce = 0;                     // N
    std::uint64_t contacts = 0;                  // how often touching began
    std::string failure;                         // why it feels no longer; empty while it does
    Diagnostics diagnostics;
};

class HapticRenderer final : public WorldRenderer {
  public:
    explicit HapticRenderer(SharedWorld& world, HapticOptions options = {});
    ~HapticRenderer() override;
    std::string subscriberName() const override { return "haptics"; }

    using WorldRenderer::renderFrame;
    const HapticOptions& options() const;
    /// A place of the device's space in the world.
    Vec3d inWorld(const Vec3d& place) const;
    /// Brings the surfaces up to date; forces are the thread's.
    Result<> renderFrame() override;

    /// One tick with the world's newest state, for programs with a clock of their own. `hand`: world, metres. A place
    /// that is not finite, or that jumps, is not known.
    HapticTick touch(const Vec3d& hand, double seconds);
    /// Starts the thread. Precondition: attached, none is started. Error: the thread cannot be had.
    Result<> start(std::unique_ptr<HapticDevice> device);
    /// Ends it.
    HapticReport stop();
    HapticReport report() const;
    /// The last tick.
    HapticTick latest() const;
    /// The device has no more to do, or there is none.
    bool hasEnded() const;
    /// Sends what has been touched since the last call as events of the scene: the proxy as a pointer; the force to
    /// MetadataFloats named "force" in a touched TouchSensor's metadata, and to `forces` of the RigidBody that the
    /// shape belongs to, against the hand's.
    void sendEvents();
    /// The ticks since the last call, if they are kept.
    std::vector<HapticTick> takeTicks();

  protected:
    std::shared_ptr<const void> freezeTables() override;
    Result<> follow(const Scene& scene, const ChangeSet& changes, const InstanceDelta& delta) override;

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
