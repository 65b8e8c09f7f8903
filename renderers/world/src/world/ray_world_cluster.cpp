// Clusters: triangles of several instances in one BVH, resting in ray space or moving as one body.
#include <algorithm>
#include <utility>

#include "ray_world_impl.h"

namespace rtsg {

namespace {

/// Whether two transforms of a mesh are the same to well within a float's rounding of its points.
bool agree(const WorldFromLocal& a, const WorldFromLocal& b, const Bounds& bounds) {
    const Vec3d reach = glm::max(glm::abs(Vec3d(bounds.min)), glm::abs(Vec3d(bounds.max)));
    Vec3d apart(0), size(0);
    for (int i = 0; i < 3; ++i) {
        apart += glm::abs(a[i] - b[i]) * reach[i];
        size += glm::abs(a[i]) * reach[i];
    }
    apart += glm::abs(a[3] - b[3]);
    const Vec3d allowed = size * 1e-9 + glm::abs(a[3]) * 1e-12;
    const double maximum = std::max({allowed.x, allowed.y, allowed.z});
    return apart.x <= maximum && apart.y <= maximum && apart.z <= maximum;  // false for NaN
}

}  // namespace

bvh::Triangles transformedTriangles(const std::shared_ptr<const Mesh>& mesh, const WorldFromLocal& m) {
    bvh::Triangles triangles{mesh, mesh->positions};
    if (m != identityTransform()) {
        triangles.positions = Array<Vec3f>::ofSize(mesh->positions.size());
        Vec3f* out = triangles.positions.mutableData();
        for (const Vec3f& p : mesh->positions)
            *out++ = Vec3f(m[0] * double{p.x} + m[1] * double{p.y} + m[2] * double{p.z} + m[3]);
    }
    triangles.cut = bvh::cutLongTriangles(*mesh, triangles.positions);
    return triangles;
}

RayWorld::Impl::Cluster& RayWorld::Impl::newCluster(std::unique_ptr<bvh::Group> group, bool isBody) {
    auto& list = isBody ? bodies : resting;
    Cluster& cluster = *list.emplace_back(std::make_unique<Cluster>());
    cluster.group = std::move(group);
    cluster.index = static_cast<std::uint32_t>(list.size() - 1);
    cluster.isBody = isBody;
    cluster.builtAt = now;
    cluster.stamp = versions.serial();
    cluster.object = top.newObject();
    return cluster;
}

void RayWorld::Impl::dropCluster(Cluster& cluster) {
    top.remove(cluster.object);
    forgetSource(cluster);
    if (cluster.thinned) std::erase(thinned, &cluster);
    if (cluster.unsettled) std::erase(unsettled, &cluster);
    discard(cluster);
    auto& list = cluster.isBody ? bodies : resting;
    const std::uint32_t index = cluster.index;
    std::swap(list[index], list.back());
    list[index]->index = index;
    list.pop_back();
}

void RayWorld::Impl::join(Cluster& cluster, std::uint32_t slot, bvh::Triangles triangles) {
    RayInstance& instance = instances.write(slot);
    InstanceState& state = states[slot];
    instance.mesh = triangles.mesh;
    state.local = cluster.group->attach(device, slot, std::move(triangles), kindsOf(instance.info));
    state.cluster = &cluster;
    state.kind = cluster.isBody ? Kind::body : Kind::resting;
    state.culled = false;
    top.setOwner(slot, cluster.object);
}

void RayWorld::Impl::putResting(const std::vector<std::uint32_t>& slots) {
    const bool fresh = options.mapping != Mapping::merged || resting.empty();
    Cluster& cluster = fresh ? newCluster(std::make_unique<bvh::Group>(device), false) : *resting.front();
    if (!fresh) makeWritable(cluster);
    for (const std::uint32_t slot : slots) {
        join(cluster, slot, transformedTriangles(states[slot].mesh->mesh, rayFromLocal(instances[slot].info)));
    }
    if (fresh) top.setGroup(cluster.object, *cluster.group);
}

// ---- bodies -------------------------------------------------------------------------------------------------------

void RayWorld::Impl::moveBody(const std::vector<std::uint32_t>& slots) {
    const auto condition = [&](std::uint32_t slot) { return instances[slot].errorScale; };
    const std::uint32_t reference = *std::min_element(
        slots.begin(), slots.end(), [&](std::uint32_t a, std::uint32_t b) { return condition(a) < condition(b); });
    // The body's frame is that of a member, unless that one is distorted.
    constexpr float kDistorted = 8;
    WorldFromLocal frame = instances[reference].info.worldFromLocal;
    if (condition(reference) > kDistorted) frame[0] = {1, 0, 0}, frame[1] = {0, 1, 0}, frame[2] = {0, 0, 1};
    const WorldFromLocal bodyFromWorld = inverse(frame);
    Cluster& body = newCluster(std::make_unique<bvh::Group>(device), true);
    ++stats.bodiesBuilt;
    for (const std::uint32_t slot : slots) {
        const WorldFromLocal m = compose(bodyFromWorld, instances[slot].info.worldFromLocal);
        const std::shared_ptr<const Mesh>& mesh = states[slot].mesh->mesh;
        if (!transformed(mesh->bounds, m).inReach()) {
            trackInstance(slot);
            continue;
        }
        if (slot == reference) body.reference = static_cast<std::uint32_t>(body.bodyFromLocal.size());
        body.bodyFromLocal.push_back(m);
        join(body, slot, transformedTriangles(mesh, m));
        watchRest(slot);
    }
    body.group->commit(device);
    body.worldFromBody = frame;
    top.setBody(body.object, *body.group, inRaySpace(frame), bodyBox(body));
    setBodyTransform(body, frame);
}

WorldFromLocal RayWorld::Impl::inRaySpace(WorldFromLocal m) const {
    m[3] -= origin;
    return m;
}

bvh::InstanceTree::Box RayWorld::Impl::bodyBox(const Cluster& body) const {
    const bvh::InstanceTree::Box& box = body.group->box();
    const WorldFromLocal m = inRaySpace(body.worldFromBody);
    if (!(box.lower.x <= box.upper.x)) return {Vec3f(m[3]), Vec3f(m[3])};
    Bounds local;
    local.min = box.lower;
    local.max = box.upper;
    return floatBox(transformed(local, m));
}

void RayWorld::Impl::setBodyTransform(Cluster& body, const WorldFromLocal& m) {
    body.worldFromBody = m;
    top.setNormals(body.object, normalMatrix(m));
    top.move(body.object, inRaySpace(m), bodyBox(body));
    // The members' points were rounded in the body's frame, and rays are on their way into it.
    constexpr float eps = 0x1p-24f, gamma = 12 * eps / (1 - 12 * eps);
    const bvh::InstanceTree::Box& box = body.group->box();
    Vec3f floor(0);
    if (box.lower.x <= box.upper.x) {
        const Vec3d reach(glm::max(glm::abs(box.lower), glm::abs(box.upper)));
        floor = Vec3f(glm::abs(m[0]) * reach.x + glm::abs(m[1]) * reach.y + glm::abs(m[2]) * reach.z) *
                (gamma * errorScale(m));
    }
    body.group->forEach([&](std::uint32_t slot) { instances.write(slot).errorFloor = floor; });
}

void RayWorld::Impl::followBody(Cluster& body) {
    std::vector<std::uint32_t>& moved = body.movedNow;
    std::erase_if(moved, [&](std::uint32_t slot) { return states[slot].cluster != &body; });
    const std::size_t visible = body.group->live() - body.group->hidden();
    const auto leave = [&](std::uint32_t slot, bool loose) {
        states[slot].loose = loose;
        lift(slot);
        setPending(slot);
    };
    const auto worldOf = [&](std::uint32_t slot) -> const WorldFromLocal& {
        return instances[slot].info.worldFromLocal;
    };
    const auto fits = [&](std::uint32_t slot, const WorldFromLocal& frame) {
        return agree(worldOf(slot), compose(frame, body.bodyFromLocal[states[slot].local]),
                     states[slot].mesh->mesh->bounds);
    };
    WorldFromLocal frame = body.worldFromBody;
    if (moved.size() * 2 > visible) {
        // The body goes where most of its members go.
        std::uint32_t guide = moved.front();
        const std::uint32_t reference = body.group->slots()[body.reference];
        if (states[reference].cluster == &body && states[reference].movedAt == now) guide = reference;
        frame = compose(worldOf(guide), inverse(body.bodyFromLocal[states[guide].local]));
        if (!canEnter(frame) || !isFinite(frame) || !boxInReach(body, frame)) {
            // Each is traced as far as it can be, and they come together again.
            for (const std::uint32_t slot : moved) leave(slot, false);
            frame = body.worldFromBody;
        } else {
            if (moved.size() < visible) {
                std::vector<std::uint32_t> left;
                body.group->forEach([&](std::uint32_t slot) {
                    if (states[slot].movedAt != now) left.push_back(slot);
                });
                for (const std::uint32_t slot : left) leave(slot, true);
            }
            setBodyTransform(body, frame);
        }
    }
    for (const std::uint32_t slot : moved)
        if (states[slot].cluster == &body && !fits(slot, frame)) leave(slot, true);
    moved.clear();
}

bool RayWorld::Impl::boxInReach(const Cluster& body, const WorldFromLocal& frame) const {
    const bvh::InstanceTree::Box& box = body.group->box();
    if (!(box.lower.x <= box.upper.x)) return true;
    Bounds local;
    local.min = box.lower;
    local.max = box.upper;
    return transformed(local, inRaySpace(frame)).inReach();
}

// ---- leaving ------------------------------------------------------------------------------------------------------

void RayWorld::Impl::lift(std::uint32_t slot) {
    InstanceState& state = states[slot];
    ++state.changes;
    if (state.kind == Kind::instanced) {
        top.remove(state.local);
    } else if (state.kind == Kind::strokes) {
        strokes.remove(state.local);
    } else if (Cluster* cluster = state.cluster) {
        if (options.mapping == Mapping::merged) {
            makeWritable(*cluster);
            cluster->group->detach(state.local);
        } else {
            cluster->group->hide(state.local, heldBits(*cluster));
            noteUnsettled(*cluster);
        }
        if (!std::exchange(cluster->thinned, true)) thinned.push_back(cluster);
    }
    state.kind = Kind::none;
    state.cluster = nullptr;
    top.setOwner(slot, bvh::TreeView::kNone);
    RayInstance& instance = instances.write(slot);
    instance.mesh = nullptr;
    instance.errorFloor = Vec3f(0);
}

void RayWorld::Impl::setKinds(std::uint32_t slot) {
    const InstanceState& state = states[slot];
    const std::uint32_t kinds = kindsOf(instances[slot].info);
    if (state.kind == Kind::instanced) {
        top.setKinds(state.local, kinds);
    } else if (state.kind == Kind::strokes) {
        strokes.setKinds(state.local, kinds);
    } else if (state.cluster) {
        state.cluster->group->setKinds(state.local, kinds, heldBits(*state.cluster));
        noteUnsettled(*state.cluster);
    }
}

void RayWorld::Impl::tidyClusters() {
    for (std::size_t i = 0; i < thinned.size(); ++i) {
        Cluster& cluster = *thinned[i];
        cluster.thinned = false;
        const bvh::Group& group = *cluster.group;
        if (cluster.isBody && group.hiddenTriangles() * 2 > group.triangles()) {
            // Most of it has left: what remains makes another.
            std::vector<std::uint32_t> rest;
            group.forEach([&](std::uint32_t slot) { rest.push_back(slot); });
            for (const std::uint32_t slot : rest) {
                cluster.thinned = true;  // it is being seen to
                lift(slot);
                setPending(slot);
            }
            cluster.thinned = false;
        }
        if (group.live() == group.hidden()) dropCluster(cluster);
    }
    thinned.clear();
}

}  // namespace rtsg
