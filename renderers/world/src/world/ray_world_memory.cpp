// Counts and memory use.
#include <unordered_map>
#include <unordered_set>

#include "ray_world_impl.h"

namespace rtsg {

namespace {

/// Distinct arrays, with the number of their owners that are known here; any other owner is the scene.
class Arrays {
  public:
    template <class T>
    void add(const Array<T>& array) {
        if (!array.empty()) add(array.header());
    }
    void add(const MeshAttribute& attribute) {
        add(attribute.indices());
        // The header lies before the values, whatever their type (array.h).
        if (attribute.present()) add(reinterpret_cast<const detail::ArrayHeader*>(attribute.data()) - 1);
    }
    void add(const Mesh& mesh) {
        add(mesh.positions);
        add(mesh.triangles);
        add(mesh.normals);
        add(mesh.colors);
        for (const TexCoords& set : mesh.texCoords) add(set.values);
    }
    void sum(std::size_t& shared, std::size_t& own) const {
        for (const auto& [header, entry] : entries_)
            (header->owners.load(std::memory_order_relaxed) > entry.known ? shared : own) += entry.bytes;
    }

  private:
    struct Entry {
        std::size_t bytes = 0;
        std::uint32_t known = 0;
    };
    void add(const detail::ArrayHeader* header) {
        Entry& entry = entries_[header];
        entry.bytes = header->size * header->elementSize;
        ++entry.known;
    }
    std::unordered_map<const detail::ArrayHeader*, Entry> entries_;
};

}  // namespace

RayWorld::Stats RayWorld::stats() const {
    Stats stats = impl_->stats;
    std::unordered_set<const Mesh*> distinct;
    for (const auto& [node, entry] : impl_->meshes) {
        if (!entry.mesh) continue;
        ++stats.meshes;
        if (!distinct.insert(entry.mesh.get()).second) continue;
        stats.uniqueTriangles += entry.mesh->triangleCount;
        stats.meshBytes += memoryUse(*entry.mesh);
    }
    for (std::size_t slot = 0; slot < impl_->instances.size(); ++slot) {
        if (!impl_->instances[slot].info.id) continue;
        const Impl::InstanceState& state = impl_->states[slot];
        ++stats.instances;
        if (state.kind != Impl::Kind::none) {
            ++stats.traced;
            stats.instancedTriangles += state.mesh->mesh->triangleCount;
        }
        stats.baked += state.cluster != nullptr;
        stats.culled += state.culled;
    }
    std::unordered_set<const bvh::MeshBvh*> counted;  // equal geometries have one
    for (const auto& [node, entry] : impl_->meshes) {
        if (!entry.bvh || !counted.insert(entry.bvh.get()).second) continue;
        stats.meshBuilds += entry.bvh->counts().builds;
        stats.meshRefits += entry.bvh->counts().refits;
        stats.meshRebuilds += entry.bvh->counts().rebuilds;
    }
    stats.groups = impl_->resting.size();
    stats.bodies = impl_->bodies.size();
    stats.bvhBytes = impl_->device.bytes() + impl_->top.bytes();
    stats.topBuilds = impl_->top.builds();
    return stats;
}

RayWorld::Memory RayWorld::memory() const {
    Memory memory;
    Arrays arrays;
    std::unordered_map<const Mesh*, bool> seen;
    for (const auto& [node, entry] : impl_->meshes) {
        if (!entry.mesh || !seen.emplace(entry.mesh.get(), true).second) continue;
        memory.triangles += entry.mesh->triangleCount;
        arrays.add(*entry.mesh);
    }
    for (const auto* clusters : {&impl_->resting, &impl_->bodies})
        for (const auto& cluster : *clusters) {
            memory.bvhBytes += cluster->group->clusterBytes();
            cluster->group->forEachArray([&](const bvh::Triangles& triangles) {
                if (triangles.positions.sameStorage(triangles.mesh->positions))
                    arrays.add(triangles.positions);
                else
                    memory.copyBytes += triangles.positions.size() * sizeof(Vec3f);
                if (triangles.cut) memory.copyBytes += triangles.cut->bytes();
            });
        }
    for (const auto& [node, entry] : impl_->meshes)
        if (entry.bvh) arrays.add(entry.bvh->indexInUse());
    arrays.sum(memory.sceneBytes, memory.tessellatedBytes);
    for (std::size_t slot = 0; slot < impl_->instances.size(); ++slot) {
        if (!impl_->instances[slot].info.id) continue;
        ++memory.instances;
        if (impl_->instances[slot].mesh) memory.instancedTriangles += impl_->instances[slot].mesh->triangleCount;
    }
    memory.bvhBytes += impl_->device.bytes();
    memory.instanceBytes = impl_->top.bytes() + impl_->strokes.bytes() + impl_->instances.bytes() +
                           impl_->states.capacity() * sizeof(Impl::InstanceState);
    return memory;
}

double RayWorld::Memory::sceneBytesPerTriangle() const {
    return triangles == 0 ? 0 : static_cast<double>(sceneBytes + tessellatedBytes) / static_cast<double>(triangles);
}

}  // namespace rtsg
