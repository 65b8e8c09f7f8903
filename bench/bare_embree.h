// Embree alone, as the limit of what a ray world can do: the same triangles, flags and quality, nothing around them.
//
// Threading: one thread, for building and for tracing.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <rtsg/renderers/camera.h>
#include <rtsg/renderers/ray_world.h>

namespace rtsg::bench {

/// One ray that somebody asked.
struct AskedRay {
    Ray ray;
    bool any = false;  // whether something is in the way, no matter what
};

/// Sixteen of them that are asked together.
struct alignas(64) AskedPacket {
    float origin[3][16], direction[3][16];
    float tMin[16], tMax[16];
    std::int32_t active[16];  // -1: asked; 0: not there

    explicit AskedPacket(const RayPacket16& rays);
    Ray ray(int lane) const;
};

/// Everything of a ray world in one flat scene: each instance's triangles in ray space.
class FlatScene {
  public:
    /// `robust`: with Embree's flag of that name, which costs a little.
    explicit FlatScene(const RayWorld& world, bool robust = true);
    ~FlatScene();
    FlatScene(const FlatScene&) = delete;
    FlatScene& operator=(const FlatScene&) = delete;

    /// CPU seconds to copy the triangles, not counted, and to build.
    double buildSeconds() const;
    std::size_t bvhBytes() const;
    std::size_t triangles() const;
    /// CPU seconds to trace single rays.
    double trace(std::span<const AskedRay> rays) const;
    /// The same for packets, of which nothing is told but whether something is in the way if `any`. `coherent`:
    /// Embree's hint that they run side by side.
    double trace(std::span<const AskedPacket> packets, bool coherent, bool any) const;
    /// CPU seconds to trace them in packets of up to sixteen that follow one another and ask alike.
    double traceInPackets(std::span<const AskedRay> rays) const;

    struct Impl;
    const Impl& impl() const { return *impl_; }

  private:
    std::unique_ptr<Impl> impl_;
};

/// Where a lane of a packet has met something: a little off it, on the side that the ray came from.
struct MetPosition {
    Vec3f position{0}, normal{0};
    MetPosition(const RayWorld& world, const RayPacket16& rays, int lane);
};

/// CPU seconds a ray at best: single or in packets, and of those that ask for the closest hit with Embree's hint that
/// they run side by side or without. 0: there is none.
double minPerRay(const FlatScene& scene, std::span<const AskedPacket> packets, bool any);

/// The least that can follow a frame: one Embree instance for each thing that moves, the rest in one; and the deforming
/// meshes alone, refitted.
class SmallestUpdate {
  public:
    /// `delta`: what a typical frame moves and deforms.
    SmallestUpdate(const RayWorld& world, const InstanceDelta& delta);
    ~SmallestUpdate();
    SmallestUpdate(const SmallestUpdate&) = delete;
    SmallestUpdate& operator=(const SmallestUpdate&) = delete;

    /// CPU seconds to set the transforms, to hand over the points, and to commit.
    double follow(const RayWorld& world, const InstanceDelta& delta);

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

/// Primary rays of a picture, in blocks of 4 x 4.
class ViewRays {
  public:
    ViewRays(const RayWorld& world, const Camera& camera, int width, int height);

    std::size_t count() const { return directions_.size(); }
    /// CPU seconds to trace them all.
    double trace(const RayWorld& world) const;
    double trace(const FlatScene& scene) const;
    /// Distance along each ray, infinite for a miss.
    std::vector<float> distances(const RayWorld& world) const;
    std::vector<float> distances(const FlatScene& scene) const;

  private:
    std::vector<Vec3f> directions_;
    Vec3f origin_{0};
};

/// Share of rays whose distances differ by more than `tolerance` of them, or where one misses.
double differing(std::span<const float> a, std::span<const float> b, float tolerance = 1e-3f);

}  // namespace rtsg::bench
