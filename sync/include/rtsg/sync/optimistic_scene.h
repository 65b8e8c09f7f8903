// OptimisticScene: a replica as its user sees it, with their own edits shown at once, before the origin has them.
//
// Invariant: the replica itself is always in a state of the origin's. The scene shown is the replica with the edits
// that wait for an answer laid over it; once there are none, both are equal. An edit that the origin refuses is taken
// back, and of a field that somebody else has changed meanwhile the origin's value counts as soon as ours has been
// answered. Costs the replica's memory again. Threading: the replica's thread.

// Example:
//     #include <rtsg/sync/optimistic_scene.h>
//     rtsg::Scene replica;
//     const auto client = rtsg::MirrorClient::connect(replica, "tcp://localhost:5570");
//     if (!client) return;
//     rtsg::OptimisticScene mine(**client, replica);  // pictures are attached to mine.scene()
//     mine.poll(std::chrono::milliseconds(20));
//     const rtsg::NodeId box = mine.scene().findName("BOX");
//     if (box) (void)mine.edit(box, rtsg::x3d::Transform::translation.index, rtsg::Vec3f(1, 0, 0));
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include <rtsg/core/x3d.h>
#include <rtsg/sync/mirror_client.h>

namespace rtsg {

class OptimisticScene : public Subscriber {
  public:
    /// `client` keeps `replica` in step; both must outlive this. Its answers are taken here from now on.
    OptimisticScene(MirrorClient& client, Scene& replica);
    ~OptimisticScene() override;

    /// What to show. It runs nothing by itself, and must not be edited but by edit().
    Scene& scene() { return shown_; }
    /// Shows the value and asks the origin for it. Errors, at once: as MirrorClient::submitEdit, no such node or field,
    /// a field that refers to nodes (these are the origin's to number).
    Result<std::uint64_t> edit(NodeId node, FieldIndex field, Value value);
    /// MirrorClient::poll(); then what was answered is settled.
    std::size_t poll(std::chrono::milliseconds timeout = std::chrono::milliseconds(0));
    /// As the client's, since the last call.
    std::vector<MirrorVerdict> takeVerdicts();
    /// Fields that show something else than the replica has, or may.
    std::size_t waiting() const { return ours_.size(); }

    Result<> apply(const Scene& scene, const ChangeSet& changes) override;
    std::string subscriberName() const override { return "optimistic scene"; }

  private:
    using Place = std::pair<std::uint32_t, FieldIndex>;
    struct Ours {
        std::uint64_t request = 0;  // the last one of this field
        Value value;
    };
    Result<> show(ChangeSet set);
    Result<> startOver(const ChangeSet& snapshot);
    void settle(const Place& place);

    MirrorClient& client_;
    Scene& replica_;
    Scene shown_;
    std::map<Place, Ours> ours_;
    std::vector<MirrorVerdict> verdicts_;
    Attachment attachment_;
};

}  // namespace rtsg
