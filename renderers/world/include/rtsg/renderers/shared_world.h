// SharedWorld: the flattened and tessellated scene and its RayWorld, which drawing, sound, picking and export share.
// Nothing else builds geometry.
//
// Invariant: it is attached to the scene's bus once. A change set goes first to the instances, then to the rays, then
// to the subscribers in the order in which they were added; so rays are up to date before any subscriber. A subscriber
// that fails gets nothing more and is reported; the others go on. If the rays fail, all stop: failure(). The RayWorld
// is made when it is first asked for, so users that only count or export pay for no BVH. Threading: the scene's thread,
// except for latest() and lookFrom(): readers on other threads use a WorldState, which does not change while the scene
// goes on. Neither waits for the other's work. Source: the paper's speed-up graph (5.1.1), separated here from the
// renderers that use it.

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

/// A whole state of a world: the rays, and the tables that subscribers have made of the same change set. It never
/// changes, and keeps its data alive. Threading: any number of threads.
struct WorldState {
    std::uint64_t sequence = 0;  // of the scene's state
    double time = 0;             // of the scene: seconds since 1970 or since another epoch
    /// Null if nobody has asked for rays() on the scene's thread.
    std::shared_ptr<const WorldVersion> rays;
    /// The subscribers' tables, with the number that SharedWorld::add() gave to each.
    std::vector<std::pair<std::uint64_t, std::shared_ptr<const void>>> tables;
    /// The number of deliveries of the world so far; two states with the same number are the same.
    std::uint64_t moment = 0;
    /// The sights that give layouts and other things in pixels their size; null if nothing is in pixels.
    std::shared_ptr<const std::vector<LayerSight>> sights;

    /// The table of InstanceSubscriber::freeze(); null if the subscriber was not added yet, had failed, or has none.
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
        /// polled: changes come merged, when update() is called.
        Delivery delivery = Delivery::immediate;
        /// Whether times() is measured, for which the clock is read several times for each change set.
        bool timed = false;
    };

    /// Attaches to the scene's bus. The scene must outlive this object, and this object its subscribers.
    explicit SharedWorld(Scene& scene);
    SharedWorld(Scene& scene, Options options);
    ~SharedWorld();
    SharedWorld(const SharedWorld&) = delete;
    SharedWorld& operator=(const SharedWorld&) = delete;

    /// Sends `subscriber` all instances at once, as a snapshot, and changes from then on. It must be removed before it
    /// ends. If it is added during a delivery, it has its turn in the same one. Returns its number, which is never used
    /// again.
    std::uint64_t add(InstanceSubscriber& subscriber);
    void remove(InstanceSubscriber& subscriber);
    /// The reason why the subscriber gets nothing more; empty while it follows, or if it was not added.
    std::string failure(const InstanceSubscriber& subscriber) const;
    /// The reason why this world no longer follows the scene; empty while it does.
    std::string failure() const;

    /// Brings the world to the scene's present state, including unsealed edits. Error: failure().
    Result<> update();
    /// The newest state, for readers on any thread. If it is older than the scene at the time of the call, the scene's
    /// thread is asked for a new one, which it makes after its next delivery or in update(), and this call waits for it
    /// up to `patience`. After that, or while readers hold RayWorld::kMaxVersions states, it returns the newest
    /// existing state. A reader recognises a known state by `moment`. The scene pays nothing while nobody asks, and
    /// forgets the last state if nobody has asked during kForget deliveries. Errors: there was no state within
    /// `patience`; the world no longer follows the scene.
    Result<std::shared_ptr<const WorldState>> latest(
        std::chrono::nanoseconds patience = std::chrono::milliseconds(100)) const;
    static constexpr std::uint64_t kForget = 256;
    /// Called on the scene's thread: the present state, for others to use while the scene goes on. Errors: as for
    /// update(); readers hold too many states.
    Result<std::shared_ptr<const WorldState>> present();
    /// The same as setViewer(), from any thread: it takes effect with the next delivery.
    void lookFrom(const EyePosition& eye, std::vector<LayerSight> sights = {});

    /// Sets the eye for which levels of detail are chosen and to which Billboards turn, for all pictures; without one,
    /// the first levels are shown, which sound meets in any case (Instance::seen, heard). `sights` are those of the
    /// picture, as in Flattener::setViewer().
    Result<> setViewer(std::optional<EyePosition> eye, std::vector<LayerSight> sights = {});
    /// Sets the source of triangles for geometry nodes of a custom type, or instead of a built-in type's source, for
    /// all users of this world. Existing nodes get new triangles, too.
    void setMeshSource(std::string_view type, MeshSource source);

    /// Calls `heard` when the scene is about to start over and is still as it was; an empty function ends this. It must
    /// not edit the scene.
    void onRestart(std::function<void()> heard);

    /// An object that several subscribers share and load once, such as the textures under one policy. The name says
    /// what it is and what it was made with. It is made if nobody holds one, and destroyed with its last holder. Call
    /// it on the scene's thread.
    std::shared_ptr<void> shared(const std::string& name, const std::function<std::shared_ptr<void>()>& make);

    /// Waits for the background work of the rays, and takes its results.
    void finishBackgroundWork();

    Scene& scene() const;
    const Flattener& flattener() const;
    /// The reference stays valid. The first call builds the RayWorld; later calls cost nothing.
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
    /// CPU seconds of the scene's thread in the last delivery, if Options::timed is set.
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
