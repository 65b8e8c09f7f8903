// Searches for the rims of openings: between the last ray that goes on and the first that does not.
#include "opening_finder.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "even_direction.h"
#include "open_loops.h"

namespace rtsg::opening {
namespace {

/// A place is outside if at least this share of all directions leads to the sky.
constexpr double kOutside = 0.1;

}  // namespace

/// One round of feeling.
struct OpeningFinder::Rim {
    std::vector<glm::dvec3> corners;   // in the plane that was thought of
    std::vector<std::uint32_t> slots;  // of the hits beside each, or kNoInstance
    std::vector<glm::dvec3> walls;     // where that was
    bool closed = false;               // it was met in all directions
};

OpeningFinder::OpeningFinder(const RayView& rays, const glm::dvec3& source) : rays_(rays) {
    for (int i = 0; i < kDirections; ++i)
        directions_[static_cast<std::size_t>(i)] = Vec3f(evenDirection(i, kDirections));
    const Bounds bounds = rays.bounds();
    if (bounds.empty()) return;
    middle_ = rays.toWorld(bounds.center());
    radius_ = glm::length(glm::dvec3(bounds.size())) / 2;
    look(source);
}

/// Measures how much of the source's view is sky, and how large the rest is.
void OpeningFinder::look(const glm::dvec3& source) {
    double cubes = 0;
    int walls = 0;
    for (const Vec3f& direction : directions_) {
        const Hit hit = meet(source, glm::dvec3(direction));
        if (!hit) continue;
        cubes += std::pow(double{hit.t}, 3);
        ++walls;
    }
    sky_ = 1 - walls / double{kDirections};
    if (walls > 0) volume_ = 4 * std::numbers::pi / 3 * cubes / walls;
}

/// Whether at least this share of all directions leads to the sky. Once that is known, no more are asked about.
bool OpeningFinder::seesSky(const glm::dvec3& at, double fraction) const {
    constexpr int kPacket = 16;
    static_assert(kDirections % kPacket == 0);
    const int minimum = static_cast<int>(std::ceil(fraction * kDirections));
    const Vec3f origin = rays_.fromWorld(at);
    int seen = 0;
    for (int first = 0; first < kDirections && seen < minimum && seen + kDirections - first >= minimum;
         first += kPacket) {
        RayPacket16 packet;
        for (int i = 0; i < kPacket; ++i) {
            Ray ray;
            ray.origin = origin;
            ray.direction = directions_[static_cast<std::size_t>(first) + static_cast<std::size_t>(i)];
            ray.tMax = RayView::kMaxCoordinate;
            packet.set(i, ray);
        }
        seen += kPacket - std::popcount(rays_.occluded(packet, false, RayKind::sound));
    }
    return seen >= minimum;
}

Hit OpeningFinder::meet(const glm::dvec3& from, const glm::dvec3& direction) const {
    Ray ray;
    ray.origin = rays_.fromWorld(from);
    ray.direction = Vec3f(direction);
    return rays_.intersect(ray, RayKind::sound);
}

/// Whether a ray gets to the sky, or farther than `wall` metres to something that sees so much of it.
bool OpeningFinder::goesOn(const glm::dvec3& from, const glm::dvec3& direction, double wall, double sky,
                           Hit& met) const {
    met = meet(from, direction);
    if (!met) return true;
    // Far enough before the hit that floats distinguish the two, also near the source.
    const double t = met.t;
    const double back = std::min(t / 2, std::max(1e-3 * t, 2e-6 * (1 + glm::length(from))));
    return t > wall && seesSky(from + direction * (t - back), sky);
}

/// The last place on its way that is not outside; none if it starts there.
std::optional<glm::dvec3> OpeningFinder::positionBefore(const EscapedRay& ray) const {
    double far = glm::distance(ray.origin, middle_) + radius_;
    double near = std::min(1e-3, 1e-3 * far);
    if (seesSky(ray.origin + ray.direction * near, kOutside)) return std::nullopt;
    while (far - near > 1e-6 * (1 + near)) {
        const double between = (near + far) / 2;
        (seesSky(ray.origin + ray.direction * between, kOutside) ? far : near) = between;
    }
    return ray.origin + ray.direction * near;
}

/// The plane of an opening, and about how wide it is: from what rays beside one that goes through meet first.
std::optional<Outline> OpeningFinder::firstLook(const glm::dvec3& before, const glm::dvec3& direction) const {
    constexpr int kAround = 32, kHalvings = 12;
    constexpr double kFirst = 0.02, kMax = 60, kGrowth = 1.5;  // tangents of angles
    const glm::dvec3 u = anyAcross(direction), v = glm::cross(direction, u);
    std::vector<glm::dvec3> rim;
    // At first all is wall; then anything much farther away than most, with a view of the sky, is outside.
    double wall = std::numeric_limits<double>::infinity();
    for (int look = 0; look < 2; ++look) {
        std::vector<double> away;
        rim.clear();
        for (int i = 0; i < kAround; ++i) {
            const double angle = 2 * std::numbers::pi * (i + 0.5) / kAround;
            const auto towards = [&](double tangent) {
                return glm::normalize(direction + tangent * (std::cos(angle) * u + std::sin(angle) * v));
            };
            Hit met;
            double inside = 0, outside = kFirst;
            while (outside < kMax && goesOn(before, towards(outside), wall, kOutside, met))
                inside = std::exchange(outside, outside * kGrowth);
            if (outside >= kMax) continue;
            for (int k = 0; k < kHalvings; ++k) {
                const double between = (inside + outside) / 2;
                (goesOn(before, towards(between), wall, kOutside, met) ? inside : outside) = between;
            }
            if (goesOn(before, towards(outside), wall, kOutside, met)) continue;
            rim.push_back(before + towards(outside) * double{met.t});
            away.push_back(double{met.t});
        }
        if (away.empty()) return std::nullopt;
        std::nth_element(away.begin(), away.begin() + static_cast<std::ptrdiff_t>(away.size() / 2), away.end());
        wall = 3 * away[away.size() / 2];
    }
    const auto plane = planeOf(rim);
    if (!plane) return std::nullopt;
    Outline outline;
    outline.normal = glm::dot(plane->normal, direction) < 0 ? -plane->normal : plane->normal;
    const double slope = glm::dot(direction, outline.normal);
    if (!(slope > 0.02)) return std::nullopt;
    outline.center = before + direction * (glm::dot(plane->middle - before, outline.normal) / slope);
    outline.along = anyAcross(outline.normal);
    outline.across = glm::cross(outline.normal, outline.along);
    std::vector<double> away;
    for (const glm::dvec3& p : rim) away.push_back(glm::length(outline.flat(p)));
    outline.halfLength = outline.halfWidth = 0.7 * *std::min_element(away.begin(), away.end());
    return outline;
}

/// Whether a place in the plane is open: from a little before it a ray gets out, and one back meets the room.
bool OpeningFinder::open(const Outline& outline, const glm::dvec2& at, Hit& met) const {
    constexpr double kBefore = 0.3, kSeesOutside = 0.03, kFacade = 0.18;
    const double before = kBefore * outline.halfWidth;
    const glm::dvec3 start = outline.position(at) - outline.normal * before;
    if (!goesOn(start, outline.normal, 2 * before, kSeesOutside, met)) return false;
    met = {};
    // Straight back there may be another opening, or the side of a deep one.
    const glm::dvec3 back[] = {-outline.normal, outline.across - outline.normal, -outline.across - outline.normal,
                               outline.along - outline.normal, -outline.along - outline.normal};
    return std::any_of(std::begin(back), std::end(back), [&](const glm::dvec3& direction) {
        Hit room;
        return !goesOn(start, glm::normalize(direction), 0, kFacade, room);
    });
}

/// The rim in several directions from the centre, as an ellipse has them.
bool OpeningFinder::feelRim(const Outline& about, int directions, int halvings, Rim& rim) const {
    constexpr double kFirst = 0.2, kMax = 8, kGrowth = 1.25;
    rim = {};
    rim.closed = true;
    for (int i = 0; i < directions; ++i) {
        const double angle = 2 * std::numbers::pi * (i + 0.5) / directions;
        const glm::dvec2 direction(std::cos(angle) * about.halfLength, std::sin(angle) * about.halfWidth);
        Hit met;
        double inside = 0, outside = kFirst;
        while (outside < kMax && open(about, direction * outside, met))
            inside = std::exchange(outside, outside * kGrowth);
        if (outside >= kMax) {
            rim.closed = false;
            rim.corners.push_back(about.position(direction * kMax));
            rim.slots.push_back(kNoInstance);
            continue;
        }
        for (int k = 0; k < halvings; ++k) {
            const double between = (inside + outside) / 2;
            (open(about, direction * between, met) ? inside : outside) = between;
        }
        rim.corners.push_back(about.position(direction * ((inside + outside) / 2)));
        const bool shut = !open(about, direction * outside, met) && met;
        rim.slots.push_back(shut ? met.instance : kNoInstance);
        if (!shut) continue;
        rim.walls.push_back(about.position(direction * outside) +
                            about.normal * (double{met.t} - 0.3 * about.halfWidth));
    }
    return rim.closed;
}

/// Moves a rim onto the plane of the walls beside it, where these are on more than one side of it.
void OpeningFinder::tilt(Outline& outline, Rim& rim) {
    const auto plane = planeOf(rim.walls);
    if (!plane || plane->across < 0.4 * outline.halfWidth || plane->off > 0.01 * plane->across) return;
    const double slope = glm::dot(plane->normal, outline.normal);
    if (std::abs(slope) < 0.8) return;
    for (glm::dvec3& corner : rim.corners)
        corner += outline.normal * (glm::dot(plane->middle - corner, plane->normal) / slope);
    outline.normal = slope < 0 ? -plane->normal : plane->normal;
}

std::optional<Felt> OpeningFinder::feel(const EscapedRay& ray) {
    constexpr int kRounds = 12;
    const auto before = positionBefore(ray);
    if (!before) return std::nullopt;
    const auto seen = firstLook(*before, ray.direction);
    Hit met;
    if (!seen || !open(*seen, glm::dvec2(0), met)) return std::nullopt;
    Felt felt;
    felt.outline = *seen;
    Rim rim;
    // Long ones are felt bit by bit: each round goes eight times as far along an axis that the last one has found.
    for (int round = 0; round < kRounds; ++round) {
        feelRim(felt.outline, 32, 7, rim);
        tilt(felt.outline, rim);
        Outline next = outlineOf(rim.corners, felt.outline.normal);
        if (!(next.halfWidth > 1e-6 * (1 + glm::length(next.center))) || !open(next, glm::dvec2(0), met))
            return std::nullopt;
        const double area = felt.outline.area;
        felt.outline = std::move(next);
        if (rim.closed && std::abs(felt.outline.area - area) < 0.02 * felt.outline.area) break;
    }
    if (!feelRim(felt.outline, 128, 10, rim)) return std::nullopt;
    felt.outline = outlineOf(rim.corners, felt.outline.normal);
    for (std::size_t i = 0, n = rim.corners.size(); i < n; ++i)
        if (rim.slots[i] != kNoInstance)
            felt.beside[rim.slots[i]] += glm::distance(rim.corners[(i + n - 1) % n], rim.corners[(i + 1) % n]) / 2;
    takeBoundary(felt);
    return felt;
}

/// Takes the open boundary of a mesh beside as the outline, if the rim is one.
void OpeningFinder::takeBoundary(Felt& felt) {
    const double tolerance = 0.02 * felt.outline.halfWidth + 1e-5 * (1 + glm::length(felt.outline.center));
    for (const auto& [slot, metres] : felt.beside) {
        const RayInstance& instance = rays_.instance(slot);
        if (!instance.mesh) continue;
        const auto [known, fresh] = loops_.try_emplace(instance.mesh.get());
        if (fresh) known->second = openLoopsOf(*instance.mesh);
        for (const std::vector<Vec3f>& loop : known->second) {
            std::vector<glm::dvec3> corners;
            for (const Vec3f& corner : loop) corners.push_back(instance.info.worldFromLocal * glm::dvec4(corner, 1.0));
            glm::dvec3 twice(0);
            for (std::size_t i = 0; i < corners.size(); ++i)
                twice += glm::cross(corners[i] - corners[0], corners[(i + 1) % corners.size()] - corners[0]);
            if (!(glm::length(twice) > 0)) continue;
            glm::dvec3 normal = glm::normalize(twice);
            if (glm::dot(normal, felt.outline.normal) < 0) normal = -normal;
            Outline exact = outlineOf(corners, normal);
            const double off = std::abs(exact.area - felt.outline.area);
            if (off > 0.05 * exact.area ||
                glm::distance(exact.center, felt.outline.center) > 0.05 * felt.outline.halfLength + tolerance)
                continue;
            felt.outline = std::move(exact);
            felt.boundaryEdges = loop.size();
            return;
        }
    }
}

}  // namespace rtsg::opening
