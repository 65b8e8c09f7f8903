// Top: all traced objects: one tree over groups and instances, and the view of it that queries use.
//
// The largest resting group, the main one, is traced first and without a test of its box: nearly every ray hits it, and
// the hit shortens the search among the other objects, which are in the tree.
// Invariant: a TopView is some lists of pages and a few numbers. Queries run on it and on nothing else, so a frozen one
// answers as the Top did at that moment. Rays that reach it have been checked (ray_view.cpp).
// Threading: changes on one thread; tracing from any, in between; frozen views from any at any time.
#pragma once

#include <cstdint>
#include <vector>

#include "bvh.h"
#include "large_triangles.h"
#include "mesh_bvh.h"
#include "primary_hits.h"

namespace rtsg::bvh {

/// A group or an instance, as rays meet it.
struct alignas(64) TopObject {
    glm::mat3 localFromRay{1.0f};  // of points relative to `translation`
    Vec3f translation{0};
    std::uint32_t mask = ~0u, slot = kNoInstance;
    RTCScene scene = nullptr;
    const std::uint32_t* slots = nullptr;        // of a group's geometries; null: an instance
    const Group* resting = nullptr;              // a group that rests
    glm::mat3 normalFromGroup{1.0f};             // of a group that moves
    const LongTriangles* const* cuts = nullptr;  // by geometry; null: nothing of it is cut
    void setTransform(const WorldFromLocal& rayFromLocal);
    std::uint32_t slotOf(std::uint32_t geometryId) const { return slots ? slots[geometryId] : slot; }
};

/// Embree's answer for a ray, in the frame of the object that it hit.
struct RawHit {
    float t, u, v;
    Vec3f normal;
    std::uint32_t triangle, geometryId, objectId;
    explicit operator bool() const { return geometryId != kNoInstance; }
};

struct PassedHits;

class TopView {
  public:
    // `hider`: surfaces that it hides are not hit; null: hides nothing.
    RawHit intersect(const Ray& ray, RayKind kind, const RayFilter* hider = nullptr) const;
    bool occluded(const Ray& ray, RayKind kind, const RayFilter* hider = nullptr) const;
    /// Lanes with all-ones in `valid` are traced; the packet's private members are set for all. Returns a bit per lane
    /// that hit something.
    std::uint32_t intersect(RayPacket16& rays, const std::int32_t* valid, bool coherent, RayKind kind,
                            const RayFilter* hider = nullptr) const {
        return intersect(rays, valid, coherent, kind, nullptr, hider);
    }
    /// The same, if the hits in the main group may be known already, hidden or not.
    std::uint32_t intersect(RayPacket16& rays, const std::int32_t* valid, bool coherent, RayKind kind,
                            const PrimaryBlock* known, const RayFilter* hider) const;
    /// Null: rays are quicker.
    std::unique_ptr<const PrimaryHits> primaryHits(const PixelGrid& grid, RayKind kind, int samples) const {
        return main_ ? PrimaryHits::make(*main_->resting, maskOf(kind), grid, samples) : nullptr;
    }
    /// Null: trees are quicker.
    std::unique_ptr<const LargeTriangles> largeTriangles(RayKind kind, const LargeTriangles::Visitor& report) const {
        return main_ ? LargeTriangles::make(*main_->resting, tree_, maskOf(kind), report) : nullptr;
    }
    /// Blocked lanes end with tMax -inf. Returns a bit for each. `passed`: records the surfaces that it lets rays pass;
    /// null: everything blocks.
    std::uint32_t occluded(RayPacket16& rays, const std::int32_t* valid, bool coherent, RayKind kind,
                           PassedHits* passed = nullptr, const RayFilter* hider = nullptr) const;

    /// RayView's function of that name.
    void visitNear(const Vec3f& center, float radius, const NearVisitor& visit) const;

    /// The object that was hit. Precondition: the ray hit something.
    const TopObject& objectOf(std::uint32_t objectId) const {
        return objectId == kNoInstance ? *main_ : object(objectId);
    }
    /// The object that traces a slot; kNone: none does.
    std::uint32_t ownerOf(std::uint32_t slot) const { return owners_[slot / kSlotsPerPage][slot % kSlotsPerPage]; }
    const TreeView& tree() const { return tree_; }

  private:
    friend class Top;
    friend class MovedTop;
    static constexpr std::size_t kObjectsPerPage = 64, kSlotsPerPage = 1024;

    const TopObject& object(std::uint32_t i) const { return objects_[i / kObjectsPerPage][i % kObjectsPerPage]; }
    /// Whether it pays to trace them as coherent rays; Embree's way for these goes by the frustum around all of them.
    bool runTogether(const RayPacket16& rays, const std::int32_t* valid) const;
    /// Sets the size of the box around everything.
    void setSize(const InstanceTree::Box& box);
    /// A bit per lane that hit something; to be called once for each query.
    std::uint32_t metBy(RayPacket16& rays) const;
    /// Puts hits on pieces on whole triangles; to be called once for each query.
    void restore(RawHit& hit) const;
    void restore(PassedHits& passed) const;
    void restore(RayPacket16& rays, std::uint32_t hits) const;
    std::uint32_t maskOf(RayKind kind) const { return static_cast<std::uint32_t>(kind) << maskShift_; }

    TreeView tree_;
    const TopObject* const* objects_ = nullptr;
    const std::uint32_t* const* owners_ = nullptr;  // by slot: the object that traces it
    const TopObject* main_ = nullptr;
    std::uint32_t mainObject_ = TreeView::kNone;
    unsigned maskShift_ = 0;
    float nearby_ = 0;  // square metres
    bool hasCuts_ = false;
};

class Top {
  public:
    /// Without versions nothing is ever frozen. They outlive this.
    explicit Top(const Versions* versions)
        : versions_(versions), tree_(versions), objects_(versions), owners_(versions) {}

    /// An object's number, for one of those that follow.
    std::uint32_t newObject();
    /// `rayFromLocal` has an inverse; the box is that of the result, in ray space.
    void setInstance(std::uint32_t object, std::uint32_t slot, const MeshBvh& mesh, const WorldFromLocal& rayFromLocal,
                     const InstanceTree::Box& box, std::uint32_t kinds);
    /// A group that rests: its triangles are in ray space.
    void setGroup(std::uint32_t object, const Group& group);
    /// A group that moves as one, after its commit; the box is that of the result.
    void setBody(std::uint32_t object, const Group& group, const WorldFromLocal& rayFromGroup,
                 const InstanceTree::Box& box);
    /// An instance or a body.
    void move(std::uint32_t object, const WorldFromLocal& rayFromLocal, const InstanceTree::Box& box);
    /// For directions of normals; of a body.
    void setNormals(std::uint32_t object, const glm::mat3& normalFromGroup);
    /// The mesh's BVH is another one or has other bounds.
    void changeMesh(std::uint32_t object, const MeshBvh& mesh, const InstanceTree::Box& box);
    void setKinds(std::uint32_t object, std::uint32_t kinds);
    /// After the commit of a group that rests.
    void updateGroup(std::uint32_t object);
    void remove(std::uint32_t object);
    /// Sets the object that traces a slot; kNone: none does. A group's geometry that another object traces is hidden.
    void setOwner(std::uint32_t slot, std::uint32_t object);
    void commit();

    /// The view as of the last commit.
    const TopView& view() const { return view_; }
    /// The lists of a frozen view's pages.
    struct Pages {
        std::vector<const TreeView::Node*> nodes;
        std::vector<const TopObject*> objects;
        std::vector<const std::uint32_t*> owners;
    };
    TopView freeze(Pages& pages) const;
    /// After Versions::refresh(), when somebody has let go.
    void sweep();

    bool empty() const { return mainObject_ == InstanceTree::kNone && tree_.empty(); }
    std::size_t bytes() const { return tree_.bytes() + objects_.bytes() + owners_.bytes(); }
    std::size_t builds() const { return tree_.builds(); }

  private:
    void chooseMain();
    void setCuts(TopObject& object, const LongTriangles* const* cuts);

    const Versions* versions_;
    InstanceTree tree_;
    Paged<TopObject, TopView::kObjectsPerPage> objects_;
    Paged<std::uint32_t, TopView::kSlotsPerPage> owners_;
    std::vector<std::uint32_t> free_, resting_;
    std::uint32_t mainObject_ = InstanceTree::kNone;
    std::size_t cutObjects_ = 0;
    TopView view_;
};

}  // namespace rtsg::bvh
