// Follows rays that escaped to the openings that they went through, and feels for the rims of these.
#include <rtsg/audio/room_openings.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <optional>
#include <utility>

#include <rtsg/renderers/ray_view.h>

#include "even_direction.h"
#include "open_loops.h"

namespace rtsg {
namespace {

/// Where at least this share of all directions leads to the sky is outside.
constexpr double kOutside = 0.1;
constexpr double kOutdoors = 0.3;

glm::dvec3 anyAcross(const glm::dvec3& d) {
    return glm::normalize(glm::cross(d, std::abs(d.x) < 0.6 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0)));
}

/// A symmetric matrix's eigenvectors by Jacobi's rotations, those of the largest eigenvalues first.
std::array<glm::dvec3, 3> principalAxes(glm::dmat3 m) {
    glm::dmat3 axes(1);
    for (int sweep = 0; sweep < 24; ++sweep)
        for (int p = 0; p < 2; ++p)
            for (int q = p + 1; q < 3; ++q) {
                if (!(std::abs(m[p][q]) > 0)) continue;
                const double turn = 0.5 * std::atan2(2 * m[p][q], m[q][q] - m[p][p]);
                const double c = std::cos(turn), s = std::sin(turn);
                glm::dmat3 rotation(1);
                rotation[p][p] = rotation[q][q] = c;
                rotation[p][q] = -s, rotation[q][p] = s;
                m = glm::transpose(rotation) * m * rotation;
                axes = axes * rotation;
            }
    std::array<int, 3> order{0, 1, 2};
    std::sort(order.begin(), order.end(), [&](int a, int b) { return m[a][a] > m[b][b]; });
    return {axes[order[0]], axes[order[1]], axes[order[2]]};
}

/// A flat polygon about a place, and what belongs to its moments.
struct Outline {
    glm::dvec3 center{0}, along{1, 0, 0}, across{0, 1, 0}, normal{0, 0, 1};
    double halfLength = 0, halfWidth = 0;  // of a rectangle with its moments
    double area = 0;
    std::vector<glm::dvec2> corners;  // metres along and across, from `center`

    glm::dvec3 place(const glm::dvec2& at) const { return center + along * at.x + across * at.y; }
    glm::dvec2 flat(const glm::dvec3& p) const { return {glm::dot(p - center, along), glm::dot(p - center, across)}; }
    bool holds(const glm::dvec3& p, double scale, double slack) const {
        const glm::dvec2 at = flat(p);
        // Within `slack` of what is `scale` times as large.
        const glm::dvec2 nearer = at / std::max(1.0, scale);
        bool inside = false;
        double nearest = std::numeric_limits<double>::infinity();
        for (std::size_t i = 0; i < corners.size(); ++i) {
            const glm::dvec2 a = corners[i], b = corners[(i + 1) % corners.size()];
            if ((a.y > nearer.y) != (b.y > nearer.y) && nearer.x < a.x + (nearer.y - a.y) / (b.y - a.y) * (b.x - a.x))
                inside = !inside;
            const glm::dvec2 edge = b - a;
            const double t = std::clamp(glm::dot(nearer - a, edge) / std::max(1e-300, glm::dot(edge, edge)), 0.0, 1.0);
            nearest = std::min(nearest, glm::distance(nearer, a + edge * t));
        }
        return inside || nearest <= slack;
    }
    double length() const { return extent(0); }
    double width() const {
        const double wide = extent(1), high = length();
        // Of what is long and narrow the axis is hardly known as well as that.
        return high > 10 * wide ? area / high : wide;
    }

  private:
    double extent(int axis) const {
        double low = std::numeric_limits<double>::infinity(), high = -low;
        for (const glm::dvec2& corner : corners) {
            low = std::min(low, corner[axis]);
            high = std::max(high, corner[axis]);
        }
        return high - low;
    }
};

/// With the centre and the axes of its area; `corners` in order.
Outline outlineOf(const std::vector<glm::dvec3>& corners, const glm::dvec3& normal) {
    Outline result;
    glm::dvec3 middle(0);
    for (const glm::dvec3& corner : corners) middle += corner / static_cast<double>(corners.size());
    const glm::dvec3 u = anyAcross(normal), v = glm::cross(normal, u);
    double area = 0;
    glm::dvec2 first(0);
    glm::dvec3 second(0);  // xx, yy, xy
    for (std::size_t i = 0; i < corners.size(); ++i) {
        const glm::dvec3 p = corners[i] - middle, q = corners[(i + 1) % corners.size()] - middle;
        const glm::dvec2 a(glm::dot(p, u), glm::dot(p, v)), b(glm::dot(q, u), glm::dot(q, v));
        const double part = (a.x * b.y - a.y * b.x) / 2;
        area += part;
        first += part / 3 * (a + b);
        second += part / 6 *
                  glm::dvec3(a.x * a.x + a.x * b.x + b.x * b.x, a.y * a.y + a.y * b.y + b.y * b.y,
                             a.x * a.y + b.x * b.y + (a.x * b.y + a.y * b.x) / 2);
    }
    if (!(std::abs(area) > 0)) return result;
    const glm::dvec2 c = first / area;
    const double xx = second.x / area - c.x * c.x, yy = second.y / area - c.y * c.y, xy = second.z / area - c.x * c.y;
    const double turn = 0.5 * std::atan2(2 * xy, xx - yy), half = std::hypot((xx - yy) / 2, xy), mean = (xx + yy) / 2;
    result.center = middle + u * c.x + v * c.y;
    result.normal = normal;
    result.along = u * std::cos(turn) + v * std::sin(turn);
    result.across = glm::cross(normal, result.along);
    result.halfLength = std::sqrt(3 * std::max(0.0, mean + half));
    result.halfWidth = std::sqrt(3 * std::max(0.0, mean - half));
    result.area = std::abs(area);
    for (const glm::dvec3& corner : corners) result.corners.push_back(result.flat(corner));
    return result;
}

/// What was felt of an opening.
struct Felt {
    Outline outline;
    std::map<std::uint32_t, double> beside;  // slots, and metres of the rim
    std::size_t boundaryEdges = 0;
    std::vector<std::size_t> exits;
};

/// One round of feeling.
struct Rim {
    std::vector<glm::dvec3> corners;   // in the plane that was thought of
    std::vector<std::uint32_t> slots;  // of what was met beside each, or kNoInstance
    std::vector<glm::dvec3> walls;     // where that was
    bool closed = false;               // it was met in all directions
};

/// A plane through most of some places.
struct Plane {
    glm::dvec3 middle{0}, normal{0, 0, 1};
    double across = 0, off = 0;  // root mean squares, along its shorter axis and off it
};

/// By least squares of the three fifths that lie best on it. None of less than eight places.
std::optional<Plane> planeOf(std::vector<glm::dvec3> places) {
    constexpr std::size_t kLeast = 8;
    constexpr int kTrims = 6;
    if (places.size() < kLeast) return std::nullopt;
    Plane plane;
    std::size_t kept = places.size();
    for (int trim = 0; trim < kTrims; ++trim) {
        const std::span<const glm::dvec3> best = std::span(places).first(kept);
        plane.middle = glm::dvec3(0);
        for (const glm::dvec3& p : best) plane.middle += p / static_cast<double>(kept);
        glm::dmat3 spread(0);
        for (const glm::dvec3& p : best)
            spread += glm::outerProduct(p - plane.middle, p - plane.middle) / static_cast<double>(kept);
        const auto axes = principalAxes(spread);
        plane.normal = axes[2];
        plane.across = std::sqrt(std::max(0.0, glm::dot(axes[1], spread * axes[1])));
        plane.off = std::sqrt(std::max(0.0, glm::dot(axes[2], spread * axes[2])));
        std::sort(places.begin(), places.end(), [&](const glm::dvec3& a, const glm::dvec3& b) {
            return std::abs(glm::dot(a - plane.middle, plane.normal)) <
                   std::abs(glm::dot(b - plane.middle, plane.normal));
        });
        kept = std::max(kLeast, places.size() * 3 / 5);
    }
    return plane;
}

class OpeningFinder {
  public:
    OpeningFinder(const RayView& rays, const glm::dvec3& source) : rays_(rays) {
        for (int i = 0; i < kDirections; ++i)
            directions_[static_cast<std::size_t>(i)] = Vec3f(evenDirection(i, kDirections));
        const Bounds bounds = rays.bounds();
        if (bounds.empty()) return;
        middle_ = rays.toWorld(bounds.center());
        radius_ = glm::length(glm::dvec3(bounds.size())) / 2;
        look(source);
    }
    bool outdoors() const { return !(radius_ > 0) || sky_ >= kOutdoors; }
    double volume() const { return volume_; }

    std::optional<Felt> feel(const EscapedRay& ray);

  private:
    static constexpr int kDirections = 96;

    void look(const glm::dvec3& source);
    double skyShare(const glm::dvec3& at) const;
    Hit meet(const glm::dvec3& from, const glm::dvec3& direction) const;
    bool goesOn(const glm::dvec3& from, const glm::dvec3& direction, double wall, double sky, Hit& met) const;
    std::optional<glm::dvec3> placeBefore(const EscapedRay& ray) const;
    std::optional<Outline> firstLook(const glm::dvec3& before, const glm::dvec3& direction) const;
    bool open(const Outline& outline, const glm::dvec2& at, Hit& met) const;
    bool feelRim(const Outline& about, int directions, int halvings, Rim& rim) const;
    static void tilt(Outline& outline, Rim& rim);
    void takeBoundary(Felt& felt);

    const RayView& rays_;
    std::array<Vec3f, kDirections> directions_;
    glm::dvec3 middle_{0};
    double radius_ = 0, sky_ = 1, volume_ = 0;
    std::map<const Mesh*, std::vector<std::vector<Vec3f>>> loops_;  // of meshes that were asked about
};

/// How much of what the source sees is sky, and how large the rest is.
void OpeningFinder::look(const glm::dvec3& source) {
    sky_ = skyShare(source);
    double cubes = 0;
    int walls = 0;
    for (const Vec3f& direction : directions_) {
        const Hit hit = meet(source, glm::dvec3(direction));
        if (!hit) continue;
        cubes += std::pow(double{hit.t}, 3);
        ++walls;
    }
    if (walls > 0) volume_ = 4 * std::numbers::pi / 3 * cubes / walls;
}

double OpeningFinder::skyShare(const glm::dvec3& at) const {
    const Vec3f origin = rays_.fromWorld(at);
    int seen = 0;
    for (std::size_t first = 0; first < kDirections; first += 16) {
        RayPacket16 packet;
        for (int i = 0; i < 16; ++i) {
            Ray ray;
            ray.origin = origin;
            ray.direction = directions_[first + static_cast<std::size_t>(i)];
            ray.tMax = RayView::kMaxCoordinate;
            packet.set(i, ray);
        }
        seen += 16 - std::popcount(rays_.occluded(packet, false, RayKind::sound));
    }
    return seen / double{kDirections};
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
    constexpr double kBack = 1e-3;
    met = meet(from, direction);
    if (!met) return true;
    return double{met.t} > wall && skyShare(from + direction * (double{met.t} * (1 - kBack))) >= sky;
}

/// The last place on its way that is not outside; none if it starts there.
std::optional<glm::dvec3> OpeningFinder::placeBefore(const EscapedRay& ray) const {
    double far = glm::distance(ray.origin, middle_) + radius_;
    double near = std::min(1e-3, 1e-3 * far);
    if (skyShare(ray.origin + ray.direction * near) >= kOutside) return std::nullopt;
    while (far - near > 1e-6 * (1 + near)) {
        const double between = (near + far) / 2;
        (skyShare(ray.origin + ray.direction * between) < kOutside ? near : far) = between;
    }
    return ray.origin + ray.direction * near;
}

/// The plane of an opening, and about how wide it is: from what rays beside one that goes through meet first.
std::optional<Outline> OpeningFinder::firstLook(const glm::dvec3& before, const glm::dvec3& direction) const {
    constexpr int kAround = 32, kHalvings = 12;
    constexpr double kFirst = 0.02, kMost = 60, kGrowth = 1.5;  // tangents of angles
    const glm::dvec3 u = anyAcross(direction), v = glm::cross(direction, u);
    std::vector<glm::dvec3> rim;
    // At first all is wall; then what is much farther away than most and sees the sky is outside.
    double wall = std::numeric_limits<double>::infinity();
    for (int look = 0; look < 2; ++look) {
        std::vector<double> away;
        rim.clear();
        for (int i = 0; i < kAround; ++i) {
            const double turn = 2 * std::numbers::pi * (i + 0.5) / kAround;
            const auto towards = [&](double tangent) {
                return glm::normalize(direction + tangent * (std::cos(turn) * u + std::sin(turn) * v));
            };
            Hit met;
            double inside = 0, outside = kFirst;
            while (outside < kMost && goesOn(before, towards(outside), wall, kOutside, met))
                inside = std::exchange(outside, outside * kGrowth);
            if (outside >= kMost) continue;
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
    const glm::dvec3 start = outline.place(at) - outline.normal * before;
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
    constexpr double kFirst = 0.2, kMost = 8, kGrowth = 1.25;
    rim = {};
    rim.closed = true;
    for (int i = 0; i < directions; ++i) {
        const double turn = 2 * std::numbers::pi * (i + 0.5) / directions;
        const glm::dvec2 way(std::cos(turn) * about.halfLength, std::sin(turn) * about.halfWidth);
        Hit met;
        double inside = 0, outside = kFirst;
        while (outside < kMost && open(about, way * outside, met)) inside = std::exchange(outside, outside * kGrowth);
        if (outside >= kMost) {
            rim.closed = false;
            rim.corners.push_back(about.place(way * kMost));
            rim.slots.push_back(kNoInstance);
            continue;
        }
        for (int k = 0; k < halvings; ++k) {
            const double between = (inside + outside) / 2;
            (open(about, way * between, met) ? inside : outside) = between;
        }
        rim.corners.push_back(about.place(way * ((inside + outside) / 2)));
        const bool shut = !open(about, way * outside, met) && met;
        rim.slots.push_back(shut ? met.instance : kNoInstance);
        if (!shut) continue;
        rim.walls.push_back(about.place(way * outside) + about.normal * (double{met.t} - 0.3 * about.halfWidth));
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
    const auto before = placeBefore(ray);
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
    if (!feelRim(felt.outline, 128, 14, rim)) return std::nullopt;
    felt.outline = outlineOf(rim.corners, felt.outline.normal);
    for (std::size_t i = 0, n = rim.corners.size(); i < n; ++i)
        if (rim.slots[i] != kNoInstance)
            felt.beside[rim.slots[i]] += glm::distance(rim.corners[(i + n - 1) % n], rim.corners[(i + 1) % n]) / 2;
    takeBoundary(felt);
    return felt;
}

/// Where the rim is an open boundary of one of the meshes beside, that is the outline.
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
            at = known([&](const Outline& outline) {
                return outline.holds(felt->outline.center, 1.05, 1e-3) &&
                       std::abs(glm::dot(felt->outline.center - outline.center, outline.normal)) <
                           outline.halfWidth + 1e-3;
            });
            if (at == found.end()) at = found.insert(found.end(), std::move(*felt));
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
