// Exact specular reflections: mirror images of a source, each checked against the geometry.
//
// Candidates are found breadth first. Candidates that are the same motion of the source (same orientation and position)
// are merged. Two orders of the same walls that give one image (in a box nearly all do) are one candidate; a source and
// its image in the wall that it touches are two. A candidate is valid if the mirror path that leaves the listener
// towards it ends in the source after the same motion. So nothing is counted twice, and no valid path of the given
// order is missed. Paths pass straight through walls that transmit sound; this does not count in the order. For points
// on walls see response/listening_positions.h. Source: Allen and Berkley 1979; Borish 1984; differs in the merging and
// in the check by retracing. Threading: pure function over const geometry.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <vector>

#include <glm/glm.hpp>

#include <rtsg/audio/acoustic_geometry.h>
#include <rtsg/audio/echogram.h>

namespace rtsg {

struct ImageSourceOptions {
    int maxOrder = 3;
    /// Paths longer than this are left out; metres.
    double maxDistance = std::numeric_limits<double>::infinity();
    /// An order that would exceed this number of candidates is not begun; `order` of the result tells which was the
    /// last.
    std::size_t maxCandidates = 200'000;
    /// Paths are not followed once their walls leave less than this share of the energy.
    double minFraction = 1e-7;
    /// The radius of a ball around the listener, metres. An image of second or higher order counts as the mean over
    /// places in this ball, as far as these are seen from the listener. 0: it counts at the listener only.
    double ball = 0;
    SourcePattern pattern = {};
};

struct ImageSources {
    /// The highest order that is complete.
    int order = 0;
    /// Whether no higher order has an image, so that all specular paths are found.
    bool complete = false;
    std::size_t candidates = 0;
    /// Sorted by time; direct sound included when it is not blocked.
    std::vector<Arrival> arrivals;
};

/// Energies are those of an Echogram; `attenuation` is the air's, 1/m.
ImageSources findImageSources(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener,
                              const ImageSourceOptions& options, double speedOfSound, const Bands& attenuation);

/// The possible positions of images of a source, for any number of listeners. Threading: const once constructed.
class ImageCandidates {
  public:
    /// `source` touches no wall. All options but `maxDistance` and `pattern` are used.
    ImageCandidates(const AcousticGeometry& geometry, const glm::dvec3& source, const ImageSourceOptions& options);
    ImageCandidates(ImageCandidates&&) noexcept;
    ImageCandidates& operator=(ImageCandidates&&) noexcept;
    ~ImageCandidates();

    /// The part of the result of findImageSources() that needs no listener: no arrivals.
    const ImageSources& found() const;

    struct Impl;
    const Impl& impl() const { return *impl_; }

  private:
    std::unique_ptr<Impl> impl_;
};
/// The same with candidates that were found before for the same geometry and options.
ImageSources findImageSources(const AcousticGeometry& geometry, const ImageCandidates& candidates,
                              const glm::dvec3& listener, const ImageSourceOptions& options, double speedOfSound,
                              const Bands& attenuation);

/// The share of energy per band that is left on the straight way: 1 in the open, 0 behind a wall that transmits
/// nothing.
Bands directFraction(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener);

}  // namespace rtsg
