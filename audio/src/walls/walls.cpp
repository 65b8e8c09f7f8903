// Keeps the walls of a scene in step with the instances, one record for each instance that changed.
#include "walls.h"

#include <algorithm>
#include <cmath>

namespace rtsg {

Walls::Walls(const RayWorld& world, const AcousticMaterial& defaults) : world_(&world), defaults_(defaults) {
    materials_.resize(1);
    materials_.change(0) = defaults;
}

std::uint32_t Walls::materialOf(NodeId node) {
    if (!node) return 0;
    const auto [at, fresh] = materialByNode_.try_emplace(node.value, static_cast<std::uint32_t>(materials_.size()));
    if (fresh) {
        materials_.resize(materials_.size() + 1);
        materials_.change(at->second) = defaults_;
    }
    return at->second;
}

NodeId Walls::nodeOf(std::uint32_t material) const {
    for (const auto& [node, at] : materialByNode_)
        if (at == material) return NodeId{node};
    return {};
}

void Walls::setMaterial(NodeId node, const AcousticMaterial& material) {
    const std::uint32_t at = materialOf(node);
    if (materials_[at] == material) return;
    materials_.change(at) = material;
    ++stamp_;
}

void Walls::write(std::uint32_t slot) {
    const RayInstance& instance = world_->instance(slot);
    Wall& wall = walls_.change(slot);
    wall.mesh = instance.info.heard ? instance.mesh : nullptr;
    wall.worldFromLocal = instance.info.worldFromLocal;
    wall.stamp = ++stamp_;
    wall.reach = 0;
    if (!wall.mesh) return;
    const Bounds& bounds = wall.mesh->bounds;
    for (int axis = 0; axis < 3; ++axis) {
        const double size = std::max(std::abs(bounds.min[axis]), std::abs(bounds.max[axis]));
        const glm::dvec3 along = glm::abs(wall.worldFromLocal[axis]) * size;
        wall.reach += along.x + along.y + along.z;
    }
}

void Walls::detach(std::uint32_t slot) {
    const auto list = slotsOf_.find(slots_[slot].geometry.value);
    if (list == slotsOf_.end()) return;
    auto& users = list->second;
    users[slots_[slot].userIndex] = users.back();
    slots_[users.back()].userIndex = slots_[slot].userIndex;
    users.pop_back();
    if (users.empty()) slotsOf_.erase(list);
}

void Walls::attach(const Instance& instance, NodeId material) {
    const std::uint32_t number = instance.id.slot;
    if (slots_[number].id) detach(number);
    auto& users = slotsOf_[instance.geometry.value];
    slots_[number] = {instance.id, instance.geometry, static_cast<std::uint32_t>(users.size())};
    users.push_back(number);
    write(number);
    walls_.change(number).material = materialOf(material);
}

void Walls::apply(const InstanceDelta& delta, const MaterialNode& materialNode) {
    slots_.resize(std::max(slots_.size(), world_->instances().size()));
    walls_.resize(slots_.size());
    const auto holds = [&](InstanceId id) { return id.slot < slots_.size() && slots_[id.slot].id == id; };
    for (const InstanceId id : delta.removed)
        if (holds(id)) {
            detach(id.slot);
            slots_[id.slot] = {};
            walls_.change(id.slot) = Wall{};
            walls_.change(id.slot).stamp = ++stamp_;
        }
    for (const auto* list : {&delta.added, &delta.rebound})
        for (const Instance& instance : *list)
            attach(instance, materialNode ? materialNode(instance) : instance.acoustics);
    for (const InstanceDelta::Moved& moved : delta.moved)
        if (holds(moved.id)) write(moved.id.slot);
    for (const InstanceDelta::Geometry& geometry : delta.geometries)
        if (const auto at = slotsOf_.find(geometry.node.value); at != slotsOf_.end())
            for (const std::uint32_t number : at->second) write(number);
}

WallsVersion Walls::freeze() {
    return {walls_.freeze(), materials_.freeze()};
}

}  // namespace rtsg
