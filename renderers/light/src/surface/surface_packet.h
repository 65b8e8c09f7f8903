// Shades the hits of a packet: prepares surfaces, and computes lighting, shadows and transmitted light.
//
// Threading: a packet belongs to one tile.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>

#include "lighting/trace_scene.h"
#include "media.h"
#include "surface_lanes.h"

namespace rtsg::trace {

/// Fills the packet for the lanes in `mask`, which hit something.
void fetchSurfaces(const TraceScene& scene, const RayPacket16& rays, std::uint32_t mask, const PathTask* tasks,
                   SurfacePacket& out);

/// Fills `exact` and `error`, once.
void findPoints(const TraceScene& scene, SurfacePacket& surfaces);

/// The start of rays that go straight on from a hit. Precondition: findPoints().
HitPoint pointBehind(const TraceScene& scene, const SurfacePacket& surfaces, int lane);

/// A point on the curved surface that a lane's flat triangle represents, on the viewer's side; nothing if the surface
/// is not convex there. Rays from this point to lights in front of the shading normal but behind the triangle do not
/// pass through the body. Precondition: findPoints(). Source: Hanika 2021 (Ray Tracing Gems II, chapter 4).
std::optional<Vec3f> pointOnCurve(const TraceScene& scene, const SurfacePacket& surfaces, int lane);

/// Whether light may pass straight through an instance.
bool letsThrough(const TraceScene& scene, std::uint32_t instance);

/// The share of light that a surface lets through straight at a hit of a ray in this direction: 0 if it is opaque
/// there. The side that the ray meets decides, as it does for an eye there. `eta`: of a body, as Media has it; nothing:
/// it lies in air.
Vec3f straightTransmittance(const TraceScene& scene, const Hit& hit, const Vec3f& direction,
                            std::optional<float> eta = {});

/// Clear surfaces that a ray passes straight; behind more it is dark. Only those that take nothing at all, such as the
/// empty parts of textures, become so many before nothing is left.
constexpr int kMaxPassed = 10'000;

/// The share of light that is left along a ray, which ends at tMax or goes on for ever. `world` has the things that it
/// may hit, `in` is the medium that it starts in.
Vec3f leftAlong(const TraceScene& scene, const RayView& world, Ray ray, RayKind kind = RayKind::shadow, RunsIn in = {});

/// The light that an opaque surface itself emits at a hit, in linear light. `footprint` is the width of a pixel there,
/// in metres.
Vec3f emitted(const TraceScene& scene, const Hit& hit, bool behind, float footprint);

/// The shares of a packet's colours in their pixels.
struct RayWeights {
    static constexpr float kWhole = std::numeric_limits<float>::infinity();  // never too little
    alignas(64) float of[16];
    float minimum;  // shadows that change a pixel by less are left out
};
/// Adds the light of the lights, shadows included, into `radiance`, which is set to the emission. `shares`: where some
/// count little; null: all are as if they counted much.
void addLights(const TraceScene& scene, SurfacePacket& surfaces, std::uint64_t& shadowRays,
               const RayWeights* weights = nullptr);

/// Adds the light of EnvironmentLights to it, without shadows; for uses without bounces.
void addEnvironments(const TraceScene& scene, SurfacePacket& surfaces);

}  // namespace rtsg::trace
