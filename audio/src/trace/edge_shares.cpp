// Sums up an edge's parts of the field: pressures with their phases, and energies such that levels are continuous.
#include "edge_shares.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <numbers>

namespace rtsg {
namespace {

using Complex = std::complex<double>;

/// How much of the interference of direct sound with what is beside a mirror image counts: all at the boundary of the
/// shadow, where both come the same way, and nothing at that of the image, whose interference is not looked at either.
double coherence(const WedgePath& path) {
    const double fromShadow = std::numbers::pi - std::abs(path.receiverAngle - path.sourceAngle);
    const double fromImage = imageAngle(path) - std::numbers::pi;
    return fromImage / (fromImage + fromShadow);
}

/// How much of the interference with what an edge adds counts near the edge's ends: all at the boundary, nothing where
/// the shortest way is by an end, for past it energies add up. `boundary`: m, of what comes straight.
double besideEnds(const WedgePath& path, double nearerEnd, double boundary) {
    constexpr double kSharp = 0.05;
    const double way = path.shortestWay();
    const double toEnd = std::max(0.0, nearerEnd - way), toBoundary = std::max(0.0, way - boundary);
    return toEnd > 0 ? std::sqrt(toEnd / (toEnd + kSharp * toBoundary)) : 0;
}

/// What comes at one tone: by the shortest way as if the edge had no ends, and by the edge as it is, the part beside
/// the image for a face that mirrors all.
struct Parts {
    WedgeField field;
    Complex besideDirect, besideMirrored;
};

/// Of the shortest way, such that at a boundary it is continuous with what was found.
Complex waveBy(const WedgePath& path, const WedgeField& f, double mirrors, Found found, double waveNumber) {
    const auto straight = [&](double angle, bool expected, bool there) {
        const double distance = path.distanceAt(angle);
        return std::polar(((expected ? 1.0 : 0.0) - (there ? 1.0 : 0.0)) / distance, -waveNumber * distance);
    };
    Complex wave = f.besideDirect + mirrors * f.besideMirrored;
    if (grazesShadow(path) && found.direct != isLit(path))
        wave += straight(path.receiverAngle - path.sourceAngle, isLit(path), found.direct);
    if (grazesImage(path) && found.mirrored != isMirrored(path))
        wave += mirrors * straight(imageAngle(path), isMirrored(path), found.mirrored);
    return wave;
}

/// Energies, one tone after the other.
class EnergySum {
  public:
    EnergySum(const RoundEdge& round, const std::array<EdgeEnd, 2>& ends, Found found)
        : path_(round.path), past_(round.past()), lit_(isLit(path_)), mirrored_(isMirrored(path_)), found_(found) {
        one_ = lit_ && !mirrored_ ? coherence(path_) : 0;
        const double shadow = path_.distanceAt(path_.receiverAngle - path_.sourceAngle);
        withDirect_ = besideEnds(path_, ends[0].way, shadow);
        withImage_ = besideEnds(path_, ends[0].way, path_.distanceAt(imageAngle(path_)));
    }

    void add(const Parts& parts, double mirrors, double weight, std::size_t band, EdgeShares& shares) const {
        const WedgeField& f = parts.field;
        const Complex d = weight * parts.besideDirect, m = weight * mirrors * parts.besideMirrored;
        const auto add = [&](Bands& to, double energy) { to[band] += energy / EdgeTones::kTones; };
        const auto interference = [](const Complex& a, const Complex& b) { return 2 * std::real(a * std::conj(b)); };
        if (!lit_ || !found_.direct) {
            // At the boundary itself direct sound may not have been found.
            const Complex missed = !past_ && grazesShadow(path_) ? weight * f.direct : 0.0;
            add(shares.own, std::norm(missed + d + (mirrored_ && found_.mirrored && !past_ ? 0.0 : m)));
        } else if (past_) {
            add(shares.own, std::norm(d) + std::norm(m) + one_ * interference(d, m));
        } else {
            // What is beside the image comes at its boundary when the image does, at that of the shadow with direct
            // sound.
            const double energy = std::norm(f.direct) + withDirect_ * interference(f.direct, d) + std::norm(d) +
                                  one_ * (std::norm(m) + interference(withDirect_ * f.direct + d, m));
            add(shares.direct, energy / std::norm(f.direct));
            // Beside an image that nothing mirrors there is another edge that ends it.
            if (!mirrored_) add(shares.own, (1 - one_) * std::norm(m));
        }
        if (mirrored_ && !past_)
            add(shares.mirrored,
                1 + (withImage_ * interference(f.mirrored, parts.besideMirrored) + std::norm(parts.besideMirrored)) /
                        std::norm(f.mirrored));
    }

  private:
    const WedgePath& path_;
    bool past_, lit_, mirrored_;
    Found found_;
    double one_ = 0, withDirect_ = 0, withImage_ = 0;
};

}  // namespace

double imageAngle(const WedgePath& path) {
    const double sum = path.receiverAngle + path.sourceAngle;
    return std::min(sum, 2 * path.opening - sum);
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
    const auto [least, most] = std::minmax(path.sourceAngle, path.receiverAngle);
    return least < 1e-5 || path.opening - most < 1e-5;
}

EdgeShares edgeSharesOf(const RoundEdge& round, const std::array<EdgeEnd, 2>& ends, std::uint32_t material,
                        const EdgeTones& tones, Found found, const BodyWeights::Tones& weights) {
    const WedgePath& path = round.path;
    const double way = path.shortestWay();
    const EnergySum energies(round, ends, found);
    EdgeShares shares;
    for (std::size_t b = 0; b < kBandCount; ++b) {
        const double mirrors = tones.mirrors(material, b);
        tones.each(b, [&](std::size_t tone, double waveNumber) {
            Parts parts;
            if (!round.past()) {
                parts.field = wedgeField(path, waveNumber);
                parts.besideDirect = parts.field.besideDirect;
                parts.besideMirrored = parts.field.besideMirrored;
                shares.wave.pressure[tone] = std::complex<float>(waveBy(path, parts.field, mirrors, found, waveNumber) *
                                                                 std::polar(weights[tone], waveNumber * way));
            }
            for (std::size_t e = 0; e < 2; ++e) {
                const Complex direct = ends[e].share * ends[e].besideDirect[tone];
                const Complex mirrored = ends[e].share * ends[e].besideMirrored[tone];
                const Complex turned = std::polar(1.0, -waveNumber * ends[e].way);
                parts.besideDirect += direct * turned;
                parts.besideMirrored += mirrored * turned;
                shares.ends[e].pressure[tone] = std::complex<float>(weights[tone] * (direct + mirrors * mirrored));
            }
            energies.add(parts, mirrors, weights[tone], b, shares);
        });
    }
    return shares;
}

}  // namespace rtsg
