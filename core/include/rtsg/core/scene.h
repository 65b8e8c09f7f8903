// Scene: owns nodes, names, routes and prototypes; the only place where state changes.
//
// Invariant: everything that happens between two seals becomes one ChangeSet on the bus; applying it to a scene
// in the previous state gives this state, bit for bit (equal hash() and dump()). The hierarchy has no cycles.
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
    ParentRef parent_;             // the first parent; a node with more keeps the rest in links_
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
    /// The node that stands for `id`: of a PROTO instance the first node of its body (4.4.4.3), through all levels; any
    /// other node stands for itself. Null if there is none.
    const Node* effectiveNode(NodeId id) const;
    std::size_t nodeCount() const;
    /// Calls in NodeId order.
    void forEachNode(const std::function<void(const Node&)>& visit) const;
    std::vector<ParentRef> parents(NodeId id) const;
    /// For each node, whether a path leads down to it from the root. Nodes that a Script refers to are not below it.
    std::vector<bool> areInWorld(std::span<const NodeId> ids) const;
    std::string_view name(NodeId id) const;
    /// The place from which a node was read, for messages about it. It is known for nodes that this process has read,
    /// up to a limit. It is no part of the scene's state: replicas do not know it.
    NodePlace placeOf(NodeId id) const;
    void setPlace(NodeId id, const NodePlace& place);
    static constexpr std::size_t kMostPlaces = std::size_t{1} << 22;
    /// `scope`: the PROTO instance or Inline inside which the name was given; none for the document itself.
    NodeId findName(std::string_view name, NodeId scope = {}) const;
    std::vector<Route> routesFrom(NodeId id) const;
    std::vector<Route> routesTo(NodeId id) const;
    std::size_t routeCount() const;  // IS connections not counted
    const NodeType& type(TypeIndex index) const;
    std::size_t typeCount() const;
    /// Looks among built-in and defined types; a scene's own never shadow built-in ones.
    std::optional<TypeIndex> findType(std::string_view name) const;

    // ---- editing: takes effect at once, becomes part of the next ChangeSet, sends no events ------------------
    Result<TypeIndex> defineType(std::shared_ptr<const NodeType> type);
    NodeId createNode(TypeIndex type, NodeId scope = {});
    Result<NodeId> createNode(std::string_view type, NodeId scope = {});  // of a PROTO: with its body
    /// Removes every reference and route to it first; its children stay.
    Result<> destroyNode(NodeId id);
    /// Destroys nodes that cannot be reached from the root, a name or a route. Returns their number.
    std::size_t destroyUnreachable();
    /// Keeps a node that a script has made: without this it is destroyed once nothing refers to it (script.h). Each
    /// hold() needs a letGo() of its own.
    void hold(NodeId id);
    void letGo(NodeId id);
    bool isHeld(NodeId id) const;
    /// Any field with storage that the standard lets an author give a value (not outputOnly, unless hidden).
    Result<> setField(NodeId id, FieldIndex field, Value value);
    template <class T>
    Result<> set(NodeId id, Field<T> field, T value) {
        if constexpr (std::is_trivially_copyable_v<T> && sizeof(T) <= 16)
            if (setPlain(id, field.index, FieldTypeOf<T>::value, &value)) return {};
        return setField(id, field.index, Value(std::move(value)));
    }
    /// Sets the field of each node to its value, in order: several times as fast as single calls where nodes are
    /// scattered in memory. Ends at the first that is refused. Precondition: as many values as nodes.
    template <class T>
    Result<> setEach(std::span<const NodeId> ids, Field<T> field, std::span<const T> values) {
        std::size_t done = 0;
        if constexpr (std::is_trivially_copyable_v<T> && sizeof(T) <= 16)
            done = setPlainEach(ids, field.index, FieldTypeOf<T>::value, values.data());
        for (; done < ids.size(); ++done)
            if (auto ok = set(ids[done], field, values[done]); !ok) return ok;
        return {};
    }
    /// `index` beyond the end appends. O(1) at the end whatever the number of children.
    Result<> insertChild(NodeId parent, FieldIndex field, NodeId child, std::size_t index = SIZE_MAX);
    Result<> insertChild(NodeId parent, Field<Array<NodeId>> field, NodeId child, std::size_t index = SIZE_MAX) {
        return insertChild(parent, field.index, child, index);
    }
    Result<> removeChild(NodeId parent, FieldIndex field, std::size_t index);
    /// Takes the node out of all fields in which it hangs, wherever they are; Scripts may go on referring to it. It
    /// stays, with its name and routes. Returns how often it was there.
    Result<std::size_t> removeFromParents(NodeId id);
    Result<> setName(NodeId id, std::string_view name);
    /// Accepts equal types only; a duplicate is ignored (4.4.2.2).
    Result<> addRoute(NodeId fromNode, FieldIndex fromField, NodeId toNode, FieldIndex toField);
    Result<> removeRoute(NodeId fromNode, FieldIndex fromField, NodeId toNode, FieldIndex toField);
    /// Connects a PROTO instance's field with one of its body's (4.4.4.3, table 4.4).
    Result<> addIsConnection(NodeId instance, FieldIndex instanceField, NodeId bodyNode, FieldIndex bodyField);

    // ---- running -------------------------------------------------------------------------------------------
    /// Queues an input event for the next frame (19775-2: setValue on a running browser).
    /// `author`: as attribute() has it.
    Result<> sendEvent(NodeId id, FieldIndex field, Value value, std::string_view author = {});
    /// Says whose wish the edit was that was just made, where it was not the application's own: the set that it goes
    /// out with names the author (ChangeSet::authors), and so do logs. `field` is kNoField for the node itself.
    void attribute(std::string_view author, NodeId id, FieldIndex field = kNoField);
    /// One timestamp: queued events, then time-dependent nodes, routes until nothing moves; seals and publishes.
    /// `t` in seconds must not go back. Returns the published set (never null; maybe without changes). From within a
    /// frame (listener, behaviour, script) it is refused with a diagnostic.
    std::shared_ptr<const ChangeSet> newFrame(double t);
    /// When the scene does something by itself next if nothing comes to it, on its own clock, seconds: its next frame
    /// whenever that is (-infinity), the start of a clock that waits, or never (kNever, behaviour.h). Frames in between
    /// would change nothing but now().
    double restsUntil() const;
    /// Publishes pending edits without running anything. Null if there are none; and inside a frame, whose set they are
    /// part of.
    std::shared_ptr<const ChangeSet> seal();
    /// Sets who casts pointers' rays and finds what the avatar touches (device_input.h); null: nobody does. It must
    /// live as long as it is set.
    void setSpaceQueries(SpaceQueries* queries);
    /// Whether keys, wheels and pointers move the viewer, as the bound NavigationInfo says (navigation.h); not at
    /// first.
    void setNavigation(bool on);
    /// The number of threads, at most 8, that work on a frame of thousands of events, the scene's own included. 0 and 1
    /// mean the scene's own thread alone, which is the default. Results are the same, bit for bit, for any number.
    /// Several threads save time if their cores are free, and cost time if other programs use these.
    void setThreads(unsigned threads);
    /// A frame is under way: the call comes from a behaviour, a script or the event listener.
    bool isInFrame() const;
    /// The caller's thread is the one that made the scene, whose edits and frames are not refused. From any thread.
    bool isOwnThread() const;
    double now() const;
    std::uint64_t sequence() const;  // state number: sets published or applied so far
    Bus& bus() { return *bus_; }
    const Bus& bus() const { return *bus_; }
    /// Says what nodes of a type do. Built-in behaviours are registered from the start; a type has one, the last that
    /// was given.
    void registerBehaviour(TypeIndex type, const Behaviour& behaviour);
    /// Registers it for every type of this name, including those that are defined later.
    void registerBehaviour(std::string_view type, const Behaviour& behaviour);
    /// Replicas of the `state` kind switch this off: no node acts then; events that are sent still follow routes.
    void setBehavioursEnabled(bool enabled);
    /// Who reads and writes documents for this scene's scripts and prototypes (document_services.h); not null. Whatever
    /// loads a document into the scene says so.
    void setDocuments(std::shared_ptr<const DocumentServices> documents);
    const DocumentServices& documents() const;
    /// The language of this scene's Script nodes (script_language.h); null: they rest, as at first. Programs that run
    /// already start anew.
    void setScripts(std::shared_ptr<const ScriptLanguage> language);
    /// For the Script nodes of this scene; programs that run already start anew.
    void setScriptOptions(ScriptOptions options);
    /// Sets ScriptOptions::resources, unless they have been given; loadFile does so. `anotherWorld` also replaces those
    /// of an earlier document, whose programs end.
    void setScriptResources(std::shared_ptr<const Resources> resources, bool anotherWorld = false);
    /// Called for every event on every field, in cascade order. There is one listener, for tools and tests. Its edits
    /// belong to the frame under way.
    using EventListener = std::function<void(double t, const Node& node, FieldIndex field, const Value& value)>;
    void setEventListener(EventListener listener);
    /// From now on, until as many calls of stopListening(), sets carry what this field sends (ChangeSet::heard), at a
    /// cost for these fields alone; for Listeners (listeners.h). Errors: it sends no events. It is no part of the
    /// state.
    Result<> listenTo(NodeId id, FieldIndex field);
    void stopListening(NodeId id, FieldIndex field);
    /// Whether a route, an IS connection or a call of listenTo() waits for what the field sends.
    bool isHeard(NodeId id, FieldIndex field) const;
    /// Grows whenever an answer of isHeard() may have changed.
    std::uint64_t hearingEdits() const;
    /// The diagnostics of the frames. If the bus has no reporter, subscribers that failed, on whatever thread, are
    /// named here too.
    Diagnostics& diagnostics();
    /// From now on every set and snapshot carries its FrameInput, at a cost that follows what comes in.
    void setInputRecording(bool on);
    bool inputRecording() const;
    /// Runs a recorded frame: its edits, its events, then the cascade, with the calls of behaviours that are not
    /// deterministic played back. Precondition: this scene's state is the one before that frame. On an error the scene
    /// must be discarded; that the outcome is another than the origin's shows in the set's hash.
    Result<std::shared_ptr<const ChangeSet>> runInput(const FrameInput& input, double t);
    RunState runState() const;
    /// Precondition: this scene is in the state that `state` was taken in, by a snapshot or a set applied.
    Result<> resumeFrom(const RunState& state);

    // ---- state ---------------------------------------------------------------------------------------------
    /// The state `sequence()`, whole. Edits that wait are sealed first, so that its number stands for its content; from
    /// within a delivery their set waits its turn, and whoever goes on from the snapshot skips sets up to its number.
    /// If there is no state to take (inside a frame; after too many sets from within one delivery), the result is an
    /// empty set to 0, with a diagnostic.
    ChangeSet snapshot() const;
    /// Edits that no set holds yet: the scene is ahead of the state `sequence()`.
    bool hasUnsealedEdits() const;
    /// Applies a set that starts at sequence() (or a snapshot onto an empty scene), and publishes it. On an error
    /// nothing is guaranteed but safety: the scene must then be discarded.
    Result<> apply(std::shared_ptr<const ChangeSet> set);
    /// Does what apply() would of a set from sequence() to `to` that sets again exactly the fields that the last set
    /// did, in the same order, as most frames of a scene in motion do. It makes no set, and so is several times as
    /// fast. Returns false, and does nothing, where that is impossible: the last set had other changes, somebody is
    /// attached to the bus, nodes act here, there are unsealed edits, or inputs are recorded. Precondition: `columns`
    /// name what the last set did, in its order.
    bool applyAgain(std::uint64_t to, double time, std::span<const PlainColumn> columns);
    /// Forgets everything, as freshly constructed, but what the application has set (behaviours, listener, recording,
    /// options, documents, scripts) and subscribers, to whom the next set that is applied comes as a snapshot. For
    /// replicas that join anew.
    Result<> reset();
    Hash128 hash() const;
    /// Canonical text of the whole state; equal states give equal text. For tests and bug reports.
    std::string dump() const;

  private:
    friend class Bus;
    friend class Cascade;
    friend class ScriptPrograms;
    /// The usual case of setField; false, and nothing done, if this is none.
    bool setPlain(NodeId id, FieldIndex field, FieldType type, const void* value);
    /// Returns how many were set before one that is not the usual case.
    std::size_t setPlainEach(std::span<const NodeId> ids, FieldIndex field, FieldType type, const void* values);

    struct State;
    struct Lane;
    std::unique_ptr<State> state_;
    std::unique_ptr<Bus> bus_;
};

}  // namespace rtsg
