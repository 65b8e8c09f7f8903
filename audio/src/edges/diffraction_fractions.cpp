// Sums up an edge's parts of the field: pressures with their phases.
#include "diffraction_fractions.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <numbers>

namespace rtsg {
namespace {

using Complex = std::complex<double>;

}  // namespace

double imageAngle(const WedgePath& path) {
    const double sum = path.receiverAngle + path.sourceAngle;
    return std::min(sum, 2 * path.opening - sum);
}

glm::dvec3 imagePosition(const WallEdge& edge, const RoundEdge& round, const glm::dvec3& source) {
    const WedgePath& path = round.path;
    const bool first = path.receiverAngle + path.sourceAngle <= path.opening;
    const double angle = first ? -path.sourceAngle : 2 * path.opening - path.sourceAngle;
    const glm::dvec3 beside = round.side * glm::cross(edge.axis, edge.faceA);
    return edge.from + edge.axis * glm::dot(source - edge.from, edge.axis) +
           path.sourceRadius * (std::cos(angle) * edge.faceA + std::sin(angle) * beside);
}

bool isLit(const WedgePath& path) {
    return std::abs(path.receiverAngle - path.sourceAngle) < std::numbers::pi;
}

bool isMirrored(const WedgePath& path) {
    return imageAngle(path) < std::numbers::pi;
}

bool grazesShadow(const WedgePath& path) {
    return std::abs(std::numbers::pi - std::abs(path.receiverAngle - path.sourceAngle)) < 1e-5;
}

bool grazesImage(const WedgePath& path) {
    return std::abs(imageAngle(path) - std::numbers::pi) * path.receiverRadius < 2e-3;
}

bool grazesFace(const WedgePath& path) {
    const auto [minimum, maximum] = std::minmax(path.sourceAngle, path.receiverAngle);
    return minimum < 1e-5 || path.opening - maximum < 1e-5;
}

EdgeFractions edgeFractionsOf(const RoundEdge& round, const std::array<EdgeEnd, 2>& ends, std::uint32_t material,
                              const EdgeTones& tones, const BodyWeights::Tones& weights) {
    const WedgePath& path = round.path;
    const WedgeBend bend(path);
    EdgeFractions fractions;
    for (std::size_t b = 0; b < kBandCount; ++b) {
        const double mirrors = tones.mirrors(material, b);
        tones.each(b, [&](std::size_t tone, double waveNumber) {
            const auto set = [&](const Complex& direct, const Complex& image, EdgeTonePressures& all,
                                 EdgeTonePressures& ofImage) {
                all[tone] = std::complex<float>(direct + image);
                ofImage[tone] = std::complex<float>(image);
            };
            if (!round.past()) {
                const auto [direct, mirrored] = bend.at(waveNumber);
                set(weights[tone] * direct, weights[tone] * mirrors * mirrored, fractions.wave, fractions.mirrored[0]);
            }
            for (std::size_t e = 0; e < 2; ++e) {
                const double counts = weights[tone] * ends[e].fraction;
                set(counts * ends[e].besideDirect[tone], mirrors * counts * ends[e].besideMirrored[tone],
                    fractions.ends[e], fractions.mirrored[e + 1]);
            }
        });
    }
    return fractions;
}

}  // namespace rtsg
