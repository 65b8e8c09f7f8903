// The data that the batches of one run share, and the results of each.
//
// Energies are kept for bands that walls tell apart (response/band_classes.h), N at most. The loss in air depends on
// the way alone and is left to whoever reads the histogram. Threading: const once made; a Batch is one thread's.
#pragma once

#include <algorithm>
#include <array>
#include <numbers>
#include <span>
#include <utility>
#include <vector>

#include <glm/glm.hpp>

#include <rtsg/audio/trace_result.h>

#include "energy_in_transit.h"
#include "response/band_classes.h"
#include "response/listener_images.h"

namespace rtsg::trace {

inline double ballVolume(double radius) {
    return 4 * std::numbers::pi / 3 * radius * radius * radius;
}

template <std::size_t N>
using Energy = std::array<double, N>;

template <std::size_t N>
double largest(const Energy<N>& energy) {
    return *std::max_element(energy.begin(), energy.end());
}
template <std::size_t N>
double sum(const Energy<N>& energy) {
    double result = 0;
    for (const double e : energy) result += e;
    return result;
}
template <std::size_t N>
void add(Energy<N>& target, const Energy<N>& energy, double factor = 1) {
    for (std::size_t b = 0; b < N; ++b) target[b] += energy[b] * factor;
}

/// The shares into which a wall divides energy.
template <std::size_t N>
struct Fractions {
    Energy<N> diffuse{}, mirror{}, through{};  // nothing where there are fewer classes

    Fractions(const AcousticMaterial& material, const BandClasses& classes) {
        for (std::size_t c = 0; c < classes.count; ++c) {
            const std::size_t b = classes.first[c];
            const double reflected = std::max(0.0, material.reflected(b));
            diffuse[c] = reflected * material.scattering[b];
            mirror[c] = reflected * (1 - material.scattering[b]);
            through[c] = material.transmission[b];
        }
    }
};

/// The sound of one listener, without the loss in air.
template <std::size_t N>
struct Heard {
    std::vector<Energy<N>> bins, lateral;  // the latter as EnergyHistogram has it
    Energy<N> tried{};                     // some of what might have arrived
};

/// Without what air takes.
template <std::size_t N>
struct Batch {
    std::vector<Heard<N>> heard;  // by listener
    Energy<N> sent{};
    /// Energy and metres of each ray that left, and of each that is still under way.
    std::vector<std::pair<Energy<N>, double>> escaped, truncated;
    struct Exit {
        glm::dvec3 origin, direction;
        Energy<N> energy;  // 1: all that a ray is sent with
        double metres;
    };
    std::vector<Exit> exits;  // of those that left
};

/// A listener with its ball, and what of the paths to it is exact.
struct Ear {
    glm::dvec3 position;
    double radius, volume;
    bool cut;  // the ball, by walls
    double startMetres;
    glm::dvec3 across;  // TraceResult::across
    bool sided;         // whether that is asked for
    int imageOrder;
    double imageFraction;
    ListenerImages images;  // sound that is scattered and then reflected on one of their paths is connected there

    Ear(const glm::dvec3& at, const TraceResult& result, double speedOfSound)
        : position(at),
          radius(result.receiverRadius),
          volume(result.receiverVolume),
          cut(volume < ballVolume(radius) * (1 - 1e-9)),
          startMetres(result.batches.front().start * speedOfSound),
          across(result.across),
          sided(across != glm::dvec3(0)),
          imageOrder(result.imageOrder),
          imageFraction(result.imageFraction) {}
};

/// The data that all batches of one run share.
template <std::size_t N>
struct Task {
    const AcousticGeometry& geometry;
    const BandClasses& classes;
    glm::dvec3 source;
    std::vector<Ear> ears;
    const TraceOptions& options;
    double seconds;
    std::vector<Fractions<N>> walls;
    std::span<const ReflectingPlane> planes;
    bool transmits;  // any of them
    EnergyInTransit underway;

    Task(const AcousticGeometry& g, const BandClasses& apart, const glm::dvec3& s, std::vector<Ear> e,
         const TraceOptions& o, double length)
        : geometry(g),
          classes(apart),
          source(s),
          ears(std::move(e)),
          options(o),
          seconds(length),
          planes(g.planes()),
          underway(g, apart, s, o, length * o.air.speedOfSound) {
        for (const AcousticMaterial& material : g.materials()) walls.emplace_back(material, classes);
        transmits =
            std::any_of(walls.begin(), walls.end(), [](const Fractions<N>& w) { return largest<N>(w.through) > 0; });
    }
};

}  // namespace rtsg::trace
