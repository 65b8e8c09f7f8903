// Finds what separates a source from a listener: closed shapes with one of them inside, or a place that no ray leaves.
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include "signal/random.h"
#include "world_geometry.h"

namespace rtsg {
namespace {

/// Of a height in [-1, 1] and a turn.
glm::dvec3 onUnitSphere(double z, double angle) {
    const double r = std::sqrt(std::max(0.0, 1 - z * z)), phi = 2 * std::numbers::pi * angle;
    return {r * std::cos(phi), r * std::sin(phi), z};
}

/// How often a closed mesh winds round a point, by the solid angles of its triangles (van Oosterom and Strackee 1983).
/// Not an integer if the point is on the mesh, or nothing is known.
double windingNumber(const Wall& wall, const glm::dvec3& position) {
    const WorldFromLocal& m = wall.worldFromLocal;
    const glm::dmat3 linear(m[0], m[1], m[2]);
    if (!(std::abs(glm::determinant(linear)) > 0)) return .5;
    const glm::dvec3 local = glm::inverse(linear) * (position - m[3]);
    double sum = 0;
    for (std::uint32_t t = 0; t < wall.mesh->triangleCount; ++t) {
        glm::dvec3 to[3];
        double away[3];
        for (std::uint32_t c = 0; c < 3; ++c) {
            to[c] = glm::dvec3(wall.mesh->vertex(t, c)) - local;
            away[c] = glm::length(to[c]);
        }
        const double volume = glm::dot(to[0], glm::cross(to[1], to[2]));
        sum += 2 * std::atan2(volume, away[0] * away[1] * away[2] + glm::dot(to[0], to[1]) * away[2] +
                                          glm::dot(to[1], to[2]) * away[0] + glm::dot(to[2], to[0]) * away[1]);
    }
    return sum / (4 * std::numbers::pi);
}

}  // namespace

/// Where some rays went that start at a point and are scattered by walls.
struct WorldGeometry::Flood {
    bool escaped = false, arrived = false;
    std::map<std::uint32_t, int> met;  // slots, and how often
};

/// The nearest surface that lets no sound pass.
bool WorldGeometry::meets(std::span<const std::uint32_t> open, const glm::dvec3& from, const glm::dvec3& direction,
                          double length, Hit& hit) const {
    Ray ray;
    ray.origin = rays_->fromWorld(from);
    ray.direction = Vec3f(direction);
    ray.tMax = static_cast<float>(std::min(length, 1e9));
    for (int layer = 0; layer < 256 && ray.tMin < ray.tMax; ++layer) {
        hit = rays_->intersect(ray, RayKind::sound);
        if (!hit) return false;
        const Bands& passes = materials_[walls_.walls[hit.instance].material].transmission;
        if (std::find(open.begin(), open.end(), hit.instance) == open.end() &&
            std::none_of(passes.begin(), passes.end(), [](double fraction) { return fraction > 0; }))
            return true;
        ray.tMin = std::nextafter(std::max(hit.t, 1e-30f), std::numeric_limits<float>::infinity());
    }
    return false;
}

WorldGeometry::Flood WorldGeometry::floodFrom(std::span<const std::uint32_t> open, const glm::dvec3& from,
                                              const glm::dvec3& to) const {
    constexpr int kWalks = 64, kSteps = 64;
    // Each ray starts a little before the end of the one that came there, by more than rounding is, and so never behind
    // a wall.
    constexpr double kBack = 1e-3;
    Flood flood;
    Random random(0x5EA1);
    const auto seen = [&](const glm::dvec3& position) {
        Hit hit;
        const double distance = glm::distance(position, to);
        return !(distance > 0) || !meets(open, position, (to - position) / distance, distance * (1 - 1e-6), hit);
    };
    flood.arrived = seen(from);
    for (int walk = 0; walk < kWalks && !flood.arrived && !flood.escaped; ++walk) {
        glm::dvec3 origin = from, direction = onUnitSphere(1 - (2.0 * walk + 1) / kWalks, walk / std::numbers::phi);
        for (int step = 0; step < kSteps && !flood.arrived; ++step) {
            Hit hit;
            if (!meets(open, origin, direction, std::numeric_limits<double>::infinity(), hit)) {
                flood.escaped = true;
                break;
            }
            ++flood.met[hit.instance];
            const glm::dvec3 normal = glm::normalize(glm::dvec3(hit.normal));
            const double length = static_cast<double>(hit.t), across = std::abs(glm::dot(normal, direction));
            origin += direction * std::max(0.0, std::min(length * (1 - kBack), length - roundingAt(origin) / across));
            const glm::dvec3 even = onUnitSphere(2 * random.uniform() - 1, random.uniform());
            // Lambert's law: an even place on a sphere that touches the surface.
            direction = glm::normalize((glm::dot(normal, direction) > 0 ? -normal : normal) * (1 + 1e-9) + even);
            flood.arrived = seen(origin);
        }
    }
    return flood;
}

Passage WorldGeometry::passageBut(std::span<const std::uint32_t> open, const glm::dvec3& a, const glm::dvec3& b) const {
    if (!rays_ || !(glm::distance(a, b) < 1e6)) return Passage::unknown;
    if (floodFrom(open, a, b).arrived) return Passage::found;
    return sealBetween(open, a, b) ? Passage::none : Passage::unknown;
}

RoomOpenings WorldGeometry::openings(const glm::dvec3& source, std::span<const EscapedRay> exits,
                                     const Bands& escaped) const {
    if (!rays_) return {};
    return findRoomOpenings(*rays_, source, exits, escaped);
}

std::optional<Seal> WorldGeometry::sealBetween(std::span<const std::uint32_t> open, const glm::dvec3& source,
                                               const glm::dvec3& listener) const {
    // Written so that a position that is not finite is nowhere.
    if (!rays_ || !(glm::distance(source, listener) < 1e6)) return std::nullopt;
    const Flood out = floodFrom(open, source, listener);
    if (out.arrived) return std::nullopt;
    const Flood in = floodFrom(open, listener, source);
    if (in.arrived || (out.escaped && in.escaped)) return std::nullopt;
    for (const bool sourceInside : {true, false}) {
        const Flood& inner = sourceInside ? out : in;
        if (inner.escaped) continue;
        Seal seal{.sourceInside = sourceInside, .proven = true, .shapes = {}};
        for (const auto& [slot, times] : inner.met) {
            const Wall& wall = walls_.walls[slot];
            if (!wall.mesh || !wall.mesh->isClosed()) continue;
            const double a = windingNumber(wall, source), b = windingNumber(wall, listener);
            const double inside = std::abs(sourceInside ? a : b), outside = std::abs(sourceInside ? b : a);
            // Nothing that is whole is .01 off.
            if (std::abs(a - std::round(a)) < .01 && std::abs(b - std::round(b)) < .01 && inside > outside + .5)
                seal.shapes.push_back(wallShapeOf(*rays_, slot));
        }
        if (seal.shapes.empty()) continue;
        const auto size = [](const WallShape& shape) { return glm::length(shape.box.high - shape.box.low); };
        std::stable_sort(seal.shapes.begin(), seal.shapes.end(),
                         [&](const WallShape& a, const WallShape& b) { return size(a) < size(b); });
        return seal;
    }
    constexpr std::size_t kNamed = 3;
    Seal seal{.sourceInside = !out.escaped, .proven = false, .shapes = {}};
    const Flood& inner = seal.sourceInside ? out : in;
    std::vector<std::pair<int, std::uint32_t>> maximum;
    for (const auto& [slot, times] : inner.met) maximum.emplace_back(-times, slot);
    std::sort(maximum.begin(), maximum.end());
    for (std::size_t i = 0; i < std::min(kNamed, maximum.size()); ++i)
        seal.shapes.push_back(wallShapeOf(*rays_, maximum[i].second));
    seal.more = maximum.size() - seal.shapes.size();
    return seal;
}

}  // namespace rtsg
