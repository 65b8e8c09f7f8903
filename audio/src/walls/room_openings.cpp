// Finds the openings by which rays escaped, and describes each.
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

/// Whether two are the same opening. A crack through a thick wall may be felt at its inner or its outer edge.
bool isSame(const Outline& a, const Outline& b) {
    static constexpr double kThickWall = 0.3;
    const auto lies = [](const Outline& in, const Outline& other) {
        const double deep = in.halfWidth + 1e-3 + std::min(8 * in.halfWidth, kThickWall);
        return in.holds(other.center, 1.05, 1e-3) && std::abs(glm::dot(other.center - in.center, in.normal)) < deep;
    };
    return lies(a, b) || lies(b, a);
}

/// Whether two that are the same are alike, so that neither is one ray's mistake.
bool agree(const Outline& a, const Outline& b) {
    constexpr double kAlike = 0.01, kTilt = 0.03;
    const auto alike = [](double x, double y) { return std::abs(x - y) <= kAlike * std::max(x, y); };
    return alike(a.area, b.area) && alike(a.length(), b.length()) && glm::distance(a.normal, b.normal) < kTilt;
}

/// Feels for openings by exits, each of which is asked once.
class OpeningSearch {
  public:
    OpeningSearch(OpeningFinder& finder, std::span<const EscapedRay> exits)
        : finder_(finder), exits_(exits), felt_(exits.size()) {}

    /// All that can be told apart: those that several rays felt alike first, then those that one ray alone felt.
    std::vector<Felt> all() {
        constexpr std::size_t kMax = 24;
        constexpr double kMinOfUsual = 0.3;  // what less goes through, for its area, is one ray's mistake
        std::vector<Felt> found, alone;
        std::vector<std::size_t> aloneBy;
        for (std::size_t i = 0; i < exits_.size() && found.size() + alone.size() < kMax; ++i) {
            if (leadsThrough(found, exits_[i])) continue;
            const Felt* const first = by(i);
            if (!first) continue;
            if (Felt* const same = oneOf(found, first->outline)) {
                if (first->boundaryEdges > 0 && same->boundaryEdges == 0) *same = *first;
                continue;
            }
            if (const Felt* const sure = confirmed(i, *first)) {
                found.push_back(*sure);
            } else if (!oneOf(alone, first->outline)) {
                alone.push_back(*first);
                aloneBy.push_back(i);
            }
        }
        const double usual = exitsPerArea(found);
        for (std::size_t k = 0; k < alone.size(); ++k)
            if (!leadsThrough(found, exits_[aloneBy[k]]) && !oneOf(found, alone[k].outline) &&
                exitsPerArea({&alone[k], 1}) >= kMinOfUsual * usual)
                found.push_back(std::move(alone[k]));
        return found;
    }
    /// The one of `found` that an exit went through, or that it felt in a part that cannot be seen from its centre.
    std::optional<std::size_t> of(const std::vector<Felt>& found, std::size_t exit) const {
        for (std::size_t k = 0; k < found.size(); ++k)
            if (wentThrough(found[k].outline, exits_[exit])) return k;
        if (felt_[exit].value)
            for (std::size_t k = 0; k < found.size(); ++k)
                if (isSame(found[k].outline, felt_[exit].value->outline)) return k;
        return std::nullopt;
    }

  private:
    struct Answer {
        bool asked = false;
        std::optional<Felt> value;
    };

    double exitsPerArea(std::span<const Felt> found) const {
        double exits = 0, area = 0;
        for (const EscapedRay& exit : exits_) exits += leadsThrough(found, exit) ? 1 : 0;
        for (const Felt& felt : found) area += felt.outline.area;
        return area > 0 ? exits / area : 0;
    }
    static bool leadsThrough(std::span<const Felt> found, const EscapedRay& exit) {
        return std::any_of(found.begin(), found.end(),
                           [&](const Felt& felt) { return wentThrough(felt.outline, exit); });
    }
    static Felt* oneOf(std::vector<Felt>& found, const Outline& outline) {
        const auto at =
            std::find_if(found.begin(), found.end(), [&](const Felt& felt) { return isSame(felt.outline, outline); });
        return at == found.end() ? nullptr : &*at;
    }
    /// The opening that an exit feels; null if it felt none, or if too many have been tried.
    const Felt* by(std::size_t exit) {
        constexpr int kVain = 96, kFelt = 48;
        Answer& answer = felt_[exit];
        if (!answer.asked && vain_ < kVain && had_ < kFelt) {
            answer.asked = true;
            answer.value = finder_.feel(exits_[exit]);
            ++(answer.value ? had_ : vain_);
        }
        return answer.value ? &*answer.value : nullptr;
    }
    /// The opening that most of the exits agree on which feel the same as the first: the narrowest, as everything that
    /// goes through passes there. The boundary of a mesh is right whoever feels it. Null if no two agree.
    const Felt* confirmed(std::size_t first, const Felt& felt) {
        constexpr std::size_t kTries = 8, kEnough = 3;
        if (felt.boundaryEdges > 0) return &felt;
        std::vector<const Felt*> tries{&felt};
        std::vector<std::size_t> alike{1};  // tries that agree with each, itself too
        for (std::size_t i = first + 1; i < exits_.size() && tries.size() < kTries; ++i) {
            const Felt* const next = by(i);
            if (!next || !isSame(felt.outline, next->outline)) continue;
            if (next->boundaryEdges > 0) return next;
            std::size_t agreeing = 1;
            for (std::size_t k = 0; k < tries.size(); ++k)
                if (agree(tries[k]->outline, next->outline)) ++alike[k], ++agreeing;
            tries.push_back(next);
            alike.push_back(agreeing);
            if (*std::max_element(alike.begin(), alike.end()) == kEnough) break;
        }
        const Felt* best = nullptr;
        const std::size_t maximum = *std::max_element(alike.begin(), alike.end());
        for (std::size_t k = 0; maximum > 1 && k < tries.size(); ++k)
            if (alike[k] == maximum && (!best || tries[k]->outline.area < best->outline.area)) best = tries[k];
        return best;
    }

    OpeningFinder& finder_;
    std::span<const EscapedRay> exits_;
    std::vector<Answer> felt_;  // does not grow, so that places in it stay
    int vain_ = 0, had_ = 0;
};

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

/// Describes an opening. `by` are the exits that went through it; `all` are the sums over all exits, by band.
RoomOpening described(const RayView& rays, const Felt& felt, const std::vector<std::size_t>& by,
                      std::span<const EscapedRay> exits, const Bands& all, const Bands& escaped, double volume) {
    constexpr std::size_t kNamed = 3;
    constexpr double kMinOfRim = 0.05, kFresh = 1;
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
    for (const std::size_t i : by)
        for (std::size_t b = 0; b < kBandCount; ++b) {
            result.fraction[b] += exits[i].energy[b];
            squares[b] += exits[i].energy[b] * exits[i].energy[b];
        }
    double half = 0;
    for (std::size_t b = 0; b < kBandCount; ++b) {
        const double unit = all[b] > 0 ? escaped[b] / all[b] : 0;
        result.fraction[b] *= unit;
        if (!(squares[b] > 0)) continue;
        // Each is a Poisson event. Those that carry most, fresh from the source, are few, and that none came does not
        // say that none can: so one more counts as if it had, as in the wider side of an exact interval (Garwood 1936)
        // where all are equal. Bands are of the same rays: their errors go together.
        half += 1.96 * (std::sqrt(squares[b] + kFresh * kFresh) + kFresh) * unit / kBandCount;
    }
    result.fractionCi95 = half;
    result.rays = by.size();
    std::vector<std::pair<double, std::uint32_t>> maximum;
    for (const auto& [slot, metres] : felt.beside)
        if (rays.instance(slot).mesh) maximum.emplace_back(-metres, slot);  // the most first
    std::sort(maximum.begin(), maximum.end());
    // The gaps at the ends of a long opening tell nothing.
    for (std::size_t i = 0; i < std::min(kNamed, maximum.size()) && maximum[i].first <= kMinOfRim * maximum[0].first;
         ++i)
        result.beside.push_back(besideOf(rays.instance(maximum[i].second)));
    return result;
}

}  // namespace

double RoomOpening::meanFraction() const {
    return meanOfBands(fraction);
}

RoomOpenings findRoomOpenings(const RayView& rays, const glm::dvec3& source, std::span<const EscapedRay> exits,
                              const Bands& escaped) {
    RoomOpenings result;
    result.escaped = result.elsewhere = meanOfBands(escaped);
    if (exits.empty()) return result;
    OpeningFinder finder(rays, source);
    result.outdoors = finder.outdoors();
    if (result.outdoors) return result;
    OpeningSearch search(finder, exits);
    const std::vector<Felt> found = search.all();
    std::vector<std::vector<std::size_t>> by(found.size());
    Bands all{};
    for (std::size_t i = 0; i < exits.size(); ++i) {
        for (std::size_t b = 0; b < kBandCount; ++b) all[b] += exits[i].energy[b];
        if (const auto k = search.of(found, i)) by[*k].push_back(i);
    }
    for (std::size_t k = 0; k < found.size(); ++k) {
        result.openings.push_back(described(rays, found[k], by[k], exits, all, escaped, finder.volume()));
        result.elsewhere -= result.openings.back().meanFraction();
    }
    result.elsewhere = std::max(0.0, result.elsewhere);
    std::stable_sort(result.openings.begin(), result.openings.end(),
                     [](const RoomOpening& a, const RoomOpening& b) { return a.meanFraction() > b.meanFraction(); });
    return result;
}

}  // namespace rtsg
