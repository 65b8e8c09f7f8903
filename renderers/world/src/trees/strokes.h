// Strokes: all lines and points to trace, beside the triangles of top.h, and the view of them that queries use.
//
// Invariant: as of TopView: a frozen StrokeView answers as the Strokes did at that moment. Rays that reach it have been
// checked. A stroke is as wide at each point of its axis as the style's pixels are there, squeezed towards the middle
// of the picture as perspective stretches away from it, so that its width is the same everywhere in the picture. For
// rays of the picture's own a point is a square of as many pixels, half open, so that one of a pixel is met by one ray
// of a picture that takes one a pixel; for others, and where the lens has no picture, a disk. A stroke has
// no thickness: rays meet it at the depth of its axis, so what is nearer hides it, however close before it. Threading:
// changes on one thread; tracing from any, in between; frozen views from any at any time.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include <rtsg/renderers/instance_delta.h>
#include <rtsg/renderers/ray.h>

#include "instance_tree.h"
#include "stroke_bvh.h"

namespace rtsg::bvh {

/// How far a step of 1 leads along each axis, at most.
inline Vec3f rowLengths(const glm::mat3& m) {
    const glm::mat3 rows = glm::transpose(m);
    return {glm::length(rows[0]), glm::length(rows[1]), glm::length(rows[2])};
}

/// How much nearer a stroke counts than it is, so that a stroke in a surface is seen in spite of roundings. It is a
/// share of the sum of three distances: of the ray's start and of the stroke from the origin of ray space, and of the
/// stroke from the eye. So it also holds far from the origin and from the eye.
constexpr float kTie = 0x1p-19f;

/// The strokes of one instance.
struct StrokeObject {
    std::shared_ptr<const StrokeBvh> bvh;
    std::shared_ptr<const StrokeStyle> style;  // null: the default
    glm::mat4x3 rayFromLocal{1.0f};
    glm::mat3 localFromRay{1.0f};  // of points relative to the translation
    Vec3f rowLengths{1};           // of localFromRay
    std::uint32_t kinds = 0, slot = kNoInstance;
    float halfWidth = .5f;  // pixels, at most
    bool isPoints = false;
    /// Pixels from the axis to where rays may meet it: to the corners of points, which are squares in the picture.
    float reach() const { return isPoints ? 1.4143f * halfWidth : halfWidth; }
};

struct StrokeHit {
    float t = 0, u = 0;
    std::uint32_t slot = kNoInstance, stroke = 0;
};

/// The surface that rays have met already, at their tMax: a stroke that lies in it is seen as a whole.
class StrokeSurface {
  public:
    virtual ~StrokeSurface() = default;
    /// Unit, in ray space; none: nothing was met.
    virtual std::optional<Vec3f> normal(int lane) const = 0;
};

/// A query of rays: the strokes of some kinds, as wide as an eye sees them, without the places that a filter leaves out
/// (null: no filter).
struct StrokeQuery {
    const PixelLens& lens;
    RayKind kind;
    const RayFilter* filter = nullptr;
    const StrokeSurface* surface = nullptr;  // null: nothing has been met
};

class StrokeView {
  public:
    bool empty() const { return tree_.empty(); }
    /// A box around all that rays can meet of them, as wide as this eye sees them; none where nothing is.
    Bounds reach(const PixelLens& lens) const;
    /// The nearest within [tMin, tMax]; false: none.
    bool intersect(const Ray& ray, const StrokeQuery& query, StrokeHit& hit) const;
    bool occluded(const Ray& ray, const StrokeQuery& query) const;
    /// Lanes with all-ones in `valid` are traced, up to their tMax, which is lowered to that of the hit. Hits are noted
    /// in the packet's private members, as kResolved has it. Returns a bit per lane that hit something.
    std::uint32_t intersect(RayPacket16& rays, const std::int32_t* valid, const StrokeQuery& query) const;
    /// Blocked lanes end with tMax -inf. Returns a bit for each.
    std::uint32_t occluded(RayPacket16& rays, const std::int32_t* valid, const StrokeQuery& query) const;

    /// inst_ of a packet's lane whose geom_ is the slot already, and whose normal is in ray space.
    static constexpr std::uint32_t kResolved = 0xFFFFFFFE;
    static bool isResolved(std::uint32_t inst) { return inst == kResolved; }

  private:
    friend class Strokes;
    static constexpr std::size_t kObjectsPerPage = 16;
    struct Rays;
    bool comesNear(const RayPacket16& packet, const std::int32_t* valid, const StrokeQuery& query,
                   simd::I8* near) const;
    template <bool kAny>
    void traverse(Rays& rays, const StrokeQuery& query) const;
    template <bool kAny>
    std::uint32_t packet(RayPacket16& rays, const std::int32_t* valid, const StrokeQuery& query) const;
    const StrokeObject& object(std::uint32_t i) const { return objects_[i / kObjectsPerPage][i % kObjectsPerPage]; }

    TreeView tree_;
    TreeView::Box box_;  // around all axes
    const StrokeObject* const* objects_ = nullptr;
    float widest_ = 0;  // StrokeObject::reach(), of all at most
};

class Strokes {
  public:
    explicit Strokes(const Versions* versions) : tree_(versions), objects_(versions) {}

    /// `rayFromLocal` has an inverse; the box is that of the result, in ray space. Returns its number.
    std::uint32_t add(std::uint32_t slot, std::shared_ptr<const StrokeBvh> bvh, bool isPoints,
                      std::shared_ptr<const StrokeStyle> style, const WorldFromLocal& rayFromLocal,
                      const TreeView::Box& box, std::uint32_t kinds);
    void move(std::uint32_t object, const WorldFromLocal& rayFromLocal, const TreeView::Box& box);
    void setKinds(std::uint32_t object, std::uint32_t kinds);
    void remove(std::uint32_t object);
    void commit();

    const StrokeView& view() const { return view_; }
    struct Pages {
        std::vector<const TreeView::Node*> nodes;
        std::vector<const StrokeObject*> objects;
    };
    StrokeView freeze(Pages& pages) const;
    /// After Versions::refresh(), when somebody has let go.
    void sweep();
    bool empty() const { return tree_.empty(); }
    /// Tables, and each tree as often as it is used.
    std::size_t bytes() const;

  private:
    InstanceTree tree_;
    Paged<StrokeObject, StrokeView::kObjectsPerPage> objects_;
    std::vector<std::uint32_t> free_;
    float widest_ = 0;
    bool changed_ = false;
    StrokeView view_;
};

}  // namespace rtsg::bvh
