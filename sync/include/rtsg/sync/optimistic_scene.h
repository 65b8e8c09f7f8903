// OptimisticScene: shows users their own edits of a replica at once, before the origin has them.
//
// Invariant: the replica itself is always in a state of the origin. The scene shown is the replica with the unanswered
// edits on top; when all are answered, both are equal. A refused edit is taken back. If somebody else has changed the
// same field meanwhile, the origin's value is shown once our edit is answered. Takes the replica's memory again.
// Threading: the replica's thread.

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
    /// `client` keeps `replica` in step; both must outlive this. From now on this takes the client's verdicts.
    OptimisticScene(MirrorClient& client, Scene& replica);
    ~OptimisticScene() override;

    /// The scene to show. It runs nothing by itself. Change it only by edit().
    Scene& scene() { return shown_; }
    /// Shows the value and asks the origin for it. Errors, at once: as MirrorClient::submitEdit; no such node or field;
    /// a field that refers to nodes, whose numbers only the origin gives.
    Result<std::uint64_t> edit(NodeId node, FieldIndex field, Value value);
    /// Calls MirrorClient::poll() and then settles what was answered.
    std::size_t poll(std::chrono::milliseconds timeout = std::chrono::milliseconds(0));
    /// The verdicts since the last call, as from the client.
    std::vector<MirrorVerdict> takeVerdicts();
    /// Number of fields that may show another value than the replica's.
    std::size_t waiting() const { return ours_.size(); }

    Result<> apply(const Scene& scene, const ChangeSet& changes) override;
    std::string subscriberName() const override { return "optimistic scene"; }

  private:
    using FieldKey = std::pair<std::uint32_t, FieldIndex>;
    struct Ours {
        std::uint64_t request = 0;  // the last one for this field
        Value value;
    };
    Result<> show(ChangeSet set);
    Result<> startOver(const ChangeSet& snapshot);
    void settle(const FieldKey& field);

    MirrorClient& client_;
    Scene& replica_;
    Scene shown_;
    std::map<FieldKey, Ours> ours_;
    std::vector<MirrorVerdict> verdicts_;
    Attachment attachment_;
};

}  // namespace rtsg
