// Images of a moving source that are rendered one by one. Their positions follow the source; their energies and
// visibility stay as traced. For diffracted sound see followed_edges.h.
//
// Threading: pure functions.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include <rtsg/audio/echogram.h>

#include "signal/convolver.h"

namespace rtsg {

struct FollowedEdge;

struct FollowedImage {
    /// boundary: an image by a face of `edge`, which is heard while it is in the light as it was not when it was
    /// traced, and taken away while it is in the shadow as it was not.
    enum class Kind : std::uint8_t { image, edge, boundary };
    Kind kind = Kind::image;
    std::shared_ptr<const FollowedEdge> edge;  // of an edge or a boundary
    std::size_t face = 0;                      // of a boundary: 0 or 1
    std::size_t arrival = 0;                   // which of the echogram's, or which of its waves
    glm::dmat3 rotation{1.0};
    glm::dvec3 offset{0};  // the image of a source at p is at turn * p + offset
    /// Pressure at one metre from the image, where all bands have the same; else that is the filter's.
    double pressure = 1;
    bool filtered = false;
    Convolver::Response filter;  // causal, of one block; the first is heard at once (minimum phase)

    glm::dvec3 at(const glm::dvec3& source) const { return rotation * source + offset; }
};

/// The loudest images, direct sound not counted, at most `most`, none of less than a thousandth of the energy of all.
std::vector<FollowedImage> followedImages(const Echogram& echogram, const glm::dvec3& source,
                                          const glm::dvec3& listener, double speedOfSound, int sampleRate,
                                          std::size_t block, std::size_t maximum);

/// Its pressure at one metre, in octave bands.
void setAmplitudes(FollowedImage& image, const Bands& amplitudes, int sampleRate, std::size_t block);

/// The echogram that is left when these images are rendered for themselves.
Echogram without(const Echogram& echogram, const std::vector<FollowedImage>& images);

/// A response of `length` samples whose spectrum has these amplitudes in octave bands, and no more delay than it needs.
std::vector<float> minimumPhase(const Bands& amplitudes, int sampleRate, std::size_t length);

}  // namespace rtsg
