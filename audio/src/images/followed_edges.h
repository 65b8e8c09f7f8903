// Waves by way of edges, for who renders each of them for itself while source and listener move.
//
// Their delays are those of the shortest ways by their edges. What a single edge bends is known for every place: its
// field relative to its delay is a sum of four functions W(w t) = exp(i w t) erfc(sqrt(i w t)), one for each boundary
// of light and shadow, where t is 0 and its sign turns over (see diffraction_wedge.h; Macdonald's solution for a half
// plane). W is a sum of low passes: the integral of 2 / sqrt(pi^3) D(sqrt(p t)) / (p + i w) over p, D being Dawson's
// function. So the weights of a PoleBank follow from t by one product with a matrix. All else is as it was when it was
// traced. Threading: pure functions.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include <glm/glm.hpp>

#include <rtsg/audio/echogram.h>
#include <rtsg/audio/trace_result.h>

#include "edges/diffraction_route.h"
#include "followed_images.h"
#include "signal/pole_bank.h"

namespace rtsg {

struct FollowedEdge {
    static constexpr std::size_t kLowPasses = 31, kColumns = kLowPasses + 1;  // the last: what is let through as it is

    EdgeRoute route;
    BendingEdge bends;  // if opening > 0
    double way = 0;     // metres, when it was traced
    double speedOfSound = 343;
    /// From low passes to weights: of what is beside direct sound, and beside what the faces mirror.
    using Makes = std::array<PoleBank::Weights, kColumns>;
    std::array<Makes, 2> makes;
    /// What is not known for other places, as it was.
    PoleBank::Weights rest{};
    std::array<bool, 2> mirrored{};  // whether the image by either face was in the light

    /// What the bank of a wave weighs; `heard`: whether direct sound is, which right at the boundary decides on which
    /// side of it one is. False where the closed form says nothing, as within the wedge.
    bool weightsAt(const glm::dvec3& source, const glm::dvec3& listener, bool heard, PoleBank::Weights& weights) const;
    /// Of the image by face 0 or 1 of a single edge: 1 if it is in the light and was not, -1 the other way round.
    double boundaryGain(std::size_t face, const glm::dvec3& source, const glm::dvec3& listener) const;
};

/// The strongest waves, at most `most`, none of less than a hundred thousandth of the energy of all; and the images by
/// the faces of their edges, for as long as these have been in the light or in the shadow only since the trace.
void addFollowedEdges(const Echogram& echogram, const glm::dvec3& source, const glm::dvec3& listener,
                      const TraceOptions& options, int sampleRate, std::size_t block, std::size_t most,
                      std::vector<FollowedImage>& followed);

}  // namespace rtsg
