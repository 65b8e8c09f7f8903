// Room openings: where energy escapes from a room: holes in a mesh, cracks between shapes, doors, windows.
//
//     TraceOptions options{.exits = 64};
//     const TraceResult traced = tracer.trace(source, listener, options);
//     const RoomOpenings found = geometry.openings(source, traced.exits, traced.escaped);
//
// A ray that escaped is followed to a point from which a tenth of all directions lead out. From there other rays find
// the rim of the opening, between the last ray that goes out and the first that does not. So an opening need not be
// part of a mesh. If the rim is the open boundary of one mesh, this boundary is the exact outline. Openings are found
// one after the other, until each ray has gone through one. Shapes that transmit sound count as closed here.
// Threading: pure functions over data that may be read on any thread.
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

/// A ray that left the geometry: its last hit, and the share of its energy that it still carried.
struct EscapedRay {
    glm::dvec3 origin{0}, direction{0, 0, 1};  // world; unit
    Bands energy{};
};

struct RoomOpening {
    struct Beside {
        NodeId shape, geometry;
        AcousticBox box;   // of the shape, in the world
        std::string name;  // given by the author, or else of its material; set in reports (SoundRenderer) only
    };
    /// Small compared with the room, and so hardly intended: less than a hundredth of V^(2/3) and half a square metre,
    /// narrower than 3 cm, or one triangle of a mesh. V: the volume seen from the source.
    bool leak = false;
    glm::dvec3 center{0}, normal{0, 0, 1};  // of its area; unit, outwards
    double length = 0, width = 0;           // m, along its longest axis and across
    double area = 0;                        // m^2, of its flat part
    /// The number of straight edges if it is the open boundary of a mesh; 0: it is not, and was found by rays only.
    std::size_t boundaryEdges = 0;
    std::vector<Beside> beside;  // largest part of the rim first, three at most
    /// The share of the emitted energy that leaves here, by band, and the 95 % half width of its mean over bands. With
    /// few rays the interval is asymmetric, and this is its wider side.
    Bands fraction{};
    double fractionCi95 = 0;
    std::size_t rays = 0;  // number of the known rays that went through it

    double meanFraction() const;
};

struct RoomOpenings {
    std::vector<RoomOpening> openings;  // largest share first
    /// More than three tenths of the source's view is sky: this is no room, and no openings were looked for.
    bool outdoors = false;
    /// Shares of the emitted energy, mean over bands: all that escaped, and the part that left by none of `openings`:
    /// through shapes that transmit sound, through too many or too small openings, or from where the sky is.
    double escaped = 0, elsewhere = 0;
};

/// `exits`: some of the rays that escaped, each chosen with the same probability; `escaped`: the share of all energy
/// that escaped. Takes some ten thousand rays an opening.
RoomOpenings findRoomOpenings(const RayView& rays, const glm::dvec3& source, std::span<const EscapedRay> exits,
                              const Bands& escaped);

}  // namespace rtsg
