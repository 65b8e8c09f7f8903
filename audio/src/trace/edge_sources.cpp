// Looks for the place on each edge by which sound goes shortest from source to listener, and bends it there.
#include "edge_sources.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

#include <rtsg/audio/wedge.h>

#include "edge_pairs.h"
#include "edge_tones.h"
#include "edge_waves.h"

namespace rtsg {
namespace {

constexpr int kTones = EdgeTones::kTones;

/// Means over each octave.
struct EdgeShares {
    Bands direct{}, mirrored{};  // factors of the energies that are there already
    Bands edge{};                // energy by way of the edge where direct sound is hidden by others, times 4 pi m^2
    Bands late{};                // what is not one with direct sound that is heard, nor with the image
    Bands dark{};                // the first with direct sound, if there is any, for it has not come otherwise
    EdgeWave wave;               // its pressure, before air and the source's pattern
};

/// Whether direct sound and the mirror image that ends at this edge were found.
struct Found {
    bool direct = false, mirrored = false;
};

double distanceAt(const WedgePath& path, double angle) {
    return std::sqrt(path.sourceRadius * path.sourceRadius + path.receiverRadius * path.receiverRadius -
                     2 * path.sourceRadius * path.receiverRadius * std::cos(angle) + path.along * path.along);
}

/// The angle that the mirror image by the nearer face is seen under.
double imageAngle(const WedgePath& path) {
    const double sum = path.receiverAngle + path.sourceAngle;
    return std::min(sum, 2 * path.opening - sum);
}

/// Grazing an edge it is chance whether direct sound is found.
bool grazesShadow(const WedgePath& path) {
    return std::abs(std::numbers::pi - std::abs(path.receiverAngle - path.sourceAngle)) < 1e-5;
}

/// Image sources are looked for from a little aside: next to its boundary one may be found that ought not to be.
bool grazesImage(const WedgePath& path) {
    return std::abs(imageAngle(path) - std::numbers::pi) * path.receiverRadius < 2e-3;
}

/// By way of the edge. At a boundary it is such that with what was found it is continuous.
std::complex<double> waveBy(const WedgePath& path, const WedgeField& f, double mirrors, Found found,
                            double waveNumber) {
    const auto straight = [&](double angle, bool expected, bool there) {
        const double distance = distanceAt(path, angle);
        return std::polar(((expected ? 1.0 : 0.0) - (there ? 1.0 : 0.0)) / distance, -waveNumber * distance);
    };
    std::complex<double> wave = f.besideDirect + mirrors * f.besideMirrored;
    if (grazesShadow(path) && found.direct != (f.direct != 0.0))
        wave += straight(path.receiverAngle - path.sourceAngle, f.direct != 0.0, found.direct);
    if (grazesImage(path) && found.mirrored != (f.mirrored != 0.0))
        wave += mirrors * straight(imageAngle(path), f.mirrored != 0.0, found.mirrored);
    return wave;
}

/// How much of the interference of direct sound with what is beside a mirror image counts: all at the boundary of the
/// shadow, where both come the same way, and nothing at that of the image, whose interference is not looked at either.
double coherence(const WedgePath& path) {
    const double fromShadow = std::numbers::pi - std::abs(path.receiverAngle - path.sourceAngle);
    const double sum = path.sourceAngle + path.receiverAngle;
    const double fromImage = std::min(sum, 2 * path.opening - sum) - std::numbers::pi;
    return fromImage / (fromImage + fromShadow);
}

EdgeShares edgeSharesOf(const WedgePath& path, std::uint32_t material, const EdgeTones& tones, Found found) {
    EdgeShares shares;
    const double way = std::hypot(path.sourceRadius + path.receiverRadius, path.along);
    for (std::size_t b = 0; b < kBandCount; ++b) {
        const double mirrors = tones.mirrors(material, b);
        tones.each(b, [&](std::size_t tone, double waveNumber) {
            const WedgeField f = wedgeField(path, waveNumber);
            shares.wave.pressure[tone] =
                std::complex<float>(waveBy(path, f, mirrors, found, waveNumber) * std::polar(1.0, waveNumber * way));
            const std::complex<double> beside = mirrors * f.besideMirrored;
            const auto add = [&](Bands& to, double energy) { to[b] += energy / kTones; };
            if (f.mirrored != 0.0) add(shares.mirrored, std::norm(1.0 + f.besideMirrored / f.mirrored));
            add(shares.dark, std::norm(f.direct + f.besideDirect + beside));
            if (f.direct == 0.0) return;
            // What is one with the image has come with it.
            add(shares.edge, std::norm(f.besideDirect + (f.mirrored != 0.0 && found.mirrored ? 0.0 : beside)));
            double energy = std::norm(f.direct + f.besideDirect);
            if (f.mirrored == 0.0) {
                // At the boundary of the image it comes when the image does, at that of the shadow with direct sound.
                const double one = coherence(path);
                energy += one * (std::norm(beside) + 2 * std::real((f.direct + f.besideDirect) * std::conj(beside)));
                add(shares.late, (1 - one) * std::norm(beside));
            }
            add(shares.direct, energy / std::norm(f.direct));
        });
    }
    return shares;
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

/// What edges do to the paths known so far, one edge after the other.
class Diffraction {
  public:
    Diffraction(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener,
                const TraceOptions& options, double seconds, std::vector<Arrival>& arrivals, EdgeField& field)
        : geometry_(geometry),
          source_(source),
          listener_(listener),
          options_(options),
          seconds_(seconds),
          attenuation_(airAttenuation(options.air)),
          tones_(geometry, options.air.speedOfSound),
          arrivals_(arrivals),
          known_(arrivals.size()),
          field_(field) {
        heardStraight_ = arrivalOf(arrivals_, known_, 0, glm::distance(source, listener) / c()) != nullptr;
    }

    EdgePairCount run() {
        std::vector<EdgeCandidate> edges;
        geometry_.visitEdges([&](const WallEdge& edge) {
            if (!heardStraight_ && options_.diffractionOrder > 1)
                edges.push_back({edge, shortestBy(edge, source_, listener_)});
            RoundEdge round;
            if (pathRound(edge, source_, listener_, round)) bend(edge, round);
        });
        return addEdgePairs(geometry_, source_, listener_, options_, seconds_, std::move(edges), bent_, arrivals_,
                            field_);
    }

  private:
    double c() const { return options_.air.speedOfSound; }

    void scale(Arrival& arrival, const Bands& factor) {
        if (arrival.straight < 0) {
            arrival.straight = static_cast<std::int32_t>(field_.straight.size());
            field_.straight.push_back(arrival.energy);
        }
        for (std::size_t b = 0; b < kBandCount; ++b) arrival.energy[b] *= factor[b];
    }

    void bend(const WallEdge& edge, const RoundEdge& round) {
        const WedgePath& path = round.path;
        const double way = glm::distance(source_, round.by) + glm::distance(round.by, listener_);
        if (!(way < seconds_ * c()) || !seen(geometry_, source_, round.by) || !seen(geometry_, listener_, round.by) ||
            !isOpen(geometry_, edge, round.by, path.opening, round.turn))
            return;
        const double image = imageAngle(path);
        const bool lit = std::abs(path.receiverAngle - path.sourceAngle) < std::numbers::pi;
        const bool mirrored = image < std::numbers::pi;
        Arrival* const mirror =
            mirrored || grazesImage(path) ? arrivalOf(arrivals_, known_, 1, distanceAt(path, image) / c()) : nullptr;
        const EdgeShares shares = edgeSharesOf(path, edge.material, tones_, {heardStraight_, mirror != nullptr});
        if (mirror) scale(*mirror, shares.mirrored);
        Arrival* const direct =
            lit ? arrivalOf(arrivals_, known_, 0, glm::distance(source_, listener_) / c()) : nullptr;
        if (direct) scale(*direct, shares.direct);
        const Bands& share = direct ? shares.late : !lit || grazesShadow(path) ? shares.dark : shares.edge;
        addWave(shares.wave, round.by, way);
        if (!lit || !mirrored || !direct) addArrival(edge, round, share, lit, direct);
    }

    double sentTo(const glm::dvec3& by) const {
        return options_.pattern ? options_.pattern(glm::normalize(by - source_)) : 1;
    }

    void addWave(EdgeWave wave, const glm::dvec3& by, double way) {
        wave.seconds = way / c();
        wave.direction = glm::normalize(by - listener_);
        weaken(wave, sentTo(by), attenuation_, way);
        if (!isFaint(wave, way)) field_.waves.push_back(wave);
    }

    void addArrival(const WallEdge& edge, const RoundEdge& round, const Bands& share, bool lit, Arrival* direct) {
        const double way = glm::distance(source_, round.by) + glm::distance(round.by, listener_);
        Arrival arrival;
        arrival.seconds = way / c();
        arrival.order = 1;
        arrival.direction = glm::normalize(round.by - listener_);
        const double sent = sentTo(round.by);
        for (std::size_t b = 0; b < kBandCount; ++b)
            arrival.energy[b] = sent * share[b] / (4 * std::numbers::pi) * std::exp(-attenuation_[b] * way);
        if (!(*std::max_element(arrival.energy.begin(), arrival.energy.end()) > 0)) return;
        if (direct && isFaintBeside(arrival, *direct)) {
            for (std::size_t b = 0; b < kBandCount; ++b) direct->energy[b] += arrival.energy[b];
            return;
        }
        arrival.straight = static_cast<std::int32_t>(field_.straight.size());
        field_.straight.push_back({});
        if (!lit) bent_.push_back({edge, round, arrivals_.size()});
        arrivals_.push_back(arrival);
    }

    const AcousticGeometry& geometry_;
    const glm::dvec3 source_, listener_;
    const TraceOptions& options_;
    const double seconds_;
    const Bands attenuation_;
    const EdgeTones tones_;
    std::vector<Arrival>& arrivals_;
    const std::size_t known_;  // of the arrivals: without edges
    EdgeField& field_;
    std::vector<BentArrival> bent_;
    bool heardStraight_ = false;
};

}  // namespace

EdgePairCount addDiffraction(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener,
                             const TraceOptions& options, double seconds, std::vector<Arrival>& arrivals,
                             EdgeField& field) {
    const EdgePairCount pairs = Diffraction(geometry, source, listener, options, seconds, arrivals, field).run();
    std::stable_sort(arrivals.begin(), arrivals.end(),
                     [](const Arrival& a, const Arrival& b) { return a.seconds < b.seconds; });
    return pairs;
}

}  // namespace rtsg
