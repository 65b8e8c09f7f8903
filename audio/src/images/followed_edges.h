// Diffracted waves that are rendered one by one while source and listener move.
//
// Their delays are those of the shortest paths over their edges. The diffraction of a single edge is known for all
// positions (diffraction_wedge.h), and the weights of a PoleBank are fitted to it. Everything else stays as traced.
// Threading: pure functions.
#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <vector>

#include <glm/glm.hpp>

#include <rtsg/audio/echogram.h>
#include <rtsg/audio/trace_result.h>

#include "edges/diffraction_route.h"
#include "followed_images.h"
#include "signal/pole_bank.h"

namespace rtsg {

struct FollowedEdge {
    EdgeRoute route;
    BendingEdge bends;      // if opening > 0
    double pathLength = 0;  // metres, when it was traced
    double speedOfSound = 343;
    Bands colour{};  // amplitudes of the sound over the edge, with the directivity of the source and the absorption of
                     // air
    std::shared_ptr<const PoleFit> fit;
    /// The part that no closed form gives for other places: it stays as it was.
    PoleBank::Weights rest{};
    std::array<bool, 2> mirrored{};  // whether the image by either face was in the light

    /// Finds the weights of a wave's filter bank. `heard` says whether direct sound is heard, which right at the
    /// boundary decides on which side of it one is. False where the closed form says nothing, as within the wedge.
    bool weightsAt(const glm::dvec3& source, const glm::dvec3& listener, bool heard, PoleBank::Weights& weights) const;
    /// The gain of the image by face 0 or 1 of a single edge: 1 if it is in the light and was not, -1 if it was and is
    /// not, else 0.
    double boundaryGain(std::size_t face, const glm::dvec3& source, const glm::dvec3& listener) const;
};

/// The strongest waves, at most `most`, none of less than a hundred thousandth of the energy of all; and the images by
/// the faces of their edges, for as long as these have been in the light or in the shadow only since the trace.
void addFollowedEdges(const Echogram& echogram, const glm::dvec3& source, const glm::dvec3& listener,
                      const TraceOptions& options, int sampleRate, std::size_t block, std::size_t maximum,
                      std::vector<FollowedImage>& followed);

}  // namespace rtsg
