// SharedWorld: the one flattened, tessellated scene and its RayWorld. Drawing, sound, picking and export start from it,
// and nobody else builds geometry.
//
// Invariant: attached to the scene's bus once. A change set goes first to the instances, then to the rays, then to the
// subscribers in the order of adding; so rays are up to date before any subscriber, whenever it was added. A subscriber
// that fails gets nothing more and is named; the others go on. If the rays fail, everybody stops: failure(). The
// RayWorld is made when somebody first asks for it: users that only count or export pay for no BVH. Threading: the
// scene's thread, but for latest() and lookFrom(): readers on other threads work from a WorldState, which stays as it
// was while the scene goes on. Neither ever waits for the other's work. Source: the paper's speed-up graph (5.1.1),
// kept apart from the renderers that use it.

// Example:
//     #include <rtsg/documents/loader.h>
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

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <rtsg/core/bus.h>
#include <rtsg/renderers/flattener.h>
#include <rtsg/renderers/ray_world.h>

namespace rtsg {

/// One whole state of a world: the rays, and the tables that subscribers have made of the same change set. It never
/// changes, and keeps alive what it was made of. Threading: any number of threads.
struct WorldState {
    std::uint64_t sequence = 0;  // as the scene numbers them
    double time = 0;             // the scene's: seconds since 1970, or whatever it counts from
    /// Null if nobody has asked for rays() on the scene's thread.
    std::shared_ptr<const WorldVersion> rays;
    /// The subscribers' tables, with the number that SharedWorld::add() gave to each.
    std::vector<std::pair<std::uint64_t, std::shared_ptr<const void>>> tables;
    /// Counts the deliveries of the world; two states with the same count are the same.
    std::uint64_t moment = 0;
    /// The sights by which layouts and everything else in pixels have their size; null if nothing is in pixels.
    std::shared_ptr<const std::vector<LayerSight>> sights;

    /// The table that InstanceSubscriber::freeze() gave; null if the subscriber was not there, had failed, or has none.
    std::shared_ptr<const void> of(std::uint64_t subscriber) const {
        for (const auto& [number, table] : tables)
            if (number == subscriber) return table;
        return nullptr;
    }
};

class SharedWorld {
  public:
    struct Options {
        Flattener::Options flattening;
        RayWorld::Options rays;
        /// polled: what happened comes merged, when update() is called.
        Delivery delivery = Delivery::immediate;
        /// Whether times() is kept, for which the clock is read several times a change set.
        bool timed = false;
    };

    /// Attaches to the scene's bus; the scene must outlive this, and this those added to it.
    explicit SharedWorld(Scene& scene);
    SharedWorld(Scene& scene, Options options);
    ~SharedWorld();
    SharedWorld(const SharedWorld&) = delete;
    SharedWorld& operator=(const SharedWorld&) = delete;

    /// `subscriber` gets all there is at once, as a snapshot, and from then on what changes. It must be removed before
    /// it goes. Added during a delivery it has its turn in the same one. Returns its number, which no other ever has.
    std::uint64_t add(InstanceSubscriber& subscriber);
    void remove(InstanceSubscriber& subscriber);
    /// Why the subscriber gets nothing more; empty while it follows, or if it was not added.
    std::string failure(const InstanceSubscriber& subscriber) const;
    /// Why nothing of this follows the scene any longer; empty while it does.
    std::string failure() const;

    /// Brings all to the scene's present state: edits not yet sealed belong to it. Error: failure().
    Result<> update();
    /// The newest state, for readers on any thread. If what is there is older than the scene at the call, the scene's
    /// thread is asked for a new one, which it makes after its next delivery or in update(), and `patience` is how long
    /// to wait for that; then, and while readers hold RayWorld::kMostVersions states, the newest one that exists is
    /// returned. A reader recognises a state that it knows by `moment`. The scene pays nothing while nobody asks, and
    /// forgets the last state when nobody has asked for kForget deliveries. Errors: none was handed over within
    /// `patience`; the world follows no longer.
    Result<std::shared_ptr<const WorldState>> latest(
        std::chrono::nanoseconds patience = std::chrono::milliseconds(100)) const;
    static constexpr std::uint64_t kForget = 256;
    /// On the scene's thread: the present state, for others to work from while the scene goes on. Errors: as update();
    /// or readers hold too many states.
    Result<std::shared_ptr<const WorldState>> present();
    /// setViewer() from any thread: with the next delivery.
    void lookFrom(const EyePlace& eye, std::vector<LayerSight> sights = {});

    /// Levels of detail are chosen for this eye, and Billboards turn to it, for all that see; none: the first levels,
    /// which are what sound meets in any case (Instance::seen, heard). `sights`: of the picture, as
    /// Flattener::setViewer().
    Result<> setViewer(std::optional<EyePlace> eye, std::vector<LayerSight> sights = {});
    /// Sets the source of triangles for geometry nodes of a user's own type, or in place of a built-in type's, for all
    /// who use this world. Nodes that are there already get them, too.
    void setMeshSource(std::string_view type, MeshSource source);

    /// Calls `heard` when the scene is about to start over and is still as it was; none: an empty function. It must not
    /// edit the scene.
    void onRestart(std::function<void()> heard);

    /// An object that several subscribers share and load once, such as the textures under one policy. Its name says
    /// what it is and with what it was made. It is made when nobody holds one, and destroyed with its last holder. To
    /// be called on the scene's thread.
    std::shared_ptr<void> shared(const std::string& name, const std::function<std::shared_ptr<void>()>& make);

    /// Waits for what the rays have left to a thread of their own, and takes it.
    void finishBackgroundWork();

    Scene& scene() const;
    const Flattener& flattener() const;
    /// A reference that stays. The first call builds; later ones cost nothing.
    const RayWorld& rays();
    /// The instances that the last delivery changed; valid until the next delivery.
    const InstanceDelta& delta() const;
    /// The number of the scene's state that all parts of the world are in.
    std::uint64_t sequence() const;

    struct Counts {
        std::uint64_t flatteners = 0, rayWorlds = 0;  // made by this process since it started, by whomever
        std::uint64_t deliveries = 0;                 // change sets and moved viewers, of this world
        std::uint64_t commits = 0;                    // of them, those with instances or geometry for the rays
        std::uint64_t handedOver = 0;                 // states, to readers on other threads
        std::uint64_t refused = 0;                    // because readers held too many
    };
    Counts counts() const;
    /// CPU seconds of the scene's thread in the last delivery, if they are kept.
    struct Times {
        double flattening = 0, rays = 0, subscribers = 0, handingOver = 0;
        double all() const { return flattening + rays + subscribers + handingOver; }
    };
    const Times& times() const;
    /// Diagnostics of paths left out, of tessellation, of instances that are not traced and of subscribers that failed;
    /// each is there once.
    Diagnostics diagnostics() const;

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
