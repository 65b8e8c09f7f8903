// RoomSize: volume and surfaces of the room around a place, and the reverberation times that follow from them.
//
// Found by rays, so that it needs no closed mesh and counts what sound reaches and nothing else. Rays that every
// surface scatters by Lambert's law meet all surfaces alike, in proportion to their areas, and places on their way are
// spread evenly over the room. From such places the volume is that which is seen, over the share of places that see
// each other; the surface is four times it over the mean way between two walls. Both are good to half a per cent in one
// room, and to some per cent where rooms are coupled by small doors. Threading: pure functions over what may be read
// from any thread. Source: Kosten, Acustica 10 (1960), on mean free paths; Sabine 1900; Eyring, JASA 1 (1930), 217.
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include <glm/glm.hpp>

#include <rtsg/audio/acoustic_box.h>
#include <rtsg/audio/acoustic_geometry.h>
#include <rtsg/audio/bands.h>

namespace rtsg {

struct RoomSize {
    struct Surface {
        std::uint32_t material = 0;  // of the geometry
        double area = 0;             // m^2, both sides of what has two
    };
    double volume = std::numeric_limits<double>::quiet_NaN();  // m^3
    double surface = volume;                                   // m^2, openings included
    double openings = 0;                                       // m^2 of them, by which rays left
    std::vector<Surface> surfaces;                             // the largest first
    AcousticBox box;                                           // of what was met
    /// Some places in it, spread evenly.
    std::vector<glm::dvec3> places;

    bool known() const { return volume > 0; }
    /// m: mean way of sound between two walls.
    double meanFreePath() const { return 4 * volume / surface; }
};

/// Around a place that touches no wall. Nothing is known where more than a quarter of the rays leave: that is no room.
RoomSize measureRoom(const AcousticGeometry& geometry, const glm::dvec3& inside);

/// Equivalent absorption area, m^2, without air; what lets sound pass takes it, too.
Bands absorptionArea(const RoomSize& room, std::span<const AcousticMaterial> materials);
/// Reverberation times, s, air included; NaN of what is not known or never decays.
Bands sabineTimes(const RoomSize& room, std::span<const AcousticMaterial> materials, const Air& air);
Bands eyringTimes(const RoomSize& room, std::span<const AcousticMaterial> materials, const Air& air);

}  // namespace rtsg
