// ProbeRay: a ray that explores a room and carries no sound. Threading: a plain value.
#pragma once

#include <algorithm>

#include <glm/glm.hpp>

#include <rtsg/audio/acoustic_geometry.h>

#include "response/band_classes.h"
#include "response/directions.h"

namespace rtsg::trace {

struct ProbeRay {
    glm::dvec3 origin, direction, facing{0};
    std::uint32_t plane = kNoPlane;
    Bands energy{};  // by class of bands
    double metres = 0;

    double maximum() const { return *std::max_element(energy.begin(), energy.end()); }
    /// Goes to a wall, loses the absorbed share there, and continues at random in proportion to the shares of energy.
    void meet(const AcousticHit& hit, const AcousticMaterial& material, const BandClasses& classes, Random& random) {
        double scattered = 0, mirrored = 0, through = 0;
        for (std::size_t c = 0; c < classes.count; ++c) {
            const std::size_t b = classes.first[c];
            scattered += energy[c] * material.reflected(b) * material.scattering[b];
            mirrored += energy[c] * material.mirrored(b);
            through += energy[c] * material.transmission[b];
            energy[c] *= 1 - material.absorption[b];
        }
        metres += hit.distance;
        origin += direction * hit.distance;
        plane = hit.plane;
        const double choice = random.uniform() * (scattered + mirrored + through);
        const double cosine = glm::dot(direction, hit.normal);
        facing = cosine > 0 ? -hit.normal : hit.normal;
        if (choice < scattered)
            direction = cosineDirection(facing, random);
        else if (choice < scattered + mirrored)
            direction -= hit.normal * (2 * cosine);
        else
            facing = -facing;
    }
};

}  // namespace rtsg::trace
