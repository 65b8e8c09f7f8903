// Measures a room by rays that scatter, and predicts its reverberation by the formulas of Sabine and Eyring.
#include <rtsg/audio/room_report.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>

#include "response/directions.h"
#include "response/listening_positions.h"
#include "signal/random.h"
#include "walls/even_direction.h"

namespace rtsg {
namespace {

constexpr int kChains = AcousticRays::kMax, kSteps = 3000;
/// Walls until it hardly matters any more where a chain began.
constexpr int kSettled = 8;
constexpr double kFarthest = 1e6;  // m
constexpr double kMaxOpen = 0.25;
/// Places from which the volume is seen, and those that they are to see.
constexpr std::size_t kLookouts = 32, kOthers = 256;
constexpr int kLooks = 1024;

/// A ray that goes from wall to wall by chance.
struct WalkingRay {
    glm::dvec3 origin{0}, direction{0, 0, 1}, facing{0};
    std::uint32_t plane = kNoPlane;
    int met = 0;
    Random random{0};

    void start(const glm::dvec3& inside) {
        const double u = random.uniform();
        origin = inside, facing = glm::dvec3(0), plane = kNoPlane, met = 0;
        direction = trace::directionFrom(u, random.uniform());
    }
    void scatter(const AcousticHit& hit) {
        origin += direction * hit.distance;
        facing = glm::dot(direction, hit.normal) > 0 ? -hit.normal : hit.normal;
        plane = hit.plane;
        direction = trace::cosineDirection(facing, random);
        ++met;
    }
};

/// The sums over walking rays.
struct Walked {
    double length = 0;
    std::uint64_t segments = 0, left = 0;
    std::map<std::uint32_t, std::uint64_t> hits;  // by material
    AcousticBox box;
    std::vector<glm::dvec3> positions;

    std::uint64_t ends() const { return segments + left; }
};

Walked walk(const AcousticGeometry& geometry, const glm::dvec3& inside) {
    Walked walked;
    std::array<WalkingRay, kChains> chains;
    for (std::size_t i = 0; i < kChains; ++i) {
        chains[i].random = Random(Random::mix(0x517E, i));
        chains[i].start(inside);
    }
    for (int step = 0; step < kSteps; ++step) {
        AcousticRays rays;
        for (const WalkingRay& ray : chains) rays.add(ray.origin, ray.facing, ray.direction, kFarthest, ray.plane);
        AcousticHits hits;
        const std::uint32_t met = geometry.closestOf(rays, hits);
        for (std::size_t i = 0; i < kChains; ++i) {
            WalkingRay& ray = chains[i];
            const bool settled = ray.met >= kSettled;
            if (!(met >> i & 1)) {
                walked.left += settled ? 1 : 0;
                ray.start(inside);
                continue;
            }
            if (settled) {
                walked.length += hits[i].distance;
                ++walked.segments;
                ++walked.hits[hits[i].material];
                walked.box.extend(ray.origin + ray.direction * hits[i].distance);
                // One in each of some steps, with a chance that grows with the way, is evenly spread.
                const double fraction = ray.random.uniform();
                if (ray.random.uniform() * 4 * walked.length < hits[i].distance * static_cast<double>(walked.segments))
                    walked.positions.push_back(ray.origin + ray.direction * (fraction * hits[i].distance));
            }
            ray.scatter(hits[i]);
        }
    }
    return walked;
}

/// Selects this many of them, spread over the whole walk.
std::vector<glm::dvec3> someOf(const std::vector<glm::dvec3>& positions, std::size_t count, std::size_t from) {
    std::vector<glm::dvec3> some;
    const std::size_t step = std::max<std::size_t>(1, positions.size() / std::max<std::size_t>(1, count));
    for (std::size_t i = from; i < positions.size() && some.size() < count; i += step) some.push_back(positions[i]);
    return some;
}

/// How far a ray goes until it leaves a box that it starts in.
double pathThrough(const AcousticBox& box, const glm::dvec3& from, const glm::dvec3& direction) {
    double distance = kFarthest;
    for (int axis = 0; axis < 3; ++axis) {
        const double d = direction[axis];
        if (d != 0) distance = std::min(distance, ((d > 0 ? box.high[axis] : box.low[axis]) - from[axis]) / d);
    }
    return std::max(0.0, distance);
}

double volumeBy(const AcousticGeometry& geometry, const std::vector<glm::dvec3>& positions, const AcousticBox& box) {
    const std::vector<glm::dvec3> lookouts = someOf(positions, kLookouts, 0), others = someOf(positions, kOthers, 1);
    double seen = 0;
    std::uint64_t asked = 0, visible = 0;
    for (const glm::dvec3& position : lookouts) {
        for (int first = 0; first < kLooks; first += AcousticRays::kMax) {
            AcousticRays rays;
            for (int i = 0; i < AcousticRays::kMax; ++i)
                rays.add(position, glm::dvec3(0), evenDirection(first + i, kLooks), kFarthest, kNoPlane);
            AcousticHits hits;
            const std::uint32_t met = geometry.closestOf(rays, hits);
            for (int i = 0; i < AcousticRays::kMax; ++i) {
                // In its openings the room ends at the box around all of its walls.
                const double distance = (met >> i & 1) != 0 ? hits[static_cast<std::size_t>(i)].distance
                                                            : pathThrough(box, position, rays.direction[i]);
                seen += 4 * std::numbers::pi / 3 * distance * distance * distance / kLooks;
            }
        }
        for (const glm::dvec3& other : others) {
            const double distance = glm::distance(position, other);
            if (!(distance > 0)) continue;
            AcousticHit hit;
            ++asked;
            visible += geometry.closest(position, (other - position) / distance, distance, kNoPlane, hit) ? 0 : 1;
        }
    }
    if (lookouts.empty() || visible == 0) return std::numeric_limits<double>::quiet_NaN();
    return seen / static_cast<double>(lookouts.size()) * static_cast<double>(asked) / static_cast<double>(visible);
}

}  // namespace

RoomSize measureRoom(const AcousticGeometry& geometry, const glm::dvec3& inside) {
    RoomSize room;
    const Walked walked = walk(geometry, inside);
    const auto ends = static_cast<double>(walked.ends());
    if (walked.segments < 1000 || static_cast<double>(walked.left) > kMaxOpen * ends) return room;
    room.box = walked.box;
    room.positions = someOf(walked.positions, kOthers, 0);
    room.volume = volumeBy(geometry, walked.positions, walked.box);
    // Only ways that end at a wall count; those through openings have no length.
    room.surface = 4 * room.volume * static_cast<double>(walked.segments) / walked.length;
    room.openings = room.surface * static_cast<double>(walked.left) / ends;
    for (const auto& [material, hits] : walked.hits)
        room.surfaces.push_back({material, room.surface * static_cast<double>(hits) / ends});
    std::ranges::stable_sort(room.surfaces, std::greater(), &RoomSize::Surface::area);
    return room;
}

Bands absorptionArea(const RoomSize& room, std::span<const AcousticMaterial> materials) {
    Bands area = allBands(room.openings);
    for (const RoomSize::Surface& surface : room.surfaces) {
        const AcousticMaterial& material = materials[surface.material];
        for (std::size_t b = 0; b < kBandCount; ++b)
            area[b] += surface.area * std::min(1.0, material.absorption[b] + material.transmission[b]);
    }
    return area;
}

namespace {

/// 24 ln 10 V / c over the absorption area, m^2.
Bands timesOf(const RoomSize& room, const Bands& absorbed, const Air& air) {
    const Bands attenuation = airAttenuation(air);
    Bands times = allBands(std::numeric_limits<double>::quiet_NaN());
    for (std::size_t b = 0; b < kBandCount; ++b) {
        const double all = absorbed[b] + 4 * attenuation[b] * room.volume;
        if (room.known() && all > 0) times[b] = 24 * std::numbers::ln10 * room.volume / (air.speedOfSound * all);
    }
    return times;
}

}  // namespace

Bands sabineTimes(const RoomSize& room, std::span<const AcousticMaterial> materials, const Air& air) {
    return timesOf(room, absorptionArea(room, materials), air);
}

Bands eyringTimes(const RoomSize& room, std::span<const AcousticMaterial> materials, const Air& air) {
    Bands absorbed = absorptionArea(room, materials);
    for (double& area : absorbed) area = -room.surface * std::log1p(-std::min(area / room.surface, 1.0));
    return timesOf(room, absorbed, air);
}

}  // namespace rtsg
