// Where instances go: the mapping from the scene's instances to Embree's objects (paper, section 5.1.2).
#include <algorithm>
#include <cmath>
#include <utility>

#include "ray_world_impl.h"

namespace rtsg {

namespace {

/// An addition of at least so many instances is taken for the arrival of a part of a scene, and what is not known to
/// move is merged; a smaller one costs what it touches.
constexpr std::size_t kBulk = 16;
/// Shared meshes up to this size are copied rather than instanced: entering an instance costs a ray as much as they do.
constexpr std::uint32_t kSmallMesh = 64;
/// Within these an Embree instance cannot lead a valid ray out of the range that Embree accepts (1.8e18).
constexpr double kLargestInverse = 1e8, kLargestErrorScale = 1e5;

struct Box {
    Vec3d center{0}, half{-1};
    bool finite() const {
        const Vec3d reach = glm::abs(center) + half;
        return reach.x <= RayWorld::kMaxCoordinate && reach.y <= RayWorld::kMaxCoordinate &&
               reach.z <= RayWorld::kMaxCoordinate;  // false for NaN
    }
};

/// Of the mesh under the transform; contains it, and is not much larger.
Box transformed(const Bounds& bounds, const WorldFromLocal& m) {
    const Vec3d center = (Vec3d(bounds.min) + Vec3d(bounds.max)) * .5,
                half = (Vec3d(bounds.max) - Vec3d(bounds.min)) * .5;
    return {m[0] * center.x + m[1] * center.y + m[2] * center.z + m[3],
            glm::abs(m[0]) * half.x + glm::abs(m[1]) * half.y + glm::abs(m[2]) * half.z};
}

bool isIdentity(const glm::mat4x3& m) {
    return m == glm::mat4x3(1.0f);
}

}  // namespace

std::uint32_t RayWorld::Impl::maskOf(const Instance& info) {
    constexpr auto shadow = static_cast<std::uint32_t>(RayKind::shadow);
    return info.castShadow ? ~0u : ~shadow;
}

RayWorld::Impl::Fitness RayWorld::Impl::fitness(std::uint32_t slot, std::string& reason) const {
    const RayInstance& instance = world->instances_[slot];
    const Place& place = places[slot];
    const WorldFromLocal& m = instance.info.worldFromLocal;
    if (!place.mesh || !place.mesh->usable) {
        reason = {};
        return Fitness::none;
    }
    if (!isFinite(m)) {
        reason = "its transform is not finite";
        return Fitness::none;
    }
    WorldFromLocal inRaySpace = m;
    inRaySpace[3] -= world->origin_;
    if (!transformed(place.mesh->mesh->bounds, inRaySpace).finite()) {
        reason = "it reaches too far out or its coordinates are not finite";
        return Fitness::none;
    }
    const glm::dmat3 cofactor(glm::cross(m[1], m[2]), glm::cross(m[2], m[0]), glm::cross(m[0], m[1]));
    double largest = 0, largestInverse = 0;
    for (int i = 0; i < 3; ++i)
        for (int k = 0; k < 3; ++k) {
            largest = std::max(largest, std::abs(cofactor[i][k]));
            largestInverse = std::max(largestInverse, std::abs(cofactor[i][k]));
        }
    if (largest == 0) {
        reason = "its transform collapses it to a line or a point";
        return Fitness::none;
    }
    const Bounds& local = place.mesh->mesh->bounds;
    const Vec3f reach = glm::max(glm::abs(local.min), glm::abs(local.max));
    largestInverse /= std::abs(glm::dot(m[0], cofactor[0]));
    if (instance.sign == 0 || !(largestInverse <= kLargestInverse) || instance.errorScale > kLargestErrorScale ||
        std::max({reach.x, reach.y, reach.z}) > kMaxCoordinate)
        return Fitness::bakeOnly;
    return Fitness::instance;
}

bool RayWorld::Impl::shouldBake(std::uint32_t slot, bool bulk) const {
    const Place& place = places[slot];
    switch (options.mapping) {
        case Mapping::merged:
            return true;
        case Mapping::perShape:
            return false;
        case Mapping::hybrid:
            break;
    }
    if (!bulk || place.moves || place.mesh->deforms || world->instances_[slot].info.motion == Motion::moving)
        return false;
    return place.mesh->users.size() == 1 || place.mesh->mesh->triangleCount <= kSmallMesh;
}

/// Far from 0 a float is coarse; subtracting an origin near the scene keeps every digit of it.
void RayWorld::Impl::chooseOrigin() {
    Vec3d lower(HUGE_VAL), upper(-HUGE_VAL);
    for (const std::uint32_t slot : pending) {
        const Place& place = places[slot];
        const WorldFromLocal& m = world->instances_[slot].info.worldFromLocal;
        if (!place.mesh || !place.mesh->usable || !isFinite(m)) continue;
        const Box box = transformed(place.mesh->mesh->bounds, m);
        lower = glm::min(lower, box.center - box.half);
        upper = glm::max(upper, box.center + box.half);
    }
    Vec3d origin(0);
    const Vec3d center = (lower + upper) * .5, half = (upper - lower) * .5;
    const double distance = std::max({std::abs(center.x), std::abs(center.y), std::abs(center.z)});
    const double extent = std::max({half.x, half.y, half.z});
    if (distance < 1e15 && distance > 4096 && distance > 4 * extent) origin = glm::round(center / 1024.0) * 1024.0;
    if (origin == world->origin_) return;
    world->origin_ = origin;
    for (RayInstance& instance : world->instances_)
        if (instance.info.id) setTransform(instance, Instance(instance.info).worldFromLocal);
}

void RayWorld::Impl::placePending() {
    const bool nothingYet = top.empty();
    if (nothingYet) chooseOrigin();
    const bool bulk = pending.size() >= kBulk || nothingYet;
    std::vector<std::uint32_t> baked;
    for (const std::uint32_t slot : pending) {
        Place& place = places[slot];
        place.pending = false;
        if (!world->instances_[slot].info.id || place.kind != Kind::none) continue;
        std::string reason;
        const Fitness fit = fitness(slot, reason);
        if (fit == Fitness::none) {
            if (!reason.empty()) cull(slot, std::move(reason));
        } else if (fit == Fitness::bakeOnly || shouldBake(slot, bulk)) {
            baked.push_back(slot);
        } else {
            placeInstance(slot);
        }
    }
    pending.clear();
    if (!baked.empty()) placeBaked(std::move(baked));
}

void RayWorld::Impl::placeBaked(std::vector<std::uint32_t> slots) {
    std::size_t triangles = 0;
    for (const std::uint32_t slot : slots) triangles += places[slot].mesh->mesh->triangleCount;
    // Groups not much larger than what arrives are joined with it: there are never more than logarithmically many,
    // and a triangle is rebuilt as rarely. The merged mapping wants one group whatever it costs.
    bvh::Group* target = nullptr;
    for (const auto& group : groups) {
        if (options.mapping == Mapping::merged || group->triangles() <= 2 * triangles) {
            triangles += group->triangles();
            if (!target) {
                target = group.get();
                continue;
            }
            std::vector<std::uint32_t> moved;
            group->forEach([&](std::uint32_t slot) { moved.push_back(slot); });
            for (const std::uint32_t slot : moved) {
                group->detach(places[slot].local);
                slots.push_back(slot);
            }
        }
    }
    if (!target) target = groups.emplace_back(std::make_unique<bvh::Group>(device)).get();
    for (const std::uint32_t slot : slots) {
        RayInstance& instance = world->instances_[slot];
        Place& place = places[slot];
        const std::shared_ptr<const Mesh>& mesh = place.mesh->mesh;
        bvh::Triangles copy{mesh, mesh->positions};
        if (!isIdentity(instance.rayFromLocal)) {
            const WorldFromLocal m = rayFromLocal(instance.info);
            copy.positions = Array<Vec3f>::ofSize(mesh->positions.size());
            Vec3f* out = copy.positions.mutableData();
            for (const Vec3f& p : mesh->positions)
                *out++ = Vec3f(m[0] * double{p.x} + m[1] * double{p.y} + m[2] * double{p.z} + m[3]);
        }
        place.local = target->attach(device, slot, std::move(copy), maskOf(instance.info));
        place.group = target;
        place.kind = Kind::baked;
        place.culled = false;
        instance.mesh = mesh;
    }
}

WorldFromLocal RayWorld::Impl::rayFromLocal(const Instance& info) const {
    WorldFromLocal m = info.worldFromLocal;
    m[3] -= world->origin_;
    return m;
}

bvh::InstanceTree::Box RayWorld::Impl::instanceBox(std::uint32_t slot) const {
    const RTCBounds& b = places[slot].mesh->bvh->bounds();
    const WorldFromLocal m = rayFromLocal(world->instances_[slot].info);
    // Nothing but degenerate triangles: a point is never hit, and has a place in the tree.
    if (!(b.lower_x <= b.upper_x)) return {Vec3f(m[3]), Vec3f(m[3])};
    Bounds local;
    local.min = {b.lower_x, b.lower_y, b.lower_z};
    local.max = {b.upper_x, b.upper_y, b.upper_z};
    const Box box = transformed(local, m);
    // Room for the rounding of the ray's transform and of the box itself.
    const Vec3d slack = (glm::abs(box.center) + box.half) * 0x1p-21;
    return {Vec3f(box.center - box.half - slack), Vec3f(box.center + box.half + slack)};
}

void RayWorld::Impl::placeInstance(std::uint32_t slot) {
    RayInstance& instance = world->instances_[slot];
    Place& place = places[slot];
    MeshEntry& entry = *place.mesh;
    if (!entry.bvh) {
        entry.bvh = std::make_unique<bvh::MeshBvh>(device, entry.mesh);
        entry.bvh->commit();
    }
    place.local = top.addInstance(slot, entry.bvh->scene(), rayFromLocal(instance.info), instanceBox(slot),
                                  maskOf(instance.info));
    place.kind = Kind::instanced;
    place.culled = false;
    instance.mesh = entry.mesh;
}

void RayWorld::Impl::tidyGroups() {
    // A group most of which has moved away is built anew without it.
    std::vector<std::uint32_t> again;
    for (const auto& group : groups) {
        if (group->hiddenTriangles() * 2 <= group->triangles()) continue;
        group->forEach([&](std::uint32_t slot) { again.push_back(slot); });
        group->drop();
    }
    if (!again.empty()) placeBaked(std::move(again));
    std::erase_if(groups, [&](const auto& group) {
        if (group->live() > 0) return false;
        if (group->topObject != bvh::InstanceTree::kNone) top.remove(group->topObject);
        return true;
    });
}

}  // namespace rtsg
