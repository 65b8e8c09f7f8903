// SurfacePacket: sixteen hits made ready for shading: places, normals and the material's numbers, lane by lane.
//
// Threading: a packet belongs to one tile. Conventions: `view` points back along the ray; both normals are on the
// viewer's side; lanes not in `mask` hold rubbish. Lines and points have one side: the normals of `thin`
// lanes are theirs, whichever side the viewer is on, and the true surface's is square to the line. Sets of lanes are
// bit masks. Whoever changes a packet's colours outside of fetchSurfaces() sets `filled` to null.
#pragma once

#include <cstdint>

#include "lanes3.h"
#include "lighting/trace_scene.h"
#include "world/ray_boxes.h"

namespace rtsg::trace {

class Media;

struct alignas(64) SurfacePacket {
    std::uint32_t mask = 0;            // lanes that hit something
    std::uint32_t back = 0;            // the ray came from behind
    std::uint32_t special = 0;         // may send further rays
    std::uint32_t unlit = 0;           // no light changes it
    std::uint32_t physical = 0;        // of the lit ones
    std::uint32_t shiny = 0;           // of the lit ones, phong with a specular part
    std::uint32_t linear = 0;          // colours and radiance are light; of the others display values
    std::uint32_t caps = 0;            // on a cap
    std::uint32_t thin = 0;            // on a line or point that is lit: it has no other side
    bool oneInstance = false;          // all lanes
    bool fromEye = false;              // met by rays from an eye, of pixels next to each other
    const Material* filled = nullptr;  // all lanes have this one's numbers, unchanged, as light or (not) display values
    bool filledLinear = false;
    PacketHits16 hits;
    alignas(64) float distance[16];
    Lanes3 position;  // ray space
    Lanes3 view, normal;
    Lanes3 base, specular, emissive, ambient;  // ambient: what ambient light is multiplied with
    alignas(64) float exponent[16], metallic[16], roughness[16];
    alignas(64) float coverage[16], opacity[16];
    alignas(64) float occlusion[16];  // remaining share of light from all around (glTF's occlusion)
    std::uint32_t lights[16];
    const Material* material[16];
    /// For surfaces that bend light: the index behind the surface divided by the one before it. Coverage 0 means that
    /// there is no surface. `media` counts the bodies that a lane's ray is in, before and behind the surface.
    alignas(64) float eta[16];
    Media* media = nullptr;  // of the tile; null: nobody asks
    std::uint32_t within[16], beyond[16];
    Lanes3 exact, error;  // as HitPoint has them; filled by findPoints
    bool pointsFound = false;
    Lanes3 radiance;  // the result: emission and reflected light of lights

    Hit hit(int lane) const {
        return {distance[lane], hits.instance[lane], hits.triangle[lane], hits.u[lane], hits.v[lane], outside(lane)};
    }
    Vec3f outside(int lane) const { return {hits.normalX[lane], hits.normalY[lane], hits.normalZ[lane]}; }
    /// The share of the lane's own colour that its fog leaves. `place` is that of the hit.
    float fogLeft(const TraceScene& scene, int lane, const Vec3f& position, float run) const {
        const Mesh& mesh = *scene.world->instance(hits.instance[lane]).mesh;
        return scene.fogs.of(lights[lane]).left(mesh, hits.triangle[lane], hits.u[lane], hits.v[lane], position, run);
    }
    /// The share of light that a PhysicalMaterial reflects along one ray, without its diffuse part.
    Vec3f gloss(int lane, float cosView) const {
        const Vec3f f0 = glm::mix(Vec3f(0.04f), base.get(lane), metallic[lane]);
        const float smooth = 1 - roughness[lane];
        return fresnelSchlick(f0, cosView) * (smooth * smooth);
    }
    /// The start of rays that a surface reflects or bends.
    HitPoint point(int lane) const { return {exact.get(lane), error.get(lane), outside(lane)}; }
};

}  // namespace rtsg::trace
