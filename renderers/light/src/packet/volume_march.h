// Marches through volumes: finds the light that they add to a ray, and the share of the light from beyond that they
// leave.
//
// An opacity is that of a way of one voxel, whichever way a ray takes through the box: over a way of d voxels of
// opacity a, (1 - a)^d is left. A march takes two samples a voxel; of several volumes in one place each takes its part.
// Threading: re-entrant. Source: ISO/IEC 19775-1 V4.0 clause 41, which does not say what length an opacity is for; Max
// 1995 (emission and absorption along a ray).
#pragma once

#include "lighting/trace_scene.h"
#include "texture/volume.h"

namespace rtsg {
struct LightState;
}

namespace rtsg::trace {

struct VolumeLight {
    Vec3f radiance{0};
    float left = 1;  // share of the light from beyond tMax
};

/// Between the ray's ends. `asLight`: colours are light, else display values; `line`: metres on this straight line
/// before the ray's origin, for fog.
VolumeLight marchVolumes(const TraceScene& scene, const Ray& ray, bool asLight, float line);

/// The share of light that is left along the ray. `scope` leaves out volumes that cast no shadow in it; null: all do.
float volumesLeft(const TraceScene& scene, const Ray& ray, const ScopeFilter* scope = nullptr);

/// The volumes of a picture: `hidden` as in Part.
void findVolumes(const LightState& state, const RayView& world, const std::vector<bool>& hidden,
                 std::shared_ptr<const RayFilter> filter, TraceScene& scene);

/// A place in a volume as a style shows it.
class StyledPoint {
  public:
    /// `at` in ray space, `view` towards the eye. Without `colors`, only the opacity counts.
    StyledPoint(const TraceScene& scene, const TraceVolume& volume, const Vec3f& position, const Vec3f& at,
                const Vec3f& view, bool asLight, bool colors)
        : scene_(scene),
          volume_(volume),
          position_(position),
          at_(at),
          view_(view),
          asLight_(asLight),
          colors_(colors) {}

    /// Colour, and opacity of one voxel.
    Vec4f operator()(const VolumeStyle& style);
    /// The colour and opacity of a surface where the voxels have this value.
    Vec4f surface(const VolumeStyle& style, float value);

  private:
    Vec4f apply(const VolumeStyle& style, const VoxelGrid& voxels, const Vec4f& voxel, int components, Vec4f color);
    void apply(const BoundaryEnhancement& step, const VoxelGrid& voxels, Vec4f& color) const;
    void apply(const Cartoon& step, const Vec3f& normal, Vec4f& color) const;
    void apply(const EdgeEnhancement& step, const Vec3f& normal, Vec4f& color) const;
    void apply(const SilhouetteEnhancement& step, const Vec3f& normal, Vec4f& color) const;
    void apply(const ToneMapped& step, const Vec3f& normal, Vec4f& color) const;
    void apply(const Shaded& step, const Vec3f& normal, Vec4f& color) const;
    void apply(const Blended& step, Vec4f& color);
    Vec3f normalOf(const StyleStep& step, const VoxelGrid& voxels) const;
    Vec3f paint(const Vec3f& display) const { return asLight_ ? linearFromSrgb(display) : display; }
    float visible(const TraceLight& light, const Vec3f& direction, float distance) const;

    const TraceScene& scene_;
    const TraceVolume& volume_;
    Vec3f position_, at_, view_;
    bool asLight_, colors_, onSurface_ = false;
};

}  // namespace rtsg::trace
