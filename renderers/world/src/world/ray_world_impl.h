// The speed-up graph: decides how each instance is traced: merged with others as triangles, or by itself.
//
// Invariant: `places` has one entry per slot of `instances`; a traced instance is in one cluster or is one object of
// the top. Clusters are built once: a member that leaves is hidden (by a mask, without building), and a new instance is
// a cluster or an object of its own until the background thread joins several. (The merged mapping rebuilds its single
// cluster.) A cluster rests in ray space, or it is a body: it moves as one, and parts that move otherwise are taken
// out.
// Versions: what queries read lies in pages (instances, top), in BVHs that are not changed once built, and in masks
// with epochs; all of these are written as versions.h says. The rest is read by apply() alone. Source: paper
// section 5.1.2.
#pragma once

#include <array>
#include <string>
#include <unordered_map>

#include <rtsg/core/worker.h>
#include <rtsg/renderers/ray_world.h>

#include "embree/mesh_bvh.h"
#include "embree/top.h"
#include "mesh/report_once.h"
#include "ray_view_impl.h"
#include "trees/paged.h"
#include "trees/strokes.h"
#include "trees/versions.h"

namespace rtsg {

struct RayWorld::Impl {
    struct MeshEntry {
        std::shared_ptr<const Mesh> mesh;
        std::shared_ptr<bvh::MeshBvh> bvh;  // made when the first instance needs it; equal geometries have one
        std::vector<std::uint32_t> users;   // slots
        std::uint32_t node = 0;             // its key
        bool usable = false;                // has triangles, and they are valid
        bool deforms = false;               // has changed since it came
        bool changed = false;               // in `changedMeshes`
        bool isBusy = false;                // in `busyMeshes`
        /// The BVH of lines or points, made when the first instance needs it. A stale one is the start of the next.
        std::shared_ptr<const bvh::StrokeBvh> strokes;
        bool strokesStale = false;
        bool hasStrokes() const { return mesh && mesh->strokeCount > 0; }
    };
    /// Triangles merged into one BVH.
    struct Cluster {
        std::unique_ptr<bvh::Group> group;
        std::uint32_t index = 0;    // in `resting` or `bodies`
        std::uint32_t object = 0;   // in the top
        std::uint64_t stamp = 0;    // versions made later may see it
        std::uint32_t builtAt = 0;  // apply() number
        bool isBody = false;
        bool thinned = false;    // in `thinned`
        bool unsettled = false;  // in `unsettled`
        // Bodies: its frame, and where the members are in it, by local number.
        WorldFromLocal worldFromBody{1.0};
        std::vector<WorldFromLocal> bodyFromLocal;
        std::uint32_t reference = 0;          // the member that tells where the body is
        std::vector<std::uint32_t> movedNow;  // slots, during apply()
    };
    enum class Kind : std::uint8_t {
        none,
        instanced,  // an object of the top: its mesh's BVH and a transform
        resting,    // in a cluster in ray space
        body,       // in a cluster that moves
        strokes,    // an object of `strokes`: lines or points
    };
    struct InstanceState {
        MeshEntry* mesh = nullptr;
        Cluster* cluster = nullptr;
        std::uint32_t userIndex = 0;
        std::uint32_t local = 0;    // number in its cluster, or of its object in the top
        std::uint32_t changes = 0;  // of transform, mesh or tenant: older results of the background are void
        std::uint32_t movedAt = 0;  // apply() number
        std::uint8_t splits = 0;    // how often it was merged and then moved; counts to kMaxDoublings
        Kind kind = Kind::none;
        bool moves = false;    // has moved since it was merged, or came
        bool loose = false;    // does not move as its body does
        bool pending = false;  // in `pending`
        bool culled = false;   // cannot be traced, which was said
        bool waiting = false;  // in `rests`
    };
    /// The ways of tracing that a transform and a mesh allow.
    enum class Fitness : std::uint8_t { instance, bakeOnly, none };
    /// One that is not merged now and may be when it has rested.
    struct Rest {
        std::uint32_t due;  // apply() number
        InstanceId id;
    };
    struct Merge;  // the background's work
    /// A version and the lists that it has; its memory is reused when its reader has finished.
    struct Snapshot {
        WorldVersion version;
        RayView::Tables tables;
        bvh::Top::Pages top;
        bvh::Strokes::Pages strokes;
        std::vector<const RayInstance*> instances;
    };

    explicit Impl(const Options& o);
    ~Impl();

    void apply(const InstanceDelta& delta);

    // ray_world.cpp: following the delta
    void setGeometry(NodeId node, std::shared_ptr<const Mesh> mesh);
    void makeRoom(const std::vector<Instance>& added);
    void add(const Instance& instance);
    void remove(InstanceId id);
    void rebind(const Instance& instance);
    void move(InstanceId id, const WorldFromLocal& worldFromLocal);
    void followMesh(MeshEntry& entry);
    /// Adds the meshes whose rebuild is ready to those that have changed.
    void lookForRebuilt(bool wait);
    void followMeshes();

    /// Keeps account of which geometries have the same mesh; `entry` holds its own no longer, or from now on.
    void leaveMesh(MeshEntry& entry);
    void joinMesh(MeshEntry& entry);

    bool isLive(InstanceId id) const;
    void link(std::uint32_t slot, NodeId geometry);
    void unlink(std::uint32_t slot);
    void setPending(std::uint32_t slot);
    void cull(std::uint32_t slot, std::string_view reason);
    void reportOfUntraced(NodeId node, std::string_view reason);
    void commit();

    // ray_world_version.cpp: for readers on other threads
    std::shared_ptr<const WorldVersion> freeze(const std::shared_ptr<Impl>& self, const RayView& view);
    /// Looks whose readers have done, and lets go of what only they could see. Before anything is changed.
    void refresh();
    /// The mask bits to leave alone in a cluster's group: versions with these bits do not see later changes.
    std::uint32_t heldBits(const Cluster& cluster);
    void noteUnsettled(Cluster& cluster);
    /// Its group may be changed: a copy, if somebody sees it.
    void makeWritable(Cluster& cluster);

    // ray_world_states.cpp: what goes where
    void chooseOrigin();
    bool isBackHome(std::uint32_t slot) const;
    void leaveFarOrigin();
    /// Sets `reason` when the answer is none.
    Fitness fitness(std::uint32_t slot, std::string& reason) const;
    /// Whether copying its triangles is worth it.
    bool canMerge(std::uint32_t slot) const;
    void putPending();
    void trackInstance(std::uint32_t slot);
    void putStrokes(std::uint32_t slot);
    bool isInReach(std::uint32_t slot) const;
    WorldFromLocal rayFromLocal(const Instance& info) const;
    bvh::InstanceTree::Box instanceBox(std::uint32_t slot) const;

    // ray_world_cluster.cpp: triangles of several in one BVH
    Cluster& newCluster(std::unique_ptr<bvh::Group> group, bool isBody);
    /// Nobody is in it any more.
    void dropCluster(Cluster& cluster);
    void join(Cluster& cluster, std::uint32_t slot, bvh::Triangles triangles);
    void putResting(const std::vector<std::uint32_t>& slots);
    void moveBody(const std::vector<std::uint32_t>& slots);
    WorldFromLocal inRaySpace(WorldFromLocal worldFromLocal) const;
    bvh::InstanceTree::Box bodyBox(const Cluster& body) const;
    bool boxInReach(const Cluster& body, const WorldFromLocal& worldFromBody) const;
    void setBodyTransform(Cluster& body, const WorldFromLocal& worldFromBody);
    /// After its members have moved: moves it, and takes out those that went elsewhere.
    void followBody(Cluster& body);
    /// Stops tracing it.
    void lift(std::uint32_t slot);
    void setKinds(std::uint32_t slot);
    void tidyClusters();

    // ray_world_background.cpp: what has rested is merged
    std::uint32_t patience(std::uint32_t slot) const;
    /// Has it merged when it has rested; more often than once does nothing.
    void watchRest(std::uint32_t slot);
    void findRested();
    bool canRestMerged(std::uint32_t slot) const;
    void startMerge();
    /// If there is one and it is done; waits for that if told so.
    void takeMerge(bool wait);
    void forgetSource(const Cluster& cluster);
    void discard(Cluster& cluster);

    ReportOnce reportOnce;  // into `diagnostics`
    Options options;
    bvh::Device device;
    bvh::Versions versions;
    bvh::Paged<RayInstance, RayInstances::kPerPage> instances{&versions};
    Vec3d origin{0};
    bool homeward = false;  // something has moved to where 0 is nearer than the origin
    std::uint64_t version = 0;
    Diagnostics diagnostics;
    std::unordered_map<std::uint32_t, MeshEntry> meshes;  // by geometry NodeId
    struct Sharing {
        std::uint32_t geometries = 0;
        std::weak_ptr<bvh::MeshBvh> bvh;
    };
    std::unordered_map<const Mesh*, Sharing> sharing;
    std::vector<InstanceState> states;
    std::vector<std::unique_ptr<Cluster>> resting, bodies;
    std::vector<std::uint32_t> pending;
    std::vector<Cluster*> touchedBodies;  // with members in movedNow
    std::vector<Cluster*> thinned;        // lost members
    std::vector<MeshEntry*> changedMeshes;
    std::vector<std::uint32_t> busyMeshes;  // keys of `meshes` for which the worker may have something to do
    bvh::Top top{&versions};
    bvh::Strokes strokes{&versions};
    RayView::Tables tables;           // of `top` and `strokes`, as of the last apply()
    std::vector<Cluster*> unsettled;  // with masks that versions hold back
    std::array<std::unique_ptr<Snapshot>, bvh::Versions::kMax> snapshots;
    std::weak_ptr<const WorldVersion> newest;
    /// Counts trees that were built or swapped without a change of the scene, which may change last digits: now, and
    /// when `newest` was made.
    std::uint64_t swaps = 0, newestSwaps = 0;
    std::uint32_t now = 0;           // apply() number
    std::vector<Rest> rests;         // a heap, the earliest first
    std::vector<InstanceId> rested;  // due for merging
    std::vector<Cluster*> ripe;      // kept for its memory
    std::shared_ptr<Merge> merge;    // the one under way
    Stats stats;
    std::unique_ptr<Worker> worker;  // last: ends before what its jobs use
};

/// A thing must rest at most 2^this times as long as Options::restFrames.
constexpr int kMaxDoublings = 8;

/// Precondition: it has one.
WorldFromLocal inverse(const WorldFromLocal& m);
/// The mesh's triangles in the frame that `m` leads to; its own arrays where that is its own frame.
bvh::Triangles transformedTriangles(const std::shared_ptr<const Mesh>& mesh, const WorldFromLocal& m);
/// Whether rays can be taken into its frame.
bool canEnter(const WorldFromLocal& m);
/// |M| |M^-1|, largest row sum: by how much a relative error in local coordinates can grow on its way back.
float errorScale(const WorldFromLocal& m);
/// Puts an instance there. `origin`: of ray space.
void setTransform(RayInstance& instance, const WorldFromLocal& worldFromLocal, const Vec3d& origin);
/// For the directions of normals of unmirrored ones, up to their lengths.
glm::mat3 normalMatrix(const WorldFromLocal& m);
struct DoubleBox {
    Vec3d center{0}, half{-1};
    /// Within the traced distance.
    bool inReach() const;
};
/// The bounds of the box under the transform: they contain it, and are not much larger.
DoubleBox transformed(const Bounds& bounds, const WorldFromLocal& m);
/// The same in float, with room for the rounding of the ray's transform and of the box itself.
bvh::InstanceTree::Box floatBox(const DoubleBox& box);

}  // namespace rtsg
