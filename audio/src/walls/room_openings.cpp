// Finds the openings that rays went by when they escaped, and says what is to be known of each.
#include <rtsg/audio/room_openings.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include <rtsg/renderers/ray_view.h>

#include "opening_finder.h"

namespace rtsg {
namespace {

using namespace opening;

/// Whether a ray that escaped went through.
bool wentThrough(const Outline& outline, const EscapedRay& ray) {
    const double slope = glm::dot(ray.direction, outline.normal);
    if (!(slope > 0)) return false;
    const double distance = glm::dot(outline.center - ray.origin, outline.normal) / slope;
    const glm::dvec3 crossing = ray.origin + ray.direction * distance;
    if (distance >= 0) return outline.holds(crossing, 1.02, 1e-4 + 0.03 * outline.halfWidth);
    // It met the sides of a deep one last.
    const double beside = 2 * outline.halfWidth + 1e-4;
    return distance > -2 * beside && outline.holds(crossing, 1.02, beside);
}

/// Whether what was felt is one that is known. A crack through a thick wall may be felt at its inner or its outer edge.
bool isSame(const Outline& known, const Outline& felt) {
    constexpr double kThickWall = 0.3;
    const double deep = known.halfWidth + 1e-3 + std::min(8 * known.halfWidth, kThickWall);
    return known.holds(felt.center, 1.05, 1e-3) && std::abs(glm::dot(felt.center - known.center, known.normal)) < deep;
}

double meanOfBands(const Bands& bands) {
    double sum = 0;
    for (const double value : bands) sum += value / kBandCount;
    return sum;
}

RoomOpening::Beside besideOf(const RayInstance& instance) {
    RoomOpening::Beside result{instance.info.shape, instance.info.geometry, {}, {}};
    const Bounds& local = instance.mesh->bounds;
    for (int i = 0; i < 8; ++i)
        result.box.extend(instance.info.worldFromLocal * glm::dvec4(i & 1 ? local.max.x : local.min.x,
                                                                    i & 2 ? local.max.y : local.min.y,
                                                                    i & 4 ? local.max.z : local.min.z, 1.0));
    return result;
}

/// What is told of one; `all`: the sums over all exits, by band.
RoomOpening described(const RayView& rays, const Felt& felt, std::span<const EscapedRay> exits, const Bands& all,
                      const Bands& escaped, double volume) {
    constexpr std::size_t kNamed = 3;
    constexpr double kLeastOfRim = 0.05;
    RoomOpening result;
    result.center = felt.outline.center;
    result.normal = felt.outline.normal;
    result.area = felt.outline.area;
    result.length = felt.outline.length();
    result.width = felt.outline.width();
    result.boundaryEdges = felt.boundaryEdges;
    result.leak = (result.area < 0.01 * std::pow(volume, 2.0 / 3) && result.area < 0.5) || result.width < 0.03 ||
                  result.boundaryEdges == 3;
    Bands squares{};
    for (const std::size_t i : felt.exits)
        for (std::size_t b = 0; b < kBandCount; ++b) {
            result.share[b] += exits[i].energy[b];
            squares[b] += exits[i].energy[b] * exits[i].energy[b];
        }
    double half = 0;
    for (std::size_t b = 0; b < kBandCount; ++b) {
        const double unit = all[b] > 0 ? escaped[b] / all[b] : 0;
        // Bands are of the same rays: their errors go together.
        half += 1.96 * std::sqrt(squares[b]) * unit / kBandCount;
        result.share[b] *= unit;
    }
    result.shareCi95 = half;
    result.rays = felt.exits.size();
    std::vector<std::pair<double, std::uint32_t>> most;
    for (const auto& [slot, metres] : felt.beside)
        if (rays.instance(slot).mesh) most.emplace_back(-metres, slot);  // the most first
    std::sort(most.begin(), most.end());
    // What is at the ends of a long one says nothing.
    for (std::size_t i = 0; i < std::min(kNamed, most.size()) && most[i].first <= kLeastOfRim * most[0].first; ++i)
        result.beside.push_back(besideOf(rays.instance(most[i].second)));
    return result;
}

}  // namespace

double RoomOpening::meanShare() const {
    return meanOfBands(share);
}

RoomOpenings findRoomOpenings(const RayView& rays, const glm::dvec3& source, std::span<const EscapedRay> exits,
                              const Bands& escaped) {
    constexpr std::size_t kMost = 24;
    constexpr int kVain = 24;
    RoomOpenings result;
    result.escaped = result.elsewhere = meanOfBands(escaped);
    if (exits.empty()) return result;
    OpeningFinder finder(rays, source);
    result.outdoors = finder.outdoors();
    if (result.outdoors) return result;
    std::vector<Felt> found;
    const auto known = [&](const auto& test) {
        return std::find_if(found.begin(), found.end(), [&](const Felt& felt) { return test(felt.outline); });
    };
    Bands all{};
    int vain = 0;
    for (std::size_t i = 0; i < exits.size(); ++i) {
        for (std::size_t b = 0; b < kBandCount; ++b) all[b] += exits[i].energy[b];
        auto at = known([&](const Outline& outline) { return wentThrough(outline, exits[i]); });
        if (at == found.end() && found.size() < kMost && vain < kVain) {
            std::optional<Felt> felt = finder.feel(exits[i]);
            if (!felt) {
                ++vain;
                continue;
            }
            // The same, by a ray that only just went through, or in a part of it that cannot be seen from its centre.
            at = known([&](const Outline& outline) { return isSame(outline, felt->outline); });
            if (at == found.end()) {
                at = found.insert(found.end(), std::move(*felt));
            } else if (felt->outline.area < at->outline.area) {
                // All that goes through passes where it is narrowest.
                felt->exits = std::move(at->exits);
                *at = std::move(*felt);
            }
        }
        if (at != found.end()) at->exits.push_back(i);
    }
    for (const Felt& felt : found) {
        result.openings.push_back(described(rays, felt, exits, all, escaped, finder.volume()));
        result.elsewhere -= result.openings.back().meanShare();
    }
    result.elsewhere = std::max(0.0, result.elsewhere);
    std::stable_sort(result.openings.begin(), result.openings.end(),
                     [](const RoomOpening& a, const RoomOpening& b) { return a.meanShare() > b.meanShare(); });
    return result;
}

}  // namespace rtsg
