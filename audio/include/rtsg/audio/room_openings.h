// Room openings: where the energy that escapes from a room goes: holes in a mesh, cracks between shapes, doors,
// windows.
//
//     TraceOptions options{.exits = 64};
//     const TraceResult traced = tracer.trace(source, listener, options);
//     const RoomOpenings found = geometry.openings(source, traced.exits, traced.escaped);
//
// A ray that escaped is followed to where a tenth of all directions lead out; from there the rim of what it went
// through is felt by other rays: the last that goes on and the first that does not. So an opening needs no mesh that
// knows of it. Where the rim is the open boundary of one mesh, that is the outline, exactly. Openings are looked for
// one after the other, until each ray went through one. Shapes that let sound pass are closed here.
// Threading: pure functions over what may be read from any thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include <glm/glm.hpp>

#include <rtsg/audio/acoustic_box.h>
#include <rtsg/audio/bands.h>
#include <rtsg/core/value.h>

namespace rtsg {

class RayView;

/// A ray that left the geometry: from where it met it last, and what it carried (1: all that it was sent with).
struct EscapedRay {
    glm::dvec3 origin{0}, direction{0, 0, 1};  // world; unit
    Bands energy{};
};

struct RoomOpening {
    struct Beside {
        NodeId shape, geometry;
        AcousticBox box;   // of the shape, in the world
        std::string name;  // that the author gave it, or what it is made of; of reports (SoundRenderer) alone
    };
    /// Small beside the room, and so hardly meant: less than a hundredth of V^(2/3) and half a square metre, narrower
    /// than 3 cm, or one triangle of a mesh. V: what the source sees.
    bool leak = false;
    glm::dvec3 center{0}, normal{0, 0, 1};  // of its area; unit, outwards
    double length = 0, width = 0;           // m, along its longest axis and across
    double area = 0;                        // m^2, of its flat part
    /// Straight edges of the open boundary of a mesh that it is; 0: it is none, and was felt by rays alone.
    std::size_t boundaryEdges = 0;
    std::vector<Beside> beside;  // most of the rim first, three at most
    /// The share of the emitted energy that leaves here, by band, and the 95 % half width of its mean over bands. Where
    /// few rays tell, the interval has two unequal sides, and this is the wider one.
    Bands share{};
    double shareCi95 = 0;
    std::size_t rays = 0;  // that went through it, of those that are known

    double meanShare() const;
};

struct RoomOpenings {
    std::vector<RoomOpening> openings;  // largest share first
    /// More than three tenths of what the source sees is sky: this is no room, and nothing was looked for.
    bool outdoors = false;
    /// Shares of the emitted energy, mean over bands: all that escaped, and the part that left by none of `openings`.
    /// That part went through shapes that let sound pass, by places too many or too small, or from where the sky is.
    double escaped = 0, elsewhere = 0;
};

/// `exits`: some of the rays that escaped, each with the same chance; `escaped`: the share of all energy that did.
/// Takes some ten thousand rays an opening.
RoomOpenings findRoomOpenings(const RayView& rays, const glm::dvec3& source, std::span<const EscapedRay> exits,
                              const Bands& escaped);

}  // namespace rtsg
