// EdgeWaves as samples: each is a short response of its own, with phases, which octave energies do not have.
//
// Threading: pure functions.
#pragma once

#include <cstddef>
#include <vector>

#include <rtsg/audio/echogram.h>
#include <rtsg/audio/impulse_response.h>

namespace rtsg {

/// By the share of energy that the source sends that way, and by the absorption of air along `way` metres, see
/// airAttenuation().
void weaken(EdgeTonePressures& pressure, double sent, const Bands& attenuation, double pathLength);

/// The wave that comes straight from a place to the listener, still without its pressure.
EdgeWave straightWave(const glm::dvec3& from, const glm::dvec3& listener, double speedOfSound);

/// Whether every tone is 80 dB below sound in the open after `way` metres.
bool isFaint(const EdgeTonePressures& pressure, double pathLength);

/// Samples that the response of a wave takes from its delay on.
std::size_t edgeWaveFrames(int sampleRate);

/// Adds them to the channels of a response; samples beyond the ends of the channels are cut off.
void addEdgeWaves(const Echogram& echogram, const ImpulseResponseOptions& options,
                  std::vector<std::vector<float>>& channels);

}  // namespace rtsg
