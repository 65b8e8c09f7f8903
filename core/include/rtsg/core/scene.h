// Scene: owns nodes, names, routes and prototypes; the only place where state changes.
//
// Invariant: all changes between two seals become one ChangeSet on the bus. Applying it to a scene in the previous
// state gives this state, bit for bit (equal hash() and dump()). The hierarchy has no cycles.
// Threading: one thread edits and runs the scene; a call from another thread is refused with a diagnostic.
// Source: ISO/IEC 19775-1 V4.0 4.4.8 (event model), 19775-2 (SAI naming).

// Example:
//     #include <rtsg/core/scene.h>
//     #include <rtsg/core/x3d.h>
//     rtsg::Scene scene;
//     const rtsg::NodeId box = scene.createNode(rtsg::x3d::Transform::type);
//     if (!scene.insertChild(scene.root(), rtsg::x3d::RtsgScene::children, box)) return;
//     if (const auto ok = scene.set(box, rtsg::x3d::Transform::translation, rtsg::Vec3f(0, 2, 0)); !ok)
//         std::cerr << ok.error().format() << '\n';
//     scene.newFrame(0);  // one ChangeSet, which everybody on the bus has now
//     std::cout << scene.node(box).get(rtsg::x3d::Transform::translation).y << ' ' << scene.hash().hex() << '\n';
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <source_location>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <rtsg/core/bus.h>
#include <rtsg/core/change.h>
#include <rtsg/core/check.h>
#include <rtsg/core/diagnostic.h>
#include <rtsg/core/node_type.h>
#include <rtsg/core/script.h>

namespace rtsg {

struct Behaviour;
struct FrameInput;
struct RunState;
class Cascade;
class DocumentServices;
class ScriptLanguage;
class SpaceQueries;

struct RouteTarget {
    NodeId node;
    FieldIndex field = kNoField;
    bool isConnection = false;
    friend bool operator==(const RouteTarget&, const RouteTarget&) = default;
};
struct Route {
    NodeId fromNode;
    FieldIndex fromField = kNoField;
    NodeId toNode;
    FieldIndex toField = kNoField;
    bool isConnection = false;
    friend bool operator==(const Route&, const Route&) = default;
};
struct ParentRef {
    NodeId node;
    FieldIndex field = kNoField;
    friend bool operator==(const ParentRef&, const ParentRef&) = default;
};

/// Read access to one node; valid until it is destroyed. Fields are stored in one block laid out by the type.
class Node {
  public:
    NodeId id() const { return id_; }
    TypeIndex typeIndex() const { return typeIndex_; }
    const NodeType& type() const { return *type_; }
    bool is(TypeIndex type) const { return typeIndex_ == type; }
    /// The PROTO instance or Inline whose body this node belongs to; none at the top level.
    NodeId scope() const { return scope_; }

    /// Precondition: `field` is a handle of this node's type and readable.
    template <class T>
    const T& get(Field<T> field) const {
        return *static_cast<const T*>(storage(field.index));
    }
    /// Precondition, checked: as above.
    Value value(FieldIndex field) const {
        RTSG_CHECK_LT(field, type_->fieldCount());
        RTSG_CHECK_NE(type_->slot(field).offset, FieldDef::kNoOffset);
        return Value::fromStorage(type_->slot(field).type, storage(field));
    }
    const void* storage(FieldIndex field) const { return block() + type_->slot(field).offset; }
    bool isDefault(FieldIndex field) const;

  private:
    friend class Scene;
    friend class SceneStore;
    friend class Cascade;
    struct Links;

    const std::byte* block() const { return reinterpret_cast<const std::byte*>(this + 1); }
    std::byte* block() { return reinterpret_cast<std::byte*>(this + 1); }

    const NodeType* type_ = nullptr;
    std::unique_ptr<Links> links_;  // routes, parents beyond the first, name: null for most nodes
    std::uint64_t dirty_ = 0;       // fields written since the last seal; bit 63 stands for all from 63 up
    NodeId id_, scope_;
    ParentRef parent_;             // of all fields together; bit 63 stands for fields 63 and above
    std::uint32_t dirtySlot_ = 0;  // of its newest entry in the list of fields written
    TypeIndex typeIndex_;
    std::uint16_t heardOf_ = 0;  // a bit for each field, by its number modulo 16, that has a group in links_
};

class Scene {
  public:
    Scene();
    ~Scene();
    Scene(const Scene&) = delete;
    Scene& operator=(const Scene&) = delete;

    // ---- reading -------------------------------------------------------------------------------------------
    /// The RtsgScene node: its `children` are the root nodes. Exists from the start, NodeId{1}.
    NodeId root() const { return NodeId{1}; }
    const Node* find(NodeId id) const;
    /// Precondition, checked: the node exists.
    const Node& node(NodeId id, std::source_location caller = std::source_location::current()) const;
    /// The node that stands for `id` in the hierarchy: for a PROTO instance the first node of its body (4.4.4.3),
    /// through all levels; any other node stands for itself. Null if there is none.
    const Node* effectiveNode(NodeId id) const;
    std::size_t nodeCount() const;
    /// Calls in NodeId order.
    void forEachNode(const std::function<void(const Node&)>& visit) const;
    std::vector<ParentRef> parents(NodeId id) const;
    /// For each node, whether a path leads down to it from the root. Nodes that a Script refers to are not below it.
    std::vector<bool> areInWorld(std::span<const NodeId> ids) const;
    std::string_view name(NodeId id) const;
    /// The place in a file from which this process has read the node, for messages; the number of places is limited. It
    /// is no part of the scene's state: replicas do not know it.
    NodeLocation locationOf(NodeId id) const;
    void setLocation(NodeId id, const NodeLocation& location);
    static constexpr std::size_t kMaxLocations = std::size_t{1} << 22;
    /// `scope`: the PROTO instance or Inline inside which the name was given; none for the document itself.
    NodeId findName(std::string_view name, NodeId scope = {}) const;
    std::vector<Route> routesFrom(NodeId id) const;
    std::vector<Route> routesTo(NodeId id) const;
    std::size_t routeCount() const;  // IS connections not counted
    const NodeType& type(TypeIndex index) const;
    std::size_t typeCount() const;
    /// Looks among built-in types first, then among those that the scene defines.
    std::optional<TypeIndex> findType(std::string_view name) const;

    // ---- editing: takes effect at once, becomes part of the next ChangeSet, sends no events ------------------
    Result<TypeIndex> defineType(std::shared_ptr<const NodeType> type);
    NodeId createNode(TypeIndex type, NodeId scope = {});
    Result<NodeId> createNode(std::string_view type, NodeId scope = {});  // of a PROTO: with its body
    /// Removes all references and routes to the node first; its children stay.
    Result<> destroyNode(NodeId id);
    /// Destroys nodes that cannot be reached from the root, from a name or by a route. Returns their number.
    std::size_t destroyUnreachable();
    /// Keeps a node that a script has made, which is otherwise destroyed once nothing refers to it (script.h). Each
    /// hold() needs its own letGo().
    void hold(NodeId id);
    void letGo(NodeId id);
    bool isHeld(NodeId id) const;
    /// Sets a field that the standard lets an author write (inputOutput or initializeOnly), or a hidden field.
    Result<> setField(NodeId id, FieldIndex field, Value value);
    template <class T>
    Result<> set(NodeId id, Field<T> field, T value) {
        if constexpr (std::is_trivially_copyable_v<T> && sizeof(T) <= 16)
            if (setPlain(id, field.index, FieldTypeOf<T>::value, &value)) return {};
        return setField(id, field.index, Value(std::move(value)));
    }
    /// Sets the field of each node to its value, in order; several times as fast as single calls if nodes are scattered
    /// in memory. It stops at the first error. Precondition: as many values as nodes.
    template <class T>
    Result<> setEach(std::span<const NodeId> ids, Field<T> field, std::span<const T> values) {
        std::size_t done = 0;
        if constexpr (std::is_trivially_copyable_v<T> && sizeof(T) <= 16)
            done = setPlainEach(ids, field.index, FieldTypeOf<T>::value, values.data());
        for (; done < ids.size(); ++done)
            if (auto ok = set(ids[done], field, values[done]); !ok) return ok;
        return {};
    }
    /// An `index` beyond the end appends. Appending takes O(1) time.
    Result<> insertChild(NodeId parent, FieldIndex field, NodeId child, std::size_t index = SIZE_MAX);
    Result<> insertChild(NodeId parent, Field<Array<NodeId>> field, NodeId child, std::size_t index = SIZE_MAX) {
        return insertChild(parent, field.index, child, index);
    }
    Result<> removeChild(NodeId parent, FieldIndex field, std::size_t index);
    /// Takes the node out of all fields that hold it; Scripts may still refer to it. It keeps its name and routes.
    /// Returns the number of places it was removed from.
    Result<std::size_t> removeFromParents(NodeId id);
    Result<> setName(NodeId id, std::string_view name);
    /// Errors: the types differ. A duplicate is ignored (4.4.2.2).
    Result<> addRoute(NodeId fromNode, FieldIndex fromField, NodeId toNode, FieldIndex toField);
    Result<> removeRoute(NodeId fromNode, FieldIndex fromField, NodeId toNode, FieldIndex toField);
    /// Connects a field of a PROTO instance with a field in its body (4.4.4.3, table 4.4).
    Result<> addIsConnection(NodeId instance, FieldIndex instanceField, NodeId bodyNode, FieldIndex bodyField);

    // ---- running -------------------------------------------------------------------------------------------
    /// Queues an input event for the next frame (19775-2: setValue on a running browser). `author` is as in
    /// attribute().
    Result<> sendEvent(NodeId id, FieldIndex field, Value value, std::string_view author = {});
    /// Names the author of the edit that was just made, if it was not the application itself: the author goes into the
    /// next set (ChangeSet::authors), and into logs. `field` is kNoField for an edit of the node itself.
    void attribute(std::string_view author, NodeId id, FieldIndex field = kNoField);
    /// Runs one timestamp: queued events, time-dependent nodes, and routes until no event is left; then seals and
    /// publishes. `t` is in seconds and must not go back. Returns the published set (never null; it may be empty).
    /// Calls from within a frame (listener, behaviour, script) are refused with a diagnostic.
    std::shared_ptr<const ChangeSet> newFrame(double t);
    /// The time (scene clock, seconds) at which the scene next acts by itself if nothing is sent to it: -infinity for
    /// its next frame at any time, the start of a clock that waits, or never (kNever, behaviour.h). Frames before that
    /// would change only now().
    double restsUntil() const;
    /// Publishes pending edits without running a frame. Null if there are none, and inside a frame, whose set includes
    /// them.
    std::shared_ptr<const ChangeSet> seal();
    /// Sets the object that casts pointers' rays and finds what the avatar touches (device_input.h); null: none. The
    /// object must live as long as it is set.
    void setSpaceQueries(SpaceQueries* queries);
    /// Whether keys, wheels and pointers move the viewer, as the bound NavigationInfo says (navigation.h); false at
    /// first.
    void setNavigation(bool on);
    /// Sets the number of threads, the scene's own included, for frames of thousands of events: 8 at most. 0 and 1 mean
    /// the scene's thread alone, which is the default. Results are the same, bit for bit, for any number. Several
    /// threads save time if their cores are free, and cost time if other programs use these.
    void setThreads(unsigned threads);
    /// Whether a frame is running, so that the call comes from a behaviour, a script or the event listener.
    bool isInFrame() const;
    /// Whether the caller is on the thread that made the scene, which may edit it and run frames. May be called on any
    /// thread.
    bool isOwnThread() const;
    double now() const;
    std::uint64_t sequence() const;  // number of the state: counts sets published or applied
    Bus& bus() { return *bus_; }
    const Bus& bus() const { return *bus_; }
    /// Sets the behaviour of a node type. Built-in behaviours are registered from the start; a later registration
    /// replaces an earlier one.
    void registerBehaviour(TypeIndex type, const Behaviour& behaviour);
    /// Registers it for all types of this name, also for types that are defined later.
    void registerBehaviour(std::string_view type, const Behaviour& behaviour);
    /// Replicas of the `state` kind switch this off: then no node acts, but events that are sent still follow routes.
    void setBehavioursEnabled(bool enabled);
    /// Sets the reader and writer of documents for scripts and prototypes (document_services.h); not null. Functions
    /// that load a document set it.
    void setDocuments(std::shared_ptr<const DocumentServices> documents);
    const DocumentServices& documents() const;
    /// Sets the language of this scene's Script nodes (script_language.h). Null, the default: Scripts do not run.
    /// Programs that run already are restarted.
    void setScripts(std::shared_ptr<const ScriptLanguage> language);
    /// Sets the options of Script nodes; programs that run already are restarted.
    void setScriptOptions(ScriptOptions options);
    /// Sets ScriptOptions::resources, unless they are set; loadFile does so. `anotherWorld` also replaces those of an
    /// earlier document, whose programs end.
    void setScriptResources(std::shared_ptr<const Resources> resources, bool anotherWorld = false);
    /// The listener is called for every event on every field, in cascade order. There is one, for tools and tests. Its
    /// edits belong to the running frame.
    using EventListener = std::function<void(double t, const Node& node, FieldIndex field, const Value& value)>;
    void setEventListener(EventListener listener);
    /// From now on, until as many calls of stopListening(), sets carry the events of this field (ChangeSet::heard), for
    /// Listeners (listeners.h). Only such fields cost time. Errors: the field sends no events. This is no part of the
    /// state.
    Result<> listenTo(NodeId id, FieldIndex field);
    void stopListening(NodeId id, FieldIndex field);
    /// Whether a route, an IS connection or a call of listenTo() needs the field's events.
    bool isHeard(NodeId id, FieldIndex field) const;
    /// A number that grows whenever a result of isHeard() may have changed.
    std::uint64_t hearingEdits() const;
    /// The diagnostics of frames. If the bus has no reporter, they also name subscribers that failed, on any thread.
    Diagnostics& diagnostics();
    /// From now on every set and snapshot carries its FrameInput; the cost grows with the inputs.
    void setInputRecording(bool on);
    bool inputRecording() const;
    /// Runs a recorded frame: its edits, its events, then the cascade, where calls of behaviours that are not
    /// deterministic are played back. Precondition: the scene is in the state before that frame. On an error the scene
    /// must be discarded. If the result differs from the original's, the set's hash shows it.
    Result<std::shared_ptr<const ChangeSet>> runInput(const FrameInput& input, double t);
    RunState runState() const;
    /// Precondition: the scene is in the state in which `state` was taken, by a snapshot or a set that was applied.
    Result<> resumeFrom(const RunState& state);

    // ---- state ---------------------------------------------------------------------------------------------
    /// The whole state `sequence()`. Pending edits are sealed first. During a delivery their set waits for its turn, so
    /// whoever continues from the snapshot skips sets up to its number. If there is no state to take (inside a frame;
    /// after too many sets within one delivery), the result is an empty set with `to` = 0, and a diagnostic.
    ChangeSet snapshot() const;
    /// Whether there are edits that no set holds yet, so that the scene is ahead of the state `sequence()`.
    bool hasUnsealedEdits() const;
    /// Applies a set that starts at sequence() (or a snapshot onto an empty scene), and publishes it. After an error
    /// the scene is safe to destroy and must be discarded.
    Result<> apply(std::shared_ptr<const ChangeSet> set);
    /// Applies a set from sequence() to `to` that sets again exactly the fields of the last set, in the same order, as
    /// most frames of a moving scene do. It makes no ChangeSet, and so is several times as fast as apply(). Returns
    /// false, and does nothing, if that is impossible: the last set had other changes, a subscriber is attached to the
    /// bus, nodes act here, there are unsealed edits, or inputs are recorded. Precondition: `columns` name the fields
    /// of the last set, in its order.
    bool applyAgain(std::uint64_t to, double time, std::span<const PlainColumn> columns);
    /// Empties the scene, but keeps what the application has set (behaviours, listener, recording, options, documents,
    /// scripts) and subscribers, who get the next set that is applied as a snapshot. For replicas that join anew.
    Result<> reset();
    Hash128 hash() const;
    /// Canonical text of the whole state: equal states give equal text. For tests and bug reports.
    std::string dump() const;

  private:
    friend class Bus;
    friend class Cascade;
    friend class ScriptPrograms;
    /// Does the usual case of setField; returns false, and does nothing, in other cases.
    bool setPlain(NodeId id, FieldIndex field, FieldType type, const void* value);
    /// Returns the number of nodes that were set before the first other case.
    std::size_t setPlainEach(std::span<const NodeId> ids, FieldIndex field, FieldType type, const void* values);

    struct State;
    struct Lane;
    std::unique_ptr<State> state_;
    std::unique_ptr<Bus> bus_;
};

}  // namespace rtsg
