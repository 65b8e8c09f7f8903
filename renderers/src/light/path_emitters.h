// EmitterLight: what shining triangles or the sky send to sixteen surfaces, found by choosing a direction for each.
//
// Threading: one of a tile. Source: Veach 1997, chapters 8 and 9 (estimators of direct light and their combination).
#pragma once

#include "emitters.h"
#include "packet_random.h"
#include "surface_packet.h"

namespace rtsg::trace {

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

/// How likely lookForEmitters() would have chosen the direction that led a task to this lane's surface; 0: never.
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
