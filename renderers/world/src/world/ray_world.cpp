// RayWorld: follows the deltas of a scene.
#include <rtsg/renderers/ray_world.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <utility>

#include "ray_world_impl.h"

namespace rtsg {

namespace {
std::atomic<std::uint64_t> rayWorldsCreated = 0;
}

RayWorld::RayWorld() : RayWorld(Options{}) {}
RayWorld::RayWorld(const Options& options) : impl_(std::make_shared<Impl>(options)) {
    tables_ = &impl_->tables;
}
RayWorld::~RayWorld() {
    // Versions may keep the rest alive; nobody waits for a thread then.
    if (impl_) impl_->worker.reset();
}
RayWorld::RayWorld(RayWorld&&) noexcept = default;
RayWorld& RayWorld::operator=(RayWorld&& other) noexcept {
    if (this == &other) return *this;
    if (impl_) impl_->worker.reset();
    RayView::operator=(other);
    impl_ = std::move(other.impl_);
    return *this;
}

RayWorld::Impl::Impl(const Options& o) : options(o), device(o.buildThreads, o.robust) {
    rayWorldsCreated.fetch_add(1, std::memory_order_relaxed);
    worker = std::make_unique<Worker>("rtsg world", o.background);
}
RayWorld::Impl::~Impl() = default;

std::uint64_t RayWorld::created() {
    return rayWorldsCreated.load(std::memory_order_relaxed);
}

void RayWorld::apply(const InstanceDelta& delta) {
    impl_->apply(delta);
    publish();
}

void RayWorld::finishBackgroundWork() {
    impl_->refresh();
    impl_->lookForRebuilt(true);
    impl_->followMeshes();
    impl_->takeMerge(true);
    impl_->tidyClusters();
    if (!impl_->pending.empty()) impl_->putPending();
    impl_->commit();
    publish();
}

void RayWorld::publish() {
    instances_ = {impl_->instances.pages(), impl_->instances.size()};
    origin_ = impl_->origin;
    version_ = impl_->version;
}

std::shared_ptr<const WorldVersion> RayWorld::freeze() {
    return impl_->freeze(impl_, *this);
}

const Diagnostics& RayWorld::diagnostics() const {
    return impl_->diagnostics;
}

void RayWorld::clearDiagnostics() {
    impl_->diagnostics = Diagnostics();
}

// ---- following the delta ------------------------------------------------------------------------------------------

void RayWorld::Impl::apply(const InstanceDelta& delta) {
    const auto start = std::chrono::steady_clock::now();
    refresh();
    ++now;
    for (const InstanceDelta::Geometry& geometry : delta.geometries) setGeometry(geometry.node, geometry.mesh);
    for (const InstanceId id : delta.removed) remove(id);
    makeRoom(delta.added);
    for (const Instance& instance : delta.added) add(instance);
    for (const Instance& instance : delta.rebound) rebind(instance);
    for (const InstanceDelta::Moved& moved : delta.moved) move(moved.id, moved.worldFromLocal);
    lookForRebuilt(false);
    followMeshes();
    for (const NodeId node : delta.geometriesRemoved) {
        const auto found = meshes.find(node.value);
        if (found == meshes.end() || !found->second.users.empty()) continue;
        leaveMesh(found->second);
        meshes.erase(found);
    }
    for (Cluster* body : touchedBodies) followBody(*body);
    touchedBodies.clear();
    takeMerge(false);
    leaveFarOrigin();
    tidyClusters();
    if (!pending.empty()) putPending();
    findRested();
    startMerge();
    commit();
    if (!delta.empty()) ++version;
    if (std::string error = device.takeError(); !error.empty()) diagnostics.error({}, "ray world: " + std::move(error));
    stats.applySeconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

namespace {

/// Why no ray may ever meet this mesh; empty if it is fine.
std::string_view defect(const Mesh& mesh) {
    if (mesh.empty() || mesh.positions.empty()) return "it has no triangles";
    const std::size_t needed = std::size_t{mesh.triangleCount - 1} * mesh.triangleStride + 3;
    if (mesh.triangleStride < 3 || mesh.triangles.size() < needed) return "its index is too short";
    const auto count = static_cast<std::uint32_t>(mesh.positions.size());
    const std::int32_t* corner = mesh.triangles.data();
    bool inRange = true;
    for (std::uint32_t t = 0; t < mesh.triangleCount; ++t, corner += mesh.triangleStride)
        inRange = inRange && static_cast<std::uint32_t>(corner[0]) < count &&
                  static_cast<std::uint32_t>(corner[1]) < count && static_cast<std::uint32_t>(corner[2]) < count;
    return inRange ? std::string_view{} : "an index is out of range";
}

}  // namespace

void RayWorld::Impl::setGeometry(NodeId node, std::shared_ptr<const Mesh> mesh) {
    MeshEntry& entry = meshes[node.value];
    entry.node = node.value;
    const bool known = entry.mesh != nullptr;
    if (known && entry.mesh == mesh) return;
    // A mesh that only deforms keeps its triangles.
    const bool sameTriangles = known && mesh && entry.usable && mesh->triangles.sameStorage(entry.mesh->triangles) &&
                               mesh->triangleCount == entry.mesh->triangleCount &&
                               mesh->triangleStride == entry.mesh->triangleStride &&
                               mesh->positions.size() == entry.mesh->positions.size();
    leaveMesh(entry);
    entry.mesh = std::move(mesh);
    joinMesh(entry);
    const std::string_view problem = sameTriangles ? std::string_view{}
                                     : entry.mesh  ? defect(*entry.mesh)
                                                   : "it has no triangles";
    entry.usable = problem.empty();
    entry.strokesStale = true;
    if (!entry.usable && entry.mesh && !entry.mesh->empty()) reportOfUntraced(node, problem);
    if (known) entry.deforms = true;
    // Others go on with the BVH that they had in common.
    if (entry.bvh.use_count() > 1)
        entry.bvh =
            entry.usable ? std::make_shared<bvh::MeshBvh>(device, *worker, entry.mesh, true, &versions) : nullptr;
    if (entry.users.empty())
        entry.bvh.reset();
    else if (!std::exchange(entry.changed, true))
        changedMeshes.push_back(&entry);
}

void RayWorld::Impl::leaveMesh(MeshEntry& entry) {
    const auto found = sharing.find(entry.mesh.get());
    if (found == sharing.end()) return;
    // Nobody else has it yet, and it is about to be of another mesh.
    if (entry.bvh.use_count() == 1 && found->second.bvh.lock() == entry.bvh) found->second.bvh.reset();
    if (--found->second.geometries == 0) sharing.erase(found);
}

void RayWorld::Impl::joinMesh(MeshEntry& entry) {
    if (entry.mesh) ++sharing[entry.mesh.get()].geometries;
}

bool RayWorld::Impl::isLive(InstanceId id) const {
    return id.slot < instances.size() && instances[id.slot].info.id == id;
}

void RayWorld::Impl::link(std::uint32_t slot, NodeId geometry) {
    InstanceState& state = states[slot];
    state.mesh = geometry ? &meshes[geometry.value] : nullptr;
    if (!state.mesh) return;
    state.userIndex = static_cast<std::uint32_t>(state.mesh->users.size());
    state.mesh->users.push_back(slot);
}

void RayWorld::Impl::unlink(std::uint32_t slot) {
    InstanceState& state = states[slot];
    if (!state.mesh) return;
    std::vector<std::uint32_t>& users = state.mesh->users;
    states[users.back()].userIndex = state.userIndex;
    users[state.userIndex] = users.back();
    users.pop_back();
    state.mesh = nullptr;
}

WorldFromLocal inverse(const WorldFromLocal& m) {
    const glm::dmat3 linear = glm::inverse(glm::dmat3(m[0], m[1], m[2]));
    return {linear[0], linear[1], linear[2], -(linear * m[3])};
}

bool canEnter(const WorldFromLocal& m) {
    /// Within these no valid ray is led out of the range that Embree accepts (1.8e18).
    constexpr double kLargestInverse = 1e8;
    constexpr float kLargestErrorScale = 1e5f;
    if (determinantSign(m) == 0) return false;
    const glm::dmat3 cofactor(glm::cross(m[1], m[2]), glm::cross(m[2], m[0]), glm::cross(m[0], m[1]));
    double largest = 0;
    for (int i = 0; i < 3; ++i)
        for (int k = 0; k < 3; ++k) largest = std::max(largest, std::abs(cofactor[i][k]));
    return largest / std::abs(glm::dot(m[0], cofactor[0])) <= kLargestInverse && errorScale(m) <= kLargestErrorScale;
}

float errorScale(const WorldFromLocal& m) {
    const glm::dmat3 cofactor(glm::cross(m[1], m[2]), glm::cross(m[2], m[0]), glm::cross(m[0], m[1]));
    const double determinant = glm::dot(m[0], cofactor[0]);
    Vec3d rows(0);
    for (int k = 0; k < 3; ++k) {
        const Vec3d inverseColumnSums = glm::abs(cofactor[k]) / std::abs(determinant);  // row k of the inverse
        rows += glm::abs(m[k]) * (inverseColumnSums.x + inverseColumnSums.y + inverseColumnSums.z);
    }
    return static_cast<float>(std::clamp(std::max({rows.x, rows.y, rows.z}), 1.0, 1e6));
}

glm::mat3 normalMatrix(const WorldFromLocal& m) {
    // The cofactor matrix is the inverse transpose times the determinant, and exists for singular matrices too.
    const double size = std::max({glm::length(m[0]), glm::length(m[1]), glm::length(m[2])});
    const glm::dmat3 cofactor(glm::cross(m[1], m[2]), glm::cross(m[2], m[0]), glm::cross(m[0], m[1]));
    return glm::mat3(cofactor * (size > 0 ? 1 / (size * size) : 0.0));
}

void setTransform(RayInstance& instance, const WorldFromLocal& m, const Vec3d& origin) {
    instance.info.worldFromLocal = m;
    instance.sign = determinantSign(m);
    WorldFromLocal inRaySpace = m;
    inRaySpace[3] -= origin;
    instance.rayFromLocal = glm::mat4x3(inRaySpace);
    instance.normalFromLocal = normalMatrix(m);
    if (instance.sign < 0) instance.normalFromLocal = -instance.normalFromLocal;
    instance.errorScale = instance.sign == 0 ? 1 : errorScale(m);
}

void RayWorld::Impl::setPending(std::uint32_t slot) {
    if (!std::exchange(states[slot].pending, true)) pending.push_back(slot);
}

void RayWorld::Impl::cull(std::uint32_t slot, std::string_view reason) {
    InstanceState& state = states[slot];
    if (std::exchange(state.culled, true)) return;
    reportOfUntraced(instances[slot].info.shape, reason);
}

void RayWorld::Impl::reportOfUntraced(NodeId node, std::string_view reason) {
    NamedNode named;
    if (options.nodes) named = options.nodes(node);
    if (named.name.empty()) named.name = "node " + std::to_string(node.value);
    reportOnce.warning(named.name + " is not traced: " + std::string(reason), diagnostics, named.location);
}

void RayWorld::Impl::makeRoom(const std::vector<Instance>& added) {
    // All at once, so that existing elements are not copied more often than needed, and a whole scene takes no more
    // memory than it needs.
    std::size_t size = instances.size();
    for (const Instance& info : added) size = std::max<std::size_t>(size, info.id.slot + 1);
    if (size == instances.size()) return;
    instances.grow(size);
    states.resize(size);
}

namespace {

bool isProxy(const Instance& info) {
    return info.felt && !info.seen;
}

}  // namespace

void RayWorld::Impl::add(const Instance& info) {
    const std::uint32_t slot = info.id.slot;
    RayInstance& instance = instances.write(slot);
    if (instance.info.id) remove(instance.info.id);
    instance.info = info;
    setTransform(instance, info.worldFromLocal, origin);
    states[slot] = InstanceState{.movedAt = now, .pending = states[slot].pending};
    link(slot, info.geometry);
    setPending(slot);
    if (info.volume) tables.volumes.push_back(slot);
    if (isProxy(info)) tables.proxies.push_back(slot);
}

void RayWorld::Impl::remove(InstanceId id) {
    if (!isLive(id)) return;
    lift(id.slot);
    unlink(id.slot);
    if (instances[id.slot].info.volume) std::erase(tables.volumes, id.slot);
    if (isProxy(instances[id.slot].info)) std::erase(tables.proxies, id.slot);
    states[id.slot] = InstanceState{.pending = states[id.slot].pending};
    instances.write(id.slot) = RayInstance{};
}

namespace {

bool sameStyle(const Instance& a, const Instance& b) {
    if (!a.strokes || !b.strokes) return a.strokes == b.strokes;
    return *a.strokes == *b.strokes;
}

}  // namespace

void RayWorld::Impl::rebind(const Instance& info) {
    if (!isLive(info.id)) return;
    const std::uint32_t slot = info.id.slot;
    RayInstance& instance = instances.write(slot);
    const bool moved = instance.info.worldFromLocal != info.worldFromLocal;
    const bool replace = instance.info.geometry != info.geometry;
    const bool masked = kindsOf(instance.info) != kindsOf(info);
    if (isProxy(instance.info) && !isProxy(info)) std::erase(tables.proxies, slot);
    if (isProxy(info) && !isProxy(instance.info)) tables.proxies.push_back(slot);
    const bool restyled = !sameStyle(instance.info, info);
    const bool elsewhere = instance.info.rigid != info.rigid, otherwise = instance.info.motion != info.motion;
    InstanceState& state = states[slot];
    if (restyled && state.kind == Kind::strokes) {
        lift(slot);
        setPending(slot);
    }
    if (replace) {
        lift(slot);
        unlink(slot);
        link(slot, info.geometry);
        state.culled = false;
        setPending(slot);
    }
    const WorldFromLocal before = instance.info.worldFromLocal;
    instance.info = info;
    instance.info.worldFromLocal = before;
    if (masked) setKinds(slot);
    if (elsewhere || otherwise) {
        state.loose = false;
        // An instance that is known to move from now on leaves the others beforehand, together with those that move
        // like it.
        if (state.kind == Kind::strokes) {
            // Every one of them is by itself anyway.
        } else if (info.motion == Motion::moving || (state.kind == Kind::body && elsewhere)) {
            lift(slot);
            setPending(slot);
        } else {
            watchRest(slot);
        }
    }
    if (moved) move(info.id, info.worldFromLocal);
}

void RayWorld::Impl::move(InstanceId id, const WorldFromLocal& worldFromLocal) {
    if (!isLive(id)) return;
    RayInstance& instance = instances.write(id.slot);
    InstanceState& state = states[id.slot];
    setTransform(instance, worldFromLocal, origin);
    state.culled = false;
    state.moves = true;
    ++state.changes;
    const bool again = std::exchange(state.movedAt, now) == now;
    if (state.kind == Kind::body) {
        Cluster& body = *state.cluster;
        if (again) return;
        if (body.movedNow.empty()) touchedBodies.push_back(&body);
        body.movedNow.push_back(id.slot);
        return;
    }
    homeward = homeward || isBackHome(id.slot);
    if (state.kind == Kind::strokes && canEnter(worldFromLocal) && isInReach(id.slot)) {
        const WorldFromLocal m = rayFromLocal(instance.info);
        strokes.move(state.local, m, floatBox(transformed(state.mesh->mesh->bounds, m)));
        return;
    }
    std::string reason;
    if (state.kind == Kind::instanced && fitness(id.slot, reason) == Fitness::instance) {
        top.move(state.local, rayFromLocal(instance.info), instanceBox(id.slot));
        return;
    }
    if (state.kind == Kind::resting) {
        ++stats.splits;
        state.splits = static_cast<std::uint8_t>(std::min(state.splits + 1, kMaxDoublings));
    }
    lift(id.slot);
    setPending(id.slot);
}

void RayWorld::Impl::followMesh(MeshEntry& entry) {
    ++swaps;
    entry.changed = false;
    if (entry.users.empty()) entry.bvh.reset();
    if (entry.bvh && entry.usable) {
        entry.bvh->update(entry.mesh);
        entry.bvh->commit();
        if (entry.bvh->busy() && !std::exchange(entry.isBusy, true)) busyMeshes.push_back(entry.node);
    }
    for (const std::uint32_t slot : entry.users) {
        InstanceState& state = states[slot];
        state.culled = false;
        state.movedAt = now;
        ++state.changes;
        std::string reason;
        if (state.kind == Kind::instanced && entry.usable && fitness(slot, reason) == Fitness::instance) {
            top.changeMesh(state.local, *entry.bvh, instanceBox(slot));
            instances.write(slot).mesh = entry.mesh;
        } else {
            lift(slot);
            setPending(slot);
        }
    }
    if (!entry.usable) entry.bvh.reset();
}

void RayWorld::Impl::followMeshes() {
    for (MeshEntry* entry : changedMeshes) followMesh(*entry);
    changedMeshes.clear();
}

void RayWorld::Impl::lookForRebuilt(bool wait) {
    std::erase_if(busyMeshes, [&](std::uint32_t node) {
        const auto found = meshes.find(node);
        if (found == meshes.end()) return true;
        MeshEntry& entry = found->second;
        if (!entry.bvh || !entry.bvh->busy()) {
            entry.isBusy = false;
            return true;
        }
        if (wait) entry.bvh->wait();
        if (entry.bvh->ready() && !std::exchange(entry.changed, true)) changedMeshes.push_back(&entry);
        return false;
    });
}

void RayWorld::Impl::commit() {
    stats.groupsBuilt = 0;
    for (const auto& cluster : resting) {
        if (!cluster->group->dirty()) continue;
        cluster->group->commit(device);
        ++stats.groupsBuilt;
        top.updateGroup(cluster->object);
    }
    top.commit();
    tables.top = top.view();
    strokes.commit();
    tables.strokes = strokes.view();
}

}  // namespace rtsg
