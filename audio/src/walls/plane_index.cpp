// Finds equal planes by hashing normal and distance into cells.
#include "plane_index.h"
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

std::uint32_t PlaneIndex::findOneSided(const glm::dvec3& normal, std::span<const glm::dvec3> points) const {
    const std::array<double, 4> value{normal.x, normal.y, normal.z, glm::dot(normal, points[0])};
    const std::array<double, 4> size{kNormalCell, kNormalCell, kNormalCell, kOffsetCell};
    // The offset of a plane that is a little tilted differs with the place where it is taken.
    const double slack = tolerance_.distance + tolerance_.angle * 0.01;
    const std::array<double, 4> tolerance{tolerance_.angle, tolerance_.angle, tolerance_.angle, slack};
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
                        if (glm::length(glm::cross(plane.normal, normal)) > tolerance_.angle) continue;
                        if (std::all_of(points.begin(), points.end(), [&](const glm::dvec3& p) {
                                return std::abs(plane.signedDistance(p)) <= tolerance_.distance;
                            }))
                            return i;
                    }
                }
    return kNoPlane;
}

std::uint32_t PlaneIndex::find(const glm::dvec3& normal, std::span<const glm::dvec3> points) const {
    const glm::dvec3 n = canonical(normal);
    const std::uint32_t found = findOneSided(n, points);
    // If two coordinates tie, rounding decides the sign of the canonical normal.
    return found != kNoPlane ? found : findOneSided(-n, points);
}

std::uint32_t PlaneIndex::insert(const ReflectingPlane& plane) {
    Entry entry;
    entry.plane = plane;
    entry.plane.normal = canonical(plane.normal);
    if (entry.plane.normal != plane.normal) entry.plane.offset = -plane.offset;
    entry.key = planeKey(entry.plane.normal, entry.plane.offset);
    std::uint32_t index = static_cast<std::uint32_t>(entries_.size());
    if (free_.empty()) {
        entries_.emplace_back();
    } else {
        index = free_.back();
        free_.pop_back();
    }
    const auto [bucket, fresh] = buckets_.try_emplace(entry.key, index);
    if (!fresh) entry.next = std::exchange(bucket->second, index);
    entries_[index] = entry;
    return index;
}

void PlaneIndex::erase(std::uint32_t plane) {
    const auto bucket = buckets_.find(entries_[plane].key);
    std::uint32_t* link = &bucket->second;
    while (*link != plane) link = &entries_[*link].next;
    *link = entries_[plane].next;
    if (bucket->second == kNoPlane) buckets_.erase(bucket);
    entries_[plane] = Entry{};
    free_.push_back(plane);
}

std::uint32_t PlaneMerger::add(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c) {
    const glm::dvec3 cross = glm::cross(b - a, c - a);
    const double length = glm::length(cross);
    if (!(length > 1e-14) || !std::isfinite(length)) return kNoPlane;
    ReflectingPlane plane;
    plane.normal = canonical(cross / length);
    plane.offset = glm::dot(plane.normal, (a + b + c) / 3.0);
    const std::array<glm::dvec3, 3> points{a, b, c};
    std::uint32_t index = index_.find(plane.normal, points);
    if (index == kNoPlane) {
        index = index_.insert(plane);
        parts_.push_back({0, a, a});
    }
    Part& part = parts_[index];
    if (length > part.area) {
        part.area = length;
        index_[index].normal = plane.normal;
        index_[index].offset = plane.offset;
    }
    for (const glm::dvec3& p : points) {
        part.low = glm::min(part.low, p);
        part.high = glm::max(part.high, p);
    }
    return index;
}

std::vector<ReflectingPlane> PlaneMerger::finish() {
    std::vector<ReflectingPlane> planes;
    planes.reserve(parts_.size());
    for (std::uint32_t i = 0; i < parts_.size(); ++i) {
        ReflectingPlane plane = index_[i];
        plane.center = (parts_[i].low + parts_[i].high) * 0.5;
        plane.radius = glm::length(parts_[i].high - parts_[i].low) * 0.5;
        planes.push_back(plane);
    }
    *this = PlaneMerger();
    return planes;
}

}  // namespace rtsg
