// Which triangles are few and large, and what is set up for each of them.
#include "large_triangles.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <vector>

#include "bvh.h"
#include "large_kernels_impl.h"
#include "mesh/lanes8.h"

namespace rtsg::bvh {

const LargeKernels& largeKernels8() {
    static constexpr const LargeKernels& table = LargeKernelsOf<simd::Lanes8>::kTable;
    return table;
}

namespace {

const LargeKernels& kernels() {
    static const LargeKernels& chosen = largeKernels16() ? *largeKernels16() : largeKernels8();
    return chosen;
}

/// Of the surface of everything, what boxes may have together: more rays stay open than are saved.
constexpr float kMostOpen = .5f;

TreeView::Box boxAround(const Triangles& triangles) {
    TreeView::Box box;
    for (const Vec3f& place : triangles.positions) box.extend({place, place});
    return box;
}

}  // namespace

struct LargeTriangles::Member {
    std::uint32_t local;
    const Triangles* triangles;
    TreeView::Box box;
    std::uint32_t count() const { return triangles->mesh->triangleCount; }
    float worth() const { return box.area() / static_cast<float>(count()); }
};

std::unique_ptr<const LargeTriangles> LargeTriangles::make(const Group& group, const TreeView& others,
                                                           std::uint32_t mask, const Sides& sides) {
    std::vector<Member> members;
    TreeView::Box whole;
    group.forEachAttached([&](std::uint32_t local, const Triangles& triangles) {
        if (!(group.mask(local) & mask) || triangles.mesh->triangleCount == 0) return;
        members.push_back({local, &triangles, boxAround(triangles)});
        whole.extend(members.back().box);
    });
    std::ranges::stable_sort(members, [](const Member& a, const Member& b) { return a.worth() > b.worth(); });
    std::unique_ptr<LargeTriangles> large(new LargeTriangles);
    std::vector<TreeView::Box> rest;
    std::size_t count = 0;
    for (const Member& member : members) {
        if (count + member.count() > LargeTable::kTriangles) {
            rest.push_back(member.box);
            continue;
        }
        count += member.count();
        large->add(member, sides(group.slots()[member.local]));
    }
    for (std::uint32_t i = 0; !others.empty() && i < 8; ++i) {
        const TreeView::Node& root = others.nodePages()[0][TreeView::kRoot];
        if (root.child[i] != TreeView::kNone) rest.push_back(root.box(i)), whole.extend(rest.back());
    }
    if (count == 0) return nullptr;
    std::ranges::stable_sort(rest, [](const auto& a, const auto& b) { return a.area() > b.area(); });
    while (rest.size() > LargeTable::kBoxes) {
        const TreeView::Box last = rest.back();
        rest.pop_back(), rest.back().extend(last);
    }
    float open = 0;
    for (const TreeView::Box& box : rest) open += box.area(), large->add(box);
    if (!(open <= kMostOpen * whole.area())) return nullptr;
    for (const Vec3f& corner : {whole.lower, whole.upper}) {
        const Vec3f size = glm::abs(corner);
        large->table_.size = std::max(large->table_.size, size.x + size.y + size.z);
    }
    return large;
}

namespace {

/// Whether a triangle's corners lie on a plane as nearly as numbers can tell.
bool liesOn(const LargeTable::Plane& plane, const Vec3d (&corners)[3], const Vec3d& normal) {
    const Vec3d own(plane.normal[0], plane.normal[1], plane.normal[2]),
        place(plane.corner[0], plane.corner[1], plane.corner[2]);
    if (!(glm::dot(own, normal) > .5)) return false;
    return std::ranges::all_of(corners, [&](const Vec3d& corner) {
        const Vec3d size = glm::abs(corner) + glm::abs(place);
        return std::abs(glm::dot(own, corner - place)) <= 0x1p-23 * (size.x + size.y + size.z);
    });
}

void store(const Vec3d& v, float* to) {
    for (int k = 0; k < 3; ++k) to[k] = static_cast<float>(v[k]);
}

}  // namespace

void LargeTriangles::add(const Member& member, std::uint32_t sides) {
    const Mesh& mesh = *member.triangles->mesh;
    const std::uint32_t firstPlane = table_.planeCount;
    // Those on a plane follow one another.
    std::vector<bool> done(mesh.triangleCount);
    const auto set = [&](std::uint32_t t, bool opens) {
        Vec3d corners[3];
        for (std::uint32_t c = 0; c < 3; ++c) corners[c] = Vec3d(member.triangles->positions[mesh.vertexIndex(t, c)]);
        const Vec3d second = corners[1] - corners[0], third = corners[2] - corners[0],
                    normal = glm::cross(second, third);
        const double squared = glm::dot(normal, normal);
        if (!(squared > 0)) return void(done[t] = true);  // without an area
        const Vec3d unit = normal / std::sqrt(squared);
        if (opens) {
            LargeTable::Plane& plane = table_.planes[table_.planeCount++];
            store(corners[0], plane.corner), store(unit, plane.normal);
        }
        LargeTable::Plane& plane = table_.planes[table_.planeCount - 1];
        if (!opens && !liesOn(plane, corners, unit)) return;
        done[t] = true;
        const std::uint32_t number = table_.triangleCount++;
        LargeTable::Triangle& own = table_.triangles[number];
        const Vec3d bySecond = glm::cross(third, normal) / squared, byThird = glm::cross(normal, second) / squared,
                    off = Vec3d(plane.corner[0], plane.corner[1], plane.corner[2]) - corners[0];
        store(bySecond, own.second), store(byThird, own.third);
        own.second[3] = static_cast<float>(glm::dot(off, bySecond));
        own.third[3] = static_cast<float>(glm::dot(off, byThird));
        own.steepest = static_cast<float>(
            std::max({glm::length(bySecond), glm::length(byThird), glm::length(bySecond + byThird)}));
        own.sides = sides;
        for (int k = 0; k < 3; ++k) table_.normal[k][number] = static_cast<float>(unit[k]);
        table_.geometry[number] = std::bit_cast<float>(member.local), table_.number[number] = std::bit_cast<float>(t);
        plane.end = table_.triangleCount;
    };
    for (std::uint32_t t = 0; t < mesh.triangleCount; ++t) {
        if (done[t]) continue;
        set(t, true);
        if (table_.planeCount == firstPlane) continue;
        for (std::uint32_t other = t + 1; other < mesh.triangleCount; ++other)
            if (!done[other]) set(other, false);
    }
}

void LargeTriangles::add(const TreeView::Box& box) {
    // Wider than what a ray's distances are rounded by.
    constexpr float kWider = 0x1p-20f;
    const Vec3f lower = box.lower - kWider * (glm::abs(box.lower) + glm::abs(box.upper)),
                upper = box.upper + kWider * (glm::abs(box.lower) + glm::abs(box.upper));
    for (int k = 0; k < 3; ++k) table_.lower[table_.boxCount][k] = lower[k], table_.upper[table_.boxCount][k] = upper[k];
    ++table_.boxCount;
}

std::uint32_t LargeTriangles::intersect(RayPacket16& rays, std::uint32_t& open) const {
    return kernels().intersect(table_, rays, open);
}
std::uint32_t LargeTriangles::occluded(const RayPacket16& rays, std::uint32_t& open) const {
    return kernels().occluded(table_, rays, open);
}

}  // namespace rtsg::bvh
