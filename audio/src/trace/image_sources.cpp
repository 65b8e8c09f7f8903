// Mirrors a source in the planes of a room and keeps the images whose path really leads to the listener.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <unordered_map>
#include <utility>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <rtsg/audio/image_sources.h>

namespace rtsg {
namespace {

/// Images nearer to each other than this are one; metres.
constexpr double kSameImage = 2e-3;
constexpr double kCell = 0.25;
/// Paths are checked from a listener this far beside the true one: symmetric rooms are full of paths that meet an edge
/// exactly, where it is chance which wall is hit, and whether both are.
const glm::dvec3 kAside{4.1e-4, 6.3e-4, 2.9e-4};

struct Candidate {
    glm::dvec3 position;
    std::uint32_t lastPlane;  // of one of the ways to get here
    double share;             // of energy that is left at best
    bool severalWays = false;
};

/// Candidates by position.
class CandidateSet {
  public:
    std::vector<Candidate> all;

    /// False when the position was there already.
    bool insert(const glm::dvec3& p, std::uint32_t lastPlane, double share) {
        const glm::dvec3 low = glm::floor((p - kSameImage) / kCell), high = glm::floor((p + kSameImage) / kCell);
        for (double x = low.x; x <= high.x; ++x)
            for (double y = low.y; y <= high.y; ++y)
                for (double z = low.z; z <= high.z; ++z) {
                    const auto bucket = buckets_.find(key({x, y, z}));
                    if (bucket == buckets_.end()) continue;
                    for (std::uint32_t i = bucket->second; i != kNoPlane; i = next_[i])
                        if (glm::distance(all[i].position, p) < kSameImage) {
                            if (all[i].lastPlane != lastPlane) all[i].severalWays = true;
                            all[i].share = std::max(all[i].share, share);
                            return false;
                        }
                }
        const auto index = static_cast<std::uint32_t>(all.size());
        all.push_back({p, lastPlane, share});
        next_.push_back(kNoPlane);
        const auto [bucket, fresh] = buckets_.try_emplace(key(glm::floor(p / kCell)), index);
        if (!fresh) next_.back() = std::exchange(bucket->second, index);
        return true;
    }

  private:
    static std::uint64_t key(const glm::dvec3& cell) {
        std::uint64_t result = 0;
        for (int i = 0; i < 3; ++i) {
            result = (result ^ static_cast<std::uint64_t>(static_cast<std::int64_t>(cell[i]))) * 0x9E3779B97F4A7C15ull;
            result ^= result >> 31;
        }
        return result;
    }

    std::unordered_map<std::uint64_t, std::uint32_t> buckets_;
    std::vector<std::uint32_t> next_;
};

/// Whether sound of an image at `p` that passes through the surfaces of `through` can reach those of `next`: both
/// seen from `p` as bounding spheres. Never false for a possible path.
bool canFollow(const glm::dvec3& p, const ReflectingPlane& through, const ReflectingPlane& next) {
    // The reflected sound lives on the side of `through` away from the image.
    const double side = through.signedDistance(p) > 0 ? -1 : 1;
    if (side * through.signedDistance(next.center) + next.radius <= 0) return false;
    const glm::dvec3 a = through.center - p, b = next.center - p;
    const double lengthA = glm::length(a), lengthB = glm::length(b);
    if (lengthA <= through.radius || lengthB <= next.radius) return true;
    const double spread = std::asin(through.radius / lengthA) + std::asin(next.radius / lengthB);
    return std::acos(std::clamp(glm::dot(a, b) / (lengthA * lengthB), -1.0, 1.0)) <= spread + 1e-6;
}

/// The mirror path from the listener towards the image, if it ends in the source: its order and its share of energy.
std::optional<Arrival> retrace(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener,
                               const glm::dvec3& image, int maxOrder) {
    const glm::dvec3 toImage = image - listener;
    const double distance = glm::length(toImage);
    if (!(distance > 1e-6)) return std::nullopt;
    Arrival arrival;
    arrival.energy = allBands(1);
    const auto materials = geometry.materials();
    glm::dvec3 origin = listener, direction = toImage / distance;
    double left = distance;
    std::uint32_t plane = kNoPlane;
    for (int order = 0;; ++order) {
        AcousticHit hit;
        // The source may be on a surface: what is within a millimetre of the end does not block.
        if (!geometry.closest(origin, direction, left - 1e-3, plane, hit)) {
            const double miss = glm::distance(origin + direction * left, source);
            if (miss > 5e-3 + 1e-5 * distance) return std::nullopt;
            arrival.order = static_cast<std::uint32_t>(order);
            return arrival;
        }
        if (order == maxOrder) return std::nullopt;
        const AcousticMaterial& material = materials[hit.material];
        bool any = false;
        for (std::size_t b = 0; b < kBandCount; ++b) {
            arrival.energy[b] *= material.mirrored(b);
            any = any || arrival.energy[b] > 0;
        }
        if (!any) return std::nullopt;
        origin += direction * hit.distance;
        direction -= hit.normal * (2 * glm::dot(direction, hit.normal));
        left -= hit.distance;
        plane = hit.plane;
    }
}

}  // namespace

Bands directShare(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener) {
    Bands share = allBands(1);
    const glm::dvec3 toSource = source - listener;
    const double distance = glm::length(toSource);
    if (!(distance > 1e-3)) return share;
    const glm::dvec3 direction = toSource / distance;
    glm::dvec3 origin = listener;
    double left = distance;
    std::uint32_t plane = kNoPlane;
    AcousticHit hit;
    while (geometry.closest(origin, direction, left - 1e-3, plane, hit)) {
        bool any = false;
        for (std::size_t b = 0; b < kBandCount; ++b) {
            share[b] *= geometry.materials()[hit.material].transmission[b];
            any = any || share[b] > 0;
        }
        if (!any) break;
        origin += direction * hit.distance;
        left -= hit.distance;
        plane = hit.plane;
    }
    return share;
}

ImageSources findImageSources(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener,
                              const ImageSourceOptions& options, double speedOfSound, const Bands& attenuation) {
    ImageSources result;
    const auto planes = geometry.planes();
    const auto keep = [&](std::optional<Arrival> arrival, const glm::dvec3& image) {
        const double distance = glm::distance(image, listener);
        if (!arrival || distance > options.maxDistance) return;
        // A source in the listener's head has no direction and, as for any nearer than a centimetre, no 1/r^2 either.
        const double clamped = std::max(distance, 0.01);
        arrival->seconds = distance / speedOfSound;
        arrival->direction = distance > 1e-9 ? (image - listener) / distance : glm::dvec3(0, 0, -1);
        for (std::size_t b = 0; b < kBandCount; ++b)
            arrival->energy[b] *= std::exp(-attenuation[b] * distance) / (4 * std::numbers::pi * clamped * clamped);
        result.arrivals.push_back(*arrival);
    };
    Arrival direct;
    direct.energy = directShare(geometry, source, listener);
    if (direct.energy != Bands{}) keep(direct, source);

    CandidateSet candidates;
    candidates.insert(source, kNoPlane, 1);
    std::size_t generation = 0, attempts = 0;
    const std::size_t maxAttempts = 64 * std::max<std::size_t>(options.maxCandidates, 1000);
    for (int order = 1; order <= options.maxOrder && !planes.empty(); ++order) {
        const std::size_t end = candidates.all.size();
        bool complete = true;
        for (std::size_t i = generation; i < end && complete; ++i)
            for (std::uint32_t p = 0; p < planes.size(); ++p) {
                // In a room of many small surfaces most pairs see each other not at all, which takes time to find out.
                if (++attempts > maxAttempts) {
                    complete = false;
                    break;
                }
                const Candidate from = candidates.all[i];
                const double share = from.share * planes[p].mirrors;
                if (from.lastPlane == p || share < options.minShare) continue;
                if (from.lastPlane != kNoPlane && !from.severalWays &&
                    !canFollow(from.position, planes[from.lastPlane], planes[p]))
                    continue;
                const double distance = planes[p].signedDistance(from.position);
                // An image in its own mirror is no further image.
                if (std::abs(distance) < kSameImage) continue;
                candidates.insert(from.position - planes[p].normal * (2 * distance), p, share);
                if (candidates.all.size() > options.maxCandidates) {
                    complete = false;
                    break;
                }
            }
        if (!complete) {
            candidates.all.resize(end);
            break;
        }
        generation = end;
        result.order = order;
        if (candidates.all.size() == end) {
            result.order = options.maxOrder;  // nothing more to find
            break;
        }
    }
    result.candidates = candidates.all.size();
    std::vector<std::optional<Arrival>> paths(candidates.all.size());
    tbb::parallel_for(
        tbb::blocked_range<std::size_t>(1, std::max<std::size_t>(1, paths.size()), 64), [&](const auto& range) {
            for (std::size_t i = range.begin(); i != range.end(); ++i)
                paths[i] = retrace(geometry, source, listener + kAside, candidates.all[i].position, result.order);
        });
    for (std::size_t i = 1; i < paths.size(); ++i) keep(paths[i], candidates.all[i].position);
    std::stable_sort(result.arrivals.begin(), result.arrivals.end(),
                     [](const Arrival& a, const Arrival& b) { return a.seconds < b.seconds; });
    return result;
}

}  // namespace rtsg
