// Octave levels of sound diffracted by edges and round bodies, from the pressures of the waves.
//
// The energy of an octave is the mean over its tones of the squared sum of all pressures. Each tone represents a fifth
// of an octave, over which the interference of two waves is averaged out as their delays differ. Mirror images add to
// direct sound and to each other as energies, as they do without edges; an image is summed as pressure with the waves
// that continue it beyond its boundary. An image counts separately as far as it is complete: the small rest of an
// image, and the reflection of a narrow mirror, are summed with direct sound. So levels are as continuous as pressures
// are. Threading: pure functions.
#pragma once

#include <cstddef>
#include <vector>

#include <glm/glm.hpp>

#include <rtsg/audio/echogram.h>

namespace rtsg {

/// The part of a wave that goes on into a mirror image.
struct ImagePart {
    static constexpr std::size_t kFaint = static_cast<std::size_t>(-1);

    glm::dvec3 image{0};        // place, of the source's mirror image
    Bands whole{};              // its pressure if nothing ended it
    std::size_t wave = kFaint;  // its number; the rest of one that is nothing by itself may be something
    double seconds = 0;
    glm::dvec3 direction{0};  // as of the wave
    EdgeTonePressures pressure{};
};

struct BentParts {
    std::vector<ImagePart> images;
};

/// Sets the energies of direct sound and of mirror images with diffracted waves, adds the waves as arrivals, and sorts
/// by time. `arrivals`: direct and specular ones.
void setLevels(const glm::dvec3& source, const glm::dvec3& listener, double speedOfSound, const BentParts& parts,
               std::vector<Arrival>& arrivals, EdgeField& field);

}  // namespace rtsg
