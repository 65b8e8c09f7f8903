// FrameInput: everything from outside that entered one frame, so that another scene in the same state can run the same
// frame.
//
// The cascade depends only on the scene's fields, the clock, the application's edits and events, the nodes that wait
// for a time (RunState), and the results of behaviours that are not deterministic. These results are recorded call by
// call and played back instead of the behaviour, and all consequences are computed anew. Invariant: complete inputs,
// run from equal states, lead to equal states, which the hash shows. Threading: immutable once published.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include <rtsg/core/change.h>

namespace rtsg {

/// One action of a behaviour. The numbers are part of the wire format.
struct BehaviourEffect {
    enum class Kind : std::uint8_t { emit = 0, store = 1, deliver = 2 } kind = Kind::emit;
    NodeId node;
    FieldIndex field = kNoField;
    Value value;
    friend bool operator==(const BehaviourEffect&, const BehaviourEffect&) = default;
};

/// A call of a behaviour that is not deterministic, and its results. The numbers are part of the wire format.
struct BehaviourCall {
    enum class Kind : std::uint8_t { accepts = 0, onEvent = 1, onTime = 2 } kind = Kind::onEvent;
    bool accepted = true;  // the result of `accepts`
    NodeId node;
    FieldIndex field = kNoField;  // none for onTime
    double next = 0;              // the result of onTime, in seconds
    std::vector<BehaviourEffect> effects;
    friend bool operator==(const BehaviourCall&, const BehaviourCall&) = default;
};

/// What a replica must know of a behaviour that the application has registered.
struct BehaviourUse {
    TypeIndex type;
    bool deterministic = false;  // True: the replica must have it too. False: its calls are played back
    bool accepts = false, onEvent = false, onTime = false;
    bool last = false;  // Behaviour::last, which decides the order of calls that are played back
    friend bool operator==(const BehaviourUse&, const BehaviourUse&) = default;
};

/// The part of a running scene's state that is not in its fields. With it and a snapshot, another scene continues
/// exactly as this one.
struct RunState {
    std::vector<NodeId> active;                       // called every frame
    std::vector<std::pair<double, NodeId>> sleepers;  // called at a time, in seconds
    std::vector<BehaviourUse> behaviours;
    std::uint32_t nextId = 0;  // one more than the highest node number so far
    friend bool operator==(const RunState&, const RunState&) = default;
};

struct FrameInput {
    /// False: more came in than is recorded here (edits from within the cascade, or a set that was applied). Then only
    /// the changes tell what happened, and `runState` how to continue.
    bool complete = true;
    bool ran = false;    // true: by newFrame; false: edits were sealed without running a frame
    bool first = false;  // the scene's first frame
    bool behavioursEnabled = true;
    std::uint32_t nextId = 0;        // as RunState::nextId, after the edits; 0: it follows from the edits
    std::vector<Change> edits;       // made before the frame, in the order of a sealed set; no events
    std::vector<DefinedType> types;  // those of `edits`
    std::vector<Change> events;      // delivered, in order
    std::shared_ptr<const std::vector<Authored>> authors;  // of edits and events that were not the application's own
    std::vector<NodeId> woken;                             // called in this frame although they did not wait for it
    std::vector<BehaviourCall> calls;
    std::vector<BehaviourUse> behaviours;      // registered since the frame before
    std::shared_ptr<const RunState> runState;  // after the frame; for snapshots and incomplete frames

    void clear();
    friend bool operator==(const FrameInput&, const FrameInput&) = delete;
};

}  // namespace rtsg
