// Follows rays from a source through a room in parallel batches, and adds image sources to what they bring.
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <tbb/parallel_for.h>

#include <rtsg/audio/acoustic_tracer.h>

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
    /// Just before the wall that `origin` is on, as seen by who came there.
    glm::dvec3 before;
    double travelled = 0;  // metres
    std::uint32_t plane = kNoPlane;
    LastEvent last = LastEvent::emitted;
    int mirrorOrder = 0;  // reflections while all were mirror-like
    bool onlyMirrors = true;
    bool transmitted = false;
};

struct Batch {
    EnergyHistogram histogram;
    Bands absorbed{}, escaped{}, truncated{};
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

class BatchTracer {
  public:
    BatchTracer(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener,
                const TraceOptions& options, int imageOrder, double radius, Batch& batch, std::uint64_t seed)
        : geometry_(geometry),
          source_(source),
          listener_(listener),
          imageOrder_(imageOrder),
          radius_(radius),
          sphereVolume_(4 * kPi / 3 * radius * radius * radius),
          maxDistance_(options.maxSeconds * options.air.speedOfSound),
          speed_(options.air.speedOfSound),
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
            ray.energy = allBands(1 / static_cast<double>(rays));
            initial_ = 1 / static_cast<double>(rays);
            follow(ray);
        }
    }

  private:
    void follow(SoundRay& ray) {
        for (;;) {
            AcousticHit hit;
            const double left = maxDistance_ - ray.travelled;
            bool met = geometry_.closest(ray.origin, ray.direction, left, ray.plane, hit);
            if (!met && ray.plane != kNoPlane && geometry_.closest(ray.before, ray.direction, left, ray.plane, hit)) {
                // In a corner rounding may have put the start behind the next wall; what is a hair before it is not.
                met = true;
                ray.origin = ray.before;
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
        return ray.last == LastEvent::mirror &&
               !(ray.onlyMirrors && !ray.transmitted && ray.mirrorOrder <= imageOrder_);
    }

    /// Mean intensity over the sphere is energy times chord over volume.
    void crossSphere(const SoundRay& ray, double length) {
        const glm::dvec3 toCenter = listener_ - ray.origin;
        const double nearest = glm::dot(toCenter, ray.direction);
        const double half2 = radius_ * radius_ - (glm::dot(toCenter, toCenter) - nearest * nearest);
        if (half2 <= 0) return;
        const double half = std::sqrt(half2), from = std::max(0.0, nearest - half),
                     to = std::min(length, nearest + half);
        if (to <= from) return;
        receive(ray.energy, (to - from) / sphereVolume_, (from + to) / 2, ray.travelled + (from + to) / 2);
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
        ray.before = point - ray.direction * std::min(step, 1e-6 * (10 + glm::length(point)));
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
            ray.transmitted = true;
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
    double radius_, sphereVolume_, maxDistance_, speed_;
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
    if (!batches.empty()) result.late.binsPerSecond = batches.front().binsPerSecond;
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
    return result;
}

TraceResult AcousticTracer::trace(const glm::dvec3& source, const glm::dvec3& listener,
                                  const TraceOptions& options) const {
    TraceResult result;
    // A place that is none, or farther away than anything is heard, neither sends nor receives.
    if (!(glm::distance(source, listener) < 1e6)) return result;
    ImageSourceOptions imageOptions;
    imageOptions.maxOrder = options.imageOrder;
    imageOptions.maxCandidates = options.maxImageCandidates;
    imageOptions.maxDistance = options.maxSeconds * options.air.speedOfSound;
    ImageSources images = findImageSources(*geometry_, source, listener, imageOptions, options.air.speedOfSound,
                                           airAttenuation(options.air));
    result.arrivals = std::move(images.arrivals);
    result.imageOrder = images.order;
    result.imageCandidates = images.candidates;
    // Cut by a surface, the sphere would be larger than the air in it; very small, it would never be hit.
    result.receiverRadius = std::clamp(0.95 * geometry_->distanceToSurface(listener),
                                       std::min(0.05, options.receiverRadius), options.receiverRadius);
    result.batches.assign(static_cast<std::size_t>(std::max(2, options.batches)),
                          EnergyHistogram{options.binsPerSecond, {}});
    refine(result, source, listener, options, options.rays);
    return result;
}

void AcousticTracer::refine(TraceResult& result, const glm::dvec3& source, const glm::dvec3& listener,
                            const TraceOptions& options, std::uint64_t rays) const {
    const std::size_t count = result.batches.size();
    const std::uint64_t each = (rays + count - 1) / count;
    if (each == 0) return;
    std::vector<Batch> fresh(count);
    tbb::parallel_for(std::size_t{0}, count, [&](std::size_t i) {
        fresh[i].histogram.binsPerSecond = result.batches[i].binsPerSecond;
        BatchTracer(*geometry_, source, listener, options, result.imageOrder, result.receiverRadius, fresh[i],
                    Random::mix(options.seed, Random::mix(result.rays, i)))
            .run(each);
    });
    const double total = static_cast<double>(result.rays + each * count);
    const double weight = static_cast<double>(each * count) / total;
    Bands absorbed{}, escaped{}, truncated{};
    for (std::size_t i = 0; i < count; ++i) {
        for (Bands& bin : result.batches[i].bins)
            for (double& energy : bin) energy *= 1 - weight;
        result.batches[i].accumulate(fresh[i].histogram, weight);
        mix(absorbed, fresh[i].absorbed, 1.0 / static_cast<double>(i + 1));
        mix(escaped, fresh[i].escaped, 1.0 / static_cast<double>(i + 1));
        mix(truncated, fresh[i].truncated, 1.0 / static_cast<double>(i + 1));
    }
    mix(result.absorbed, absorbed, weight);
    mix(result.escaped, escaped, weight);
    mix(result.truncated, truncated, weight);
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
