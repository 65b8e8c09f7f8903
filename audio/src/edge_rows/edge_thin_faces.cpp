// Lays one edge along the middle of a narrow face, and fades over to it as waves become longer.
#include "edge_thin_faces.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "edges/edge_ends.h"
#include "edges/edge_paths.h"
#include "edges/edge_shares.h"

namespace rtsg {
namespace {

/// Wave number times width at which half is of one edge. Fitted to boundary elements.
constexpr double kHalf = 0.7;
/// Radians behind both outer faces within which it comes up: nearer to one the edges are heard by themselves, too.
constexpr double kFade = 0.15;

/// Of both faces of an edge that in which the other one does not lie.
const glm::dvec3& outerFace(const WallEdge& edge, const WallEdge& other) {
    const glm::dvec3 way = other.from - edge.from, across = way - edge.axis * glm::dot(way, edge.axis);
    return glm::dot(edge.faceA, across) > glm::dot(edge.faceB, across) ? edge.faceB : edge.faceA;
}

/// In the middle of both, as long as they are side by side; `width` in metres.
bool middleEdge(const WallEdge& a, const WallEdge& b, WallEdge& middle, double& width) {
    constexpr double kParallel = 1e-3;
    if (glm::length(glm::cross(a.axis, b.axis)) > kParallel) return false;
    const glm::dvec3 way = b.from - a.from, across = way - a.axis * glm::dot(way, a.axis);
    const double begin = glm::dot(way, a.axis), end = begin + b.length * glm::dot(a.axis, b.axis);
    const double low = std::max(0.0, std::min(begin, end)), high = std::min(a.length, std::max(begin, end));
    if (!(high > low)) return false;
    width = glm::length(across);
    middle = a;
    middle.from += a.axis * low + 0.5 * across;
    middle.length = high - low;
    middle.faceA = outerFace(a, b);
    middle.faceB = outerFace(b, a);
    middle.rim = nullptr;
    return true;
}

double fadedIn(double angle) {
    const double t = std::clamp(angle / kFade, 0.0, 1.0);
    return t * t * (3 - 2 * t);
}

}  // namespace

void blendThinFace(const PairWay& way, const glm::dvec3& source, const glm::dvec3& listener, const EdgeTones& tones,
                   PairField& field) {
    const double hidden = fadedIn(way.atFirst.shadow()) * fadedIn(way.atSecond.shadow());
    WallEdge middle;
    RoundEdge round;
    double width = 0;
    if (!way.onFace || isRim(*way.first) || !(hidden > 0) || !middleEdge(*way.first, *way.second, middle, width) ||
        !pathRound(middle, source, listener, round))
        return;
    const double c = tones.speedOfSound();
    const auto waveNumber = [&](std::size_t tone) {
        return 2 * std::numbers::pi * edgeToneHz(static_cast<double>(tone)) / c;
    };
    BodyWeights::Tones share;
    for (std::size_t t = 0; t < kEdgeTones; ++t) {
        const double x = waveNumber(t) * width / kHalf;
        share[t] = hidden / (1 + x * x * x * x);
    }
    const std::array<EdgeEnd, 2> ends = endsOf(middle, round, c);
    const EdgeShares shares = edgeSharesOf(round, ends, middle.material, tones, share);
    const double longer = round.path.shortestWay() - way.path.way;
    for (std::size_t t = 0; t < kEdgeTones; ++t) {
        field.wave[t] *= 1 - share[t];
        for (FacePair::End& end : field.ends) end.pressure[t] *= 1 - share[t];
        field.wave[t] += std::complex<double>(shares.wave[t]) * std::polar(1.0, -waveNumber(t) * longer);
    }
    const glm::dvec3 half =
        0.5 * (way.bySecond - way.byFirst) - 0.5 * middle.axis * glm::dot(way.bySecond - way.byFirst, middle.axis);
    for (std::size_t e = 0; e < 2; ++e) {
        FacePair::End end;
        end.first = ends[e].place - half;
        end.second = ends[e].place + half;
        end.way = ends[e].way;
        for (std::size_t t = 0; t < kEdgeTones; ++t) end.pressure[t] = shares.ends[e][t];
        field.ends.push_back(end);
    }
}

}  // namespace rtsg
