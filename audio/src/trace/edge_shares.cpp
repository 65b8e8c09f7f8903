// Sums up an edge's parts of the field: pressures with their phases.
#include "edge_shares.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <numbers>

namespace rtsg {
namespace {

using Complex = std::complex<double>;

/// Next to its boundary it is chance whether direct sound is found.
bool grazesShadow(const WedgePath& path) {
    return std::abs(std::numbers::pi - std::abs(path.receiverAngle - path.sourceAngle)) < 1e-5;
}

/// What comes straight from `angle` where it is expected and was not found, less where it is the other way round.
Complex missed(const WedgePath& path, double angle, bool expected, bool found, double waveNumber) {
    const double distance = path.distanceAt(angle);
    return std::polar(((expected ? 1.0 : 0.0) - (found ? 1.0 : 0.0)) / distance, -waveNumber * distance);
}

}  // namespace

double imageAngle(const WedgePath& path) {
    const double sum = path.receiverAngle + path.sourceAngle;
    return std::min(sum, 2 * path.opening - sum);
}

glm::dvec3 imagePlace(const WallEdge& edge, const RoundEdge& round, const glm::dvec3& source) {
    const WedgePath& path = round.path;
    const bool first = path.receiverAngle + path.sourceAngle <= path.opening;
    const double angle = first ? -path.sourceAngle : 2 * path.opening - path.sourceAngle;
    const glm::dvec3 beside = round.turn * glm::cross(edge.axis, edge.faceA);
    return edge.from + edge.axis * glm::dot(source - edge.from, edge.axis) +
           path.sourceRadius * (std::cos(angle) * edge.faceA + std::sin(angle) * beside);
}

bool isLit(const WedgePath& path) {
    return std::abs(path.receiverAngle - path.sourceAngle) < std::numbers::pi;
}

bool isMirrored(const WedgePath& path) {
    return imageAngle(path) < std::numbers::pi;
}

bool grazesImage(const WedgePath& path) {
    return std::abs(imageAngle(path) - std::numbers::pi) * path.receiverRadius < 2e-3;
}

bool grazesFace(const WedgePath& path) {
    const auto [least, most] = std::minmax(path.sourceAngle, path.receiverAngle);
    return least < 1e-5 || path.opening - most < 1e-5;
}

EdgeShares edgeSharesOf(const RoundEdge& round, const std::array<EdgeEnd, 2>& ends, std::uint32_t material,
                        const EdgeTones& tones, Found found, const BodyWeights::Tones& weights) {
    const WedgePath& path = round.path;
    const double way = path.shortestWay();
    const bool lit = isLit(path), mirrored = isMirrored(path);
    const bool missesDirect = grazesShadow(path) && found.direct != lit;
    const bool missesImage = grazesImage(path) && found.mirrored != mirrored;
    EdgeShares shares;
    for (std::size_t b = 0; b < kBandCount; ++b) {
        const double mirrors = tones.mirrors(material, b);
        tones.each(b, [&](std::size_t tone, double waveNumber) {
            const auto set = [&](const Complex& direct, const Complex& image, EdgeTonePressures& all,
                                 EdgeTonePressures& ofImage) {
                all[tone] = std::complex<float>(direct + image);
                ofImage[tone] = std::complex<float>(image);
            };
            if (!round.past()) {
                const WedgeField field = wedgeField(path, waveNumber);
                const Complex turned = std::polar(weights[tone], waveNumber * way);
                Complex direct = field.besideDirect, image = field.besideMirrored;
                if (missesDirect)
                    direct += missed(path, path.receiverAngle - path.sourceAngle, lit, found.direct, waveNumber);
                if (missesImage) image += missed(path, imageAngle(path), mirrored, found.mirrored, waveNumber);
                set(turned * direct, mirrors * turned * image, shares.wave, shares.mirrored[0]);
            }
            for (std::size_t e = 0; e < 2; ++e) {
                const double counts = weights[tone] * ends[e].share;
                set(counts * ends[e].besideDirect[tone], mirrors * counts * ends[e].besideMirrored[tone],
                    shares.ends[e], shares.mirrored[e + 1]);
            }
        });
    }
    return shares;
}

}  // namespace rtsg
