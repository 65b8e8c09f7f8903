// InputPlayer: repeats the recorded input of frames in a live scene.
#pragma once

#include <unordered_map>
#include <utility>
#include <vector>

#include <rtsg/core/scene.h>

namespace rtsg {

/// Which input to repeat. An application that runs along makes its edits itself.
enum class ReplayInput : std::uint8_t { everything, eventsOnly };

class InputPlayer {
  public:
    /// `live` must be in the state before the first frame. `recorded` is the scene to which the frames are applied, if
    /// `live` may be another version of it; then nodes and fields are found by name.
    explicit InputPlayer(Scene& live, const Scene* recorded = nullptr, ReplayInput which = ReplayInput::everything)
        : live_(live), recorded_(recorded), which_(which) {}

    /// Call it when both scenes are in the session's first state. It pairs the named nodes, so that they are still
    /// known after they are renamed or destroyed.
    void begin();
    /// Makes the set's external edits, queues its events, and runs or seals the frame as the origin did. Error: the
    /// live scene refuses an edit or event, because it is another scene.
    Result<> run(const ChangeSet& set);

  private:
    struct NodeField {
        NodeId node;
        FieldIndex field = kNoField;
    };
    Result<NodeId> here(NodeId node) const;
    Result<NodeField> here(NodeId node, FieldIndex field) const;
    Result<Value> here(Value value) const;
    Result<> create(const Change& change);
    Result<> edit(const ChangeSet& set, const Change& change);
    void pair(NodeId node);
    bool isOutput(NodeId node, FieldIndex field) const;
    std::string describe(const Change& change) const;

    Scene& live_;
    const Scene* recorded_;
    ReplayInput which_;
    std::unordered_map<std::uint32_t, NodeId>
        created_;  // our nodes for those that the application created, and named ones
    std::vector<std::pair<NodeId, FieldIndex>> sent_;  // targets of this frame's events, sorted
};

}  // namespace rtsg
