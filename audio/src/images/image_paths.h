// The ways from a listener to mirror images of a source, followed through the walls of a room.
//
// Threading: const once made; follow() may be called on several threads at once.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include <glm/glm.hpp>

#include <rtsg/audio/acoustic_geometry.h>
#include <rtsg/audio/echogram.h>

#include "image_candidates.h"

namespace rtsg::trace {

class ImagePaths {
  public:
    /// `source`: where it is, itself. Ways of more than `maxOrder` reflections, or whose walls leave less than
    /// `minFraction` of the energy, are none.
    ImagePaths(const AcousticGeometry& geometry, const glm::dvec3& source, int maxOrder, double minFraction);
    ~ImagePaths();

    struct Asked {
        glm::dvec3 from;
        const ImageCandidate* image = nullptr;
        std::vector<Arrival>* found = nullptr;  // gets energies and orders of the ways that there are
    };
    /// Sixteen at a time.
    void follow(std::span<const Asked> asked) const;

  private:
    struct Impl;
    std::unique_ptr<const Impl> impl_;
};

}  // namespace rtsg::trace
