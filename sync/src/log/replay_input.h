// What came into a recorded frame from outside, made to happen again in a live scene.
#pragma once

#include <unordered_map>
#include <utility>
#include <vector>

#include <rtsg/core/scene.h>

namespace rtsg {

/// Which of the recorded inputs: an application that runs along makes its edits itself.
enum class ReplayInput : std::uint8_t { everything, eventsOnly };

class InputPlayer {
  public:
    /// `live` is in the state that the first frame starts at. With `recorded`, the scene that the frames were applied
    /// to, `live` may be another edition of it: nodes are then found by their DEF names, fields by theirs.
    explicit InputPlayer(Scene& live, const Scene* recorded = nullptr, ReplayInput which = ReplayInput::everything)
        : live_(live), recorded_(recorded), which_(which) {}

    /// Both scenes are in the session's first state. Pairs nodes that have names, so that they are known when they are
    /// renamed or destroyed later.
    void begin();
    /// Makes the set's external edits, queues its events, and runs or seals the frame as the origin did. What the live
    /// scene will not take, because it is another, is the error.
    Result<> run(const ChangeSet& set);

  private:
    struct Place {
        NodeId node;
        FieldIndex field = kNoField;
    };
    Result<NodeId> here(NodeId node) const;
    Result<Place> here(NodeId node, FieldIndex field) const;
    Result<Value> here(Value value) const;
    Result<> create(const Change& change);
    Result<> edit(const ChangeSet& set, const Change& change);
    void pair(NodeId node);
    bool isOutput(NodeId node, FieldIndex field) const;
    std::string describe(const Change& change) const;

    Scene& live_;
    const Scene* recorded_;
    ReplayInput which_;
    std::unordered_map<std::uint32_t, NodeId> made_;   // by us, for nodes that the application created; named ones
    std::vector<std::pair<NodeId, FieldIndex>> sent_;  // what this frame's events go to, sorted
};

}  // namespace rtsg
