// Lists where mirror images of a source may be: candidates by position, each with the last wall of its way.
//
// Every image with a valid path is among them; most of them have none for a given listener.
// Threading: const once found.
#pragma once

#include <cstdint>
#include <vector>

#include <glm/glm.hpp>

#include <rtsg/audio/acoustic_geometry.h>

#include "image_sources.h"

namespace rtsg {
namespace trace {

/// How far an image, or the end of its path, may be from its exact position: walls are given in single precision, so
/// each reflection rotates distant points by some of its roundings.
inline double imageTolerance(int order, double distance) {
    return 2e-6 * (1 + order) * (1 + distance);
}

/// The turn of a reflection.
inline glm::dmat3 mirroring(const glm::dvec3& normal) {
    return glm::dmat3(1.0) - 2.0 * glm::outerProduct(normal, normal);
}

/// Whether two turns are one, but for roundings.
bool alike(const glm::dmat3& a, const glm::mat3& b);

struct ImageCandidate {
    glm::dvec3 position;
    glm::mat3 rotation;       // of the source on its way there
    std::uint32_t lastPlane;  // of one of the ways to get here
    double fraction;          // of energy that is left at best
    bool severalPaths = false;
};

/// Candidates by position.
class ImageCandidateSet {
  public:
    std::vector<ImageCandidate> all;

    /// False when it was there already; `same` is how near the positions of one are.
    bool insert(const glm::dvec3& p, const glm::dmat3& rotation, std::uint32_t lastPlane, double fraction, double same);

  private:
    /// A cell with the last of its candidates; none as long as it is free.
    struct Bucket {
        std::uint64_t cell = 0;
        std::uint32_t newest = kNoPlane;
    };
    /// The bucket of a cell, or the free one where it belongs.
    Bucket& newestIn(std::uint64_t cell);
    void grow();

    std::vector<Bucket> buckets_{64};
    std::vector<std::uint32_t> next_;  // of the same cell
};

/// Whether sound of an image at `p` that passes through the surfaces of `through` can reach those of `next`: both
/// seen from `p` as bounding spheres. Never false for a possible path.
bool canFollow(const glm::dvec3& p, const ReflectingPlane& through, const ReflectingPlane& next);

}  // namespace trace

struct ImageCandidates::Impl {
    trace::ImageCandidateSet set;
    std::size_t mirroredOnce = 1;  // end of those
    ImageSources found;
};

}  // namespace rtsg
