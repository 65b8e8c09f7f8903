#include <rtsg/audio/acoustic_geometry.h>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace rtsg {
namespace {

// Hash cells are much larger than the tolerances, so that most look-ups touch one cell.
constexpr double kNormalCell = 0.02;
constexpr double kOffsetCell = 0.05;

std::uint64_t cellKey(const std::array<std::int64_t, 4>& cell) {
    std::uint64_t key = 0;
    for (const std::int64_t c : cell) {
        key = (key ^ static_cast<std::uint64_t>(c)) * 0x9E3779B97F4A7C15ull;
        key ^= key >> 29;
    }
    return key;
}

std::int64_t cellOf(double value, double size) {
    return static_cast<std::int64_t>(std::floor(value / size));
}

std::uint64_t planeKey(const glm::dvec3& normal, double offset) {
    return cellKey({cellOf(normal.x, kNormalCell), cellOf(normal.y, kNormalCell), cellOf(normal.z, kNormalCell),
                    cellOf(offset, kOffsetCell)});
}

/// One of the two unit normals of a plane, the same for both orientations except on ties.
glm::dvec3 canonical(const glm::dvec3& normal) {
    const glm::dvec3 size = glm::abs(normal);
    const double largest = size.x >= size.y && size.x >= size.z ? normal.x : size.y >= size.z ? normal.y : normal.z;
    return largest < 0 ? -normal : normal;
}

}  // namespace

std::uint32_t PlaneMerger::find(const glm::dvec3& normal, const glm::dvec3& a, const glm::dvec3& b,
                                const glm::dvec3& c) const {
    const double offset = glm::dot(normal, a);
    const std::array<double, 4> value{normal.x, normal.y, normal.z, offset};
    const std::array<double, 4> size{kNormalCell, kNormalCell, kNormalCell, kOffsetCell};
    const std::array<double, 4> tolerance{angleTolerance_, angleTolerance_, angleTolerance_,
                                          distanceTolerance_ + angleTolerance_ * 0.01};
    std::array<std::int64_t, 4> low{}, high{};
    for (std::size_t i = 0; i < 4; ++i) {
        low[i] = cellOf(value[i] - tolerance[i], size[i]);
        high[i] = cellOf(value[i] + tolerance[i], size[i]);
    }
    for (auto w = low[3]; w <= high[3]; ++w)
        for (auto x = low[0]; x <= high[0]; ++x)
            for (auto y = low[1]; y <= high[1]; ++y)
                for (auto z = low[2]; z <= high[2]; ++z) {
                    const auto bucket = buckets_.find(cellKey({x, y, z, w}));
                    if (bucket == buckets_.end()) continue;
                    for (std::uint32_t i = bucket->second; i != kNoPlane; i = entries_[i].next) {
                        const ReflectingPlane& plane = entries_[i].plane;
                        if (glm::length(glm::cross(plane.normal, normal)) <= angleTolerance_ &&
                            std::abs(plane.signedDistance(a)) <= distanceTolerance_ &&
                            std::abs(plane.signedDistance(b)) <= distanceTolerance_ &&
                            std::abs(plane.signedDistance(c)) <= distanceTolerance_)
                            return i;
                    }
                }
    return kNoPlane;
}

std::uint32_t PlaneMerger::add(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c) {
    const glm::dvec3 cross = glm::cross(b - a, c - a);
    const double length = glm::length(cross);
    if (!(length > 1e-14) || !std::isfinite(length)) return kNoPlane;
    const glm::dvec3 normal = canonical(cross / length);
    std::uint32_t index = find(normal, a, b, c);
    if (index == kNoPlane) index = find(-normal, a, b, c);
    if (index == kNoPlane) {
        index = static_cast<std::uint32_t>(entries_.size());
        Entry entry;
        entry.low = entry.high = a;
        const auto [bucket, fresh] = buckets_.try_emplace(planeKey(normal, glm::dot(normal, a)), index);
        if (!fresh) entry.next = std::exchange(bucket->second, index);
        entries_.push_back(entry);
    }
    Entry& entry = entries_[index];
    if (length > entry.area) {
        entry.area = length;
        entry.plane.normal = normal;
        entry.plane.offset = glm::dot(normal, (a + b + c) / 3.0);
    }
    for (const glm::dvec3& p : {a, b, c}) {
        entry.low = glm::min(entry.low, p);
        entry.high = glm::max(entry.high, p);
    }
    return index;
}

std::vector<ReflectingPlane> PlaneMerger::finish() {
    std::vector<ReflectingPlane> planes;
    planes.reserve(entries_.size());
    for (Entry& entry : entries_) {
        entry.plane.center = (entry.low + entry.high) * 0.5;
        entry.plane.radius = glm::length(entry.high - entry.low) * 0.5;
        planes.push_back(entry.plane);
    }
    entries_.clear();
    buckets_.clear();
    return planes;
}

}  // namespace rtsg
