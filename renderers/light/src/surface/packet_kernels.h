// Kernels that treat all lanes of a packet alike, in registers as wide as the machine's: 16 floats with AVX-512, else
// 8.
//
// Invariant: bit for bit the same numbers at either width. The code is one template (packet_kernels_impl.h), compiled
// in two units, of which one is for x86-64-v4: that one must share no inline functions with others, or the linker might
// give everyone its version. Threading: re-entrant. Source: ISO/IEC 19775-1 V4.0 17.2.2 (lighting).
#pragma once

#include <cstdint>

#include "lanes3.h"
#include "lighting/trace_scene.h"

namespace rtsg::trace {

struct SurfacePacket;

/// The light that one light sends to sixteen points.
struct alignas(64) Incoming {
    Lanes3 direction;              // towards the light, unit
    alignas(64) float factor[16];  // attenuation times spot; 0 where the light does not reach
    alignas(64) float cosine[16];  // to the shading normal, at least 0
    alignas(64) float distance[16];
    Lanes3 visible;  // share that shadows leave
};

/// A camera's rays through a block of four by four pixels.
struct PixelBlock {
    float x, y;  // of the first pixel's upper left corner, from the picture's middle, which stays exact
    /// That middle at distance 1, and how far apart pixels are there.
    float middleX, across, middleY, down;
    Vec3f eye, right, up, forward;
    float tMax;
};

/// The authored normals of a mesh, and where they come to stand.
struct NormalSource {
    const float* values;
    const std::int32_t* index;               // null: each corner has the value of its number
    std::uint32_t triangleStep, cornerStep;  // as MeshAttribute has them
    glm::mat3 normalFromLocal;
};

struct PacketKernels {
    /// Makes rays through these points of the pixels, [0, 1)^2, for the lanes in `active`.
    void (*makeRays)(const PixelBlock& block, std::uint32_t active, const float* u, const float* v, RayPacket16& rays);
    /// Sets `normal` to the true surfaces' normals.
    void (*useOutside)(SurfacePacket& surfaces);
    /// Into `normal`, in the frame and the order of mesh normals, of any length, in the lanes of `lanes`; the others
    /// keep theirs, unless these are all that hit something.
    void (*fetchNormals)(const NormalSource& source, std::uint32_t lanes, SurfacePacket& surfaces);
    /// Places, directions, unit normals on the viewer's side, distances and which lanes see the back.
    void (*finishGeometry)(const RayPacket16& rays, SurfacePacket& surfaces);
    /// The same material for all lanes.
    void (*fillAll)(const Material& material, const Material::Linear& colors, float coverage, float opacity,
                    SurfacePacket& surfaces);
    /// `exact` and `error` of the lanes of `lanes`, which lie on this instance's mesh.
    void (*findPoints)(const RayInstance& instance, const Vec3f* positions, const std::int32_t* triangles,
                       std::uint32_t stride, std::uint32_t lanes, SurfacePacket& surfaces);
    /// Sets `radiance` to the light that the surfaces emit.
    void (*addOwn)(SurfacePacket& surfaces);
    /// Computes the light from a light that is no projector. Returns whether any lane is lit at all.
    bool (*gather)(const TraceLight& light, const SurfacePacket& surfaces, Incoming& in);
    /// The lanes whose pixel the light's shadow would change by less than `least`. `shares`: the weight of a lane's
    /// colour in its pixel.
    std::uint32_t (*faint)(const TraceLight& light, const Incoming& in, const float* weights, float minimum, bool shiny,
                           const SurfacePacket& surfaces);
    /// Rays from the lanes of `mask` that the light may reach to it; `behind`: of these the ones whose own true surface
    /// lies between. Returns the lanes.
    std::uint32_t (*shadowRays)(const TraceLight& light, const SurfacePacket& surfaces, const Incoming& in,
                                std::uint32_t mask, RayPacket16& rays, std::uint32_t& behind);
    /// Adds the light of `in` that the lanes of `mask` reflect to `radiance`.
    void (*addPhong)(const TraceLight& light, const Incoming& in, std::uint32_t mask, bool shiny,
                     SurfacePacket& surfaces);
    void (*addPhysical)(const TraceLight& light, const Incoming& in, std::uint32_t mask, SurfacePacket& surfaces);
    /// gather() and addPhong() in one, where nothing casts a shadow.
    void (*shinePhong)(const TraceLight& light, std::uint32_t mask, bool shiny, SurfacePacket& surfaces);
    /// Adds radiance and 1 to the pixels of a block whose first one is at `pixels`; rows are kTileSide pixels apart.
    void (*addToPixels)(const SurfacePacket& surfaces, std::uint32_t mask, float* pixels);
};

/// For this machine.
const PacketKernels& packetKernels();
/// 8 wide, which every machine can.
const PacketKernels& packetKernels8();
/// 16 wide; null where this build or machine has none.
const PacketKernels* packetKernels16();

}  // namespace rtsg::trace
