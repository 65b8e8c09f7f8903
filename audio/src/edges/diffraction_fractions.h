// Finds the waves that one edge makes of the sound between two places, and the parts of them that belong to a mirror
// image.
//
// Threading: pure functions.
#pragma once

#include <array>
#include <cstdint>

#include <glm/glm.hpp>

#include <rtsg/audio/echogram.h>

#include "diffraction_ends.h"
#include "diffraction_small_bodies.h"
#include "response/edge_tones.h"

namespace rtsg {

/// Pressures re the phases of their ways, before air and the source's pattern.
struct EdgeFractions {
    EdgeTonePressures wave{};                 // by the shortest way; nothing if it leads past the edge
    std::array<EdgeTonePressures, 2> ends{};  // by the ends
    /// The parts of these that make mirror images continuous, in the same order: the wave, and the ends.
    std::array<EdgeTonePressures, 3> mirrored{};
};

/// `weights`: how much of it counts, by tone; a body's own mirror image is as much weaker.
EdgeFractions edgeFractionsOf(const RoundEdge& round, const std::array<EdgeEnd, 2>& ends, std::uint32_t material,
                              const EdgeTones& tones, const BodyWeights::Tones& weights);

/// Next to its boundary it is chance whether direct sound is found.
bool grazesShadow(const WedgePath& path);
/// Image sources are looked for from a little aside: next to its boundary one may be found that ought not to be.
bool grazesImage(const WedgePath& path);
/// In the plane of a face of the edge is the source or the receiver.
bool grazesFace(const WedgePath& path);
/// The angle that the mirror image by the nearer face is seen under.
double imageAngle(const WedgePath& path);
/// The source's mirror image by the nearer face.
glm::dvec3 imagePosition(const WallEdge& edge, const RoundEdge& round, const glm::dvec3& source);
/// Whether the receiver is not in the edge's shadow, and whether the face mirrors sound to it: by angles alone.
bool isLit(const WedgePath& path);
bool isMirrored(const WedgePath& path);

}  // namespace rtsg
