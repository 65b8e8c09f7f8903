// EmitterLight: the light of emitting triangles or the sky at sixteen surfaces, with one sampled direction for each.
//
// Threading: one of a tile. Source: Veach 1997, chapters 8 and 9 (estimators of direct light and their combination).
#pragma once

#include "lighting/emitters.h"
#include "lighting/packet_random.h"
#include "surface/surface_packet.h"

namespace rtsg::trace {

// A ray reaches a little further than its target, so that rounding does not end it in front of it.
constexpr float kReach = 1.001f;
// Hits up to this share of the distance are in front of the target. Nearer to it, only the nearest hit tells which is
// first.
constexpr float kBefore = 1 - 0x1p-19f;

struct EmitterLight {
    std::uint32_t mask = 0;         // lanes that are reached
    Lanes3 direction;               // towards the light, unit
    Lanes3 light;                   // radiance that arrives, over `density`
    alignas(64) float density[16];  // per steradian, of choosing this direction
};

/// Chooses an emitter for every lane that bounces could find it from, and looks whether it is there.
/// Precondition: findPoints().
void lookForEmitters(const TraceScene& scene, const SurfacePacket& surfaces, const PathTask* tasks,
                     PacketRandom& random, EmitterLight& out, std::uint64_t& shadowRays);

/// Whether light from a point on an emitter reaches the start of a ray, which has made this hit; `left`: the share that
/// transparent surfaces on the way leave.
bool reachesEmitter(const TraceScene& scene, const Emitters::Emitter& target, const Vec3f& position, Ray ray, Hit hit,
                    Vec3f& left);

/// How likely an emitter's triangle, `distance` away from a surface at `from` of this shading normal, would have been
/// chosen there, per steradian; 0: never.
float emitterDensity(const TraceScene& scene, std::uint32_t instance, std::uint32_t triangle, const Vec3f& from,
                     const Vec3f& direction, float distance, const Vec3f& normal);
/// The same of the direction that led a task to this lane's surface.
float emitterDensity(const TraceScene& scene, const SurfacePacket& surfaces, int lane, const PathTask& task);

/// The same towards the sky, where SkyLight tells.
void lookForSky(const TraceScene& scene, const SurfacePacket& surfaces, PacketRandom& random, EmitterLight& out,
                std::uint64_t& shadowRays);

/// The same towards one of the scene's lamps; `density` is infinite, as no bounce comes across one.
void lookForLamps(const TraceScene& scene, const SurfacePacket& surfaces, PacketRandom& random, EmitterLight& out,
                  std::uint64_t& shadowRays);

/// The weight of a sample that one method found with density `own`, and another could have found with `other`.
inline float powerHeuristic(float own, float other) {
    const float ratio = other / own;
    return 1 / (1 + ratio * ratio);
}

}  // namespace rtsg::trace
