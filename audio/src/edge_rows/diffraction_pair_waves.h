// Waves of pairs of edges.
//
// Threading: pure functions; EndWaves one thread per object.
#pragma once

#include <array>
#include <complex>
#include <vector>

#include <glm/glm.hpp>

#include <rtsg/audio/echogram.h>
#include <rtsg/audio/trace_result.h>

#include "diffraction_pair_path.h"
#include "edges/diffraction_small_bodies.h"

namespace rtsg {

/// Factors of all that it has, by tone.
void weigh(PairField& field, const BodyWeights::Tones& weights);
void weigh(PairField& field, const std::array<std::complex<double>, kEdgeTones>& factors);

/// The waves from the ends of edges along faces.
std::vector<EdgeWave> endWaves(const PairField& field, const glm::dvec3& source, const glm::dvec3& listener,
                               const TraceOptions& options);

/// The waves that both edges bend.
struct Bent {
    EdgeWave wave;
    std::vector<EdgeWave> ends;
};

Bent bentBy(const PairPath& path, const PairField& field, const glm::dvec3& source, const glm::dvec3& listener,
            const TraceOptions& options);

/// Ends of pairs by the places on both edges: where two pairs meet at a corner, nothing is left.
class EndWaves {
  public:
    void add(const EdgeWave& wave);
    const std::vector<EdgeWave>& waves() const { return waves_; }

  private:
    std::vector<EdgeWave> waves_;
};

}  // namespace rtsg
