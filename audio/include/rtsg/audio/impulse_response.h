// From an Echogram to a pressure impulse response.
//
// Pressure 1 is the pressure of the source at 1 m in a free field: direct sound at distance d has amplitude 1 / d, and
// a band's energy E (see Echogram) becomes a squared pressure of 4 pi E. Arrivals become band-limited impulses at
// fractional sample times. The rest becomes Gaussian noise, the same in all bands, with the energy of each bin in the
// mean; it is the same for the same seed, and channels of one response are uncorrelated. Diffracted waves are left out
// if together they are 40 dB below the total in every octave. Bands are weighted by zero-phase filters that add up to
// 1, so a signal that is equal in all bands passes unchanged. Filters of high order ring for some milliseconds before
// an impulse where bands differ. Threading: pure functions.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <glm/glm.hpp>

#include <rtsg/audio/echogram.h>
#include <rtsg/audio/hrtf.h>

namespace rtsg {

struct ImpulseResponse {
    int sampleRate = 48000;
    std::vector<std::vector<float>> channels;  // of equal length: mono; left and right; ambisonic ones in ACN order

    std::size_t frames() const { return channels.empty() ? 0 : channels.front().size(); }
};

struct ImpulseResponseOptions {
    enum class Channels : std::uint8_t {
        mono,       // pressure at the listener
        stereo,     // arrivals panned by their direction; sound from ahead has the full pressure in both
        binaural,   // through a head: an HRTF, or a sphere
        ambisonic,  // AmbiX (ACN, SN3D); the rest comes evenly from all directions
    };
    Channels channels = Channels::mono;
    int sampleRate = 48000;
    int ambisonicOrder = 1;
    /// The listener's axes in the world frame, orthonormal; stereo uses only the first.
    glm::dvec3 listenerRight{1, 0, 0}, listenerUp{0, 1, 0}, listenerBack{0, 0, 1};
    /// Arrivals below this order are left out: 1 leaves out direct sound, which is then rendered by other means.
    std::uint32_t firstOrder = 0;
    /// The response ends where less than this share of the energy is left in every band.
    double cutFraction = 1e-8;
    double speedOfSound = 343;
    double headRadius = kHeadRadius;  // of binaural sound without an HRTF, metres
    /// Binaural: sound within `hrtfSeconds` of the first arrival goes through this head. Later sound is panned as in
    /// stereo, with the delay of each ear (Woodworth's sphere). Null: a rigid sphere.
    std::shared_ptr<const Hrtf> hrtf;
    double hrtfSeconds = 0.08;
    /// Of the noise, which is another for each seed.
    std::uint64_t seed = 1;
    /// Seeds only choose where it begins in noise that all responses share: for sound that is made anew all the time.
    bool sharedNoise = false;
    /// The length of the response, which is cut or filled up with silence; 0: `cutFraction` says where it ends.
    double seconds = 0;
};

/// A seed for the noise between two points in the world, unlike for other points and other seeds.
std::uint64_t noiseSeed(std::uint64_t seed, const glm::dvec3& source, const glm::dvec3& listener);

ImpulseResponse makeImpulseResponse(const Echogram& echogram, const ImpulseResponseOptions& options);

/// Amplitude weight of band `band` at `hz`; the weights of all bands add up to 1 at every frequency.
double bandWeight(int band, double hz);

}  // namespace rtsg
