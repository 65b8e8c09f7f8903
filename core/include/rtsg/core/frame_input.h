// FrameInput: all that came into one frame from outside, enough to run the very same frame in another scene that is
// in the same state.
//
// The cascade depends on nothing but the scene's fields, the clock, the edits and events of the application, which
// nodes are waiting for time to pass (RunState), and what behaviours did that are not deterministic. The last are
// recorded call by call, and played back in the place of the behaviour, so that all that follows from them is
// computed anew. Invariant: complete inputs, run from equal states, lead to equal states; the hash tells.
// Threading: immutable once published.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include <rtsg/core/change.h>

namespace rtsg {

/// One thing that a behaviour did. The numbers are part of the wire format.
struct BehaviourEffect {
    enum class Kind : std::uint8_t { emit = 0, store = 1, deliver = 2 } kind = Kind::emit;
    NodeId node;
    FieldIndex field = kNoField;
    Value value;
    friend bool operator==(const BehaviourEffect&, const BehaviourEffect&) = default;
};

/// A call of a behaviour that is not deterministic, with what came of it. The numbers are part of the wire format.
struct BehaviourCall {
    enum class Kind : std::uint8_t { accepts = 0, onEvent = 1, onTime = 2 } kind = Kind::onEvent;
    bool accepted = true;  // accepts: what it returned
    NodeId node;
    FieldIndex field = kNoField;  // none for onTime
    double next = 0;              // onTime: what it returned, seconds
    std::vector<BehaviourEffect> effects;
    friend bool operator==(const BehaviourCall&, const BehaviourCall&) = default;
};

/// A behaviour that the application has registered, as far as a replica must know of it.
struct BehaviourUse {
    TypeIndex type;
    bool deterministic = false;  // the replica must have it too; else its calls are played back
    bool accepts = false, onEvent = false, onTime = false;
    bool last = false;  // Behaviour::last: without it calls that are played back would come in another order
    friend bool operator==(const BehaviourUse&, const BehaviourUse&) = default;
};

/// The state of a running scene that is not in its fields. With it and a snapshot, another scene runs on exactly as
/// this one.
struct RunState {
    std::vector<NodeId> active;                       // asked every frame
    std::vector<std::pair<double, NodeId>> sleepers;  // asked once the time has come, seconds
    std::vector<BehaviourUse> behaviours;
    std::uint32_t nextId = 0;  // node numbers given so far end before it
    friend bool operator==(const RunState&, const RunState&) = default;
};

struct FrameInput {
    /// False when more came in than is noted here (edits from within the cascade, a set that was applied): then only
    /// the changes themselves tell what happened, and `runState` how things go on.
    bool complete = true;
    bool ran = false;    // by newFrame; else edits were sealed without running anything
    bool first = false;  // there was no timestamp before
    bool behavioursEnabled = true;
    std::uint32_t nextId = 0;        // as RunState's, the edits included; 0: what the edits make it
    std::vector<Change> edits;       // made before the frame, as a sealed set would have them; no events
    std::vector<DefinedType> types;  // those of `edits`
    std::vector<Change> events;      // delivered, in order
    std::shared_ptr<const std::vector<Authored>> authors;  // of edits and events that were not the application's own
    std::vector<NodeId> woken;                             // asked in this frame beside those that were waiting
    std::vector<BehaviourCall> calls;
    std::vector<BehaviourUse> behaviours;      // registered since the frame before
    std::shared_ptr<const RunState> runState;  // after the frame: with snapshots and incomplete frames

    void clear();
    friend bool operator==(const FrameInput&, const FrameInput&) = delete;
};

}  // namespace rtsg
