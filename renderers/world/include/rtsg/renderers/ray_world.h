// RayWorld: the speed-up graph and its bounding volume hierarchy (BVH), built from InstanceDeltas; light, sound,
// picking and collision query it.
//
// Things at rest are merged into few BVHs, and things that move together are one object. A resting thing that moves is
// taken out alone; one that has rested for long is merged again, on a thread for which apply() never waits. Invariant:
// after apply() it gives the same answers as one built from scratch. Rays and transforms that would make Embree abort
// do not reach it: such a ray is counted as a miss, such an instance is left out with a diagnostic. Ray space is world
// space minus origin(), in float; origin() is 0 unless the scene lies far away from 0. Threading: apply() alone on one
// thread; between two of them every const member on any number of threads. freeze() gives versions that answer at any
// time. Source: paper section 5.1.1 (speed-up graph), 5.1.2 (mapping objects to instances).
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

/// A state of a RayWorld that does not change, for readers on other threads while the world goes on. It shares the
/// triangles, BVHs and pages of tables of that moment with the world and keeps them alive, also after the world's end.
/// Threading: any number of threads; the last owner may drop it on any thread.
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
    /// How instances become Embree objects; `hybrid` is the default and usually the fastest. See the paper's section
    /// 5.1.2.
    enum class Mapping : std::uint8_t { merged, perShape, hybrid };

    struct NamedNode {
        std::string name;  // its type and its DEF name or number; empty: not known
        NodeLocation location;
    };
    struct Options {
        Mapping mapping = Mapping::hybrid;
        /// Watertight intersection: no leaks at shared edges. Switching it off gains little.
        bool robust = true;
        /// The number of threads that build the BVH; 0 means one for each core. It does not affect other parts of the
        /// program.
        unsigned buildThreads = 0;
        /// A thing that has rested for so many apply() calls is merged with the rest. Each time that it moves later, it
        /// must rest twice as long before the next merge, up to 256 times as long; a thing that is known to be able to
        /// move must rest 16 times as long. For merges, a group of n triangles is rebuilt at most once in restFrames (1
        /// + n / 100,000) calls, or when half of it has left or as much again has arrived.
        unsigned restFrames = 256;
        /// False: there is no background thread, and finishBackgroundWork() does its work.
        bool background = true;
        /// Gives the name of a node and its place in a file, for diagnostics; if empty, nodes are named by their
        /// numbers.
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

    /// The bytes in use. The scene's own arrays are read in place; all other bytes are needed for tracing.
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

    /// Waits for the work in the background, and takes its results. Call it on apply()'s thread.
    void finishBackgroundWork();

    /// The world as it is now, for other threads; the same version as before if nothing has changed. Null while
    /// kMaxVersions are held: a reader that stalls can keep others from getting a version, but the world holds no more
    /// states than that. A version costs a list of pages (8 bytes for each 4 to 8 kB of tables) and, while it is held,
    /// a copy of each page that changes. Call it on apply()'s thread.
    std::shared_ptr<const WorldVersion> freeze();
    static constexpr std::size_t kMaxVersions = 7;

    Stats stats() const;
    /// Computes the memory use; it visits every mesh and instance.
    Memory memory() const;
    const Diagnostics& diagnostics() const;
    void clearDiagnostics();
    /// The number of ray worlds made since the process started.
    static std::uint64_t created();

  private:
    struct Impl;
    void publish();
    std::shared_ptr<Impl> impl_;  // shared with its versions
};

}  // namespace rtsg
