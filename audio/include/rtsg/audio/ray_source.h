// RaySource: the rays that sound asks of a world, whether that is live or a version of it.
//
//     const RaysOf rays(world);            // RayWorld, or anything with the same three queries
//     engine.render(*tables.latest(), rays, t, sound);
//
// Invariant: it answers for one state of the world, the same as that of the tables beside it.
// Threading: all queries from any number of threads.
#pragma once

#include <rtsg/renderers/ray.h>

namespace rtsg {

class RaySource {
  public:
    virtual ~RaySource() = default;
    /// As of RayWorld.
    virtual Hit intersect(const Ray& ray, RayKind kind) const = 0;
    virtual void visitNear(const Vec3f& center, float radius, const NearVisitor& visit) const = 0;
    virtual Vec3d origin() const = 0;

    Vec3f fromWorld(const Vec3d& world) const { return Vec3f(world - origin()); }
};

/// `world` must outlive this.
template <class World>
class RaysOf final : public RaySource {
  public:
    explicit RaysOf(const World& world) : world_(&world) {}
    Hit intersect(const Ray& ray, RayKind kind) const override { return world_->intersect(ray, kind); }
    void visitNear(const Vec3f& center, float radius, const NearVisitor& visit) const override {
        world_->visitNear(center, radius, visit);
    }
    Vec3d origin() const override { return world_->origin(); }

  private:
    const World* world_;
};

}  // namespace rtsg
