// RayView: the queries that rays make of a world: hits, things nearby, and the instances they belong to.
//
// Light, sound, picking and collision query a RayView; it may be a RayWorld or a version of one. Invariant: all queries
// run here, for both. An invalid ray counts as a miss and is counted. Ray space is world space minus origin(), in
// float; origin() is 0 unless the scene lies far away from 0. Threading: every member on any number of threads; for a
// RayWorld, between two apply() calls. Source: paper section 5.1.1 (speed-up graph).
#pragma once

#include <cstddef>
#include <cstdint>
#include <iterator>
#include <memory>

#include <rtsg/renderers/instance_delta.h>
#include <rtsg/renderers/mesh.h>
#include <rtsg/renderers/ray.h>

namespace rtsg {

namespace bvh {
struct PassedHits;
struct PrimaryBlock;
struct RawHit;
}  // namespace bvh

/// An instance as rays see it. It lives as long as the instance, at one slot; in a RayWorld, read it between two
/// apply() calls.
struct RayInstance {
    Instance info;
    std::shared_ptr<const Mesh> mesh;  // null: not traced
    glm::mat4x3 rayFromLocal{1.0f};    // ray space (see origin())
    glm::mat3 normalFromLocal{
        1.0f};             // directions only, to be normalised; right for mirrored and for flattened ones too
    int sign = 1;          // of the determinant
    float errorScale = 1;  // how much the transform magnifies rounding errors, at least 1
    Vec3f errorFloor{0};   // added to every error bound: the rounding of instances that are merged into a moving body
};

/// A point on a surface with what is needed to start a ray there.
struct HitPoint {
    Vec3f position{0};  // ray space, from the corners and not from the ray: as exact as float allows
    Vec3f error{0};     // bound of |position - exact| per axis
    Vec3f normal{0};    // as in Hit
};

/// The instances by slot, in pages. A free slot has no instance in its info.id.
class RayInstances {
  public:
    static constexpr std::size_t kPerPage = 32;

    class Iterator {
      public:
        using value_type = RayInstance;
        using difference_type = std::ptrdiff_t;
        Iterator() = default;
        Iterator(const RayInstance* const* pages, std::size_t slot) : pages_(pages), slot_(slot) {}
        const RayInstance& operator*() const { return pages_[slot_ / kPerPage][slot_ % kPerPage]; }
        const RayInstance* operator->() const { return &**this; }
        Iterator& operator++() { return ++slot_, *this; }
        Iterator operator++(int) { return {pages_, slot_++}; }
        friend bool operator==(const Iterator& a, const Iterator& b) { return a.slot_ == b.slot_; }

      private:
        const RayInstance* const* pages_ = nullptr;
        std::size_t slot_ = 0;
    };

    RayInstances() = default;
    RayInstances(const RayInstance* const* pages, std::size_t size) : pages_(pages), size_(size) {}
    std::size_t size() const { return size_; }
    bool empty() const { return size_ == 0; }
    /// Precondition: slot < size().
    const RayInstance& operator[](std::size_t slot) const { return pages_[slot / kPerPage][slot % kPerPage]; }
    Iterator begin() const { return {pages_, 0}; }
    Iterator end() const { return {pages_, size_}; }

  private:
    const RayInstance* const* pages_ = nullptr;
    std::size_t size_ = 0;
};

class RayView {
  public:
    /// Closest hit with tMin <= t <= tMax. A ray that is not finite, has a negative tMin, starts beyond kMaxCoordinate
    /// or whose direction is shorter than 1e-12 or longer than 1e9 misses and is counted in badRays().
    Hit intersect(const Ray& ray, RayKind kind = RayKind::view) const;
    /// Whether anything lies in [tMin, tMax]; for bad rays false, counted as above.
    bool occluded(const Ray& ray, RayKind kind = RayKind::shadow) const;
    /// The same for the active lanes. `coherent` says that the rays run close together, as primary rays do, which makes
    /// it faster; otherwise the packet itself is examined. Returns a bit for each lane that hit something or is
    /// blocked.
    std::uint32_t intersect(RayPacket16& rays, bool coherent = false, RayKind kind = RayKind::view) const;
    std::uint32_t occluded(RayPacket16& rays, bool coherent = false, RayKind kind = RayKind::shadow) const;
    /// The hit of lane `lane` of an intersected packet; no instance for a miss.
    Hit hit(const RayPacket16& rays, int lane) const;
    /// The hits of all lanes in `mask` (bits), which must have hit something; the other lanes of `out` are undefined.
    /// Returns whether all of them are known to have met one instance.
    bool hits(const RayPacket16& rays, std::uint32_t mask, PacketHits16& out) const;

    /// Calls visit(slot, triangle) for every triangle within `radius` of `center` (both in ray space, metres), and
    /// perhaps for others; perhaps more than once for long ones. visit returns the radius from then on. Nearer
    /// triangles tend to come first. Only triangles that rays of this kind may meet count; shadow counts as view.
    using NearVisitor = rtsg::NearVisitor;
    void visitNear(const Vec3f& center, float radius, const NearVisitor& visit, RayKind kind = RayKind::view) const;
    /// The same for triangles that stop avatars (Instance::felt).
    void visitFelt(const Vec3f& center, float radius, const NearVisitor& visit) const;

    /// Precondition: the slot of a hit or of a live instance.
    const RayInstance& instance(std::uint32_t slot) const { return instances_[slot]; }
    /// Indexed by slot. A free slot has no instance in its info.id.
    const RayInstances& instances() const { return instances_; }
    /// The exact point of a hit and a bound of its rounding error; for a line or point, the point on its axis.
    /// Precondition: not on a cap.
    HitPoint point(const Hit& hit) const;
    /// The same for any hit, with its ray: for a line or point, the point where the ray met it. The point on a cap can
    /// only be found with the ray.
    HitPoint point(const Hit& hit, const Ray& ray) const;
    /// The hit point of a line or point, on its axis, as if it were a surface with this normal: rays that leave it to
    /// either side start beyond its width. The normal is a unit vector in ray space, perpendicular to the line.
    HitPoint strokePoint(const Hit& hit, const Vec3f& normal) const;
    /// Call it when `ray` met the back of a solid, which does not count. Finds another surface in the same place, up to
    /// rounding, that is no such back; no instance if there is none. It is needed because a ray reports any one of
    /// several surfaces that coincide.
    Hit frontOfCoincident(const Ray& ray, const Hit& back, RayKind kind = RayKind::view) const;
    /// The start of a ray that leaves `from` towards `direction`, chosen so that it does not hit the surface it leaves.
    static Vec3f leave(const HitPoint& from, const Vec3f& direction);

    /// The world position of the origin of ray space. It changes only when a scene turns out to lie far from it.
    const Vec3d& origin() const { return origin_; }
    Vec3f fromWorld(const Vec3d& world) const { return Vec3f(world - origin_); }
    Vec3d toWorld(const Vec3f& ray) const { return Vec3d(ray) + origin_; }

    /// The box around everything visible, in ray space; min > max if there is nothing. It visits every instance.
    Bounds bounds() const;

    /// The number of RayWorld::apply() calls that changed anything, with which caches can tell whether they are out of
    /// date.
    std::uint64_t version() const { return version_; }
    /// The number of rays that intersect() and the like refused.
    std::uint64_t badRays() const;

    /// Coordinates beyond this (in metres) are neither traced nor accepted in rays.
    static constexpr float kMaxCoordinate = 1e9f;

    /// The lens that makes lines and points as wide as pixels. With the default lens, rays meet none of them.
    const PixelLens& lens() const { return lens_; }

  protected:
    struct Tables;  // what is traced
    RayView() = default;
    ~RayView() = default;
    RayView(const RayView&) = default;
    RayView& operator=(const RayView&) = default;

    const Tables* tables_ = nullptr;
    RayInstances instances_;
    Vec3d origin_{0};
    std::uint64_t version_ = 0;
    PixelLens lens_;
    /// A ball around all lines and points as this eye sees them, in ray space. Squared radius < 0: there are none.
    Vec3f strokesMiddle_{0};
    float strokesRadiusSquared_ = -1;
    const RayFilter* filter_ = nullptr;
    RayKind views_ = RayKind::view;

  private:
    RayKind meant(RayKind kind) const { return kind == RayKind::view ? views_ : kind; }
    friend class ClearPath;
    friend class Motions;
    friend class MovedView;
    friend class LargeRays;
    friend class PrimaryRays;
    Hit intersectAll(const Ray& ray, RayKind kind) const;
    Hit intersectFiltered(Ray ray, RayKind kind) const;
    /// The nearest surface, up to rounding, that is not left out in the place where `leftOut` was met; no instance if
    /// there is none.
    Hit meetCoincident(const Ray& ray, const Hit& leftOut, RayKind kind) const;
    Hit meetCaps(const Ray& ray, const Hit& hit, RayKind kind) const;
    std::uint32_t meetCaps(RayPacket16& rays, std::uint32_t hits, std::uint32_t asked, const float* tMax,
                           RayKind kind) const;
    std::uint32_t bodyAround(const Vec3f& position, const Vec3f& direction, std::uint32_t plane, RayKind kind) const;
    std::uint32_t intersect(RayPacket16& rays, bool coherent, RayKind kind, const bvh::PrimaryBlock* known) const;
    std::uint32_t intersectAll(RayPacket16& rays, const std::int32_t* valid, bool coherent, RayKind kind,
                               const bvh::PrimaryBlock* known = nullptr) const;
    Hit hit(const bvh::RawHit& raw) const;
    /// Does the same as occluded(), but surfaces that `passed` lets rays through do not count, and are recorded there.
    /// `unknown` is as in ClearPath::find().
    std::uint32_t occludedBut(RayPacket16& rays, bool coherent, RayKind kind, bvh::PassedHits& passed,
                              std::uint32_t& unknown) const;
    std::uint32_t occludedByAll(RayPacket16& rays, const std::int32_t* valid, bool coherent, RayKind kind) const;
    std::uint32_t filterHits(RayPacket16& rays, std::uint32_t hits, std::uint32_t asked, const float* tMax,
                             RayKind kind) const;
    /// The filter if it hides whole instances; else null.
    const RayFilter* hider() const { return filter_ && filter_->hidesAny() ? filter_ : nullptr; }
    std::uint32_t passHidden(RayPacket16& rays, std::uint32_t hits, const float* tMax, bool coherent,
                             RayKind kind) const;
    bool seesStrokes(RayKind kind) const { return strokesRadiusSquared_ >= 0 && kind != RayKind::sound; }
    void meetStrokes(const Ray& ray, RayKind kind, Hit& hit) const;
};

/// A view in which rays also meet lines and points, and do not meet the parts that a filter leaves out. The view, lens
/// and filter must outlive it.
class LensedView final : public RayView {
  public:
    /// `views` is the kind that rays of kind `view` have here.
    LensedView(const RayView& view, const PixelLens& lens, const RayFilter* filter = nullptr,
               RayKind views = RayKind::view);
    /// The same with another filter in place of its own.
    LensedView(const LensedView& view, const RayFilter* filter) : RayView(view) { filter_ = filter; }
};

}  // namespace rtsg
