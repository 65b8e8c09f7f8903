// SharedWorld: the one flattened, tessellated scene and its RayWorld. What draws, hears, picks or exports starts from
// it, and nobody else builds geometry.
//
// Invariant: attached to the scene's bus once. Of every change set first the instances, then the rays, then those added
// are brought to its sequence number, in the order of adding; so rays are up to date before any of them, whenever they
// came. One that fails gets nothing more and is named; the others go on. If the rays fail, everybody stops: failure().
// The RayWorld is made when somebody first asks for it: who only counts or exports pays for no BVH.
// Threading: the scene's thread; between two change sets the const members of rays() from any.
// Source: the paper's speed-up graph (5.1.1), kept apart from the renderers that use it.

// Example:
//     #include <rtsg/core/loader.h>
//     #include <rtsg/renderers/shared_world.h>
//     rtsg::Scene scene;
//     rtsg::Diagnostics diagnostics;
//     rtsg::loadFile(scene, "hall.x3dv", diagnostics);
//     rtsg::SharedWorld world(scene);  // follows the scene from here on
//     scene.newFrame(0);
//     rtsg::Ray ray;
//     ray.origin = {0, 1.7f, 10};
//     ray.direction = {0, 0, -1};
//     if (const rtsg::Hit hit = world.rays().intersect(ray)) std::cout << "a wall in " << hit.t << " m\n";
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include <rtsg/core/bus.h>
#include <rtsg/renderers/flattener.h>
#include <rtsg/renderers/ray_world.h>

namespace rtsg {

class SharedWorld {
  public:
    struct Options {
        Flattener::Options flattening;
        RayWorld::Options rays;
        /// polled: what happened comes merged, when update() is called.
        Delivery delivery = Delivery::immediate;
        /// Whether times() is kept; the clock costs about a microsecond a change set.
        bool timed = false;
    };

    /// Attaches to the scene's bus; the scene must outlive this, and this those added to it.
    explicit SharedWorld(Scene& scene);
    SharedWorld(Scene& scene, Options options);
    ~SharedWorld();
    SharedWorld(const SharedWorld&) = delete;
    SharedWorld& operator=(const SharedWorld&) = delete;

    /// `subscriber` gets all there is at once, as a snapshot, and from then on what changes. It must be removed before
    /// it goes. Added during a delivery it has its turn in the same one.
    void add(InstanceSubscriber& subscriber);
    void remove(InstanceSubscriber& subscriber);
    /// Why the subscriber gets nothing more; empty while it follows, or if it was not added.
    std::string failure(const InstanceSubscriber& subscriber) const;
    /// Why nothing of this follows the scene any longer; empty while it does.
    std::string failure() const;

    /// Brings all to the scene's present state: edits not yet sealed belong to it. Error: failure().
    Result<> update();
    /// Levels of detail are chosen for this eye, in world space, for all that start from here; none: the first levels.
    Result<> setViewer(std::optional<Vec3d> position);
    /// The triangles of geometry nodes of a type of one's own (or in place of a built-in one's), for all that start
    /// from here. Also of those that are there already.
    void setMeshSource(std::string_view type, MeshSource source);

    /// Waits for what the rays have left to a thread of their own, and takes it.
    void finishBackgroundWork();

    Scene& scene() const;
    const Flattener& flattener() const;
    /// A reference that stays. The first call builds; later ones cost nothing.
    const RayWorld& rays();
    /// What the last delivery brought; valid until the next.
    const InstanceDelta& delta() const;
    /// The state that all of it is in, as the scene numbers them.
    std::uint64_t sequence() const;

    struct Counts {
        std::uint64_t flatteners = 0, rayWorlds = 0;  // made by this process since it started, by whomever
        std::uint64_t deliveries = 0;                 // change sets and moved viewers, of this world
        std::uint64_t commits = 0;                    // of them, those with instances or geometry for the rays
    };
    Counts counts() const;
    /// CPU seconds of the scene's thread in the last delivery, if they are kept.
    struct Times {
        double flattening = 0, rays = 0, subscribers = 0;
        double all() const { return flattening + rays + subscribers; }
    };
    const Times& times() const;
    /// Of paths left out, of tessellation, of instances that are not traced, of subscribers that failed; each once.
    Diagnostics diagnostics() const;

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
