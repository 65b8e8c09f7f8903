// OwnScene: a scene that is not to be touched, as somebody with an eye of their own sees it.
//
// What a ProximitySensor keeps before the viewer of that scene (a HUD) is kept before one's own eye: Transforms whose
// translation or rotation has a ROUTE from position_changed or orientation_changed. Everything else is as it is there;
// without an eye of one's own, all is. Invariant: `theirs` stays untouched, and node numbers are the same in both.
// Takes the scene's memory again. Threading: the scene's thread. Source: ISO/IEC 19775-1 V4.0 22.4.1.
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
    /// Whether anything is so kept there; if not, a world of the scene itself shows the same.
    static bool isNeeded(const Scene& theirs);

    /// `theirs` must outlive this.
    explicit OwnScene(Scene& theirs);
    ~OwnScene() override;

    /// The scene to show. It runs nothing by itself, and is not to be edited.
    Scene& scene() { return shown_; }
    /// Keeps before this eye what is kept; none: where it is there. Errors: those of Scene::apply().
    Result<> place(const std::optional<ViewerPose>& eye);
    /// Of the nodes on a path from the root: the one that is kept elsewhere than there. Null: there is none.
    std::optional<NodeId> keptOn(std::span<const NodeId> path) const;
    /// The ray that meets things below such a node there as `ray` meets them here.
    PointerInput asThere(const PointerInput& ray, NodeId kept) const;

    Result<> apply(const Scene& scene, const ChangeSet& changes) override;
    std::string subscriberName() const override { return "own scene"; }

  private:
    using Place = std::pair<std::uint32_t, FieldIndex>;
    struct Kept {
        NodeId sensor;
        Place position, orientation;  // of the Transform; the field of one that is not kept is kNoField
    };
    Result<> show(ChangeSet set);
    void find();
    void want(const Kept& kept, const ViewerPose& eye, std::map<Place, Value>& wanted) const;

    Scene& theirs_;
    Scene shown_;
    bool stale_ = true;            // other routes may keep things
    std::vector<Kept> kept_;       // by the routes there are
    std::map<Place, Value> ours_;  // fields that show another value than theirs
    Attachment attachment_;
};

/// What takes the coordinates around a node, by its first place in the hierarchy, to the world's.
glm::dmat4 worldAroundNode(const Scene& scene, NodeId node);

}  // namespace rtsg
