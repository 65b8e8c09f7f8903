// Finds the pressure that lies beyond the ends of an edge, at the tones that stand for all.
#include "diffraction_ends.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <tuple>

namespace rtsg {
namespace {

/// Relative to its delay it changes so slowly that two tones an octave tell of those between, by a cubic.
constexpr double kTonesAStep = 2.5;
/// An edge counts beyond its end as far as the way is longer by no more than a part of a wave of 125 Hz; 1 / m, in air
/// of 343 m/s.
constexpr double kBentWaveNumber = 2.3;
constexpr std::size_t kSteps = static_cast<std::size_t>(kEdgeTones / kTonesAStep) + 3;

}  // namespace

void setBeyond(const WedgePath& path, double speedOfSound, EdgeEnd& end) {
    const auto waveNumberAt = [&](double tone) { return 2 * std::numbers::pi * edgeToneHz(tone) / speedOfSound; };
    std::array<WedgeEnd, kSteps> known;
    wedgeBeyond(path, waveNumberAt(-kTonesAStep), end.pathLength, known);
    // The lowest tone has most of it. 80 dB below sound in the open it is nothing, as in isFaint().
    constexpr double kFaint = 1e-4;
    if (!(std::abs(known[1].besideDirect) + std::abs(known[1].besideMirrored) > kFaint / end.pathLength)) return;
    // Multiplied by its wave number, because contributions far from the shortest path decrease with it.
    for (std::size_t i = 0; i < kSteps; ++i) {
        const double waveNumber = waveNumberAt((static_cast<double>(i) - 1) * kTonesAStep);
        known[i].besideDirect *= waveNumber;
        known[i].besideMirrored *= waveNumber;
    }
    for (std::size_t tone = 0; tone < kEdgeTones; ++tone) {
        const double at = static_cast<double>(tone) / kTonesAStep + 1;
        const std::size_t i = std::min(static_cast<std::size_t>(at), kSteps - 3);
        const double t = at - static_cast<double>(i), each = 1 / waveNumberAt(static_cast<double>(tone));
        // Catmull and Rom's.
        const double w[] = {t * (-1 + t * (2 - t)) / 2, (2 + t * t * (3 * t - 5)) / 2, t * (1 + t * (4 - 3 * t)) / 2,
                            t * t * (t - 1) / 2};
        for (std::size_t k = 0; k < 4; ++k) {
            end.besideDirect[tone] += each * w[k] * known[i - 1 + k].besideDirect;
            end.besideMirrored[tone] += each * w[k] * known[i - 1 + k].besideMirrored;
        }
    }
}

std::array<EdgeEnd, 2> endsOf(const WallEdge& edge, const RoundEdge& round, double speedOfSound) {
    const WedgePath& path = round.path;
    std::array<EdgeEnd, 2> ends;
    ends[0].position = edge.from;
    ends[0].pathLength = path.pathLengthBy(path.from);
    ends[1].position = edge.from + edge.axis * edge.length;
    ends[1].pathLength = path.pathLengthBy(path.to);
    ends[0].fraction = ends[1].fraction = -1;
    if (path.from > 0) ends[0].fraction = 1;
    if (path.to < 0) ends[1].fraction = 1;
    if (ends[1].pathLength < ends[0].pathLength) std::swap(ends[0], ends[1]);
    for (EdgeEnd& end : ends) setBeyond(path, speedOfSound, end);
    return ends;
}

double bentPastAtMost(const WallEdge& edge, const BesideEdge& beside, double straight) {
    constexpr double kAll = std::numeric_limits<double>::infinity();
    const auto [zs, zr, s, r, z] = std::tuple(beside.zs, beside.zr, beside.s, beside.r, beside.z);
    if (!(s > 0 && r > 0) || (z >= 0 && z <= edge.length)) return kAll;
    const double end = z < 0 ? 0 : edge.length, in = end - zs, out = zr - end;
    const double toEdge = std::sqrt(s * s + in * in), fromEdge = std::sqrt(r * r + out * out);
    // Each of four terms is at most 1 / sinh(index eta), and index / sinh(index eta) is most where the index is least:
    // a half, as the opening is at most 2 pi.
    const double cosh = (toEdge * fromEdge - in * out) / (s * r);
    if (!(cosh > 1 + 1e-9)) return kAll;
    const double longer = std::abs(in / toEdge - out / fromEdge);
    const double length = longer * edge.length * kBentWaveNumber > 1 ? 1 / (kBentWaveNumber * longer) : edge.length;
    return 0.5 / std::sqrt(0.5 * (cosh - 1)) * length / (std::numbers::pi * toEdge * fromEdge) * straight;
}

double bentPast(const WallEdge& edge, const RoundEdge& round) {
    const WedgePath& path = round.path;
    const double near = path.from > 0 ? path.from : path.to;
    const double along = path.along * path.sourceRadius / (path.sourceRadius + path.receiverRadius);
    const double in = along + near, out = path.along - in;  // along the edge
    const double toEdge = std::hypot(path.sourceRadius, in), fromEdge = std::hypot(path.receiverRadius, out);
    const double longer = std::abs(in / toEdge - out / fromEdge);
    const double length = std::min(edge.length, longer > 0 ? 1 / (kBentWaveNumber * longer) : edge.length);
    const double index = std::numbers::pi / path.opening;
    const double cosh = (toEdge * fromEdge - in * out) / (path.sourceRadius * path.receiverRadius);
    const double power = std::pow(cosh + std::sqrt(std::max(0.0, cosh * cosh - 1)), index);
    double bent = 0;
    for (const double angle : {path.receiverAngle - path.sourceAngle, path.receiverAngle + path.sourceAngle}) {
        double both = 0;
        for (const double sign : {1.0, -1.0}) {
            const double turned = index * (std::numbers::pi + sign * angle);
            both += std::sin(turned) / std::max(1e-3, 0.5 * (power + 1 / power) - std::cos(turned));
        }
        bent += std::abs(both);
    }
    const double direct = path.distanceAt(path.receiverAngle - path.sourceAngle);
    return index / (4 * std::numbers::pi) * bent * length / (toEdge * fromEdge) * direct;
}

}  // namespace rtsg
