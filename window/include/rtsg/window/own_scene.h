// OwnScene: a copy of a scene that must not be changed, with its HUD moved to the viewer's own eye.
//
// A HUD is a Transform whose translation or rotation has a ROUTE from position_changed or orientation_changed of a
// ProximitySensor: it stays before the viewer of that scene. Here it stays before the own eye. Everything else is as in
// that scene; without an own eye, HUDs are, too. Invariant: `theirs` stays unchanged, and node numbers are the same in
// both. It takes the scene's memory again. Threading: the scene's thread. Source: ISO/IEC 19775-1 V4.0 22.4.1.
#pragma once

#include <map>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include <rtsg/core/bus.h>
#include <rtsg/core/device_input.h>
#include <rtsg/core/scene.h>
#include <rtsg/core/viewer_pose.h>

namespace rtsg {

class OwnScene : public Subscriber {
  public:
    /// Whether the scene has a HUD; if not, a world of the scene itself shows the same.
    static bool isNeeded(const Scene& theirs);

    /// `theirs` must outlive this.
    explicit OwnScene(Scene& theirs);
    ~OwnScene() override;

    /// The scene to show. It runs nothing by itself, and must not be edited.
    Scene& scene() { return shown_; }
    /// Moves HUDs to this eye; without an eye they are where they are in `theirs`. Errors: those of Scene::apply().
    Result<> setPose(const std::optional<ViewerPose>& eye);
    /// The first HUD on a path from the root that is moved. Nothing if there is none.
    std::optional<NodeId> keptOn(std::span<const NodeId> path) const;
    /// The ray that meets things below the HUD `kept` in `theirs` as `ray` meets them here.
    PointerInput asThere(const PointerInput& ray, NodeId kept) const;

    Result<> apply(const Scene& scene, const ChangeSet& changes) override;
    std::string subscriberName() const override { return "own scene"; }

  private:
    using FieldKey = std::pair<std::uint32_t, FieldIndex>;
    struct Kept {
        NodeId sensor;
        FieldKey position, orientation;  // of the Transform; kNoField for a field without such a ROUTE
    };
    Result<> show(ChangeSet set);
    void find();
    void want(const Kept& kept, const ViewerPose& eye, std::map<FieldKey, Value>& wanted) const;

    Scene& theirs_;
    Scene shown_;
    bool stale_ = true;               // routes have changed, so `kept_` must be found again
    std::vector<Kept> kept_;          // as the present routes say
    std::map<FieldKey, Value> ours_;  // fields with another value than in `theirs`
    Attachment attachment_;
};

/// The transform from the coordinates around a node, at its first place in the hierarchy, to the world's.
glm::dmat4 worldAroundNode(const Scene& scene, NodeId node);

}  // namespace rtsg
