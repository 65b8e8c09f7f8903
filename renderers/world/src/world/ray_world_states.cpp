// Maps the scene's instances to Embree's objects (paper, section 5.1.2).
#include <algorithm>
#include <cmath>
#include <utility>

#include "ray_world_impl.h"

namespace rtsg {

namespace {

/// An addition of at least this many instances counts as the arrival of a part of a scene, and instances that are not
/// known to move are merged; the cost of a smaller one depends on the instances that it touches.
constexpr std::size_t kBulk = 16;
/// Shared meshes up to this size are copied rather than instanced: entering an instance costs a ray as much as they do.
constexpr std::uint32_t kSmallMesh = 64;

}  // namespace

bool DoubleBox::inReach() const {
    const Vec3d reach = glm::abs(center) + half;
    return reach.x <= RayWorld::kMaxCoordinate && reach.y <= RayWorld::kMaxCoordinate &&
           reach.z <= RayWorld::kMaxCoordinate;  // false for NaN
}

DoubleBox transformed(const Bounds& bounds, const WorldFromLocal& m) {
    const Vec3d center = (Vec3d(bounds.min) + Vec3d(bounds.max)) * .5,
                half = (Vec3d(bounds.max) - Vec3d(bounds.min)) * .5;
    return {m[0] * center.x + m[1] * center.y + m[2] * center.z + m[3],
            glm::abs(m[0]) * half.x + glm::abs(m[1]) * half.y + glm::abs(m[2]) * half.z};
}

bvh::InstanceTree::Box floatBox(const DoubleBox& box) {
    const Vec3d slack = (glm::abs(box.center) + box.half) * 0x1p-21;
    return {Vec3f(box.center - box.half - slack), Vec3f(box.center + box.half + slack)};
}

std::uint32_t kindsOf(const Instance& info) {
    constexpr auto view = static_cast<std::uint32_t>(RayKind::view),
                   shadow = static_cast<std::uint32_t>(RayKind::shadow),
                   sound = static_cast<std::uint32_t>(RayKind::sound), eye = static_cast<std::uint32_t>(RayKind::eye);
    if (info.volume) return 0;
    if (info.boundingBox) return eye;
    std::uint32_t kinds = ~0u;
    if (!info.seen) kinds &= ~(view | shadow | eye);
    if (info.clear) kinds &= ~(shadow | eye);
    if (!info.castShadow) kinds &= ~shadow;
    if (!info.heard) kinds &= ~sound;
    return kinds;
}

RayWorld::Impl::Fitness RayWorld::Impl::fitness(std::uint32_t slot, std::string& reason) const {
    const RayInstance& instance = instances[slot];
    const InstanceState& state = states[slot];
    const WorldFromLocal& m = instance.info.worldFromLocal;
    if (!state.mesh || !state.mesh->usable) {
        reason = {};
        return Fitness::none;
    }
    if (!isFinite(m)) {
        reason = "its transform is not finite";
        return Fitness::none;
    }
    WorldFromLocal inRaySpace = m;
    inRaySpace[3] -= origin;
    const DoubleBox box = transformed(state.mesh->mesh->bounds, inRaySpace);
    if (!box.inReach()) {
        reason = "it reaches too far out or its coordinates are not finite";
        return Fitness::none;
    }
    // An instance that is only a few steps of float wide at its place would collapse to a point, or to another shape.
    const double size = std::max({box.half.x, box.half.y, box.half.z}),
                 away = std::max({std::abs(box.center.x), std::abs(box.center.y), std::abs(box.center.z)});
    if (size > 0 && size < away * 0x1p-22) {
        reason = "it is too small for its distance from the scene's middle, where numbers are coarser than it";
        return Fitness::none;
    }
    double area = 0;
    for (int i = 0; i < 3; ++i) {
        const Vec3d side = glm::abs(glm::cross(m[i], m[(i + 1) % 3]));
        area = std::max({area, side.x, side.y, side.z});
    }
    if (area == 0) {
        reason = "its transform collapses it to a line or a point";
        return Fitness::none;
    }
    const Bounds& local = state.mesh->mesh->bounds;
    const Vec3f reach = glm::max(glm::abs(local.min), glm::abs(local.max));
    if (!canEnter(m) || std::max({reach.x, reach.y, reach.z}) > kMaxCoordinate) return Fitness::bakeOnly;
    return Fitness::instance;
}

bool RayWorld::Impl::canMerge(std::uint32_t slot) const {
    const MeshEntry& mesh = *states[slot].mesh;
    const auto shared = sharing.find(mesh.mesh.get());
    const bool alone = mesh.users.size() == 1 && (shared == sharing.end() || shared->second.geometries == 1);
    return alone || mesh.mesh->triangleCount <= kSmallMesh;
}

/// Far from 0 a float is coarse; subtracting an origin near the scene keeps every digit of it.
void RayWorld::Impl::chooseOrigin() {
    Vec3d lower(HUGE_VAL), upper(-HUGE_VAL);
    for (const std::uint32_t slot : pending) {
        const InstanceState& state = states[slot];
        const WorldFromLocal& m = instances[slot].info.worldFromLocal;
        if (!state.mesh || !(state.mesh->usable || state.mesh->hasStrokes()) || !isFinite(m)) continue;
        const DoubleBox box = transformed(state.mesh->mesh->bounds, m);
        lower = glm::min(lower, box.center - box.half);
        upper = glm::max(upper, box.center + box.half);
    }
    Vec3d found(0);
    const Vec3d center = (lower + upper) * .5, half = (upper - lower) * .5;
    const double distance = std::max({std::abs(center.x), std::abs(center.y), std::abs(center.z)});
    const double extent = std::max({half.x, half.y, half.z});
    if (distance < 1e15 && distance > 4096 && distance > 4 * extent) found = glm::round(center / 1024.0) * 1024.0;
    if (found == origin) return;
    origin = found;
    for (std::size_t slot = 0; slot < instances.size(); ++slot)
        if (instances[slot].info.id)
            setTransform(instances.write(slot), WorldFromLocal(instances[slot].info.worldFromLocal), origin);
}

/// Whether it is nearer to the world's 0 than to an origin far out, where floats are too coarse for it.
bool RayWorld::Impl::isBackHome(std::uint32_t slot) const {
    if (origin == Vec3d(0) || !isFinite(instances[slot].info.worldFromLocal)) return false;
    const MeshEntry* mesh = states[slot].mesh;
    if (!mesh || !(mesh->usable || mesh->hasStrokes())) return false;
    const DoubleBox box = transformed(mesh->mesh->bounds, instances[slot].info.worldFromLocal);
    return glm::length(box.center) < glm::length(box.center - origin);
}

/// The first instances may have been far out. Once something is nearer to the world's 0, all are placed again about an
/// origin that suits all of them.
void RayWorld::Impl::leaveFarOrigin() {
    if (origin == Vec3d(0)) return;
    for (std::size_t i = 0; i < pending.size() && !homeward; ++i) homeward = isBackHome(pending[i]);
    if (!std::exchange(homeward, false)) return;
    for (std::uint32_t slot = 0; slot < instances.size(); ++slot) {
        if (!instances[slot].info.id || states[slot].pending) continue;
        if (states[slot].kind != Kind::none) lift(slot);
        setPending(slot);
    }
}

void RayWorld::Impl::putPending() {
    const bool nothingYet = top.empty() && strokes.empty();
    if (nothingYet) chooseOrigin();
    const bool bulk = pending.size() >= kBulk || nothingYet;
    std::vector<std::uint32_t> atRest;
    std::vector<std::pair<std::uint32_t, std::uint32_t>> movers;  // by the transform that moves them
    for (const std::uint32_t slot : pending) {
        InstanceState& state = states[slot];
        state.pending = false;
        const Instance& info = instances[slot].info;
        if (!info.id || state.kind != Kind::none) continue;
        if (state.mesh && state.mesh->hasStrokes()) {
            putStrokes(slot);
            continue;
        }
        std::string reason;
        const Fitness fit = fitness(slot, reason);
        if (fit == Fitness::none) {
            if (!reason.empty()) cull(slot, reason);
        } else if (fit == Fitness::bakeOnly || options.mapping == Mapping::merged) {
            atRest.push_back(slot);
        } else if (options.mapping == Mapping::perShape || state.mesh->deforms || !canMerge(slot)) {
            trackInstance(slot);
        } else if (state.moves || info.motion == Motion::moving) {
            if (info.rigid != 0 && !state.loose)
                movers.emplace_back(info.rigid, slot);
            else
                trackInstance(slot);
        } else if (bulk) {
            atRest.push_back(slot);
        } else {
            trackInstance(slot);
        }
    }
    pending.clear();
    if (!atRest.empty()) putResting(atRest);
    std::sort(movers.begin(), movers.end());
    std::vector<std::uint32_t> together;
    for (std::size_t i = 0; i < movers.size(); ++i) {
        together.push_back(movers[i].second);
        if (i + 1 < movers.size() && movers[i + 1].first == movers[i].first) continue;
        if (together.size() > 1)
            moveBody(together);
        else
            trackInstance(together.front());
        together.clear();
    }
}

WorldFromLocal RayWorld::Impl::rayFromLocal(const Instance& info) const {
    return inRaySpace(info.worldFromLocal);
}

bvh::InstanceTree::Box RayWorld::Impl::instanceBox(std::uint32_t slot) const {
    const Bounds& local = states[slot].mesh->bvh->bounds();
    const WorldFromLocal m = rayFromLocal(instances[slot].info);
    // Nothing but degenerate triangles: a point is never hit, and has a place in the tree.
    if (!(local.min.x <= local.max.x)) return {Vec3f(m[3]), Vec3f(m[3])};
    return floatBox(transformed(local, m));
}

void RayWorld::Impl::trackInstance(std::uint32_t slot) {
    RayInstance& instance = instances.write(slot);
    InstanceState& state = states[slot];
    MeshEntry& entry = *state.mesh;
    std::weak_ptr<bvh::MeshBvh>& common = sharing[entry.mesh.get()].bvh;
    if (!entry.bvh && !entry.deforms) entry.bvh = common.lock();
    if (!entry.bvh) {
        entry.bvh = std::make_shared<bvh::MeshBvh>(device, *worker, entry.mesh, entry.deforms, &versions);
        if (!entry.deforms) common = entry.bvh;
        entry.bvh->commit();
        if (entry.bvh->busy() && !std::exchange(entry.isBusy, true)) busyMeshes.push_back(entry.node);
    }
    state.local = top.newObject();
    top.setInstance(state.local, slot, *entry.bvh, rayFromLocal(instance.info), instanceBox(slot),
                    kindsOf(instance.info));
    top.setOwner(slot, state.local);
    state.kind = Kind::instanced;
    state.culled = false;
    instance.mesh = entry.mesh;
    watchRest(slot);
}

bool RayWorld::Impl::isInReach(std::uint32_t slot) const {
    const WorldFromLocal& m = instances[slot].info.worldFromLocal;
    return isFinite(m) && transformed(states[slot].mesh->mesh->bounds, inRaySpace(m)).inReach();
}

void RayWorld::Impl::putStrokes(std::uint32_t slot) {
    RayInstance& instance = instances.write(slot);
    InstanceState& state = states[slot];
    MeshEntry& entry = *state.mesh;
    if (!isInReach(slot)) {
        cull(slot, "it reaches too far out or its coordinates are not finite");
        return;
    }
    WorldFromLocal m = rayFromLocal(instance.info);
    std::shared_ptr<const bvh::StrokeBvh> bvh;
    if (canEnter(m)) {
        if (!entry.strokes || std::exchange(entry.strokesStale, false))
            entry.strokes = bvh::StrokeBvh::of(*entry.mesh, entry.strokes.get());
        entry.strokesStale = false;
        bvh = entry.strokes;
    } else {
        // A transform that flattens has no inverse: the strokes themselves are moved to their places.
        bvh = bvh::StrokeBvh::of(*entry.mesh, nullptr, &m);
        m = identityTransform();
    }
    const bool points = entry.mesh->strokes == Mesh::Strokes::points;
    const bvh::TreeView::Box& own = bvh->box();
    const bvh::InstanceTree::Box box = floatBox(transformed({own.lower, own.upper}, m));
    state.local = strokes.add(slot, std::move(bvh), points, instance.info.strokes, m, box, kindsOf(instance.info));
    state.kind = Kind::strokes;
    state.culled = false;
    instance.mesh = entry.mesh;
}

}  // namespace rtsg
