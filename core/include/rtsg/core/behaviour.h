// Behaviour: what a node type does when events reach it or time passes. Only types that act have one.
//
// A behaviour keeps no state of its own: all state is in fields (hidden ones if need be), so a snapshot is complete and
// a replica can take over. Threading: behaviours are called on the scene's thread, inside newFrame; those that promise
// to be `local` are called on other threads too.
// Source: ISO/IEC 19775-1 V4.0 4.4.8.3 (execution model); each behaviour cites its clause.

// Example:
//     #include <rtsg/core/behaviour.h>
//     #include <rtsg/core/x3d.h>
//     // A Switch that goes on by itself, once a second.
//     const auto next = [](rtsg::Cascade& cascade, const rtsg::Node& node) -> double {
//         const std::int32_t now = node.get(rtsg::x3d::Switch::whichChoice);
//         cascade.emit(node, rtsg::x3d::Switch::whichChoice, now + 1);
//         return cascade.now() + 1;  // when to be called next
//     };
//     rtsg::Scene scene;
//     scene.registerBehaviour(rtsg::x3d::Switch::type, rtsg::Behaviour{.onTime = next, .deterministic = true});
#pragma once

#include <limits>
#include <span>

#include <glm/gtc/quaternion.hpp>

#include <rtsg/core/scene.h>

namespace rtsg {

constexpr double kNever = std::numeric_limits<double>::infinity();
/// A result of onTime: the node waits until one of its fields is written or something has moved. That something is what
/// the call asked for by Cascade::worldFromLocal() and viewer(); if it asked for nothing, anything in the scene counts.
constexpr double kUntilMoved = std::numeric_limits<double>::max();

/// The viewer's position and orientation in world coordinates: those of the bound viewpoint, or of the default one.
struct Viewer {
    NodeId viewpoint;  // none: no viewpoint is bound
    glm::dvec3 position{0, 0, 10}, centerOfRotation{0, 0, 0};
    glm::dquat orientation{1, 0, 0, 0};  // turns the view along -Z with +Y up
};

/// One of the places of a node that stands in several places (DEF/USE).
struct Standing {
    glm::dmat4 worldFromLocal{1};
    bool shown = true;  // by every Switch and LOD on the way to it
};

/// The running event cascade of one timestamp, as a behaviour sees it.
class Cascade {
  public:
    double now() const { return now_; }
    /// The timestamp before this one; equal to now() in a scene's first frame.
    double previous() const { return previous_; }
    const Scene& scene() const { return scene_; }

    /// Sends an output event and stores its value. Once an event of the field has gone along routes at this timestamp,
    /// nothing more is stored or sent until the next timestamp (4.4.8.4), so that the field holds what it sent.
    template <class T>
    void emit(const Node& node, Field<T> field, const T& value) {
        if constexpr (isCustom<T>)
            if (!takes(node, field.index, Value(value))) return;
        if constexpr (std::is_trivially_copyable_v<T> && sizeof(T) <= 16 && !std::is_same_v<T, NodeId>)
            emitPlain<sizeof(T)>(node, field.index, &value);
        else
            emitStorage(node, field.index, &value);
    }
    /// Stores the value of a field, hidden or not, without sending an event.
    template <class T>
    void store(const Node& node, Field<T> field, const T& value) {
        if constexpr (isCustom<T>)
            if (!takes(node, field.index, Value(value))) return;
        storeStorage(node, field.index, &value);
    }
    /// The three functions below take `value` in block representation.
    void emitStorage(const Node& node, FieldIndex field, const void* value);
    void storeStorage(const Node& node, FieldIndex field, const void* value);
    /// Does what emitStorage does, and stores the value in any case: others may read the field although no route leads
    /// to them.
    void emitAgain(const Node& node, FieldIndex field, const void* value);
    /// Sends or stores a field that a Script declares, with the checks that values from outside need. It sends if the
    /// field has events.
    Result<> output(const Node& node, FieldIndex field, const Value& value);
    /// Delivers an event to another node's input at this timestamp (direct output of a Script). If the field has
    /// already sent its event of this timestamp, it keeps its value, as for events along routes.
    Result<> deliver(NodeId node, FieldIndex field, const Value& value);
    /// Whether the field has already sent its event of this timestamp along routes.
    bool hasSent(const Node& node, FieldIndex field) const;
    /// Whether the field can hold the nodes of the value now: they exist, their types are accepted, and none of them is
    /// above this node in the hierarchy.
    Result<> mayHold(const Node& node, FieldIndex field, const Value& value) const;
    /// Asks for a call of another node's onTime at this timestamp, even if it was called before. This is not recorded,
    /// so only deterministic behaviours may use it.
    void wake(const Node& node);
    /// The transform to world coordinates from the coordinates inside `node`, on the first path from the root. `asker`
    /// is the node whose onTime calls this; if that returns kUntilMoved, it is called again when the transform changes,
    /// in the same frame if need be.
    const glm::dmat4& worldFromLocal(const Node& node, const Node& asker);
    /// Whether every Switch and LOD above the node shows it; the asker is called again as for worldFromLocal().
    bool isShown(const Node& node, const Node& asker);
    /// The places of the node on its other paths from the root; most nodes have none. At most some thousand paths are
    /// looked at. The asker is called again as for worldFromLocal().
    std::span<const Standing> otherTransforms(const Node& node, const Node& asker);
    /// The viewer; the asker is called again when it moves.
    const Viewer& viewer(const Node& asker);
    /// Behaviour::context of the node's type.
    void* context(const Node& node) const;
    /// Adds a warning about the node. The same text about the same node is reported once only.
    void warn(const Node& node, const std::string& text);

  private:
    friend class Scene;
    friend class ScriptPrograms;
    Cascade(Scene& scene, double now, double previous, Scene::Lane& lane)
        : scene_(scene), now_(now), previous_(previous), lane_(lane) {}
    template <class T>
    static constexpr bool isCustom = std::is_same_v<T, CustomValue> || std::is_same_v<T, Array<CustomValue>>;
    /// Whether the value has the field's custom type, which the C++ type does not tell; if not, there is a warning.
    bool takes(const Node& node, FieldIndex field, const Value& value);
    /// Does what emitStorage does, for a value of `size` plain bytes.
    template <std::size_t size>
    void emitPlain(const Node& node, FieldIndex field, const void* value);
    Scene& scene_;
    double now_, previous_;
    Scene::Lane& lane_;  // notes what is done through this cascade
};
extern template void Cascade::emitPlain<1>(const Node&, FieldIndex, const void*);
extern template void Cascade::emitPlain<4>(const Node&, FieldIndex, const void*);
extern template void Cascade::emitPlain<8>(const Node&, FieldIndex, const void*);
extern template void Cascade::emitPlain<12>(const Node&, FieldIndex, const void*);
extern template void Cascade::emitPlain<16>(const Node&, FieldIndex, const void*);

/// The value of an event. It is valid during the call only.
class EventValue {
  public:
    /// `storage` is the value in block representation.
    EventValue(FieldType type, const void* storage) : storage_(storage), type_(type) {}
    FieldType type() const { return type_; }
    /// Precondition, checked: T is the C++ type of the field.
    template <class T>
    const T& as() const {
        RTSG_CHECK_EQ(static_cast<int>(FieldTypeOf<T>::value), static_cast<int>(type_));
        return *static_cast<const T*>(storage_);
    }
    Value value() const { return Value::fromStorage(type_, storage_); }
    const void* storage() const { return storage_; }

  private:
    const void* storage_;
    FieldType type_;
};

struct Behaviour {
    /// Returns false to refuse an event for an inputOutput field, before it is stored.
    bool (*accepts)(const Node& node, FieldIndex field, EventValue value) = nullptr;
    /// An input event has arrived; inputOutput fields already hold the new value.
    void (*onEvent)(Cascade& cascade, const Node& node, FieldIndex field, EventValue value) = nullptr;
    /// The time has come, or a field was written. Returns the time of the next call: now or an earlier time means every
    /// frame, kNever means not before a field is written, and kUntilMoved means not before a field is written or
    /// something has moved.
    double (*onTime)(Cascade& cascade, const Node& node) = nullptr;
    /// True: onTime is called once at a timestamp, after all other events have been handled. Behaviours that depend on
    /// places need this, since routes may still change the places.
    bool last = false;
    /// True promises that the results follow from the scene's fields, the event and the clock alone, on any machine: no
    /// random numbers, wall clock, files or variables of its own. Calls of other behaviours are recorded, for replicas
    /// that run the cascade themselves.
    bool deterministic = false;
    /// True promises that the behaviour reads only the node, the event and the clock, and writes only the node, by
    /// emit() and store(). Such behaviours may be called on several threads at the same time (Scene::setThreads).
    bool local = false;
    /// Names the one input of a local behaviour whose events make it do more than `local` promises. These events, and
    /// the calls of onTime that follow them, stay on the scene's thread.
    FieldIndex beyond = kNoField;
    /// Belongs to whoever registers the behaviour, for things that are no part of the scene, such as an engine or a
    /// connection. It must live as long as the scene uses the behaviour: register another behaviour before it ends.
    void* context = nullptr;
};

struct BuiltinBehaviour {
    TypeIndex type;
    Behaviour behaviour;
};
std::span<const BuiltinBehaviour> builtinBehaviours();

}  // namespace rtsg
