// Follows rays from a source through a room in parallel batches, and adds image sources to what they bring.
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <tbb/parallel_for.h>

#include <rtsg/audio/acoustic_tracer.h>

#include "places.h"
#include "signal/random.h"

namespace rtsg {
namespace {

constexpr double kPi = std::numbers::pi;
/// Share of a ray's energy at which Russian roulette begins, and the chance to survive it.
constexpr double kRouletteStart = 1e-6;
constexpr double kRouletteSurvival = 0.2;

enum class LastEvent : std::uint8_t { emitted, diffuse, mirror };

struct SoundRay {
    glm::dvec3 origin, direction;
    Bands energy;
    glm::dvec3 before;     // where it came from to `origin`
    double travelled = 0;  // metres
    std::uint32_t plane = kNoPlane;
    LastEvent last = LastEvent::emitted;
    int mirrorOrder = 0;  // reflections while all were mirror-like
    bool onlyMirrors = true;
};

struct Batch {
    EnergyHistogram histogram;
    Bands absorbed{}, escaped{}, truncated{}, tried{};
};

glm::dvec3 directionFrom(double u, double v) {
    const double z = 1 - 2 * u, r = std::sqrt(std::max(0.0, 1 - z * z)), phi = 2 * kPi * v;
    return {r * std::cos(phi), r * std::sin(phi), z};
}

/// Lambert-distributed about a unit normal.
glm::dvec3 cosineDirection(const glm::dvec3& normal, Random& random) {
    const double u = random.uniform(), phi = 2 * kPi * random.uniform();
    const glm::dvec3 helper = std::abs(normal.x) < 0.7 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0);
    const glm::dvec3 tangent = glm::normalize(glm::cross(helper, normal)), bitangent = glm::cross(normal, tangent);
    const double r = std::sqrt(u);
    return r * std::cos(phi) * tangent + r * std::sin(phi) * bitangent + std::sqrt(std::max(0.0, 1 - u)) * normal;
}

double largest(const Bands& energy) {
    return *std::max_element(energy.begin(), energy.end());
}
double sum(const Bands& energy) {
    double result = 0;
    for (const double e : energy) result += e;
    return result;
}

double ballVolume(double radius) {
    return 4 * kPi / 3 * radius * radius * radius;
}

class BatchTracer {
  public:
    BatchTracer(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener,
                const TraceOptions& options, const TraceResult& result, Batch& batch, std::uint64_t seed)
        : geometry_(geometry),
          source_(source),
          listener_(listener),
          imageOrder_(result.imageOrder),
          radius_(result.receiverRadius),
          sphereVolume_(result.receiverVolume),
          cut_(result.receiverVolume < ballVolume(result.receiverRadius) * (1 - 1e-9)),
          maxDistance_(result.seconds * options.air.speedOfSound),
          speed_(options.air.speedOfSound),
          pattern_(options.pattern),
          attenuation_(airAttenuation(options.air)),
          airAbsorbs_(largest(attenuation_) > 0),
          batch_(batch),
          random_(seed) {}

    void run(std::uint64_t rays) {
        // Evenly spread directions, shifted at random: unbiased, less noise, and batches stay independent.
        const double shiftU = random_.uniform(), shiftV = random_.uniform();
        constexpr double kPlastic = 1.32471795724474602596;  // the R2 sequence
        for (std::uint64_t i = 0; i < rays; ++i) {
            const double n = static_cast<double>(i) + 1;
            SoundRay ray;
            ray.origin = ray.before = source_;
            const double u = n / kPlastic + shiftU, v = n / (kPlastic * kPlastic) + shiftV;
            ray.direction = directionFrom(u - std::floor(u), v - std::floor(v));
            initial_ = 1 / static_cast<double>(rays);
            ray.energy = allBands(pattern_ ? initial_ * pattern_(ray.direction) : initial_);
            if (largest(ray.energy) > 0) follow(ray);
        }
    }

  private:
    void follow(SoundRay& ray) {
        for (;;) {
            AcousticHit hit;
            const double left = maxDistance_ - ray.travelled;
            bool met = geometry_.closest(ray.origin, ray.direction, left, ray.plane, hit);
            if (!met && ray.plane != kNoPlane) {
                // In a corner rounding may have put the start behind the next wall, or the ray between two of them.
                const glm::dvec3 inside = offWalls(geometry_, ray.origin, ray.before);
                met = geometry_.closest(inside, ray.direction, left, kNoPlane, hit);
                if (met) ray.origin = inside;
            }
            if (countsInSphere(ray)) crossSphere(ray, met ? hit.distance : left);
            if (!met) {
                // Beyond the echogram's end there may still be a wall: then the sound is late, not gone.
                const bool wall = geometry_.closest(ray.origin, ray.direction, 1e9, ray.plane, hit);
                add(wall ? batch_.truncated : batch_.escaped, ray.energy);
                return;
            }
            if (!interact(ray, hit)) return;
        }
    }

    bool countsInSphere(const SoundRay& ray) const {
        return ray.last == LastEvent::mirror && !(ray.onlyMirrors && ray.mirrorOrder <= imageOrder_);
    }

    /// Mean intensity over the ball is energy times chord over volume.
    void crossSphere(const SoundRay& ray, double length) {
        add(batch_.tried, ray.energy);
        const glm::dvec3 toCenter = listener_ - ray.origin;
        const double nearest = glm::dot(toCenter, ray.direction);
        const double half2 = radius_ * radius_ - (glm::dot(toCenter, toCenter) - nearest * nearest);
        if (half2 <= 0) return;
        const double half = std::sqrt(half2), from = std::max(0.0, nearest - half),
                     to = std::min(length, nearest + half);
        if (to <= from) return;
        double at = (from + to) / 2;
        if (cut_) {
            // One point of the chord stands for all: it counts if it is seen from the listener.
            at = from + (to - from) * random_.uniform();
            const glm::dvec3 toPoint = ray.origin + ray.direction * at - listener_;
            const double distance = glm::length(toPoint);
            AcousticHit hit;
            if (distance > 0 && geometry_.closest(listener_, toPoint / distance, distance, kNoPlane, hit)) return;
        }
        receive(ray.energy, (to - from) / sphereVolume_, at, ray.travelled + at);
    }

    /// `distance` of it since the energy was last weakened by air.
    void receive(const Bands& energy, double factor, double distance, double travelled) {
        if (travelled >= maxDistance_) return;
        Bands received;
        for (std::size_t b = 0; b < kBandCount; ++b) {
            received[b] = energy[b] * factor;
            if (airAbsorbs_) received[b] *= std::exp(-attenuation_[b] * distance);
        }
        batch_.histogram.add(travelled / speed_, received);
    }

    bool interact(SoundRay& ray, const AcousticHit& hit) {
        const AcousticMaterial& material = geometry_.materials()[hit.material];
        const double step = hit.distance, cosine = glm::dot(ray.direction, hit.normal);
        const glm::dvec3 point = ray.origin + ray.direction * step;
        ray.before = ray.origin;
        ray.travelled += step;
        if (airAbsorbs_)
            for (std::size_t b = 0; b < kBandCount; ++b) {
                const double lost = ray.energy[b] * -std::expm1(-attenuation_[b] * step);
                batch_.absorbed[b] += lost;
                ray.energy[b] -= lost;
            }
        const glm::dvec3 facing = cosine > 0 ? -hit.normal : hit.normal;

        Bands diffuse, mirror, through;
        for (std::size_t b = 0; b < kBandCount; ++b) {
            const double reflected = std::max(0.0, material.reflected(b));
            diffuse[b] = ray.energy[b] * reflected * material.scattering[b];
            mirror[b] = ray.energy[b] * reflected * (1 - material.scattering[b]);
            through[b] = ray.energy[b] * material.transmission[b];
            batch_.absorbed[b] += ray.energy[b] - diffuse[b] - mirror[b] - through[b];
        }
        const double diffuseSum = sum(diffuse), mirrorSum = sum(mirror), throughSum = sum(through);
        const double all = diffuseSum + mirrorSum + throughSum;
        if (!(all > 0)) return false;
        if (diffuseSum > 0) nextEvent(point, facing, diffuse, hit.plane, ray.travelled);

        const double choice = random_.uniform() * all;
        double probability = 0;
        // Rounding may put the choice past the last share; a share of nothing is never chosen.
        if (diffuseSum > 0 && (choice < diffuseSum || mirrorSum + throughSum <= 0)) {
            ray.energy = diffuse;
            probability = diffuseSum / all;
            ray.direction = cosineDirection(facing, random_);
            ray.last = LastEvent::diffuse;
            ray.onlyMirrors = false;
        } else if (mirrorSum > 0 && (choice < diffuseSum + mirrorSum || throughSum <= 0)) {
            ray.energy = mirror;
            probability = mirrorSum / all;
            ray.direction -= hit.normal * (2 * cosine);
            ray.last = LastEvent::mirror;
            ++ray.mirrorOrder;
        } else {
            ray.energy = through;
            probability = throughSum / all;
        }
        ray.origin = point;
        ray.plane = hit.plane;
        for (double& e : ray.energy) e /= probability;
        if (largest(ray.energy) < kRouletteStart * initial_) {
            if (random_.uniform() >= kRouletteSurvival) return false;
            for (double& e : ray.energy) e /= kRouletteSurvival;
        }
        return true;
    }

    /// Lambert: of the energy scattered at `point` the listener gets cos / (pi d^2), through whatever lets sound pass.
    void nextEvent(const glm::dvec3& point, const glm::dvec3& normal, Bands energy, std::uint32_t plane,
                   double travelled) {
        const glm::dvec3 toListener = listener_ - point;
        const double distance = glm::length(toListener), cosine = glm::dot(toListener, normal) / distance;
        if (!(cosine > 0) || travelled + distance >= maxDistance_) return;
        add(batch_.tried, energy);
        const glm::dvec3 direction = toListener / distance;
        glm::dvec3 origin = point;
        double left = distance;
        AcousticHit hit;
        while (geometry_.closest(origin, direction, left, plane, hit)) {
            const AcousticMaterial& material = geometry_.materials()[hit.material];
            for (std::size_t b = 0; b < kBandCount; ++b) energy[b] *= material.transmission[b];
            if (!(largest(energy) > 0)) return;
            origin += direction * hit.distance;
            left -= hit.distance;
            plane = hit.plane;
        }
        receive(energy, cosine / (kPi * distance * distance), distance, travelled + distance);
    }

    static void add(Bands& target, const Bands& energy) {
        for (std::size_t b = 0; b < kBandCount; ++b) target[b] += energy[b];
    }

    const AcousticGeometry& geometry_;
    glm::dvec3 source_, listener_;
    int imageOrder_;
    double radius_, sphereVolume_;
    bool cut_;  // by walls
    double maxDistance_, speed_;
    const SourcePattern& pattern_;
    Bands attenuation_;
    bool airAbsorbs_;
    Batch& batch_;
    Random random_;
    double initial_ = 1;
};

/// Mean of what `oldRays` and `newRays` rays gave.
void mix(Bands& mean, const Bands& fresh, double weight) {
    for (std::size_t b = 0; b < kBandCount; ++b) mean[b] += (fresh[b] - mean[b]) * weight;
}

}  // namespace

Echogram TraceResult::echogram() const {
    Echogram result;
    result.arrivals = arrivals;
    if (!batches.empty()) {
        result.late.binsPerSecond = batches.front().binsPerSecond;
        result.late.start = batches.front().start;
    }
    for (const EnergyHistogram& batch : batches)
        result.late.accumulate(batch, 1.0 / static_cast<double>(batches.size()));
    return result;
}

MetricsEstimate TraceResult::metrics() const {
    MetricsEstimate result = estimateMetrics(arrivals, batches);
    constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
    for (std::size_t b = 0; b < kBandCount; ++b)
        for (RoomMetrics* m : {&result.value, &result.ci95}) {
            if (truncated[b] > 3e-5) m->t30[b] = kNan;
            if (truncated[b] > 3e-4) m->t20[b] = kNan;
            if (truncated[b] > 1e-2) m->edt[b] = kNan;
        }
    // Nothing that arrived by chance is no proof that nothing would: how far the figures are off is not known.
    for (std::size_t b = 0; b < kBandCount; ++b) {
        if (!(tried[b] > 0) || std::any_of(batches.begin(), batches.end(), [&](const EnergyHistogram& batch) {
                return std::any_of(batch.bins.begin(), batch.bins.end(), [&](const Bands& bin) { return bin[b] > 0; });
            }))
            continue;
        RoomMetrics& m = result.ci95;
        for (Bands* figure : {&m.edt, &m.t20, &m.t30, &m.c50, &m.c80, &m.d50, &m.ts, &m.g}) (*figure)[b] = kNan;
    }
    return result;
}

namespace {

constexpr double kMost = 60;  // seconds of an echogram that is as long as it need be

/// How long it takes until 65 dB of what a source emits are gone in all bands: the longest that any of some rays needs.
double decaySeconds(const AcousticGeometry& geometry, const glm::dvec3& source, const TraceOptions& options) {
    constexpr int kRays = 64, kMostReflections = 4000;
    constexpr double kGone = 3e-7, kShort = 10;
    const Bands attenuation = airAttenuation(options.air);
    Random random(Random::mix(options.seed, 0xDECA));
    double longest = 0;
    for (int i = 0; i < kRays; ++i) {
        glm::dvec3 origin = source, direction = evenDirection(i, kRays);
        std::uint32_t plane = kNoPlane;
        Bands energy = allBands(1);
        double metres = 0;
        for (int reflection = 0; largest(energy) > kGone && metres < kMost * options.air.speedOfSound; ++reflection) {
            AcousticHit hit;
            // What is slow to fade in a small room would take rays without end.
            if (reflection > kMostReflections && metres > kShort * options.air.speedOfSound) break;
            if (!geometry.closest(origin, direction, 1e6, plane, hit)) break;
            const AcousticMaterial& material = geometry.materials()[hit.material];
            double scattered = 0, mirrored = 0, through = 0;
            for (std::size_t b = 0; b < kBandCount; ++b) {
                scattered += energy[b] * material.reflected(b) * material.scattering[b];
                mirrored += energy[b] * material.mirrored(b);
                through += energy[b] * material.transmission[b];
                energy[b] *= (1 - material.absorption[b]) * std::exp(-attenuation[b] * hit.distance);
            }
            metres += hit.distance;
            origin += direction * hit.distance;
            plane = hit.plane;
            const double choice = random.uniform() * (scattered + mirrored + through);
            const double cosine = glm::dot(direction, hit.normal);
            if (choice < scattered)
                direction = cosineDirection(cosine > 0 ? -hit.normal : hit.normal, random);
            else if (choice < scattered + mirrored)
                direction -= hit.normal * (2 * cosine);
        }
        longest = std::max(longest, metres / options.air.speedOfSound);
    }
    return longest;
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

TraceResult AcousticTracer::trace(const glm::dvec3& from, const glm::dvec3& to, const TraceOptions& options) const {
    TraceResult result;
    // A place that is none, or farther away than anything is heard, neither sends nor receives.
    if (!(glm::distance(from, to) < 1e6)) return result;
    const glm::dvec3 source = offWalls(*geometry_, from, to), listener = offWalls(*geometry_, to, from);
    const double direct = glm::distance(source, listener) / options.air.speedOfSound;
    result.seconds = options.maxSeconds > 0
                         ? options.maxSeconds
                         : std::clamp(decaySeconds(*geometry_, source, options) + 2 * direct, 1.0, kMost);
    ImageSourceOptions imageOptions;
    imageOptions.maxOrder = options.imageOrder;
    imageOptions.maxCandidates = options.maxImageCandidates;
    imageOptions.maxDistance = result.seconds * options.air.speedOfSound;
    imageOptions.pattern = options.pattern;
    ImageSources images = findImageSources(*geometry_, source, listener, imageOptions, options.air.speedOfSound,
                                           airAttenuation(options.air));
    result.arrivals = std::move(images.arrivals);
    result.imageOrder = images.order;
    result.imageCandidates = images.candidates;
    chooseReceiver(*geometry_, source, listener, options, result);
    const double start =
        result.arrivals.empty() ? 0 : std::fmod(result.arrivals.front().seconds, 1 / options.binsPerSecond);
    result.batches.assign(static_cast<std::size_t>(std::max(2, options.batches)),
                          EnergyHistogram{options.binsPerSecond, {}, start});
    refine(result, source, listener, options, options.rays);
    return result;
}

void AcousticTracer::refine(TraceResult& result, const glm::dvec3& from, const glm::dvec3& to,
                            const TraceOptions& options, std::uint64_t rays) const {
    const std::size_t count = result.batches.size();
    if (count == 0) return;
    const glm::dvec3 source = offWalls(*geometry_, from, to), listener = offWalls(*geometry_, to, from);
    const std::uint64_t each = (rays + count - 1) / count;
    if (each == 0) return;
    std::vector<Batch> fresh(count);
    tbb::parallel_for(std::size_t{0}, count, [&](std::size_t i) {
        fresh[i].histogram = EnergyHistogram{result.batches[i].binsPerSecond, {}, result.batches[i].start};
        BatchTracer(*geometry_, source, listener, options, result, fresh[i],
                    Random::mix(options.seed, Random::mix(result.rays, i)))
            .run(each);
    });
    const double total = static_cast<double>(result.rays + each * count);
    const double weight = static_cast<double>(each * count) / total;
    Bands absorbed{}, escaped{}, truncated{}, tried{};
    for (std::size_t i = 0; i < count; ++i) {
        for (Bands& bin : result.batches[i].bins)
            for (double& energy : bin) energy *= 1 - weight;
        result.batches[i].accumulate(fresh[i].histogram, weight);
        mix(absorbed, fresh[i].absorbed, 1.0 / static_cast<double>(i + 1));
        mix(escaped, fresh[i].escaped, 1.0 / static_cast<double>(i + 1));
        mix(truncated, fresh[i].truncated, 1.0 / static_cast<double>(i + 1));
        mix(tried, fresh[i].tried, 1.0 / static_cast<double>(i + 1));
    }
    mix(result.absorbed, absorbed, weight);
    mix(result.escaped, escaped, weight);
    mix(result.truncated, truncated, weight);
    mix(result.tried, tried, weight);
    result.rays += each * count;
}

double AcousticTracer::refineTo(TraceResult& result, const glm::dvec3& source, const glm::dvec3& listener,
                                const TraceOptions& options, double error, std::uint64_t maxRays,
                                const std::function<bool()>& goOn) const {
    double now = largestError(result.metrics());
    while (now > error && result.rays < maxRays && (!goOn || goOn())) {
        // Errors fall with the root of the rays; never more than four times as many on a guess.
        const double ratio = std::min(2.0, now / error);
        const auto more =
            static_cast<std::uint64_t>(static_cast<double>(result.rays) * std::max(0.2, ratio * ratio - 1));
        refine(result, source, listener, options, std::min(std::max<std::uint64_t>(more, 1), maxRays - result.rays));
        now = largestError(result.metrics());
    }
    return now;
}

}  // namespace rtsg
