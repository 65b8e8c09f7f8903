// Levels of octaves of what edges and round bodies bend, from the pressures of its waves.
//
// The energy of an octave is the mean over its tones of all pressures as one, each tone standing for a fifth of an
// octave: what two waves do to each other counts as far as that is not averaged away where one comes later than the
// other. Mirror images add to direct sound, and to each other, as energies, as they do without edges; an image is one
// with those parts of waves that go on into it beyond its boundary. Of all that, it is for itself as far as it is
// whole: what little is left of an image, and what a narrow mirror throws back, is one with direct sound. So levels are
// as continuous as pressures are. Threading: pure functions.
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

/// Sets the energies of direct sound and mirror images that something bends, and adds arrivals of the waves; sorts by
/// time. `arrivals`: what comes straight or mirrored.
void setLevels(const glm::dvec3& source, const glm::dvec3& listener, double speedOfSound, const BentParts& parts,
               std::vector<Arrival>& arrivals, EdgeField& field);

}  // namespace rtsg
