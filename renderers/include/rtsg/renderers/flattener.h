// Flattener: keeps the paths of a scene (one occurrence per path) and turns ChangeSets into InstanceDeltas.
//
// Invariant: after apply() the occurrences are those that building from the scene anew would give; the work follows
// the changes and what lies below the changed nodes, never the scene. Nothing recurses: nesting may be of any depth.
// What is rendered: Shapes below groups, the chosen child of Switch and LOD, the first node of a PROTO's or the whole
// of an Inline's body, Collision's children without the proxy. Billboard counts as the identity (its turning belongs to
// the viewer, and one flattening serves several).
// Threading: one thread, the scene's; the deltas may go to any other.
// Source: ISO/IEC 19775-1 V4.0 4.3.5, 10.4 (grouping), 10.4.4 (Transform), 22.4 (Switch), 23.4.3 (LOD), 35 (layers).
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include <rtsg/core/bus.h>
#include <rtsg/core/diagnostic.h>
#include <rtsg/renderers/instance_delta.h>

namespace rtsg {

class Scene;

/// The mesh of a geometry node; null when it has none. Called once per new or changed geometry.
using MeshSource = std::function<std::shared_ptr<const Mesh>(const Scene& scene, NodeId geometry)>;

class Flattener {
  public:
    struct Options {
        /// None: tessellate(), whose diagnostics are added to the flattener's.
        MeshSource meshes;
        /// Where more paths than this lead to shapes the rest is left out with a diagnostic (sharing can be
        /// exponential).
        std::size_t maxOccurrences = 8'000'000;
    };

    Flattener();
    explicit Flattener(Options options);
    ~Flattener();
    Flattener(Flattener&&) noexcept;
    Flattener& operator=(Flattener&&) noexcept;

    /// Follows the scene, which is in the state `changes` leads to. The delta is valid until the next call. A snapshot
    /// starts over: everything there was is removed first.
    const InstanceDelta& apply(const Scene& scene, const ChangeSet& changes);

    /// The viewer's place in world space, by which LOD chooses; none: every LOD shows its first level. Takes effect
    /// with the next apply() or with updateViewer().
    void setViewer(std::optional<Vec3d> position);
    /// Re-chooses the LOD levels alone, between two frames.
    const InstanceDelta& updateViewer(const Scene& scene);

    /// By slot, with holes (id is none).
    const std::vector<Instance>& instances() const;
    const std::vector<Placed>& placed() const;
    std::size_t instanceCount() const;
    /// From a root node to the Shape, both included.
    std::vector<NodeId> path(InstanceId instance) const;
    std::vector<NodeId> placedPath(InstanceId placed) const;
    ScopeId scopeParent(ScopeId scope) const;
    /// A delta that leads from nothing to here, for those who come late.
    InstanceDelta snapshot() const;

    /// Of paths left out, and of the tessellation of geometry.
    const Diagnostics& diagnostics() const;

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

/// What follows a flattened scene: RayWorld, light, sound, rasteriser.
class InstanceSubscriber {
  public:
    virtual ~InstanceSubscriber() = default;
    /// On the scene's thread, in the order of attaching. `scene` and `changes` are there for materials and the like.
    virtual Result<> apply(const Scene& scene, const ChangeSet& changes, const InstanceDelta& delta) = 0;
};

/// One flattening for several subscribers: attach this to the bus and them to this.
class FlattenedScene final : public Subscriber {
  public:
    explicit FlattenedScene(Flattener::Options options = {});

    /// `subscriber` must outlive this or be removed. One that comes late is sent a snapshot with the next change set,
    /// or at once by catchUp().
    void add(InstanceSubscriber& subscriber);
    void remove(InstanceSubscriber& subscriber);
    /// Sends what a moved viewer changes (Flattener::setViewer) and snapshots to late subscribers, with an empty change
    /// set. On the scene's thread.
    Result<> catchUp(const Scene& scene);

    Result<> apply(const Scene& scene, const ChangeSet& changes) override;
    std::string subscriberName() const override { return "flattener"; }

    Flattener& flattener() { return flattener_; }
    const Flattener& flattener() const { return flattener_; }

  private:
    struct Entry {
        InstanceSubscriber* subscriber;
        bool upToDate;
    };
    Result<> deliver(const Scene& scene, const ChangeSet& changes, const InstanceDelta& delta);

    Flattener flattener_;
    std::vector<Entry> subscribers_;
};

}  // namespace rtsg
