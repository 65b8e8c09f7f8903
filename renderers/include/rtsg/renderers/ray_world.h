// RayWorld: the speed-up graph and its bounding volume hierarchy, built from InstanceDeltas, queried by light, sound,
// picking and collision alike.
//
// What rests is merged into few BVHs, what moves together is one object; a resting thing that moves is taken out alone,
// one that has rested for long is merged again, by a thread of its own: apply() never waits for that.
// Invariant: after apply() it answers as one built from scratch would. No ray and no transform that Embree would abort
// on reaches it: a bad ray is a counted miss, an instance that cannot be traced is left out with a diagnostic.
// Ray space is world space minus origin(), in float; origin() is 0 unless the scene lies far away from 0.
// Threading: apply() alone on one thread; between two of them every const member from any number of threads.
// Source: paper section 5.1.1 (speed-up graph), 5.1.2 (mapping objects to instances).
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include <rtsg/core/diagnostic.h>
#include <rtsg/renderers/instance_delta.h>
#include <rtsg/renderers/mesh.h>
#include <rtsg/renderers/ray.h>

namespace rtsg {

/// An instance as rays see it. Lives as long as the instance, at one slot; read it between two apply() calls.
struct RayInstance {
    Instance info;
    std::shared_ptr<const Mesh> mesh;  // null: not traced
    glm::mat4x3 rayFromLocal{1.0f};    // ray space (see origin())
    glm::mat3 normalFromLocal{
        1.0f};             // directions only, to be normalised; right for mirrored and for flattened ones too
    int sign = 1;          // of the determinant
    float errorScale = 1;  // how much the transform magnifies rounding errors, at least 1
    Vec3f errorFloor{0};   // what is added to every error bound: of those merged into a body that moves, its rounding
};

/// A point on a surface with what is needed to start a ray there.
struct HitPoint {
    Vec3f position{0};  // ray space, from the corners and not from the ray: as exact as float allows
    Vec3f error{0};     // bound of |position - exact| per axis
    Vec3f normal{0};    // as in Hit
};

class RayWorld {
  public:
    /// How instances become Embree objects; `hybrid` is the default and meant to win. See the paper's section 5.1.2.
    enum class Mapping : std::uint8_t { merged, perShape, hybrid };

    struct Options {
        Mapping mapping = Mapping::hybrid;
        /// Watertight intersection: no leaks at shared edges. Off gains little.
        bool robust = true;
        /// Threads that build the BVH; 0 as many as cores.
        unsigned buildThreads = 0;
        /// What rests for so many apply() calls is merged with the rest; after each time that this proves wrong, for a
        /// thing twice as many, up to 256 times; for one that is known to be able to move 16 times as many. A group of
        /// n triangles is rebuilt for that at most once in restFrames (1 + n / 100,000) calls, or when half of it is
        /// gone or as much again has arrived.
        unsigned restFrames = 256;
        /// False: what else is left to a thread of its own is done by finishBackgroundWork() alone.
        bool background = true;
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
        // Of the BVHs of single meshes there are; rebuilt: because refits had spoilt it.
        std::size_t meshBuilds = 0, meshRefits = 0, meshRebuilds = 0;
        double applySeconds = 0;
    };

    /// Where the bytes are. The scene's own arrays are read in place; what else there is, is the price of tracing.
    struct Memory {
        std::size_t triangles = 0;           // of the distinct meshes
        std::size_t instancedTriangles = 0;  // what rays see
        std::size_t instances = 0;
        std::size_t sceneBytes = 0;        // arrays that scene and tracer share
        std::size_t tessellatedBytes = 0;  // arrays that the tessellation made (primitives, polygons, normals)
        std::size_t copyBytes = 0;         // positions of merged triangles that had to leave their own frame
        std::size_t bvhBytes = 0;          // Embree's, by its memory monitor
        std::size_t instanceBytes = 0;     // records per instance and the tree over them
        std::size_t total() const { return sceneBytes + tessellatedBytes + copyBytes + bvhBytes + instanceBytes; }
        double sceneBytesPerTriangle() const;  // scene and tessellation
        double bvhBytesPerTriangle() const;    // copies and BVH
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

    /// Closest hit with tMin <= t <= tMax. A ray that is not finite, has a negative tMin, starts beyond kMaxCoordinate
    /// or whose direction is shorter than 1e-12 or longer than 1e9 misses and is counted in badRays().
    Hit intersect(const Ray& ray, RayKind kind = RayKind::view) const;
    /// Whether anything lies in [tMin, tMax]; for bad rays false, counted as above.
    bool occluded(const Ray& ray, RayKind kind = RayKind::shadow) const;
    /// As above for the active lanes. `coherent`: the rays run close together (primary rays, say), which makes it
    /// faster. Returns a bit per lane that hit something or is blocked.
    std::uint32_t intersect(RayPacket16& rays, bool coherent = false, RayKind kind = RayKind::view) const;
    std::uint32_t occluded(RayPacket16& rays, bool coherent = false, RayKind kind = RayKind::shadow) const;
    /// What lane `lane` of an intersected packet hit; no instance for a miss.
    Hit hit(const RayPacket16& rays, int lane) const;
    /// The same for all lanes in `mask` (bits), which hit something; the others of `out` hold rubbish.
    void hits(const RayPacket16& rays, std::uint32_t mask, PacketHits16& out) const;

    /// Calls visit(slot, triangle) for every triangle whose box comes within `radius` of `center` (both in ray space,
    /// metres), and maybe others; visit returns the radius from then on. What is nearer tends to come first.
    using NearVisitor = rtsg::NearVisitor;
    void visitNear(const Vec3f& center, float radius, const NearVisitor& visit) const;

    /// Precondition: the slot of a hit or of a live instance.
    const RayInstance& instance(std::uint32_t slot) const { return instances_[slot]; }
    /// Indexed by slot, with holes: a hole's info.id is no instance.
    std::span<const RayInstance> instances() const { return instances_; }
    /// The exact point of a hit and the bound of its rounding error.
    HitPoint point(const Hit& hit) const;
    /// Where a ray leaving `from` towards `direction` should start so that it does not hit the surface it leaves.
    static Vec3f leave(const HitPoint& from, const Vec3f& direction);

    /// World position of ray space's zero. Changes only when a scene turns out to lie far from it.
    const Vec3d& origin() const { return origin_; }
    Vec3f fromWorld(const Vec3d& world) const { return Vec3f(world - origin_); }
    Vec3d toWorld(const Vec3f& ray) const { return Vec3d(ray) + origin_; }

    /// Box around everything traced, in ray space; min > max when there is nothing. Looks at every instance.
    Bounds bounds() const;

    /// Counts apply() calls that changed anything: caches keyed by it know when to forget.
    std::uint64_t version() const { return version_; }
    Stats stats() const;
    /// Looks at every mesh and instance.
    Memory memory() const;
    std::uint64_t badRays() const;
    const Diagnostics& diagnostics() const { return diagnostics_; }
    void clearDiagnostics() { diagnostics_ = Diagnostics(); }

    /// Coordinates beyond this (m) are neither traced nor accepted in rays.
    static constexpr float kMaxCoordinate = 1e9f;

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
    std::vector<RayInstance> instances_;
    Vec3d origin_{0};
    std::uint64_t version_ = 0;
    Diagnostics diagnostics_;
};

}  // namespace rtsg
