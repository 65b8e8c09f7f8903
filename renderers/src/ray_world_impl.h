// The speed-up graph: which instance is traced how: merged with others as triangles in ray space, or as itself.
//
// Invariant: `places` has one entry per slot of RayWorld::instances_; a traced instance is in one group or one object
// of the top. What is taken to rest is merged into few groups; what moves is an object of its own. A resting one that
// moves after all is hidden where it was (a mask, no building) and placed anew. Source: paper section 5.1.2.
#pragma once

#include <atomic>
#include <string>
#include <unordered_map>

#include "embree_bvh.h"

namespace rtsg {

struct RayWorld::Impl {
    struct MeshEntry {
        std::shared_ptr<const Mesh> mesh;
        std::unique_ptr<bvh::MeshBvh> bvh;  // made when the first instance needs it
        std::vector<std::uint32_t> users;   // slots
        bool usable = false;                // has triangles, and they are valid
        bool deforms = false;               // has changed since it came
        bool changed = false;               // in `changedMeshes`
    };
    enum class Kind : std::uint8_t { none, instanced, baked };
    struct Place {
        MeshEntry* mesh = nullptr;
        bvh::Group* group = nullptr;  // of a baked one
        std::uint32_t userIndex = 0;
        std::uint32_t local = 0;  // number in its group, or of its object in the top
        Kind kind = Kind::none;
        bool moves = false;    // has moved since it came
        bool pending = false;  // in `pending`
        bool culled = false;   // cannot be traced, which was said
    };
    /// What a transform and a mesh allow.
    enum class Fitness : std::uint8_t { instance, bakeOnly, none };

    Impl(RayWorld& owner, const Options& o) : world(&owner), options(o), device(o.buildThreads, o.robust) {}

    void apply(const InstanceDelta& delta);

    void setGeometry(NodeId node, std::shared_ptr<const Mesh> mesh);
    void add(const Instance& instance);
    void remove(InstanceId id);
    void rebind(const Instance& instance);
    void move(InstanceId id, const WorldFromLocal& worldFromLocal);
    void followMesh(MeshEntry& entry);

    bool isLive(InstanceId id) const;
    void link(std::uint32_t slot, NodeId geometry);
    void unlink(std::uint32_t slot);
    void setTransform(RayInstance& instance, const WorldFromLocal& worldFromLocal);
    void setPending(std::uint32_t slot);
    /// Stops tracing it.
    void lift(std::uint32_t slot);
    void cull(std::uint32_t slot, std::string reason);

    Hit resolve(float t, float u, float v, Vec3f normal, std::uint32_t triangle, std::uint32_t geometryId,
                std::uint32_t instanceId) const;
    static std::uint32_t maskOf(const Instance& info);
    void chooseOrigin();
    /// Sets `reason` when the answer is none.
    Fitness fitness(std::uint32_t slot, std::string& reason) const;
    bool shouldBake(std::uint32_t slot, bool bulk) const;
    void placePending();
    void placeBaked(std::vector<std::uint32_t> slots);
    void placeInstance(std::uint32_t slot);
    WorldFromLocal rayFromLocal(const Instance& info) const;
    bvh::InstanceTree::Box instanceBox(std::uint32_t slot) const;
    void tidyGroups();
    void commit();

    RayWorld* world;
    Options options;
    bvh::Device device;
    std::unordered_map<std::uint32_t, MeshEntry> meshes;  // by geometry NodeId
    std::vector<Place> places;
    std::vector<std::unique_ptr<bvh::Group>> groups;
    std::vector<std::uint32_t> pending;
    std::vector<MeshEntry*> changedMeshes;
    bvh::Top top;
    Stats stats;
    mutable std::atomic<std::uint64_t> badRays{0};
};

}  // namespace rtsg
