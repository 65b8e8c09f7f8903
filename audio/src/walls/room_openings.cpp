// Finds the opening by which most rays escaped: several of them feel for the one that they went through.
#include <rtsg/audio/room_openings.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>

#include <rtsg/renderers/ray_view.h>

#include "opening_finder.h"

namespace rtsg {
namespace {

using namespace opening;

double meanOfBands(const Bands& bands) {
    double sum = 0;
    for (const double value : bands) sum += value / kBandCount;
    return sum;
}

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

/// How many feel for it at most, and those that have found one; others find the same, or nothing.
constexpr int kMaxAsked = 96, kMaxFelt = 12;

/// The opening that most exits went through of those that some of them felt; of the same one felt several times the
/// narrowest that most agree on, as everything that goes through passes there, or the boundary of a mesh, which is
/// exact. None if none of them felt one.
const Felt* mainOf(const std::vector<Felt>& felt, std::span<const EscapedRay> exits) {
    const Felt* best = nullptr;
    double maximum = 0;
    for (const Felt& one : felt) {
        const auto through = static_cast<double>(
            std::ranges::count_if(exits, [&](const EscapedRay& exit) { return wentThrough(one.outline, exit); }));
        const auto alike = static_cast<double>(std::ranges::count_if(felt, [&](const Felt& other) {
            constexpr double kAlike = 0.01;
            return std::abs(one.outline.area - other.outline.area) <= kAlike * other.outline.area &&
                   glm::distance(one.outline.normal, other.outline.normal) < 0.03;
        }));
        // Those that felt it aslant are alone, and what goes through a wider one by mistake is little more.
        const double counts =
            through * (one.boundaryEdges > 0 ? kMaxFelt : alike) / std::max(1e-9, std::sqrt(one.outline.area));
        if (counts <= maximum) continue;
        maximum = counts;
        best = &one;
    }
    return best;
}

void describe(const RayView& rays, const Felt& felt, std::span<const EscapedRay> exits, double volume,
              RoomOpenings& result) {
    constexpr std::size_t kNamed = 3;
    constexpr double kMinOfRim = 0.05;
    Bands all{}, through{};
    for (const EscapedRay& exit : exits)
        for (std::size_t b = 0; b < kBandCount; ++b) {
            all[b] += exit.energy[b];
            if (wentThrough(felt.outline, exit)) through[b] += exit.energy[b];
        }
    result.fraction = result.escaped * meanOfBands(through) / meanOfBands(all);
    result.center = felt.outline.center;
    result.length = felt.outline.length();
    result.width = felt.outline.width();
    result.area = felt.outline.area;
    result.triangle = felt.boundaryEdges == 3;
    result.leak =
        (result.area < 0.01 * std::pow(volume, 2.0 / 3) && result.area < 0.5) || result.width < 0.03 || result.triangle;
    std::vector<std::pair<double, std::uint32_t>> maximum;
    for (const auto& [slot, metres] : felt.beside)
        if (rays.instance(slot).mesh) maximum.emplace_back(-metres, slot);  // the most first
    std::sort(maximum.begin(), maximum.end());
    // The gaps at the ends of a long opening tell nothing.
    for (std::size_t i = 0; i < std::min(kNamed, maximum.size()) && maximum[i].first <= kMinOfRim * maximum[0].first;
         ++i)
        result.beside.push_back(wallShapeOf(rays, maximum[i].second));
}

}  // namespace

WallShape wallShapeOf(const RayView& rays, std::uint32_t slot) {
    const RayInstance& instance = rays.instance(slot);
    WallShape shape{instance.info.shape, instance.info.geometry, {}, {}};
    const Bounds& local = instance.mesh->bounds;
    for (int i = 0; i < 8; ++i)
        shape.box.extend(instance.info.worldFromLocal * glm::dvec4(i & 1 ? local.max.x : local.min.x,
                                                                   i & 2 ? local.max.y : local.min.y,
                                                                   i & 4 ? local.max.z : local.min.z, 1.0));
    return shape;
}

RoomOpenings findRoomOpenings(const RayView& rays, const glm::dvec3& source, std::span<const EscapedRay> exits,
                              const Bands& escaped) {
    RoomOpenings result;
    result.escaped = meanOfBands(escaped);
    if (exits.empty()) return result;
    OpeningFinder finder(rays, source);
    result.outdoors = finder.outdoors();
    if (result.outdoors) return result;
    std::vector<Felt> felt;
    for (std::size_t i = 0; i < std::min<std::size_t>(exits.size(), kMaxAsked) && felt.size() < kMaxFelt; ++i)
        if (auto one = finder.feel(exits[i])) felt.push_back(std::move(*one));
    if (const Felt* const found = mainOf(felt, exits)) describe(rays, *found, exits, finder.volume(), result);
    return result;
}

}  // namespace rtsg
