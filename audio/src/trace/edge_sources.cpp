// Looks for the place on each edge by which sound goes shortest from source to listener, and bends it there.
#include "edge_sources.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

#include <rtsg/audio/wedge.h>

namespace rtsg {
namespace {

constexpr double kPi = std::numbers::pi;
/// Frequencies that stand for an octave.
constexpr int kTones = 5;

/// The angle of a place about an edge, from its first face on, 0 to 2 pi.
double angleAbout(const WallEdge& edge, const glm::dvec3& across) {
    const double angle = std::atan2(glm::dot(glm::cross(edge.faceA, across), edge.axis), glm::dot(edge.faceA, across));
    return angle < 0 ? angle + 2 * kPi : angle;
}

/// A path round an edge, the place on it, and which way angles count from its first face on.
struct RoundEdge {
    WedgePath path;
    glm::dvec3 by{0};
    double turn = 1;
};

/// Where sound goes round an edge from source to listener, if it does.
bool pathRound(const WallEdge& edge, const glm::dvec3& source, const glm::dvec3& listener, RoundEdge& round) {
    WedgePath& path = round.path;
    const glm::dvec3 toSource = source - edge.from, toListener = listener - edge.from;
    const double zs = glm::dot(toSource, edge.axis), zr = glm::dot(toListener, edge.axis);
    const glm::dvec3 acrossS = toSource - edge.axis * zs, acrossR = toListener - edge.axis * zr;
    path.sourceRadius = glm::length(acrossS);
    path.receiverRadius = glm::length(acrossR);
    if (!(path.sourceRadius > 0) || !(path.receiverRadius > 0)) return false;
    const double z = zs + (zr - zs) * path.sourceRadius / (path.sourceRadius + path.receiverRadius);
    if (!(z >= 0 && z <= edge.length)) return false;
    path.along = zr - zs;
    round.by = edge.from + edge.axis * z;
    const bool rim = glm::dot(edge.faceA, edge.faceB) > 1 - 1e-9;
    const double between = rim ? 2 * kPi : angleAbout(edge, edge.faceB);
    double s = angleAbout(edge, acrossS), r = angleAbout(edge, acrossR);
    path.opening = between;
    if (s > between && r > between) {
        // The air on the other side of the first face.
        path.opening = 2 * kPi - between;
        round.turn = -1;
        s = 2 * kPi - s;
        r = 2 * kPi - r;
    } else if (s > between || r > between) {
        return false;
    }
    path.sourceAngle = s;
    path.receiverAngle = r;
    return path.opening > kPi + 0.05;
}

/// Whether nothing lies between a place and one on an edge, but what meets there.
bool seen(const AcousticGeometry& geometry, const glm::dvec3& from, const glm::dvec3& edge) {
    const glm::dvec3 way = edge - from;
    const double distance = glm::length(way), rounding = 1e-5 * (1 + distance);
    AcousticHit hit;
    return !(distance > rounding) || !geometry.closest(from, way / distance, distance - rounding, kNoPlane, hit);
}

/// Whether there is air all round the edge: it may be the seam of two walls.
bool isOpen(const AcousticGeometry& geometry, const WallEdge& edge, const RoundEdge& round) {
    constexpr int kSteps = 8;
    constexpr double kOff = 0.05;  // radians from the faces
    const glm::dvec3 size = glm::abs(round.by);
    const double radius = std::max(1e-3, 1e-5 * std::max({size.x, size.y, size.z}));
    const glm::dvec3 beside = glm::cross(edge.axis, edge.faceA) * round.turn;
    const auto at = [&](int i) {
        const double angle = kOff + (round.path.opening - 2 * kOff) * i / kSteps;
        return round.by + radius * (std::cos(angle) * edge.faceA + std::sin(angle) * beside);
    };
    for (int i = 0; i < kSteps; ++i) {
        const glm::dvec3 from = at(i), way = at(i + 1) - from;
        const double length = glm::length(way);
        AcousticHit hit;
        if (geometry.closest(from, way / length, length, kNoPlane, hit)) return false;
    }
    return true;
}

/// Means over each octave.
struct Shares {
    Bands direct{}, mirrored{};  // factors of the energies that are there already
    Bands edge{};                // energy by way of the edge itself, times 4 pi m^2
    Bands dark{};                // the same with direct sound, if there is any, for it has not come otherwise
};

/// How much of the interference of direct sound with what is beside a mirror image counts: all at the boundary of the
/// shadow, where both come the same way, and nothing at that of the image, whose interference is not looked at either.
double coherence(const WedgePath& path) {
    const double fromShadow = kPi - std::abs(path.receiverAngle - path.sourceAngle);
    const double sum = path.sourceAngle + path.receiverAngle;
    const double fromImage = std::min(sum, 2 * path.opening - sum) - kPi;
    return fromImage / (fromImage + fromShadow);
}

Shares sharesOf(const WedgePath& path, const AcousticMaterial& material, double speedOfSound) {
    Shares shares;
    for (std::size_t b = 0; b < kBandCount; ++b) {
        const double mirrors = std::sqrt(std::max(0.0, material.mirrored(b)));
        for (int i = 0; i < kTones; ++i) {
            const double octave = (i + 0.5) / kTones - 0.5;
            const double hz = 1000 * std::pow(2.0, static_cast<double>(b) - 4 + octave);
            const WedgeField f = wedgeField(path, 2 * kPi * hz / speedOfSound);
            const std::complex<double> beside = mirrors * f.besideMirrored;
            const auto add = [&](Bands& to, double energy) { to[b] += energy / kTones; };
            if (f.mirrored != 0.0) add(shares.mirrored, std::norm(1.0 + f.besideMirrored / f.mirrored));
            add(shares.dark, std::norm(f.direct + f.besideDirect + beside));
            if (f.direct == 0.0) continue;
            double energy = std::norm(f.direct + f.besideDirect);
            if (f.mirrored == 0.0) {
                energy += std::norm(beside) +
                          2 * coherence(path) * std::real((f.direct + f.besideDirect) * std::conj(beside));
                add(shares.edge, std::norm(beside));
            }
            add(shares.direct, energy / std::norm(f.direct));
        }
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

}  // namespace

void addDiffraction(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener,
                    const TraceOptions& options, double seconds, std::vector<Arrival>& arrivals) {
    const double c = options.air.speedOfSound;
    const Bands attenuation = airAttenuation(options.air);
    const std::size_t known = arrivals.size();
    geometry.visitEdges([&](const WallEdge& edge) {
        RoundEdge round;
        if (!pathRound(edge, source, listener, round)) return;
        const WedgePath& path = round.path;
        const glm::dvec3& by = round.by;
        const double way = glm::distance(source, by) + glm::distance(by, listener);
        if (!(way < seconds * c) || !seen(geometry, source, by) || !seen(geometry, listener, by) ||
            !isOpen(geometry, edge, round))
            return;
        const Shares shares = sharesOf(path, geometry.materials()[edge.material], c);
        const double sum = path.sourceAngle + path.receiverAngle, other = 2 * path.opening - sum;
        const bool lit = std::abs(path.receiverAngle - path.sourceAngle) < kPi;
        const bool mirrored = sum < kPi || other < kPi;
        const auto scale = [&](Arrival* arrival, const Bands& factor) {
            for (std::size_t b = 0; arrival && b < kBandCount; ++b) arrival->energy[b] *= factor[b];
            return arrival != nullptr;
        };
        // Image sources are looked for from a little aside: next to its boundary one may be there that ought not to be.
        const double beyond = (std::min(sum, other) - kPi) * path.receiverRadius;
        if (mirrored || beyond < 2e-3)
            scale(arrivalOf(arrivals, known, 1, distanceAt(path, std::min(sum, other)) / c), shares.mirrored);
        const bool straight =
            lit && scale(arrivalOf(arrivals, known, 0, glm::distance(source, listener) / c), shares.direct);
        if (straight || (lit && mirrored)) return;
        // Grazing an edge it is chance which of both says that it is dark.
        const bool dark = !lit || kPi - std::abs(path.receiverAngle - path.sourceAngle) < 1e-5;
        const Bands& share = dark ? shares.dark : shares.edge;
        Arrival arrival;
        arrival.seconds = way / c;
        arrival.order = 1;
        arrival.direction = glm::normalize(by - listener);
        const double sent = options.pattern ? options.pattern(glm::normalize(by - source)) : 1;
        for (std::size_t b = 0; b < kBandCount; ++b)
            arrival.energy[b] = sent * share[b] / (4 * kPi) * std::exp(-attenuation[b] * way);
        if (*std::max_element(arrival.energy.begin(), arrival.energy.end()) > 0) arrivals.push_back(arrival);
    });
    std::stable_sort(arrivals.begin(), arrivals.end(),
                     [](const Arrival& a, const Arrival& b) { return a.seconds < b.seconds; });
}

}  // namespace rtsg
