// MeshBvh: one mesh's own BVH, shared by all its instances, and how it follows a mesh that deforms.
//
// Invariant: what scene() answers is that of the last commit(); a refit and a rebuilt tree give the same hits.
// A mesh whose triangles stay while its positions change is refitted. A BvhWatch tells when that has spoilt the tree:
// then a new one is built in the background over the positions of that moment, while the old one is refitted on; when
// it is ready, the next update refits it to the positions of then and takes it. Small meshes are built anew at once.
// Each rebuild shows what it gained, and from that the watch's limit is learnt: the aim is rays at .9 of a rebuilt
// tree's speed. While a version reads the tree, another over the same triangles is refitted instead of it: as a rule
// two take turns. Threading: changes on one thread; tracing from any, in between; of what a version holds, at any time.
// Source: Lauterbach et al. 2006 (RT-DEFORM: rebuild when the refitted tree's cost has grown).
#pragma once

#include <memory>

#include <rtsg/core/worker.h>

#include "bvh.h"
#include "bvh_watch.h"
#include "trees/versions.h"

namespace rtsg::bvh {

class MeshBvh {
  public:
    struct Counts {
        std::size_t builds = 0, refits = 0, rebuilds = 0;  // rebuilds: because refits had spoilt the tree
    };

    /// The device outlives this and the worker, and so do the versions, if there are any. `deforming`: to be refitted;
    /// it turns out by itself, too.
    MeshBvh(const Device& device, Worker& worker, std::shared_ptr<const Mesh> mesh, bool deforming = false,
            Versions* versions = nullptr);
    ~MeshBvh();
    MeshBvh(const MeshBvh&) = delete;
    MeshBvh& operator=(const MeshBvh&) = delete;

    /// Builds or refits the changed parts.
    void commit();
    /// Takes other positions for the same triangles, or another mesh altogether. The same mesh again puts a finished
    /// rebuild in place.
    void update(std::shared_ptr<const Mesh> mesh);

    RTCScene scene() const { return tree_->scene.get(); }
    /// Group::cuts() of the one geometry; null if it is not cut.
    const LongTriangles* const* cuts() const { return tree_->cut ? &tree_->cutInUse : nullptr; }
    const Array<std::int32_t>& indexInUse() const { return tree_->index; }
    /// The bounds at the last commit, in the mesh's frame.
    const Bounds& bounds() const { return bounds_; }
    bool refitted() const { return refitted_; }
    const Counts& counts() const { return counts_; }

    /// Whether there is work in the background.
    bool busy() const { return work_ != nullptr; }
    /// Whether background work is finished, so that the next update will take it.
    bool ready() const;
    void wait() const;

  private:
    struct Work;
    /// An Embree scene with the arrays that it reads: a refit continues with the indices of the build, which equal the
    /// mesh's but may be another array.
    struct Tree {
        Array<Vec3f> positions;
        Array<std::int32_t> index;
        std::shared_ptr<const LongTriangles> cut;
        const LongTriangles* cutInUse = nullptr;
        GeometryHandle geometry;
        SceneHandle scene;
        std::uint64_t stamp = 0;  // when it was written last (versions.h)
    };
    /// One that waits until no version reads it any more, and its turn comes.
    struct Spare {
        std::unique_ptr<Tree> tree;
        std::uint64_t until;  // serial when its turn ended
    };
    enum class Task : std::uint8_t { watch, rebuild, lookAndRebuild };
    void build(std::shared_ptr<const Mesh> mesh, bool deforming);
    void refit();
    bool isSeen() const { return versions_ && versions_->sees(tree_->stamp); }
    /// Puts one in place that no version reads, to be refitted.
    void alternate();
    void setTree(std::unique_ptr<Tree> tree);
    void retire(std::unique_ptr<Tree> tree, std::uint64_t until);
    static std::unique_ptr<Tree> newTree(const Device& device, const std::shared_ptr<const Mesh>& mesh, bool deforming);
    void start(Task task, const BvhWatch::Look& look, bool atOnce);
    void take();

    const Device& device_;
    Worker& worker_;
    std::shared_ptr<const Mesh> mesh_;
    Versions* versions_;
    std::unique_ptr<Tree> tree_;
    std::vector<Spare> spares_;        // over the same triangles
    std::shared_ptr<BvhWatch> watch_;  // of a deforming mesh, once it is made
    std::shared_ptr<Work> work_;
    double limit_;  // of the watch's change
    bool committed_ = false, deforming_ = false, refitted_ = false;
    unsigned updatesSinceLook_ = 0;
    Counts counts_;
    Bounds bounds_;
};

}  // namespace rtsg::bvh
