// What one edge does to the sound between two places: waves, and shares of energies of octaves.
//
// Threading: pure functions.
#pragma once

#include <array>
#include <cstdint>

#include <rtsg/audio/echogram.h>

#include "body_weights.h"
#include "edge_ends.h"
#include "edge_tones.h"

namespace rtsg {

/// Whether direct sound was found, and the mirror image that ends at this edge.
struct Found {
    bool direct = false, mirrored = false;
};

struct EdgeShares {
    /// Factors of the energies that are there already, where the shortest way leads by the edge; means over each
    /// octave.
    Bands direct{}, mirrored{};
    Bands own{};                   // of an arrival by way of the edge, times 4 pi m^2
    EdgeWave wave;                 // by the shortest way, before air and the source's pattern; nothing if it leads past
    std::array<EdgeWave, 2> ends;  // by the ends
};

/// `weights`: how much of it counts, by tone; a body's own mirror image is as much weaker.
EdgeShares edgeSharesOf(const RoundEdge& round, const std::array<EdgeEnd, 2>& ends, std::uint32_t material,
                        const EdgeTones& tones, Found found, const BodyWeights::Tones& weights);

/// Grazing an edge it is chance whether direct sound is found.
bool grazesShadow(const WedgePath& path);
/// Image sources are looked for from a little aside: next to its boundary one may be found that ought not to be.
bool grazesImage(const WedgePath& path);
/// In the plane of a face of the edge is the source or the receiver.
bool grazesFace(const WedgePath& path);
/// The angle that the mirror image by the nearer face is seen under.
double imageAngle(const WedgePath& path);
/// Whether the receiver is not in the edge's shadow, and whether the face mirrors sound to it: by angles alone.
bool isLit(const WedgePath& path);
bool isMirrored(const WedgePath& path);

}  // namespace rtsg
