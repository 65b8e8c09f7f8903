// Chooses the waves that are worth following, and fits weights to the diffraction of an edge at any place.
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
/// Waves with a smaller share of the energy are not followed, nor is a smaller remainder beside the closed form.
constexpr double kMinWave = 1e-5;
constexpr double kMinRest = 1e-4;
/// Nearer to a boundary than this, in radians, direct sound decides on which side one is.
constexpr double kAtBoundary = 1e-4, kBeside = 2e-6;
/// Tones as far as half of any sample rate.
constexpr std::size_t kMaxTones = kEdgeTones + 12;
using EdgeSpectrum = std::array<EdgeValue, kMaxTones>;

/// The band of a tone; tones beyond the last one are in the last band.
std::size_t bandOf(std::size_t tone) {
    return std::min(tone, kEdgeTones - 1) * static_cast<std::size_t>(kBandCount) / kEdgeTones;
}

std::vector<double> tonesOf(int sampleRate) {
    std::vector<double> hz;
    while (hz.size() < kEdgeTones || (hz.size() < kMaxTones && hz.back() < 0.5 * sampleRate))
        hz.push_back(edgeToneHz(static_cast<double>(hz.size())));
    return hz;
}

const std::shared_ptr<const PoleFit>& fitFor(int sampleRate) {
    thread_local std::vector<std::pair<int, std::shared_ptr<const PoleFit>>> all;
    for (const auto& [rate, one] : all)
        if (rate == sampleRate) return one;
    return all.emplace_back(sampleRate, std::make_shared<const PoleFit>(sampleRate, tonesOf(sampleRate))).second;
}

/// Adds the weights of a spectrum of as many tones as the fit has.
void addWeights(const PoleFit& fit, const EdgeSpectrum& spectrum, PoleBank::Weights& weights) {
    const PoleFit::Weights more = fit.weightsOf(std::span(spectrum).first(fit.hz().size()));
    for (std::size_t k = 0; k < weights.size(); ++k) weights[k] += static_cast<float>(more[k]);
}

/// The pressure that the edge bends, by tone, relative to the phase of its shortest way.
EdgeSpectrum bentBy(const FollowedEdge& edge, const WedgePath& path) {
    const WedgeBend bend(path);
    EdgeSpectrum spectrum{};
    for (std::size_t tone = 0; tone < edge.fit->hz().size(); ++tone) {
        const std::size_t b = bandOf(tone);
        const auto [direct, mirrored] = bend.at(2 * kHalfTurn * edge.fit->hz()[tone] / edge.speedOfSound);
        spectrum[tone] = edge.colour[b] * (direct + edge.bends.mirrors[b] * mirrored);
    }
    return spectrum;
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
        const EdgePath now = edgePath(route, source, listener);
        const auto nearer = static_cast<float>(now.length > 0 ? std::min(10.0, pathLength / now.length) : 1);
        for (std::size_t k = 0; k < weights.size(); ++k) weights[k] = rest[k] * nearer;
        return true;
    }
    WedgePath path = pathAbout(route, bends, source, listener);
    if (!isInAir(path)) return false;
    const double difference = path.receiverAngle - path.sourceAngle;
    if (std::abs(kHalfTurn - std::abs(difference)) < kAtBoundary)
        path.receiverAngle = path.sourceAngle + std::copysign(kHalfTurn + (heard ? -kBeside : kBeside), difference);
    weights = rest;
    addWeights(*fit, bentBy(*this, path), weights);
    return true;
}

double FollowedEdge::boundaryGain(std::size_t face, const glm::dvec3& source, const glm::dvec3& listener) const {
    const WedgePath path = pathAbout(route, bends, source, listener);
    if (!isInAir(path)) return 0;
    return (isMirrored(path, face) ? 1 : 0) - (mirrored[face] ? 1 : 0);
}

namespace {

double waveEnergy(const EdgeWave& wave) {
    double sum = 0;
    for (const std::complex<float>& tone : wave.pressure) sum += static_cast<double>(std::norm(tone));
    return sum * kBandCount / kEdgeTones / (4 * kHalfTurn);
}

/// Whether its route is that of its delay.
bool hasRoute(const EdgeWave& wave, const glm::dvec3& source, const glm::dvec3& listener, double speedOfSound) {
    const double length = edgePath(wave.route, source, listener).length;
    return std::abs(length - wave.seconds * speedOfSound) < 1e-6 * (1 + length);
}

/// Selects the part of the waves that is followed.
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
        edge->pathLength = wave.seconds * options_.air.speedOfSound;
        edge->speedOfSound = options_.air.speedOfSound;
        edge->fit = fitFor(sampleRate_);
        if (!(wave.bends.opening > 0)) {
            addRest(wave, {}, *edge);
            return edge;
        }
        const double sent = sentTo(wave.route.first);
        for (std::size_t b = 0; b < kBandCount; ++b)
            edge->colour[b] = std::sqrt(sent * std::exp(-attenuation_[b] * edge->pathLength));  // as weaken() has it
        const WedgePath path = pathAbout(wave.route, wave.bends, source_, listener_);
        for (std::size_t face = 0; face < 2; ++face) edge->mirrored[face] = isMirrored(path, face);
        if (!isAtBoundary(path)) addRest(wave, bentBy(*edge, path), *edge);
        return edge;
    }

    /// The image by a face, with its amplitude at a metre.
    FollowedImage boundary(const std::shared_ptr<const FollowedEdge>& edge, std::size_t face) const {
        const BendingEdge& bends = edge->bends;
        const glm::dvec3 normal =
            face == 0 ? bends.beside : std::cos(bends.opening) * bends.beside - std::sin(bends.opening) * bends.face;
        FollowedImage image;
        image.kind = FollowedImage::Kind::boundary;
        image.edge = edge;
        image.face = face;
        image.rotation = glm::dmat3(1.0) - 2.0 * glm::outerProduct(normal, normal);
        image.offset = 2 * glm::dot(normal, edge->route.first) * normal;
        const double sent = sentTo(edge->route.first), pathLength = glm::distance(image.at(source_), listener_);
        Bands amplitudes;
        for (std::size_t b = 0; b < kBandCount; ++b)
            amplitudes[b] = bends.mirrors[b] * std::sqrt(sent * std::exp(-attenuation_[b] * pathLength));
        setAmplitudes(image, amplitudes, sampleRate_, block_);
        return image;
    }

  private:
    double sentTo(const glm::dvec3& by) const {
        return options_.pattern ? options_.pattern(glm::normalize(by - source_)) : 1;
    }
    /// There the wave was chosen to fit its traced side, which is chance.
    static bool isAtBoundary(const WedgePath& path) {
        const double difference = std::abs(path.receiverAngle - path.sourceAngle);
        const double sum = path.receiverAngle + path.sourceAngle, image = std::min(sum, 2 * path.opening - sum);
        return std::abs(kHalfTurn - difference) < kAtBoundary ||
               std::abs(kHalfTurn - image) * path.receiverRadius < 0.01;
    }
    /// The part of the wave that the closed form does not give.
    static void addRest(const EdgeWave& wave, const EdgeSpectrum& known, FollowedEdge& edge) {
        EdgeSpectrum rest{};
        double maximum = 0, all = 0;
        for (std::size_t tone = 0; tone < rest.size(); ++tone) {
            const EdgeValue pressure(wave.pressure[std::min(tone, kEdgeTones - 1)]);
            rest[tone] = pressure - known[std::min(tone, kEdgeTones - 1)];
            maximum = std::max(maximum, std::abs(rest[tone]));
            all = std::max(all, std::abs(pressure));
        }
        if (maximum > kMinRest * all) addWeights(*edge.fit, rest, edge.rest);
    }

    const glm::dvec3 source_, listener_;
    const TraceOptions& options_;
    const Bands attenuation_;
    const int sampleRate_;
    const std::size_t block_;
};

}  // namespace

void addFollowedEdges(const Echogram& echogram, const glm::dvec3& source, const glm::dvec3& listener,
                      const TraceOptions& options, int sampleRate, std::size_t block, std::size_t maximum,
                      std::vector<FollowedImage>& followed) {
    const std::vector<EdgeWave>& waves = echogram.edges.waves;
    if (waves.empty()) return;
    double all = 0;
    for (const double band : echogram.total()) all += band;
    std::vector<std::pair<double, std::size_t>> loudest;
    for (std::size_t i = 0; i < waves.size(); ++i) {
        const double energy = waveEnergy(waves[i]);
        if (energy > kMinWave * all && hasRoute(waves[i], source, listener, options.air.speedOfSound))
            loudest.emplace_back(-energy, i);
    }
    const std::size_t count = std::min(maximum, loudest.size());
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
