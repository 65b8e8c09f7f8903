// Finds walls right beside a listener, and how much each scatters of the sound that arrives there.
#include "near_walls.h"

#include <algorithm>

#include "walls/even_direction.h"

namespace rtsg::trace {
namespace {

constexpr double kReach = 0.1;            // m: farther away, rays find scattered sound well enough
constexpr double kReachOfDistance = 0.2;  // of the source, whose sound changes over the spot
constexpr int kDirections = 4096;
/// A wall nearer than this share of the reach is touched.
constexpr double kTouched = 0x1p-12;
/// Flat rays may meet a wall as many times the reach away.
constexpr double kFlat = 1000;
/// Normals closer than this are those of one wall.
constexpr double kAlike = 0.98;

/// Each with the one against it, so that just half of them meet a wall that goes through the middle; turned so that
/// none lies in a plane of two axes.
glm::dvec3 evenPair(int i) {
    constexpr int kHalf = kDirections / 2;
    static const glm::dmat3 rotation({.36, .48, -.8}, {-.8, .6, 0}, {.48, .64, .6});
    return i < kHalf ? rotation * evenDirection(i, kDirections) : -(rotation * evenDirection(i - kHalf, kDirections));
}

}  // namespace

NearWalls::NearWalls(const AcousticGeometry& geometry, const BandClasses& classes, const glm::dvec3& source,
                     const glm::dvec3& listener)
    : reach_(std::min(kReach, kReachOfDistance * glm::distance(source, listener))), classes_(classes.count) {
    if (geometry.distanceToSurface(listener) < reach_) look(geometry, classes, listener);
    if (walls_.empty()) {
        reach_ = 0;
        return;
    }
    lightEachOther(geometry, classes);
}

void NearWalls::look(const AcousticGeometry& geometry, const BandClasses& classes, const glm::dvec3& listener) {
    for (int first = 0; first < kDirections; first += AcousticRays::kMax) {
        AcousticRays rays;
        for (int i = first; i < first + AcousticRays::kMax; ++i)
            rays.add(listener, glm::dvec3(0), evenPair(i), kFlat * reach_, kNoPlane);
        AcousticHits hits;
        const std::uint32_t met = geometry.closestOf(rays, hits);
        for (int i = 0; i < rays.count; ++i) {
            const AcousticHit& hit = hits[static_cast<std::size_t>(i)];
            // A wall that is touched counts as a whole, however flat the ray.
            if ((met >> i & 1) != 0 &&
                (hit.distance <= reach_ ||
                 hit.distance * std::abs(glm::dot(hit.normal, rays.direction[i])) < kTouched * reach_))
                follow(geometry, classes, listener, rays.direction[i], hit);
        }
    }
    for (Wall& wall : walls_) {
        wall.pathLength /= static_cast<double>(wall.views.size());
        wall.directionTo /= static_cast<double>(wall.views.size());
    }
}

/// Notes the walls that are seen in a direction: `hit`, which is the first, and those in its mirrors.
void NearWalls::follow(const AcousticGeometry& geometry, const BandClasses& classes, const glm::dvec3& listener,
                       const glm::dvec3& direction, AcousticHit hit) {
    // A flat ray to a wall that is touched stands for the spot, which ends there.
    hit.distance = std::min(hit.distance, reach_);
    glm::dvec3 point = listener, ahead = direction;
    Bands left{};
    std::fill_n(left.begin(), classes.count, 1.0);
    for (double pathLength = hit.distance;; pathLength += hit.distance) {
        point += ahead * hit.distance;
        const AcousticMaterial& material = geometry.materials()[hit.material];
        const double across = glm::dot(hit.normal, ahead);
        const glm::dvec3 normal = across > 0 ? -hit.normal : hit.normal;
        if (std::ranges::any_of(material.scattering, [](double fraction) { return fraction > 0; })) {
            auto wall = std::ranges::find_if(walls_, [&](const Wall& w) {
                return w.material == hit.material && glm::dot(w.normal, normal) > kAlike;
            });
            if (wall == walls_.end()) {
                wall = walls_.insert(wall, Wall());
                wall->normal = normal;
                wall->material = hit.material;
            }
            wall->views.push_back({direction, left});
            wall->pathLength += pathLength;
            wall->directionTo += point - listener;
        }
        double maximum = 0;
        for (std::size_t c = 0; c < classes.count; ++c) {
            left[c] *= std::max(0.0, material.mirrored(classes.first[c]));
            maximum = std::max(maximum, left[c]);
        }
        ahead -= hit.normal * (2 * across);
        if (!(maximum > 0) || !geometry.closest(point, ahead, reach_ - pathLength, hit.plane, hit)) return;
    }
}

void NearWalls::lightEachOther(const AcousticGeometry& geometry, const BandClasses& classes) {
    constexpr double kEach = 4.0 / kDirections;  // its share of the sphere, over pi
    constexpr int kRounds = 64;
    const std::size_t count = walls_.size();
    for (std::size_t c = 0; c < classes.count; ++c) {
        const std::size_t b = classes.first[c];
        // The factors by which each spot sends to each, as the listener sees them, and by which each is heard.
        std::vector<double> factor(count * count, 0.0), heard(count, 0.0), scattered(count), next(count);
        for (std::size_t from = 0; from < count; ++from) {
            const AcousticMaterial& material = geometry.materials()[walls_[from].material];
            scattered[from] = std::max(0.0, material.reflected(b)) * material.scattering[b];
            for (const View& view : walls_[from].views) {
                heard[from] += kEach * view.left[c];
                for (std::size_t to = 0; to < count; ++to)
                    factor[from * count + to] +=
                        kEach * view.left[c] * std::max(0.0, glm::dot(walls_[to].normal, view.direction));
            }
        }
        // Straight, and by way of the others.
        std::vector<double> all = heard;
        for (int round = 0; count > 1 && round < kRounds; ++round) {
            for (std::size_t i = 0; i < count; ++i) {
                next[i] = heard[i];
                for (std::size_t to = 0; to < count; ++to) next[i] += factor[i * count + to] * scattered[to] * all[to];
            }
            all.swap(next);
        }
        for (std::size_t i = 0; i < count; ++i) walls_[i].back[c] = all[i] * scattered[i];
    }
    for (Wall& wall : walls_) wall.views = {};  // a tenth of a megabyte, of no more use
}

EnergyHistogram echoOf(const NearWalls& walls, const BandClasses& classes, std::span<const Arrival> arrivals,
                       const EnergyHistogram& like, double speedOfSound) {
    EnergyHistogram result{like.binsPerSecond, {}, like.start};
    for (const Arrival& arrival : arrivals)
        walls.echo(arrival.direction, [&](double later, const Bands& fractions) {
            Bands energy{};
            for (std::size_t b = 0; b < kBandCount; ++b) energy[b] = arrival.energy[b] * fractions[classes.of[b]];
            result.add(arrival.seconds + later / speedOfSound, energy);
        });
    return result;
}

}  // namespace rtsg::trace
