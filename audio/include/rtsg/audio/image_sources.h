// Exact specular reflections: mirror images of a source, each checked on the geometry.
//
// Candidates are found breadth first and merged when they are the same motion of the source: turned alike and at one
// position. Two orders of the same walls that give one image (in a box nearly all do) are one candidate; a source and
// its image in the wall that it touches are two. A candidate counts when the mirror path that leaves the listener
// towards it ends in the source after the same motion, so nothing is counted twice and no valid path of the given order
// is missed. Paths pass straight through walls that let sound pass; that does not count in the order. Places on walls:
// see response/places.h. Source: Allen and Berkley 1979; Borish 1984; differs in the merging and in the check by
// retracing. Threading: pure function over const geometry.
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

/// How much of the energy that a source radiates alike in all directions it sends towards a unit direction in the
/// world; empty: 1 everywhere.
using SourcePattern = std::function<double(const glm::dvec3& direction)>;

struct ImageSourceOptions {
    int maxOrder = 3;
    /// Paths longer than this are left out; metres.
    double maxDistance = std::numeric_limits<double>::infinity();
    /// When the candidates of an order would exceed this, the order is not begun and `order` of the result says so.
    std::size_t maxCandidates = 200'000;
    /// Paths whose walls leave less than this share of the energy are not followed.
    double minShare = 1e-7;
    /// The radius of a ball around the listener, metres. An image of second or higher order counts as the mean over
    /// places in this ball, as far as these are seen from the listener. 0: it counts as at the listener.
    double ball = 0;
    SourcePattern pattern = {};
};

struct ImageSources {
    /// The highest order that is complete.
    int order = 0;
    /// Whether no order above has any: nothing is left to others.
    bool complete = false;
    std::size_t candidates = 0;
    /// Sorted by time; direct sound included when it is not blocked.
    std::vector<Arrival> arrivals;
};

/// Energies are those of an Echogram; `attenuation` is the air's, 1/m.
ImageSources findImageSources(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener,
                              const ImageSourceOptions& options, double speedOfSound, const Bands& attenuation);

/// The places where images of a source may be, for any number of listeners. Threading: const once made.
class ImageCandidates {
  public:
    /// `source` touches no wall; of the options all but `maxDistance` and `pattern` count.
    ImageCandidates(const AcousticGeometry& geometry, const glm::dvec3& source, const ImageSourceOptions& options);
    ImageCandidates(ImageCandidates&&) noexcept;
    ImageCandidates& operator=(ImageCandidates&&) noexcept;
    ~ImageCandidates();

    /// The result of findImageSources() as far as it is known without a listener: no arrivals.
    const ImageSources& found() const;

    struct Impl;
    const Impl& impl() const { return *impl_; }

  private:
    std::unique_ptr<Impl> impl_;
};
/// The same as above, with candidates that were found before with the same geometry and options.
ImageSources findImageSources(const AcousticGeometry& geometry, const ImageCandidates& candidates,
                              const glm::dvec3& listener, const ImageSourceOptions& options, double speedOfSound,
                              const Bands& attenuation);

/// Share of the energy per band that is left on the straight way: 1 in the open, 0 behind a wall that lets nothing
/// through.
Bands directShare(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener);

}  // namespace rtsg
