// Makes the waves that pairs of edges diffract.
#include "diffraction_pair_waves.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>

#include "edges/diffraction_paths.h"
#include "edges/diffraction_waves.h"

namespace rtsg {

namespace {

template <class Factors>
void multiply(PairField& field, const Factors& factors) {
    for (std::size_t t = 0; t < kEdgeTones; ++t) {
        field.wave[t] *= factors[t];
        for (FacePair::End& end : field.ends) end.pressure[t] *= factors[t];
    }
}

}  // namespace

void weigh(PairField& field, const BodyWeights::Tones& weights) {
    multiply(field, weights);
}

void weigh(PairField& field, const std::array<std::complex<double>, kEdgeTones>& factors) {
    multiply(field, factors);
}

std::vector<EdgeWave> endWaves(const PairField& field, const glm::dvec3& source, const glm::dvec3& listener,
                               const TraceOptions& options) {
    const Bands attenuation = airAttenuation(options.air);
    std::vector<EdgeWave> waves;
    for (const FacePair::End& end : field.ends) {
        if (end.second == listener || end.first == source) continue;
        EdgeWave wave;
        wave.order = 2;
        wave.seconds = end.pathLength / options.air.speedOfSound;
        wave.direction = glm::normalize(end.second - listener);
        wave.route = {end.first, end.second, glm::dvec3(0), glm::dvec3(0)};
        for (std::size_t t = 0; t < kEdgeTones; ++t) wave.pressure[t] = std::complex<float>(end.pressure[t]);
        weaken(wave.pressure, options.pattern ? options.pattern(glm::normalize(end.first - source)) : 1, attenuation,
               end.pathLength);
        waves.push_back(wave);
    }
    return waves;
}

Bent bentBy(const PairPath& path, const PairField& field, const glm::dvec3& source, const glm::dvec3& listener,
            const TraceOptions& options) {
    const Bands attenuation = airAttenuation(options.air);
    const double length = path.path.pathLength + path.past;
    const glm::dvec3 first = offEnds(*path.first, path.byFirst), second = offEnds(*path.second, path.bySecond);
    Bent bent;
    bent.wave.seconds = length / options.air.speedOfSound;
    bent.wave.order = 2;
    bent.wave.direction = glm::normalize(second - listener);
    // A way that leads past an end goes by that end.
    const auto axisIf = [&](std::size_t e, const WallEdge& edge) {
        return path.fromLow[e] < 0 || path.fromHigh[e] < 0 ? glm::dvec3(0) : edge.axis;
    };
    bent.wave.route = {axisIf(0, *path.first) == glm::dvec3(0) ? first : path.byFirst,
                       axisIf(1, *path.second) == glm::dvec3(0) ? second : path.bySecond, axisIf(0, *path.first),
                       axisIf(1, *path.second)};
    const auto sentTo = [&](const glm::dvec3& by) {
        return options.pattern ? options.pattern(glm::normalize(by - source)) : 1.0;
    };
    const double sent = sentTo(first);
    for (std::size_t t = 0; t < kEdgeTones; ++t) bent.wave.pressure[t] = std::complex<float>(field.wave[t]);
    weaken(bent.wave.pressure, sent, attenuation, length);
    bent.ends = endWaves(field, source, listener, options);
    return bent;
}

void EndWaves::add(const EdgeWave& wave) {
    const double rounding = 1e-6 + 2 * positionRounding(wave.route.first);
    const auto known = std::ranges::find_if(waves_, [&](const EdgeWave& one) {
        return glm::distance(one.route.first, wave.route.first) <= rounding &&
               glm::distance(one.route.last, wave.route.last) <= rounding &&
               std::abs(one.seconds - wave.seconds) <= 1e-8 + 1e-7 * wave.seconds;
    });
    if (known == waves_.end()) {
        waves_.push_back(wave);
        return;
    }
    for (std::size_t t = 0; t < kEdgeTones; ++t) known->pressure[t] += wave.pressure[t];
}

}  // namespace rtsg
