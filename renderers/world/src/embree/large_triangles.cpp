// Chooses the few large triangles, and sets up the table for them.
#include "large_triangles.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <optional>
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

const LargeKernels& largeKernels() {
    static const LargeKernels& chosen = largeKernels16() ? *largeKernels16() : largeKernels8();
    return chosen;
}

/// The largest share that the boxes' surface may have of the whole: beyond it more rays stay open than are saved.
constexpr float kMaxOpen = .5f;

struct Corners {
    Vec3d at[3];
    std::uint32_t number;
    Corners(const Triangles& triangles, std::uint32_t triangle) : number(triangle) {
        for (std::uint32_t c = 0; c < 3; ++c)
            at[c] = Vec3d(triangles.positions[triangles.mesh->vertexIndex(number, c)]);
    }
    const Vec3d& operator[](int i) const { return at[i % 3]; }
    /// The normal, whose length is twice the area.
    Vec3d normal() const { return glm::cross(at[1] - at[0], at[2] - at[0]); }
};

/// Two triangles of a parallelogram, or one alone; and which corner of each is opposite to the other one.
struct Face {
    Corners first;
    std::optional<Corners> other;
    int corner[2] = {0, 0};
};

/// Whether the two make a parallelogram, as nearly as its corners can tell.
bool isPair(const Corners& a, const Corners& b, int& rotationA, int& rotationB) {
    for (rotationA = 0; rotationA < 3; ++rotationA)
        for (rotationB = 0; rotationB < 3; ++rotationB) {
            const Vec3d &one = a[rotationA], &second = a[rotationA + 1], &third = a[rotationA + 2],
                        &opposite = b[rotationB];
            if (b[rotationB + 1] != third || b[rotationB + 2] != second) continue;
            const Vec3d off = glm::abs(one + opposite - second - third), size = glm::abs(second) + glm::abs(third);
            return std::max({off.x, off.y, off.z}) <= 0x1p-22 * (size.x + size.y + size.z);
        }
    return false;
}

std::vector<Face> facesOf(const Triangles& triangles) {
    std::vector<Corners> rest;
    for (std::uint32_t t = 0; t < triangles.mesh->triangleCount; ++t) {
        const Corners corners(triangles, t);
        const Vec3d normal = corners.normal();
        if (glm::dot(normal, normal) > 0) rest.push_back(corners);  // has an area
    }
    std::vector<Face> faces;
    for (std::size_t i = 0; i < rest.size(); ++i) {
        Face& face = faces.emplace_back(Face{rest[i], {}});
        for (std::size_t k = i + 1; k < rest.size() && !face.other; ++k) {
            if (!isPair(rest[i], rest[k], face.corner[0], face.corner[1])) continue;
            face.other = rest[k];
            rest.erase(rest.begin() + static_cast<std::ptrdiff_t>(k));
        }
        if (!face.other) face.corner[0] = 0;
    }
    return faces;
}

/// Whether all of a mesh lies behind each of its triangles, as nearly as its corners can tell.
bool isConvex(const Triangles& triangles) {
    using namespace simd;
    constexpr std::size_t kMax = 4096;  // the time of the search grows with the square
    const Array<Vec3f>& positions = triangles.positions;
    const std::uint32_t count = triangles.mesh->triangleCount;
    if (count > kMax || positions.size() > kMax || positions.empty()) return false;
    std::vector<float> columns[3];
    for (int k = 0; k < 3; ++k) {
        for (const Vec3f& position : positions) columns[k].push_back(position[k]);
        columns[k].resize((positions.size() + 7) / 8 * 8, positions[0][k]);
    }
    for (std::uint32_t t = 0; t < count; ++t) {
        const Corners corners(triangles, t);
        const Vec3d across = corners.normal();
        const double length = glm::length(across);
        if (!(length > 0)) continue;
        const Vec3f normal(across / length), at(corners[0]), size = glm::abs(at);
        const float slack = 0x1p-20f * (size.x + size.y + size.z + std::sqrt(static_cast<float>(length)));
        F8 maximum{};
        for (std::size_t i = 0; i < columns[0].size(); i += 8)
            maximum = max(maximum, (load(&columns[0][i]) - at.x) * normal.x + (load(&columns[1][i]) - at.y) * normal.y +
                                       (load(&columns[2][i]) - at.z) * normal.z);
        if (any(maximum > slack)) return false;
    }
    return true;
}

/// A box, and how far from its middle anything in it is.
struct Around {
    TreeView::Box box;
    float radius = 0;
    const Triangles* all = nullptr;          // that are in it; null: of several meshes
    std::uint32_t slot = LargeTable::kNone;  // theirs
    explicit Around(const TreeView::Box& whole) : box(whole), radius(glm::length(whole.upper - middle())) {}
    Around(const Triangles& triangles, std::uint32_t slotOfAll) : all(&triangles), slot(slotOfAll) {
        for (const Vec3f& position : triangles.positions) box.extend({position, position});
        float squared = 0;
        for (const Vec3f& position : triangles.positions) {
            const Vec3f off = position - middle();
            squared = std::max(squared, glm::dot(off, off));
        }
        radius = std::sqrt(squared);
    }
    Vec3f middle() const { return .5f * box.lower + .5f * box.upper; }
    float area() const { return box.area(); }
    void extend(const Around& other) {
        box.extend(other.box);
        *this = Around(box);  // of several
    }
};

bool isSmall(const Triangles& triangles) {
    return triangles.mesh->triangleCount <= 2 * LargeTable::kFaces;
}

/// A mesh of the group.
struct Member {
    std::uint32_t local;
    Around around;
    std::vector<Face> faces;  // empty: too many
    float worth = 0;
};

std::vector<Member> membersOf(const Group& group, std::uint32_t mask) {
    std::vector<Member> members;
    const auto forEach = [&](const auto& visit) {
        group.forEachAttached([&](std::uint32_t local, const Triangles& triangles) {
            if ((group.mask(local) & mask) && triangles.mesh->triangleCount > 0) visit(local, triangles);
        });
    };
    bool any = false;
    forEach([&](std::uint32_t, const Triangles& triangles) { any = any || isSmall(triangles); });
    if (!any) return members;  // and nobody looks at the corners of all there is
    forEach([&](std::uint32_t local, const Triangles& triangles) {
        Member& member = members.emplace_back(Member{local, Around(triangles, group.slots()[local]), {}});
        if (!isSmall(triangles)) return;
        member.faces = facesOf(triangles);
        if (member.faces.empty()) return;
        member.worth = member.around.area() / static_cast<float>(member.faces.size());
    });
    std::ranges::stable_sort(members, [](const Member& a, const Member& b) { return a.worth > b.worth; });
    return members;
}

void storeFloats(const Vec3d& v, float* to) {
    for (int k = 0; k < 3; ++k) to[k] = static_cast<float>(v[k]);
}

LargeSpot spotOf(const Vec3d& corner, const Vec3d& second, const Vec3d& third, const Vec3f& color) {
    // The error bound of RayView::point(), for numbers in the rays' own frame.
    constexpr float eps = 0x1p-24f, gamma = 12 * eps / (1 - 12 * eps);
    const Vec3f error = gamma * (glm::abs(Vec3f(corner)) + glm::abs(Vec3f(second)) + glm::abs(Vec3f(third)));
    LargeSpot spot{};
    storeFloats(corner, spot.corner), storeFloats(second, spot.second), storeFloats(third, spot.third),
        storeFloats(Vec3d(error), spot.error);
    spot.red = color.r, spot.green = color.g, spot.blue = color.b;
    return spot;
}

/// The next face of the table. Pairs must come first.
void add(const Face& face, std::uint32_t local, std::uint32_t slot, const LargeTriangles::About& about,
         LargeTable& table) {
    const std::uint32_t i = table.faceCount++;
    table.pairCount += face.other.has_value();
    const Vec3d &corner = face.first[face.corner[0]], second = face.first[face.corner[0] + 1] - corner,
                third = face.first[face.corner[0] + 2] - corner, normal = face.first.normal();
    const double squared = glm::dot(normal, normal);
    const Vec3d x = glm::cross(third, normal) / squared, y = glm::cross(normal, second) / squared,
                unit = normal / std::sqrt(squared);
    LargeTable::Face& own = table.faces[i];
    storeFloats(corner, own.corner), storeFloats(unit, own.normal), storeFloats(x, own.x), storeFloats(y, own.y);
    own.steepest = static_cast<float>(std::max({glm::length(x), glm::length(y), glm::length(x + y)}));
    own.sides = about.sides;
    table.spots[i] = spotOf(corner, second, third, about.color);
    const bool oneSided = about.sides == LargeTriangles::kFront || about.sides == LargeTriangles::kBack;
    if (about.isMirrored && oneSided) own.sides ^= LargeTriangles::kFront | LargeTriangles::kBack;
    table.mirrored[i] = about.isMirrored ? -1 : 1;
    for (int k = 0; k < 3; ++k) table.normal[k][i] = own.normal[k] * table.mirrored[i];
    const Corners& other = face.other ? *face.other : face.first;
    for (int k = 0; k < 2; ++k) {
        table.corner[k][i] = static_cast<float>(face.corner[k]);
        table.number[k][i] = std::bit_cast<float>(k == 0 ? face.first.number : other.number);
    }
    table.geometry[i] = std::bit_cast<float>(local), table.instance[i] = std::bit_cast<float>(slot);
    table.label[i] = std::bit_cast<float>(about.label);
}

/// The next box of the table, and the ball in it, widened by the rounding of a ray's distances.
void add(const Around& around, LargeTable& table) {
    const Vec3f size = glm::abs(around.box.lower) + glm::abs(around.box.upper), more = 0x1p-20f * size,
                middle = around.middle();
    const std::uint32_t i = table.boxCount++;
    for (int k = 0; k < 3; ++k) {
        table.lower[i][k] = around.box.lower[k] - more[k], table.upper[i][k] = around.box.upper[k] + more[k];
        table.middle[i][k] = middle[k];
    }
    const float radius = around.radius * (1 + 0x1p-20f) + 0x1p-20f * (size.x + size.y + size.z);
    table.radiusSquared[i] = radius * radius;
    const bool bulges = around.all && !isSmall(*around.all) && isConvex(*around.all);
    table.convex[i] = bulges ? around.slot : LargeTable::kNone;
}

/// At most so many boxes as a table has, the smallest of them in one. Returns the sum of their surfaces.
float add(std::vector<Around> boxes, LargeTable& table) {
    std::ranges::stable_sort(boxes, [](const Around& a, const Around& b) { return a.area() > b.area(); });
    while (boxes.size() > LargeTable::kBoxes) {
        const Around last = boxes.back();
        boxes.pop_back(), boxes.back().extend(last);
    }
    float sum = 0;
    for (const Around& one : boxes) sum += one.area(), add(one, table);
    return sum;
}

}  // namespace

std::unique_ptr<const LargeTriangles> LargeTriangles::make(const Group& group, const TreeView& others,
                                                           std::uint32_t mask, const Visitor& report) {
    std::vector<const Member*> chosen;
    std::vector<Around> rest;
    TreeView::Box whole;
    std::size_t count = 0;
    std::vector<Member> members = membersOf(group, mask);
    for (Member& member : members) {
        whole.extend(member.around.box);
        const bool fits = !member.faces.empty() && count + member.faces.size() <= LargeTable::kFaces;
        if (fits)
            chosen.push_back(&member), count += member.faces.size();
        else
            rest.push_back(member.around);
    }
    if (count == 0) return nullptr;
    for (std::uint32_t i = 0; !others.empty() && i < 8; ++i) {
        const TreeView::Node& root = others.nodePages()[0][TreeView::kRoot];
        if (root.child[i] != TreeView::kNone) rest.emplace_back(root.box(i)), whole.extend(root.box(i));
    }
    std::unique_ptr<LargeTriangles> large(new LargeTriangles);
    LargeTable& table = large->table_;
    if (!(add(std::move(rest), table) <= kMaxOpen * whole.area())) return nullptr;
    for (const bool pairs : {true, false})
        for (const Member* member : chosen) {
            const std::uint32_t slot = group.slots()[member->local];
            const About about = report(slot);
            for (const Face& face : member->faces)
                if (face.other.has_value() == pairs) add(face, member->local, slot, about, table);
        }
    for (const Vec3f& corner : {glm::abs(whole.lower), glm::abs(whole.upper)})
        table.size = std::max(table.size, corner.x + corner.y + corner.z);
    return large;
}

std::uint32_t LargeTriangles::intersect(const RayRows& rows, RayPacket16& rays, LargeHits& hits,
                                        std::uint32_t& open) const {
    return largeKernels().intersect(table_, rows, rays, hits, open);
}
std::uint32_t LargeTriangles::occluded(const RayRows& rows, std::uint32_t& open) const {
    return largeKernels().occluded(table_, rows, open);
}

}  // namespace rtsg::bvh
