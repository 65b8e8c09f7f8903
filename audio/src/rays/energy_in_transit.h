// EnergyInTransit: an estimate of the energy of a source that is still on its way, by the distance travelled.
//
// Where walls differ much in what they take, or some are missing, late energy is that of the few rays that met the
// right walls: single rays sent at random tell little of it. Here a fixed number of them goes on all the time: those
// with much energy are followed several times over, in place of those with little. What comes of it guides rays and
// weighs nothing itself. Source: Kahn and Harris 1951, splitting and Russian roulette; Booth and Hendricks 1984, weight
// windows. Threading: const once made.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include <glm/glm.hpp>

#include <rtsg/audio/trace_result.h>

#include "response/band_classes.h"

namespace rtsg::trace {

class EnergyInTransit {
  public:
    /// As far as `metres`. Nothing is known, as nothing is gained, where all walls take alike.
    EnergyInTransit(const AcousticGeometry& geometry, const BandClasses& classes, const glm::dvec3& source,
                    const TraceOptions& options, double metres);

    bool known() const { return !fractions_.empty(); }
    /// The energy that a ray should have after so many metres, as a share of its first energy, in the band with most
    /// left: the mean of all rays. Below -40 dB, where T20 and T30 need little, fewer rays have more.
    double at(double metres) const {
        return fractions_[std::min(static_cast<std::size_t>(metres * stepsPerMetre_), fractions_.size() - 1)];
    }

  private:
    double stepsPerMetre_ = 1;
    std::vector<double> fractions_;  // within equal steps
};

}  // namespace rtsg::trace
