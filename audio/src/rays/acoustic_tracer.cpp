// Follows rays from a source through a room in parallel batches, for all listeners, and adds image sources.
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

#include <rtsg/renderers/parallel_for.h>

#include "acoustic_tracer.h"
#include "batch_tracer.h"
#include "diffraction_images.h"
#include "images/image_sources.h"
#include "probe_ray.h"
#include "walls/even_direction.h"

namespace rtsg {
namespace {

using namespace trace;

/// Moves a mean towards fresh values that make up this share of all.
void mix(Bands& mean, const Bands& fresh, double weight) {
    for (std::size_t b = 0; b < kBandCount; ++b) mean[b] += (fresh[b] - mean[b]) * weight;
}

/// TraceResult::across. Up is that of X3D.
glm::dvec3 axisAcross(const glm::dvec3& source, const glm::dvec3& listener) {
    const glm::dvec3 displacement = source - listener, right(-displacement.z, 0, displacement.x);
    const double length = glm::length(right);
    return length > 1e-6 * glm::length(displacement) ? right / length : glm::dvec3(1, 0, 0);
}

}  // namespace

bool TraceResult::silent() const {
    return arrivals.empty() && std::all_of(batches.begin(), batches.end(), [](const EnergyHistogram& batch) {
               return std::all_of(batch.bins.begin(), batch.bins.end(),
                                  [](const Bands& bin) { return bin == Bands{}; });
           });
}

Echogram TraceResult::echogram() const {
    Echogram result;
    result.arrivals = arrivals;
    result.edges = edges;
    if (!batches.empty()) {
        result.late.binsPerSecond = batches.front().binsPerSecond;
        result.late.start = batches.front().start;
    }
    for (const EnergyHistogram& batch : batches)
        result.late.accumulate(batch, 1.0 / static_cast<double>(batches.size()));
    return result;
}

MetricsEstimate TraceResult::metrics() const {
    MetricsEstimate result = estimateMetrics(arrivals, batches, across);
    constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
    for (std::size_t b = 0; b < kBandCount; ++b)
        for (RoomMetrics* m : {&result.value, &result.ci95}) {
            if (truncated[b] > 3e-5) m->t30[b] = kNan;
            if (truncated[b] > 3e-4) m->t20[b] = kNan;
            if (truncated[b] <= 1e-2) continue;
            // All of these need the energy that was still to come, and in a room that absorbs nothing it has no end.
            for (Bands* figure : {&m->edt, &m->c50, &m->c80, &m->d50, &m->ts, &m->g, &m->lf}) (*figure)[b] = kNan;
        }
    // Nothing that arrived by chance is no proof that nothing would: how far the figures are off is not known.
    for (std::size_t b = 0; b < kBandCount; ++b) {
        if (!(tried[b] > 0) || std::any_of(batches.begin(), batches.end(), [&](const EnergyHistogram& batch) {
                return std::any_of(batch.bins.begin(), batch.bins.end(), [&](const Bands& bin) { return bin[b] > 0; });
            }))
            continue;
        RoomMetrics& m = result.ci95;
        for (Bands* figure : {&m.edt, &m.t20, &m.t30, &m.c50, &m.c80, &m.d50, &m.ts, &m.g, &m.lf}) (*figure)[b] = kNan;
    }
    return result;
}

namespace {

constexpr double kMax = 60;  // seconds of an echogram that is as long as it need be

/// A ray that is followed until its energy is gone.
struct FadingRay {
    static constexpr int kMaxReflections = 4000;
    static constexpr double kGone = 3e-7, kShort = 10;

    ProbeRay ray;  // its energy: of the band of each class from which air takes least, the lowest
    Random random;
    int reflections = 0;

    bool goesOn(double speedOfSound) const {
        // Sound that fades slowly in a small room would take rays without end.
        const bool tooSlow = reflections > kMaxReflections && ray.metres > kShort * speedOfSound;
        return ray.maximum() > kGone && ray.metres < kMax * speedOfSound && !tooSlow;
    }
    void meet(const AcousticHit& hit, const AcousticMaterial& material, const BandClasses& classes,
              const Bands& attenuation) {
        ray.meet(hit, material, classes, random);
        for (std::size_t c = 0; c < classes.count; ++c)
            if (const double takes = attenuation[classes.first[c]]; takes > 0)
                ray.energy[c] *= std::exp(-takes * hit.distance);
        ++reflections;
    }
};

/// How long it takes until the energy of a source has fallen by 65 dB in all bands: the longest time among some rays.
double decaySeconds(const AcousticGeometry& geometry, const glm::dvec3& source, const TraceOptions& options) {
    constexpr int kRays = 64;
    const double speed = options.air.speedOfSound;
    const Bands attenuation = airAttenuation(options.air);
    const BandClasses classes = bandClasses(geometry.materials());
    Bands full{};
    std::fill_n(full.begin(), classes.count, 1.0);
    double longest = 0;
    std::vector<FadingRay> lanes;
    for (int sent = 0; sent < kRays || !lanes.empty();) {
        for (; lanes.size() < AcousticRays::kMax && sent < kRays; ++sent)
            lanes.push_back({.ray = {.origin = source, .direction = evenDirection(sent, kRays), .energy = full},
                             .random = Random(Random::mix(options.seed, 0xDECA + static_cast<std::uint64_t>(sent)))});
        AcousticRays rays;
        for (const auto& [ray, random, reflections] : lanes)
            rays.add(ray.origin, ray.facing, ray.direction, 1e6, ray.plane);
        AcousticHits hits;
        const std::uint32_t met = geometry.closestOf(rays, hits);
        std::size_t left = 0;
        for (std::size_t i = 0; i < lanes.size(); ++i) {
            FadingRay& fading = lanes[i];
            const bool shut = (met >> i & 1) != 0;
            if (shut) fading.meet(hits[i], geometry.materials()[hits[i].material], classes, attenuation);
            longest = std::max(longest, fading.ray.metres);
            if (shut && fading.goesOn(speed)) lanes[left++] = fading;
        }
        lanes.erase(lanes.begin() + static_cast<std::ptrdiff_t>(left), lanes.end());
    }
    return longest / speed;
}

/// The ball around the listener in which rays are counted.
void chooseReceiver(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener,
                    const TraceOptions& options, TraceResult& result) {
    const Surroundings around = surroundings(geometry, listener, std::max(1.0, glm::distance(source, listener)));
    const double size = std::cbrt(around.volume);
    const double radius =
        options.receiverRadius > 0 ? options.receiverRadius : std::min(std::max(0.5, 0.065 * size), 0.2 * size);
    // Smaller before a wall, but not so small that it is hardly hit.
    result.receiverRadius = std::clamp(0.95 * around.nearest, 0.5 * radius, radius);
    result.receiverVolume = around.nearest < result.receiverRadius
                                ? visibleVolume(geometry, listener, result.receiverRadius)
                                : ballVolume(result.receiverRadius);
}

}  // namespace

namespace {

/// Mirror images as far as they are worth it: all of the paths that keep the shares tried, from the largest on, as long
/// as these are few; else as many orders as are allowed.
struct WorthyImages {
    ImageSourceOptions options;
    ImageCandidates candidates;
};
WorthyImages imagesWorth(const AcousticGeometry& geometry, const glm::dvec3& source, const TraceOptions& options,
                         double seconds) {
    constexpr std::size_t kFew = 4000;
    constexpr double kFractions[] = {3e-2, 3e-3, 3e-4, 3e-5, 3e-6, 1e-7};
    ImageSourceOptions asked;
    asked.maxOrder = options.imageOrder;
    asked.maxCandidates = options.maxImageCandidates;
    asked.maxDistance = seconds * options.air.speedOfSound;
    asked.pattern = options.pattern;
    std::optional<ImageCandidates> best;
    if (options.imageOrder >= TraceOptions().imageOrder)
        for (const double tried : kFractions) {
            ImageSourceOptions some = asked;
            some.minFraction = tried;
            if (best) some.maxCandidates = std::min(kFew, asked.maxCandidates);
            ImageCandidates candidates(geometry, source, some);
            if (!candidates.found().complete) break;
            asked.minFraction = tried;
            best = std::move(candidates);
            if (best->found().candidates > kFew / 4) break;
        }
    if (!best) best.emplace(geometry, source, asked);
    return {asked, std::move(*best)};
}

/// Energy by band from energy by class of bands.
template <std::size_t N>
double bandOf(const Energy<N>& energy, const BandClasses& classes, std::size_t band) {
    return energy[N == 1 ? 0 : classes.of[band]];
}

/// The share of energy that air leaves after some metres.
Bands airFraction(const Bands& attenuation, double metres) {
    Bands fraction;
    for (std::size_t b = 0; b < kBandCount; ++b) fraction[b] = std::exp(-attenuation[b] * metres);
    return fraction;
}

/// Listeners that hear one source from the same place, and so share its rays.
struct Group {
    glm::dvec3 source;
    std::vector<TraceResult*> results;
    std::vector<glm::dvec3> listeners;  // off the walls that they touch
};

/// The results of listeners that hear anything, by where the source is for them: on a wall that depends on the side
/// from which it is looked at.
std::vector<Group> groupsOf(const AcousticGeometry& geometry, const glm::dvec3& from,
                            std::span<const glm::dvec3> listeners, std::span<TraceResult> results) {
    std::vector<Group> groups;
    for (std::size_t i = 0; i < std::min(listeners.size(), results.size()); ++i) {
        // A place that is none, or farther away than anything is heard, neither sends nor receives.
        if (!(glm::distance(from, listeners[i]) < 1e6)) continue;
        const glm::dvec3 source = outsideBodies(geometry, from, listeners[i]);
        auto group = std::find_if(groups.begin(), groups.end(), [&](const Group& g) { return g.source == source; });
        if (group == groups.end()) group = groups.insert(group, {source, {}, {}});
        group->results.push_back(&results[i]);
        group->listeners.push_back(outsideBodies(geometry, listeners[i], from));
    }
    return groups;
}

/// Adds the energy that the batches of one run brought a listener to its result, where this run has the share `weight`.
template <std::size_t N>
void addHeard(TraceResult& result, std::vector<Batch<N>>& fresh, const BandClasses& classes, std::size_t listener,
              const TraceOptions& options, const Bands& attenuation, double weight) {
    const std::size_t count = result.batches.size();
    const double metresPerBin = options.air.speedOfSound / options.binsPerSecond;
    const Bands perBin = airFraction(attenuation, metresPerBin);
    Bands tried{};
    const auto mixIn = [&](std::vector<Bands>& mean, std::vector<Energy<N>>& bins, const EnergyHistogram& times) {
        for (Bands& bin : mean)
            for (double& energy : bin) energy *= 1 - weight;
        while (!bins.empty() && !(largest<N>(bins.back()) > 0)) bins.pop_back();
        if (mean.size() < bins.size()) mean.resize(bins.size(), Bands{});
        // Air absorbs as at the middle of each bin.
        Bands air = airFraction(attenuation, (times.startOf(0) * options.binsPerSecond + 0.5) * metresPerBin);
        for (std::size_t k = 0; k < bins.size(); ++k)
            for (std::size_t b = 0; b < kBandCount; ++b) {
                mean[k][b] += weight * bandOf<N>(bins[k], classes, b) * air[b];
                air[b] *= perBin[b];
            }
    };
    for (std::size_t i = 0; i < count; ++i) {
        mixIn(result.batches[i].bins, fresh[i].heard[listener].bins, result.batches[i]);
        mixIn(result.batches[i].lateral, fresh[i].heard[listener].lateral, result.batches[i]);
        for (std::size_t b = 0; b < kBandCount; ++b)
            tried[b] += bandOf<N>(fresh[i].heard[listener].tried, classes, b) / static_cast<double>(count);
    }
    mix(result.tried, tried, weight);
}

/// The energy of one run by its fate.
struct Fate {
    Bands absorbed{}, escaped{}, truncated{};
};

template <std::size_t N>
Fate fateOf(const std::vector<Batch<N>>& batches, const BandClasses& classes, const Bands& attenuation) {
    Fate fate;
    const double fraction = 1.0 / static_cast<double>(batches.size());
    const auto collect = [&](const std::vector<std::pair<Energy<N>, double>>& rays, Bands& into) {
        for (const auto& [energy, metres] : rays) {
            const Bands left = airFraction(attenuation, metres);
            for (std::size_t b = 0; b < kBandCount; ++b) into[b] += fraction * bandOf<N>(energy, classes, b) * left[b];
        }
    };
    Bands sent{};
    for (const Batch<N>& batch : batches) {
        collect(batch.escaped, fate.escaped);
        collect(batch.truncated, fate.truncated);
        for (std::size_t b = 0; b < kBandCount; ++b) sent[b] += fraction * bandOf<N>(batch.sent, classes, b);
    }
    for (std::size_t b = 0; b < kBandCount; ++b) fate.absorbed[b] = sent[b] - fate.escaped[b] - fate.truncated[b];
    return fate;
}

/// Adds the rays that left; those of one run after the other, as each was sent with the same.
template <std::size_t N>
void addExits(const std::vector<Batch<N>>& batches, const BandClasses& classes, const Bands& attenuation,
              std::vector<EscapedRay>& exits) {
    constexpr std::size_t kMaxExits = 4096;
    for (const Batch<N>& batch : batches)
        for (const typename Batch<N>::Exit& exit : batch.exits) {
            if (exits.size() >= kMaxExits) return;
            Bands energy = airFraction(attenuation, exit.metres);
            for (std::size_t b = 0; b < kBandCount; ++b) energy[b] *= bandOf<N>(exit.energy, classes, b);
            exits.push_back({exit.origin, exit.direction, energy});
        }
}

/// Finds the images of listeners with which walls that scatter are connected: few, as each of these walls chooses from
/// all. Ways through walls that let sound pass have no end of their own, so that none are looked for there.
void connect(const AcousticGeometry& geometry, const TraceOptions& options, std::vector<Ear>& ears) {
    constexpr std::size_t kMaxOfOne = 64, kMaxOfAll = 96;
    const auto materials = geometry.materials();
    if (options.connectedOrder <= 0 || std::any_of(materials.begin(), materials.end(), [](const AcousticMaterial& m) {
            return std::any_of(m.transmission.begin(), m.transmission.end(),
                               [](double fraction) { return fraction > 0; });
        }))
        return;
    for (Ear& ear : ears)
        ear.images = ListenerImages(geometry, ear.position, options.connectedOrder,
                                    std::min(kMaxOfOne, kMaxOfAll / ears.size()));
}

/// Adds rays to the batches of a group's results; energies are in at most N classes of bands.
template <std::size_t N>
void refineAs(const AcousticGeometry& geometry, const BandClasses& classes, const Group& group,
              const TraceOptions& options, std::uint64_t each) {
    const TraceResult& first = *group.results.front();
    std::vector<Ear> ears;
    for (std::size_t k = 0; k < group.results.size(); ++k)
        ears.emplace_back(group.listeners[k], *group.results[k], options.air.speedOfSound);
    connect(geometry, options, ears);
    const Task<N> task(geometry, classes, group.source, std::move(ears), options, first.seconds);
    std::vector<Batch<N>> fresh(first.batches.size());
    const std::uint64_t before = first.rays;
    parallelFor(fresh.size(), [&](std::size_t i) {
        BatchTracer<N>(task, fresh[i], Random::mix(options.seed, Random::mix(before, i))).run(each);
    });
    const Bands attenuation = airAttenuation(options.air);
    const Fate fate = fateOf(fresh, classes, attenuation);
    const std::uint64_t rays = each * fresh.size();
    for (std::size_t k = 0; k < group.results.size(); ++k) {
        TraceResult& result = *group.results[k];
        const double weight = static_cast<double>(rays) / static_cast<double>(result.rays + rays);
        addHeard(result, fresh, classes, k, options, attenuation, weight);
        mix(result.absorbed, fate.absorbed, weight);
        mix(result.escaped, fate.escaped, weight);
        mix(result.truncated, fate.truncated, weight);
        addExits(fresh, classes, attenuation, result.exits);
        result.rays += rays;
    }
}

void refineGroup(const AcousticGeometry& geometry, const Group& group, const TraceOptions& options,
                 std::uint64_t rays) {
    const std::size_t count = group.results.front()->batches.size();
    const std::uint64_t each = count == 0 ? 0 : (rays + count - 1) / count;
    if (each == 0) return;
    const BandClasses classes = bandClasses(geometry.materials());
    // The counts of classes are the widths of vector instructions.
    const auto refine = classes.count == 1   ? refineAs<1>
                        : classes.count <= 4 ? refineAs<4>
                        : classes.count <= 8 ? refineAs<8>
                                             : refineAs<kBandCount>;
    refine(geometry, classes, group, options, each);
}

/// Whether direct sound has the level of a centimetre, to which nothing that bends adds: of the interference with it
/// only roundings would be left.
bool isAtTheListener(const glm::dvec3& source, const glm::dvec3& listener, const std::vector<Arrival>& arrivals) {
    constexpr double kBounded = 0.01;
    return glm::distance(source, listener) < kBounded &&
           std::ranges::any_of(arrivals, [](const Arrival& one) { return one.order == 0; });
}

/// All of a result but for what rays bring.
void startResult(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener,
                 const TraceOptions& options, const WorthyImages& worth, double seconds, TraceResult& result) {
    result.seconds = seconds;
    if (options.lateral) result.across = axisAcross(source, listener);
    result.bandsTraced = static_cast<int>(bandClasses(geometry.materials()).count);
    result.imageFraction = worth.options.minFraction;
    chooseReceiver(geometry, source, listener, options, result);
    ImageSourceOptions asked = worth.options;
    asked.ball = result.receiverRadius;
    ImageSources images = findImageSources(geometry, worth.candidates, listener, asked, options.air.speedOfSound,
                                           airAttenuation(options.air));
    result.arrivals = std::move(images.arrivals);
    if (options.diffractionOrder > 0 && !isAtTheListener(source, listener, result.arrivals)) {
        const BentBy bending = addBending(geometry, source, listener, options, seconds, result.arrivals, result.edges);
        result.edgePairs = bending.pairs;
        if (options.imageOrder > 0) addBentImages(geometry, source, listener, options, bending.parts, result);
    }
    result.imageOrder = images.order;
    result.imageCandidates = images.candidates;
    const double start =
        result.arrivals.empty() ? 0 : std::fmod(result.arrivals.front().seconds, 1 / options.binsPerSecond);
    result.batches.assign(static_cast<std::size_t>(std::max(2, options.batches)),
                          EnergyHistogram{options.binsPerSecond, {}, start});
}

}  // namespace

std::vector<TraceResult> AcousticTracer::trace(const glm::dvec3& source, std::span<const glm::dvec3> listeners,
                                               const TraceOptions& options) const {
    std::vector<TraceResult> results(listeners.size());
    for (const Group& group : groupsOf(*geometry_, source, listeners, results)) {
        double farthest = 0;
        for (const glm::dvec3& listener : group.listeners)
            farthest = std::max(farthest, glm::distance(group.source, listener));
        const double seconds =
            options.maxSeconds > 0
                ? options.maxSeconds
                : std::clamp(decaySeconds(*geometry_, group.source, options) + 2 * farthest / options.air.speedOfSound,
                             1.0, kMax);
        const WorthyImages worth = imagesWorth(*geometry_, group.source, options, seconds);
        for (std::size_t k = 0; k < group.results.size(); ++k)
            startResult(*geometry_, group.source, group.listeners[k], options, worth, seconds, *group.results[k]);
        refineGroup(*geometry_, group, options, options.rays);
    }
    return results;
}

TraceResult AcousticTracer::trace(const glm::dvec3& source, const glm::dvec3& listener,
                                  const TraceOptions& options) const {
    return std::move(trace(source, std::span(&listener, 1), options).front());
}

void AcousticTracer::refine(std::span<TraceResult> results, const glm::dvec3& source,
                            std::span<const glm::dvec3> listeners, const TraceOptions& options,
                            std::uint64_t rays) const {
    for (const Group& group : groupsOf(*geometry_, source, listeners, results))
        refineGroup(*geometry_, group, options, rays);
}

void AcousticTracer::refine(TraceResult& result, const glm::dvec3& source, const glm::dvec3& listener,
                            const TraceOptions& options, std::uint64_t rays) const {
    refine(std::span(&result, 1), source, std::span(&listener, 1), options, rays);
}

double AcousticTracer::refineTo(std::span<TraceResult> results, const glm::dvec3& source,
                                std::span<const glm::dvec3> listeners, const TraceOptions& options, double error,
                                std::uint64_t maxRays, const std::function<bool()>& goOn) const {
    const auto worst = [&] {
        double maximum = 0;
        for (const TraceResult& result : results) maximum = std::max(maximum, largestError(result.metrics()));
        return maximum;
    };
    const auto sent = [&] {
        std::uint64_t maximum = 0;
        for (const TraceResult& result : results) maximum = std::max(maximum, result.rays);
        return maximum;
    };
    double now = worst();
    for (std::uint64_t rays = sent(); now > error && rays > 0 && rays < maxRays && (!goOn || goOn()); rays = sent()) {
        // Errors fall with the root of the rays; never more than four times as many on a guess.
        const double ratio = std::min(2.0, now / error);
        const auto more = static_cast<std::uint64_t>(static_cast<double>(rays) * std::max(0.2, ratio * ratio - 1));
        refine(results, source, listeners, options, std::min(std::max<std::uint64_t>(more, 1), maxRays - rays));
        now = worst();
    }
    return now;
}

double AcousticTracer::refineTo(TraceResult& result, const glm::dvec3& source, const glm::dvec3& listener,
                                const TraceOptions& options, double error, std::uint64_t maxRays,
                                const std::function<bool()>& goOn) const {
    return refineTo(std::span(&result, 1), source, std::span(&listener, 1), options, error, maxRays, goOn);
}

}  // namespace rtsg
