// Finds closed bodies in a mesh by the corners that its triangles share.
#include "mesh_bodies.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <unordered_map>

namespace rtsg {
namespace {

/// The first of the corners that hang together with this one.
std::uint32_t groupOf(std::vector<std::uint32_t>& first, std::uint32_t corner) {
    while (first[corner] != corner) corner = first[corner] = first[first[corner]];
    return corner;
}

/// Whether two bodies overlap; false if one only stands on the other.
bool standInEachOther(const MeshBody& a, const MeshBody& b) {
    const glm::dvec3 within = glm::min(a.high, b.high) - glm::max(a.low, b.low);
    return glm::all(glm::greaterThan(within, 1e-6 * (1.0 + glm::max(glm::abs(a.high), glm::abs(b.high)))));
}

}  // namespace

MeshBodies::MeshBodies(const Mesh& mesh) {
    corners_.reserve(mesh.triangleCount);
    std::vector<std::uint32_t> first;
    std::vector<glm::dvec3> positions;
    std::vector<std::uint32_t> numbers;  // of the corners of triangles
    for (std::uint32_t t = 0; t < mesh.triangleCount; ++t)
        for (std::uint32_t c = 0; c < 3; ++c) {
            const Vec3f corner = mesh.vertex(t, c) + Vec3f(0);  // there is one zero
            const auto [known, fresh] = corners_.try_emplace(corner, static_cast<std::uint32_t>(first.size()));
            if (fresh) {
                first.push_back(known->second);
                positions.emplace_back(corner);
            }
            numbers.push_back(known->second);
            if (c > 0) first[groupOf(first, known->second)] = groupOf(first, numbers[numbers.size() - 2]);
        }
    // By their ends, the lower number first: how often more that way than the other.
    std::unordered_map<std::uint64_t, int> rounds;
    rounds.reserve(2 * numbers.size());
    std::vector<MeshBody> sums(first.size());
    for (std::size_t i = 0; i < numbers.size(); i += 3) {
        const std::uint32_t group = groupOf(first, numbers[i]);
        glm::dvec3 to[3];
        for (std::size_t c = 0; c < 3; ++c) {
            const std::uint32_t a = numbers[i + c], b = numbers[i + (c + 1) % 3];
            if (a != b) rounds[std::uint64_t{std::min(a, b)} << 32 | std::max(a, b)] += a < b ? 1 : -1;
            sums[group].low = glm::min(sums[group].low, positions[a]);
            sums[group].high = glm::max(sums[group].high, positions[a]);
            to[c] = positions[a] - positions[group];
        }
        // About a corner of it, so that nothing is lost to rounding far from the origin.
        sums[group].volume += glm::dot(to[0], glm::cross(to[1], to[2])) / 6;
    }
    for (const auto& [ends, rotation] : rounds)
        if (rotation != 0) sums[groupOf(first, static_cast<std::uint32_t>(ends >> 32))].volume = 0;
    std::vector<std::uint32_t> closed;
    for (std::uint32_t g = 0; g < first.size(); ++g)
        if (first[g] == g && sums[g].volume != 0) closed.push_back(g);
    for (std::size_t i = 0; i < closed.size(); ++i)
        for (std::size_t k = 0; k < i; ++k)
            if (standInEachOther(sums[closed[i]], sums[closed[k]]))
                first[groupOf(first, closed[i])] = groupOf(first, closed[k]);
    std::vector<std::uint32_t> bodyOf(first.size(), kNone);
    for (const std::uint32_t one : closed) {
        std::uint32_t& body = bodyOf[groupOf(first, one)];
        if (body == kNone) {
            body = static_cast<std::uint32_t>(bodies_.size());
            bodies_.emplace_back();
        }
        bodies_[body].low = glm::min(bodies_[body].low, sums[one].low);
        bodies_[body].high = glm::max(bodies_[body].high, sums[one].high);
        bodies_[body].volume += std::abs(sums[one].volume);
    }
    for (auto& [corner, number] : corners_) number = bodyOf[groupOf(first, number)];
}

std::size_t MeshBodies::Hash::operator()(const Vec3f& corner) const {
    std::uint64_t sum = 0;
    for (const float x : {corner.x, corner.y, corner.z}) {
        sum = (sum ^ std::bit_cast<std::uint32_t>(x)) * 0x9E3779B97F4A7C15ull;
        sum ^= sum >> 32;
    }
    return static_cast<std::size_t>(sum);
}

std::uint32_t MeshBodies::at(const Vec3f& corner) const {
    const auto found = corners_.find(corner + Vec3f(0));
    return found == corners_.end() ? kNone : found->second;
}

bool placedBody(const MeshBody& body, const WorldFromLocal& m, WallBody& result) {
    const glm::dvec3 half = 0.5 * (body.high - body.low);
    result.middle = m * glm::dvec4(0.5 * (body.low + body.high), 1);
    for (int i = 0; i < 3; ++i) result.half[i] = glm::dvec3(m[i]) * half[i];
    result.boxFromWorld = glm::inverse(result.half);
    const double box = 8 * std::abs(glm::determinant(result.half));
    result.fill = std::min(1.0, body.volume / (8 * half.x * half.y * half.z));
    return result.fill > 0 && box > 0 && std::isfinite(box + glm::length(result.middle));
}

}  // namespace rtsg
