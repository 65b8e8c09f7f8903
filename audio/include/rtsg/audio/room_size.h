// RoomSize: volume and surfaces of the room around a place, and the reverberation times that follow from them.
//
// Measured by rays, so that no closed mesh is needed and only surfaces that sound reaches are counted. Rays that every
// surface scatters by Lambert's law hit surfaces in proportion to their areas, and points on their paths are spread
// evenly over the room. The volume is the mean volume seen from such points, divided by the share of pairs of points
// that see each other. The surface is four times the volume divided by the mean free path. Both are accurate to half a
// per cent in a single room, and to some per cent in rooms that are coupled by small doors. Threading: pure functions
// over data that may be read on any thread. Source: Kosten, Acustica 10 (1960), on mean free paths; Sabine 1900;
// Eyring, JASA 1 (1930), 217.
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
        double area = 0;             // m^2, both sides of two-sided surfaces
    };
    double volume = std::numeric_limits<double>::quiet_NaN();  // m^3
    double surface = volume;                                   // m^2, openings included
    double openings = 0;                                       // m^2 of openings, through which rays left
    std::vector<Surface> surfaces;                             // the largest first
    AcousticBox box;                                           // of all hits
    /// Some points in the room, spread evenly.
    std::vector<glm::dvec3> positions;

    bool known() const { return volume > 0; }
    /// Mean distance between two reflections, m.
    double meanFreePath() const { return 4 * volume / surface; }
};

/// Measures the room around a point that touches no wall. Nothing is known if more than a quarter of the rays leave:
/// then there is no room.
RoomSize measureRoom(const AcousticGeometry& geometry, const glm::dvec3& inside);

/// Equivalent absorption area, m^2, without air; transmission counts as absorption.
Bands absorptionArea(const RoomSize& room, std::span<const AcousticMaterial> materials);
/// Reverberation times, s, air included; NaN if the room is not known or the sound never decays.
Bands sabineTimes(const RoomSize& room, std::span<const AcousticMaterial> materials, const Air& air);
Bands eyringTimes(const RoomSize& room, std::span<const AcousticMaterial> materials, const Air& air);

}  // namespace rtsg
