// Looks for the place on each edge by which sound goes shortest from source to listener, and bends it there.
#include "edge_sources.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

#include <rtsg/audio/wedge.h>

#include "edge_pairs.h"
#include "edge_tones.h"

namespace rtsg {
namespace {

constexpr int kTones = EdgeTones::kTones;

/// Means over each octave.
struct EdgeShares {
    Bands direct{}, mirrored{};  // factors of the energies that are there already
    Bands edge{};                // energy by way of the edge itself, times 4 pi m^2
    Bands late{};                // of that, what is not one with direct sound that is heard
    Bands dark{};                // the first with direct sound, if there is any, for it has not come otherwise
};

/// How much of the interference of direct sound with what is beside a mirror image counts: all at the boundary of the
/// shadow, where both come the same way, and nothing at that of the image, whose interference is not looked at either.
double coherence(const WedgePath& path) {
    const double fromShadow = std::numbers::pi - std::abs(path.receiverAngle - path.sourceAngle);
    const double sum = path.sourceAngle + path.receiverAngle;
    const double fromImage = std::min(sum, 2 * path.opening - sum) - std::numbers::pi;
    return fromImage / (fromImage + fromShadow);
}

EdgeShares edgeSharesOf(const WedgePath& path, std::uint32_t material, const EdgeTones& tones) {
    EdgeShares shares;
    for (std::size_t b = 0; b < kBandCount; ++b) {
        const double mirrors = tones.mirrors(material, b);
        tones.each(b, [&](double waveNumber) {
            const WedgeField f = wedgeField(path, waveNumber);
            const std::complex<double> beside = mirrors * f.besideMirrored;
            const auto add = [&](Bands& to, double energy) { to[b] += energy / kTones; };
            if (f.mirrored != 0.0) add(shares.mirrored, std::norm(1.0 + f.besideMirrored / f.mirrored));
            add(shares.dark, std::norm(f.direct + f.besideDirect + beside));
            if (f.direct == 0.0) return;
            double energy = std::norm(f.direct + f.besideDirect);
            if (f.mirrored == 0.0) {
                // At the boundary of the image it comes when the image does, at that of the shadow with direct sound.
                const double one = coherence(path);
                energy += one * (std::norm(beside) + 2 * std::real((f.direct + f.besideDirect) * std::conj(beside)));
                add(shares.edge, std::norm(beside));
                add(shares.late, (1 - one) * std::norm(beside));
            }
            add(shares.direct, energy / std::norm(f.direct));
        });
    }
    return shares;
}

double distanceAt(const WedgePath& path, double angle) {
    return std::sqrt(path.sourceRadius * path.sourceRadius + path.receiverRadius * path.receiverRadius -
                     2 * path.sourceRadius * path.receiverRadius * std::cos(angle) + path.along * path.along);
}

/// Of the paths known before; null if it is not one of them.
Arrival* arrivalOf(std::vector<Arrival>& arrivals, std::size_t known, std::uint32_t order, double seconds) {
    for (std::size_t i = 0; i < known; ++i)
        if (arrivals[i].order == order && std::abs(arrivals[i].seconds - seconds) < 1e-8 + 1e-6 * seconds)
            return &arrivals[i];
    return nullptr;
}

/// So little that it need not be an arrival of its own.
bool isFaintBeside(const Arrival& arrival, const Arrival& other) {
    constexpr double kFaint = 1e-3;
    for (std::size_t b = 0; b < kBandCount; ++b)
        if (arrival.energy[b] > kFaint * other.energy[b]) return false;
    return true;
}

/// By the place on an edge that is nearest to the way between both; no shorter way leads round it.
double shortestBy(const WallEdge& edge, const glm::dvec3& source, const glm::dvec3& listener) {
    const glm::dvec3 toSource = source - edge.from, toListener = listener - edge.from;
    const double zs = glm::dot(toSource, edge.axis), zr = glm::dot(toListener, edge.axis);
    const double rs = glm::length(toSource - edge.axis * zs), rr = glm::length(toListener - edge.axis * zr);
    const double z = std::clamp(rs + rr > 0 ? zs + (zr - zs) * rs / (rs + rr) : zs, 0.0, edge.length);
    const glm::dvec3 by = edge.from + edge.axis * z;
    return glm::distance(source, by) + glm::distance(by, listener);
}

}  // namespace

EdgePairCount addDiffraction(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener,
                             const TraceOptions& options, double seconds, std::vector<Arrival>& arrivals) {
    const double c = options.air.speedOfSound;
    const Bands attenuation = airAttenuation(options.air);
    const std::size_t known = arrivals.size();
    const EdgeTones tones(geometry, c);
    const bool heardStraight = arrivalOf(arrivals, known, 0, glm::distance(source, listener) / c) != nullptr;
    std::vector<EdgeCandidate> edges;
    std::vector<BentArrival> bent;
    geometry.visitEdges([&](const WallEdge& edge) {
        if (!heardStraight && options.diffractionOrder > 1) edges.push_back({edge, shortestBy(edge, source, listener)});
        RoundEdge round;
        if (!pathRound(edge, source, listener, round)) return;
        const WedgePath& path = round.path;
        const glm::dvec3& by = round.by;
        const double way = glm::distance(source, by) + glm::distance(by, listener);
        if (!(way < seconds * c) || !seen(geometry, source, by) || !seen(geometry, listener, by) ||
            !isOpen(geometry, edge, by, path.opening, round.turn))
            return;
        const EdgeShares shares = edgeSharesOf(path, edge.material, tones);
        const double sum = path.sourceAngle + path.receiverAngle, other = 2 * path.opening - sum;
        const bool lit = std::abs(path.receiverAngle - path.sourceAngle) < std::numbers::pi;
        const bool mirrored = sum < std::numbers::pi || other < std::numbers::pi;
        const auto scale = [&](Arrival* arrival, const Bands& factor) {
            for (std::size_t b = 0; arrival && b < kBandCount; ++b) arrival->energy[b] *= factor[b];
            return arrival != nullptr;
        };
        // Image sources are looked for from a little aside: next to its boundary one may be there that ought not to be.
        const double beyond = (std::min(sum, other) - std::numbers::pi) * path.receiverRadius;
        if (mirrored || beyond < 2e-3)
            scale(arrivalOf(arrivals, known, 1, distanceAt(path, std::min(sum, other)) / c), shares.mirrored);
        Arrival* const direct = lit ? arrivalOf(arrivals, known, 0, glm::distance(source, listener) / c) : nullptr;
        const bool straight = scale(direct, shares.direct);
        if (lit && mirrored) return;
        // Grazing an edge it is chance which of both says that it is dark.
        const bool dark = !lit || std::numbers::pi - std::abs(path.receiverAngle - path.sourceAngle) < 1e-5;
        const Bands& share = straight ? shares.late : dark ? shares.dark : shares.edge;
        Arrival arrival;
        arrival.seconds = way / c;
        arrival.order = 1;
        arrival.direction = glm::normalize(by - listener);
        const double sent = options.pattern ? options.pattern(glm::normalize(by - source)) : 1;
        for (std::size_t b = 0; b < kBandCount; ++b)
            arrival.energy[b] = sent * share[b] / (4 * std::numbers::pi) * std::exp(-attenuation[b] * way);
        if (!(*std::max_element(arrival.energy.begin(), arrival.energy.end()) > 0)) return;
        if (straight && isFaintBeside(arrival, *direct)) {
            for (std::size_t b = 0; b < kBandCount; ++b) direct->energy[b] += arrival.energy[b];
            return;
        }
        if (!lit) bent.push_back({edge, round, arrivals.size()});
        arrivals.push_back(arrival);
    });
    const EdgePairCount pairs =
        addEdgePairs(geometry, source, listener, options, seconds, std::move(edges), bent, arrivals);
    std::stable_sort(arrivals.begin(), arrivals.end(),
                     [](const Arrival& a, const Arrival& b) { return a.seconds < b.seconds; });
    return pairs;
}

}  // namespace rtsg
