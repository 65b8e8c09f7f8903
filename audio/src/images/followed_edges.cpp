// Chooses the waves that are worth following, and makes of what an edge bends weights for any place.
#include "followed_edges.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <memory>
#include <numbers>
#include <span>

namespace rtsg {
namespace {

using EdgeValue = std::complex<double>;
constexpr double kHalfTurn = std::numbers::pi;
/// A wave of less of all energy is not followed, nor is what is left of one beside the closed form.
constexpr double kLeastWave = 1e-5;
constexpr float kLeastRest = 1e-4f;
/// Nearer to a boundary than this, in radians, direct sound decides on which side one is.
constexpr double kAtBoundary = 1e-4;
/// The lowest of the low passes, an octave apart each: log2 of 1 / s.
constexpr int kLowestPass = -3;

double dawson(double x) {
    // Rybicki's sum, good to 1e-10 with this step.
    constexpr double kStep = 0.2;
    if (x < 0.2) {
        const double xx = x * x;
        return x * (1 - xx * (2.0 / 3) * (1 - xx * 0.4 * (1 - xx * (2.0 / 7) * (1 - xx * (2.0 / 9)))));
    }
    if (x > 20) return 0.5 / x * (1 + 0.5 / (x * x));
    const double even = 2 * std::round(x / kStep / 2);
    double sum = 0;
    for (int k = -25; k <= 25; k += 2) {
        const double off = x - (even + k) * kStep;
        sum += std::exp(-off * off) / (even + k);
    }
    return sum / std::sqrt(kHalfTurn);
}

/// The share of each low pass in W, by the octaves of p t: the integral in steps of an octave, good to 1e-6.
class LowPassShares {
  public:
    LowPassShares() {
        for (std::size_t f = 0; f <= kFractions; ++f) {
            const auto at = [&](int octave) {
                const double x = std::sqrt(std::exp2(octave + static_cast<double>(f) / kFractions));
                return 2 * std::numbers::ln2 / std::pow(kHalfTurn, 1.5) * dawson(x);
            };
            // What is left beyond 100 octaves is nothing.
            double beyond = 0;
            for (int octave = kHigh + 100; octave >= kLow; --octave) {
                if (octave <= kHigh) {
                    shares_[f][static_cast<std::size_t>(octave - kLow)] = static_cast<float>(at(octave));
                    beyond_[f][static_cast<std::size_t>(octave - kLow)] = static_cast<float>(beyond);
                }
                beyond += at(octave);
            }
        }
    }
    /// Adds those of `gain` W, t in seconds.
    void add(double gain, double t, std::span<float, FollowedEdge::kColumns> to) const {
        const double place = std::clamp(std::log2(t), static_cast<double>(kLow - kLowestPass), 7.99);
        const double octave = std::floor(place), fraction = (place - octave) * kFractions;
        const auto f = static_cast<std::size_t>(fraction);
        const auto blend = static_cast<float>(fraction - static_cast<double>(f)), g = static_cast<float>(gain);
        const auto from = static_cast<std::size_t>(static_cast<int>(octave) + kLowestPass - kLow);
        const float *const a = shares_[f].data() + from, *const b = shares_[f + 1].data() + from;
        for (std::size_t k = 0; k < FollowedEdge::kLowPasses; ++k) to[k] += g * (a[k] + (b[k] - a[k]) * blend);
        const std::size_t last = from + FollowedEdge::kLowPasses - 1;
        to.back() += g * (beyond_[f][last] + (beyond_[f + 1][last] - beyond_[f][last]) * blend);
    }

  private:
    static constexpr std::size_t kFractions = 32;
    static constexpr int kLow = -60, kHigh = 7 + kLowestPass + static_cast<int>(FollowedEdge::kLowPasses);
    std::array<std::array<float, kHigh - kLow + 1>, kFractions + 1> shares_{}, beyond_{};
};

/// Which of a wedge's boundaries count, and where one is. `side`: of the boundary that is near, -1 in the light, 1 in
/// the shadow, 0 as it comes.
struct EdgeTerms {
    explicit EdgeTerms(const WedgePath& path) : n_(path.opening / kHalfTurn) {
        const double radii = path.sourceRadius + path.receiverRadius;
        way = std::hypot(radii, path.along);
        // Kouyoumjian's and Pathak's distance.
        length_ = path.sourceRadius * path.receiverRadius / way;
    }

    /// Adds what is beside the boundary at `sign` pi of an angle between source and receiver.
    void add(double angle, double sign, double side, double speedOfSound, const LowPassShares& shares,
             std::span<float, FollowedEdge::kColumns> to) const {
        const double turns = std::round((angle + sign * kHalfTurn) / (2 * kHalfTurn * n_));
        const double cosine = std::cos((2 * kHalfTurn * n_ * turns - angle) / 2);
        const double sine = std::sin((kHalfTurn + sign * angle) / (2 * n_));
        double gain = 0.5 / way;
        if (side != 0 || std::abs(sine) < 1e-9)
            gain *= side != 0 ? side : 1;
        else
            gain *= -std::abs(cosine) * std::cos((kHalfTurn + sign * angle) / (2 * n_)) / (sine * n_);
        shares.add(gain, length_ * 2 * cosine * cosine / speedOfSound, to);
    }

    double way = 0;

  private:
    double n_, length_ = 0;
};

const LowPassShares& lowPassShares() {
    static const LowPassShares shares;
    return shares;
}

bool isInAir(const WedgePath& path) {
    return path.sourceRadius > 0 && path.receiverRadius > 0 && path.sourceAngle <= path.opening &&
           path.receiverAngle <= path.opening;
}

bool isMirrored(const WedgePath& path, std::size_t face) {
    const double sum = path.sourceAngle + path.receiverAngle;
    return (face == 0 ? sum : 2 * path.opening - sum) < kHalfTurn;
}

}  // namespace

bool FollowedEdge::weightsAt(const glm::dvec3& source, const glm::dvec3& listener, bool heard,
                             PoleBank::Weights& weights) const {
    if (!(bends.opening > 0)) {
        const EdgeWay now = edgeWay(route, source, listener);
        const auto nearer = static_cast<float>(now.length > 0 ? std::min(10.0, way / now.length) : 1);
        for (std::size_t k = 0; k < weights.size(); ++k) weights[k] = rest[k] * nearer;
        return true;
    }
    const WedgePath path = pathAbout(route, bends, source, listener);
    if (!isInAir(path)) return false;
    const EdgeTerms terms(path);
    const double difference = path.receiverAngle - path.sourceAngle, sum = path.receiverAngle + path.sourceAngle;
    std::array<std::array<float, kColumns>, 2> parts{};
    for (const double sign : {1.0, -1.0}) {
        const bool near = std::abs(kHalfTurn + sign * difference) < kAtBoundary;
        terms.add(difference, sign, near ? heard ? -1 : 1 : 0, speedOfSound, lowPassShares(), parts[0]);
        terms.add(sum, sign, 0, speedOfSound, lowPassShares(), parts[1]);
    }
    weights = rest;
    for (std::size_t part = 0; part < 2; ++part)
        for (std::size_t column = 0; column < kColumns; ++column)
            for (std::size_t k = 0; k < weights.size(); ++k) weights[k] += parts[part][column] * makes[part][column][k];
    return true;
}

double FollowedEdge::boundaryGain(std::size_t face, const glm::dvec3& source, const glm::dvec3& listener) const {
    const WedgePath path = pathAbout(route, bends, source, listener);
    if (!isInAir(path)) return 0;
    return (isMirrored(path, face) ? 1 : 0) - (mirrored[face] ? 1 : 0);
}

namespace {

/// Of a tone; beyond the last one it is the last.
std::size_t bandOf(std::size_t tone) {
    return std::min(tone, kEdgeTones - 1) * static_cast<std::size_t>(kBandCount) / kEdgeTones;
}

/// Spectra at the tones of waves, and beyond them as at the last one.
class EdgeFit {
  public:
    using Spectrum = std::vector<EdgeValue>;

    explicit EdgeFit(int sampleRate) : fit_(sampleRate, tonesOf(sampleRate)) {
        Spectrum spectrum(fit_.hz().size());
        for (std::size_t b = 0; b < kBandCount; ++b)
            for (std::size_t column = 0; column < FollowedEdge::kColumns; ++column) {
                const double pole = std::exp2(kLowestPass + static_cast<double>(column));
                for (std::size_t i = 0; i < spectrum.size(); ++i) {
                    const bool within = bandOf(i) == b, through = column == FollowedEdge::kLowPasses;
                    const EdgeValue pass = through ? 1.0 : pole / EdgeValue(pole, 2 * kHalfTurn * fit_.hz()[i]);
                    spectrum[i] = within ? pass : 0.0;
                }
                makes_[b][column] = single(fit_.weightsOf(spectrum));
            }
    }
    static const EdgeFit& kept(int sampleRate) {
        thread_local std::vector<std::pair<int, std::unique_ptr<const EdgeFit>>> all;
        for (const auto& [rate, one] : all)
            if (rate == sampleRate) return *one;
        return *all.emplace_back(sampleRate, std::make_unique<const EdgeFit>(sampleRate)).second;
    }

    /// Of all low passes, each times `colour`, an amplitude by bands.
    void makes(const Bands& colour, FollowedEdge::Makes& result) const {
        result = {};
        for (std::size_t b = 0; b < kBandCount; ++b)
            for (std::size_t column = 0; column < FollowedEdge::kColumns; ++column)
                for (std::size_t k = 0; k < PoleBank::kWeights; ++k)
                    result[column][k] += static_cast<float>(colour[b]) * makes_[b][column][k];
    }
    PoleBank::Weights weightsOf(std::span<const std::complex<float>> tones) const {
        Spectrum spectrum(fit_.hz().size());
        for (std::size_t i = 0; i < spectrum.size(); ++i) spectrum[i] = EdgeValue(tones[std::min(i, kEdgeTones - 1)]);
        return single(fit_.weightsOf(spectrum));
    }

  private:
    static std::vector<double> tonesOf(int sampleRate) {
        std::vector<double> hz;
        for (std::size_t tone = 0; tone < kEdgeTones || edgeToneHz(static_cast<double>(tone)) < 0.5 * sampleRate;
             ++tone)
            hz.push_back(edgeToneHz(static_cast<double>(tone)));
        return hz;
    }
    static PoleBank::Weights single(const PoleFit::Weights& weights) {
        PoleBank::Weights result;
        std::ranges::transform(weights, result.begin(), [](double weight) { return static_cast<float>(weight); });
        return result;
    }

    PoleFit fit_;
    std::array<FollowedEdge::Makes, kBandCount> makes_;  // of what is in a band alone
};

double waveEnergy(const EdgeWave& wave) {
    double sum = 0;
    for (const std::complex<float>& tone : wave.pressure) sum += static_cast<double>(std::norm(tone));
    return sum * kBandCount / kEdgeTones / (4 * kHalfTurn);
}

/// Whether its route is that of its delay.
bool hasRoute(const EdgeWave& wave, const glm::dvec3& source, const glm::dvec3& listener, double speedOfSound) {
    const double length = edgeWay(wave.route, source, listener).length;
    return std::abs(length - wave.seconds * speedOfSound) < 1e-6 * (1 + length);
}

/// Makes of waves what is followed of them.
class EdgeFollower {
  public:
    EdgeFollower(const glm::dvec3& source, const glm::dvec3& listener, const TraceOptions& options, int sampleRate,
                 std::size_t block)
        : source_(source),
          listener_(listener),
          options_(options),
          attenuation_(airAttenuation(options.air)),
          sampleRate_(sampleRate),
          block_(block) {}

    std::shared_ptr<const FollowedEdge> follow(const EdgeWave& wave) const {
        auto edge = std::make_shared<FollowedEdge>();
        edge->route = wave.route;
        edge->bends = wave.bends;
        edge->way = wave.seconds * options_.air.speedOfSound;
        edge->speedOfSound = options_.air.speedOfSound;
        const EdgeFit& fit = EdgeFit::kept(sampleRate_);
        if (!(wave.bends.opening > 0)) {
            edge->rest = fit.weightsOf(wave.pressure);
            return edge;
        }
        const double sent = sentTo(wave.route.first);
        Bands beside, besideMirrored;
        for (std::size_t b = 0; b < kBandCount; ++b) {
            beside[b] = std::sqrt(sent * std::exp(-attenuation_[b] * edge->way));  // as weaken() has it
            besideMirrored[b] = beside[b] * wave.bends.mirrors[b];
        }
        fit.makes(beside, edge->makes[0]);
        fit.makes(besideMirrored, edge->makes[1]);
        const WedgePath path = pathAbout(wave.route, wave.bends, source_, listener_);
        for (std::size_t face = 0; face < 2; ++face) edge->mirrored[face] = isMirrored(path, face);
        if (!isAtBoundary(path)) findRest(wave, path, beside, besideMirrored, *edge);
        return edge;
    }

    /// Of the image by a face, at a metre from it.
    FollowedImage boundary(const std::shared_ptr<const FollowedEdge>& edge, std::size_t face) const {
        const BendingEdge& bends = edge->bends;
        const glm::dvec3 normal =
            face == 0 ? bends.beside : std::cos(bends.opening) * bends.beside - std::sin(bends.opening) * bends.face;
        FollowedImage image;
        image.kind = FollowedImage::Kind::boundary;
        image.edge = edge;
        image.face = face;
        image.turn = glm::dmat3(1.0) - 2.0 * glm::outerProduct(normal, normal);
        image.offset = 2 * glm::dot(normal, edge->route.first) * normal;
        const double sent = sentTo(edge->route.first), way = glm::distance(image.at(source_), listener_);
        Bands amplitudes;
        for (std::size_t b = 0; b < kBandCount; ++b)
            amplitudes[b] = bends.mirrors[b] * std::sqrt(sent * std::exp(-attenuation_[b] * way));
        setAmplitudes(image, amplitudes, sampleRate_, block_);
        return image;
    }

  private:
    double sentTo(const glm::dvec3& by) const {
        return options_.pattern ? options_.pattern(glm::normalize(by - source_)) : 1;
    }
    /// There the wave has been made to go with what was found, of which it is chance on which side that is.
    static bool isAtBoundary(const WedgePath& path) {
        const double difference = std::abs(path.receiverAngle - path.sourceAngle);
        const double sum = path.receiverAngle + path.sourceAngle, image = std::min(sum, 2 * path.opening - sum);
        return std::abs(kHalfTurn - difference) < kAtBoundary ||
               std::abs(kHalfTurn - image) * path.receiverRadius < 0.01;
    }
    /// What the wave has beyond the closed form.
    void findRest(const EdgeWave& wave, const WedgePath& path, const Bands& beside, const Bands& besideMirrored,
                  FollowedEdge& edge) const {
        const WedgeBend bend(path);
        const double way = path.shortestWay();
        const auto knownAt = [&](std::size_t tone) {
            const double k = 2 * kHalfTurn * edgeToneHz(static_cast<double>(tone)) / edge.speedOfSound;
            const auto [direct, mirrored] = bend.at(k);
            const std::size_t b = bandOf(tone);
            return std::complex<float>((beside[b] * direct + besideMirrored[b] * mirrored) *
                                       std::polar(1.0, k * (edge.way - way)));
        };
        // Most have nothing, which a few tones show.
        constexpr std::size_t kStep = 10;
        bool any = false;
        for (std::size_t tone = kStep / 5; tone < kEdgeTones; tone += kStep) {
            const std::complex<float> known = knownAt(tone);
            any = any || std::abs(wave.pressure[tone] - known) > kLeastRest * std::abs(known);
        }
        if (!any) return;
        std::array<std::complex<float>, kEdgeTones> rest;
        for (std::size_t tone = 0; tone < kEdgeTones; ++tone) rest[tone] = wave.pressure[tone] - knownAt(tone);
        edge.rest = EdgeFit::kept(sampleRate_).weightsOf(rest);
    }

    const glm::dvec3 source_, listener_;
    const TraceOptions& options_;
    const Bands attenuation_;
    const int sampleRate_;
    const std::size_t block_;
};

}  // namespace

void addFollowedEdges(const Echogram& echogram, const glm::dvec3& source, const glm::dvec3& listener,
                      const TraceOptions& options, int sampleRate, std::size_t block, std::size_t most,
                      std::vector<FollowedImage>& followed) {
    const std::vector<EdgeWave>& waves = echogram.edges.waves;
    if (waves.empty()) return;
    double all = 0;
    for (const double band : echogram.total()) all += band;
    std::vector<std::pair<double, std::size_t>> loudest;
    for (std::size_t i = 0; i < waves.size(); ++i) {
        const double energy = waveEnergy(waves[i]);
        if (energy > kLeastWave * all && hasRoute(waves[i], source, listener, options.air.speedOfSound))
            loudest.emplace_back(-energy, i);
    }
    lowPassShares();  // here rather than in a block of sound
    const std::size_t count = std::min(most, loudest.size());
    std::partial_sort(loudest.begin(), loudest.begin() + static_cast<std::ptrdiff_t>(count), loudest.end());
    const EdgeFollower follower(source, listener, options, sampleRate, block);
    for (std::size_t k = 0; k < count; ++k) {
        FollowedImage wave;
        wave.kind = FollowedImage::Kind::edge;
        wave.arrival = loudest[k].second;
        wave.edge = follower.follow(waves[wave.arrival]);
        followed.push_back(wave);
        const Bands& mirrors = wave.edge->bends.mirrors;
        if (!(*std::max_element(mirrors.begin(), mirrors.end()) > 0)) continue;
        for (std::size_t face = 0; face < 2; ++face) followed.push_back(follower.boundary(wave.edge, face));
    }
}

}  // namespace rtsg
