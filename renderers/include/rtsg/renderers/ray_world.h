// RayWorld: the speed-up graph and its bounding volume hierarchy, built from InstanceDeltas, queried by light, sound,
// picking and collision alike.
//
// What rests is merged into few BVHs, what moves together is one object; a resting thing that moves is taken out alone,
// one that has rested for long is merged again, by a thread of its own: apply() never waits for that.
// Invariant: after apply() it answers as one built from scratch would. No ray and no transform that Embree would abort
// on reaches it: a bad ray is a counted miss, an instance that cannot be traced is left out with a diagnostic.
// Ray space is world space minus origin(), in float; origin() is 0 unless the scene lies far away from 0.
// Threading: apply() alone on one thread; between two of them every const member from any number of threads. freeze()
// gives versions that answer at any time.
// Source: paper section 5.1.1 (speed-up graph), 5.1.2 (mapping objects to instances).
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include <rtsg/core/diagnostic.h>
#include <rtsg/renderers/instance_delta.h>
#include <rtsg/renderers/ray_view.h>

namespace rtsg {

/// A state of a RayWorld that stays as it was, for readers on other threads while the world goes on. It shares the
/// triangles and BVHs of that moment with the world and keeps them alive, and so the pages of its tables that change
/// later. It outlives the world, if need be. Threading: any number of threads; the last owner may drop it on any
/// thread.
class WorldVersion : public RayView {
  private:
    friend class RayWorld;
    WorldVersion() = default;
    void take(const RayView& now, const Tables& tables, const RayInstances& instances) {
        RayView::operator=(now);
        tables_ = &tables;
        instances_ = instances;
    }
};

class RayWorld : public RayView {
  public:
    /// How instances become Embree objects; `hybrid` is the default and meant to win. See the paper's section 5.1.2.
    enum class Mapping : std::uint8_t { merged, perShape, hybrid };

    struct NamedNode {
        std::string name;  // its type and its DEF or number; empty: it is not known
        NodePlace place;
    };
    struct Options {
        Mapping mapping = Mapping::hybrid;
        /// Watertight intersection: no leaks at shared edges. Off gains little.
        bool robust = true;
        /// The number of threads that build the BVH; 0 is one for each core. Other parts of the program keep their
        /// threads.
        unsigned buildThreads = 0;
        /// A thing that has rested for so many apply() calls is merged with the rest. Each time that it moves after
        /// all, it must rest twice as long before the next time, up to 256 times as long; a thing that is known to be
        /// able to move must rest 16 times as long. To merge things, a group of n triangles is rebuilt at most once in
        /// restFrames (1 + n / 100,000) calls, or when half of it is gone or as much again has arrived.
        unsigned restFrames = 256;
        /// False: the work that is otherwise left to a thread is done by finishBackgroundWork() alone.
        bool background = true;
        /// Gives the name of a node and the place from which it was read, for diagnostics; if empty, nodes are named by
        /// their numbers.
        std::function<NamedNode(NodeId)> nodes{};
    };

    struct Stats {
        std::size_t instances = 0, traced = 0, culled = 0;  // culled: bad transform or no usable triangle
        std::size_t meshes = 0, uniqueTriangles = 0, instancedTriangles = 0;
        std::size_t bvhBytes = 0, meshBytes = 0;
        std::size_t groups = 0, groupsBuilt = 0;  // of merged triangles; built: by the last apply()
        std::size_t topBuilds = 0;                // of the tree over groups and instances, since the start
        std::size_t baked = 0;                    // instances merged with others
        std::size_t bodies = 0, bodiesBuilt = 0;  // groups that move as one; built: since the start
        std::size_t merges = 0;                   // background rebuilds of what rests, since the start
        std::size_t splits = 0;                   // resting ones that moved, since the start
        // Counts of the BVHs of single meshes; meshRebuilds counts those that were made anew because refits had spoilt
        // them.
        std::size_t meshBuilds = 0, meshRefits = 0, meshRebuilds = 0;
        double applySeconds = 0;
    };

    /// The bytes in use. The scene's own arrays are read in place; all other bytes are the price of tracing.
    struct Memory {
        std::size_t triangles = 0;           // of the distinct meshes
        std::size_t instancedTriangles = 0;  // what rays see
        std::size_t instances = 0;
        std::size_t sceneBytes = 0;        // arrays that scene and tracer share
        std::size_t tessellatedBytes = 0;  // arrays that the tessellation made (primitives, polygons, normals)
        std::size_t copyBytes = 0;         // positions of merged triangles that had to leave their own frame
        std::size_t bvhBytes = 0;          // Embree's, by its memory monitor, and clusters of triangles for pictures
        std::size_t instanceBytes = 0;     // records per instance and the tree over them
        std::size_t total() const { return sceneBytes + tessellatedBytes + copyBytes + bvhBytes + instanceBytes; }
        double sceneBytesPerTriangle() const;  // scene and tessellation
    };

    RayWorld();
    explicit RayWorld(const Options& options);
    ~RayWorld();
    RayWorld(RayWorld&&) noexcept;
    RayWorld& operator=(RayWorld&&) noexcept;

    /// Follows the scene by one delta and commits once. Instances that cannot be traced end up in diagnostics().
    void apply(const InstanceDelta& delta);

    /// Waits for what is being done in the background, and takes it. On apply()'s thread.
    void finishBackgroundWork();

    /// The world as it is now, for other threads; the last one made while nothing has changed since. Null while
    /// kMostVersions are held: a reader that stalls costs others their turn, and the world no more than so many states.
    /// Costs a list of pages (8 bytes for each 4 to 8 kB of tables); and while it is held, the first change of each
    /// page the copy of that page. On apply()'s thread.
    std::shared_ptr<const WorldVersion> freeze();
    static constexpr std::size_t kMostVersions = 7;

    Stats stats() const;
    /// Looks at every mesh and instance.
    Memory memory() const;
    const Diagnostics& diagnostics() const;
    void clearDiagnostics();
    /// Ray worlds made since the process started.
    static std::uint64_t made();

  private:
    struct Impl;
    void publish();
    std::shared_ptr<Impl> impl_;  // shared with its versions
};

}  // namespace rtsg
