// TextureLanes: does the look-ups of TextureLookup for lanes of one instance and one material, eight lanes at a time.
//
// Invariant: a lane's result does not depend on other lanes, and is the same, bit for bit, as that of TextureLookup.
// Threading: one thread. The objects that it refers to must outlive it.
#pragma once

#include <cstdint>

#include "lanes.h"
#include "surface_packet.h"
#include "texture_lookup.h"

namespace rtsg::trace {

class TextureLanes {
  public:
    struct alignas(64) Colors {
        float r[16], g[16], b[16], a[16];
    };
    TextureLanes(const TraceScene& scene, const RayInstance& instance, const SlotShading& slot, ColorSpace space,
                 const PathTask* tasks, std::uint32_t lanes, const SurfacePacket& surfaces)
        : scene_(scene), instance_(instance), slot_(slot), space_(space), lanes_(lanes), s_(surfaces) {
        findFootprints(tasks);
    }

    /// Precondition: the material has a texture for this role. Lanes that do not count hold rubbish.
    void look(const Material& material, TextureRole role, Colors& out);
    /// The look-up of a single lane.
    TextureLookup lookup(int lane, LastStretch* last) const {
        return {instance_,           slot_, s_.hit(lane), footprint_[lane], space_, &scene_, s_.position.get(lane),
                s_.normal.get(lane), last};
    }

  private:
    /// Corners of the triangles of eight lanes.
    struct Corners {
        simd::F8 s[3], t[3];
        simd::V8 positions[3];  // in the mesh's frame
    };
    void findFootprints(const PathTask* tasks);
    /// Whether the mesh has numbers for (s, t) of this channel at its vertices or corners.
    bool isPlain(std::size_t channel) const;
    /// Into `coordinates_` and `size_`.
    void findCoordinates(std::size_t channel);
    Corners corners(std::size_t channel, int at) const;
    void lookTogether(const TextureUse& use, Colors& out) const;

    const TraceScene& scene_;
    const RayInstance& instance_;
    const SlotShading& slot_;
    const ColorSpace space_;
    const std::uint32_t lanes_;
    const SurfacePacket& s_;
    alignas(64) float footprint_[16];  // metres, of pixels on the surface
    std::size_t channel_ = SIZE_MAX;   // of the next three
    alignas(64) float given_[2][16];   // (s, t) before any transform
    alignas(64) float size_[16];       // as LastStretch::value, flat
    alignas(64) float divisor_[16];    // of (s, t) after it
};

}  // namespace rtsg::trace
