// RigidBodyPhysics: makes the rigid bodies, joints and collision sensors of a scene act.
//
// In each frame all RigidBodyCollections take the steps of kStep that end by its time, at multiples of kStep of the
// scene's clock: the motion depends on neither the frame rate nor the machine's speed. The results are events of that
// frame, recorded and mirrored like others, so replicas and replays need no engine. Inputs of a frame act from its time
// on. Without ODE (libode-dev when the library was built) the nodes do nothing, and a diagnostic says so. Threading:
// the scene's thread. Source: ISO/IEC 19775-1 V4.0, clause 37.

// Example:
//     #include <rtsg/documents/loader.h>
//     #include <rtsg/physics/rigid_body_physics.h>
//     rtsg::Scene scene;
//     rtsg::RigidBodyPhysics physics(scene);  // before or after the scene is loaded
//     rtsg::Diagnostics diagnostics;
//     const char* text = "#X3D V4.0 utf8\nPROFILE Full\n RigidBodyCollection { bodies RigidBody { } }";
//     (void)rtsg::loadText(scene, text, diagnostics);
//     for (int k = 0; k <= 60; ++k) scene.newFrame(k / 60.0);  // it has fallen 4.9 m
#pragma once

#include <cstdint>
#include <memory>

#include <rtsg/core/scene.h>

namespace rtsg {

class RigidBodyPhysics {
  public:
    /// The length of a step in seconds.
    static constexpr double kStep = 1.0 / 120;
    /// If frames are further apart than this many seconds, the rest of the time is skipped, which a diagnostic reports.
    static constexpr double kLongestFrame = 10;
    /// The most points of contact in a step, and Contact nodes of a sensor. A diagnostic reports when there were more.
    static constexpr std::size_t kMaxContacts = 50'000, kMaxReported = 256;
    /// The most rows of a step with `preferAccuracy`, whose cost grows with their third power. Larger steps are solved
    /// by iteration, and a diagnostic says so.
    static constexpr std::size_t kMaxAccurateRows = 600;

    /// `scene` must outlive it, and can have one at a time; bodies stop when it ends. A scene without such nodes pays
    /// nothing.
    explicit RigidBodyPhysics(Scene& scene);
    ~RigidBodyPhysics();
    RigidBodyPhysics(const RigidBodyPhysics&) = delete;
    RigidBodyPhysics& operator=(const RigidBodyPhysics&) = delete;

    /// Whether the library was built with an engine.
    static bool isAvailable();
    struct Counts {
        std::size_t bodies = 0, awake = 0, geometries = 0, contacts = 0;  // now; the contacts of the last step
        std::uint64_t steps = 0;                                          // in which something could move
    };
    Counts counts() const;

    class Engine;

  private:
    std::unique_ptr<Engine> engine_;
};

}  // namespace rtsg
