// The inside of Scene: node storage, names, routes, pending changes. Shared by the rooms `state`, `cascade` and `input`
// only.
//
// Every write goes through beginWrite (which takes the old value out of the hash and remembers the field), then
// writes; seal() puts the new values into the hash and into the ChangeSet. So a field written a hundred times
// in a frame is hashed and sent once. ChangeSets and the memory behind them are used again: a steady frame allocates
// nothing.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <map>
#include <queue>
#include <set>
#include <unordered_map>

#include <rtsg/core/behaviour.h>
#include <rtsg/core/frame_input.h>
#include <rtsg/core/scene.h>
#include <rtsg/core/script_language.h>

#include "scene/state_hash.h"
#include "scene/world_transforms.h"
#include "storage/division.h"
#include "storage/lane.h"
#include "storage/node_arena.h"
#include "storage/node_links.h"
#include "storage/node_table.h"
#include "storage/thread_team.h"
#include "type_entry.h"

namespace rtsg {

inline constexpr DiagnosticCode kNoSuchNode{"no-such-node"}, kNoSuchField{"no-such-field"}, kWrongType{"wrong-type"},
    kWrongAccess{"access"}, kCycle{"cycle"}, kWrongThread{"wrong-thread"};

struct Scene::State : Scene::Lane {
    explicit State(Scene& scene);
    ~State();

    /// 19.2.2: an interpolator's output reads as its first key's value until it has had an input. Precondition: one of
    /// those types (TypeEntry::begun).
    void showFirst(Lane& lane, Node& node, FieldIndex field);

    /// Gives a value that an edit has set in a PROTO instance to its body, through all levels of IS.
    Result<> passToBody(NodeId id, FieldIndex field);

    Scene& owner;
    /// The address of a thread's own variable names the thread, at no cost.
    static const void* currentThread() {
        static thread_local char own;
        return &own;
    }
    const void* thread = currentThread();

    // ---- nodes ----
    NodeArena memory, linkMemory;  // linkMemory: of Node::Links alone
    NodeTable nodeTable{memory};
    std::uint32_t nextId = 1;
    [[gnu::always_inline]] Node* find(NodeId id) const { return nodeTable.find(id); }
    Node& allocate(NodeId id, TypeIndex type, NodeId scope);
    /// Makes a node with the type's defaults; the caller has to retain shared ones. Nothing is counted.
    Node& makeNode(NodeId id, TypeIndex typeIndex, const NodeType& type, NodeId scope);
    static void retainDefaults(Node& node);
    void release(Node& node);
    void destroyHere(Node& node);
    void dropLinks(Node& node);
    std::size_t bytesOf(const Node& node) const { return sizeof(Node) + node.type_->blockSize(); }
    Node::Links& links(Node& node);
    /// Null if nobody hears of the field. For most fields the node itself tells, and its links are not read.
    static RouteGroup* groupOf(Node& node, FieldIndex field) {
        return node.heardOf_ & Node::Links::heardBit(field) ? node.links_->outOf(field) : nullptr;
    }
    /// Whether the event of this timestamp has been sent along routes (4.4.8.4): then the field keeps that value.
    /// Listeners do not count, because they change nothing.
    bool hasGone(const RouteGroup& group) const { return group.gone == stamp && !group.targets.empty(); }
    bool hasGone(Node& node, FieldIndex field) const {
        const RouteGroup* group = groupOf(node, field);
        return group && hasGone(*group);
    }
    /// Made if there is none.
    RouteGroup& makeGroup(Node& node, FieldIndex field);
    /// Precondition: nobody hears of the field any longer.
    void eraseGroup(Node& node, RouteGroup* group);
    void trimLinks(Node& node);

    /// By number; 16 bytes a node.
    struct ReadAt {
        std::uint32_t node, file;  // of filesRead
        SourceLocation where;
    };
    std::vector<ReadAt> readAt;
    std::vector<std::string> filesRead;

    // ---- types, names, routes ----
    std::vector<TypeEntry> types;
    /// Scenes count them, or keep lists of them.
    static bool isCounted(TypeIndex type);
    std::vector<std::shared_ptr<const NodeType>> ownTypes;
    std::unordered_map<std::string_view, std::uint16_t> typeByName;
    void addTypeEntry(const NodeType& type);
    std::map<std::string, Behaviour, std::less<>> behavioursByName;  // for types defined later
    struct NameKey {
        std::uint32_t scope;
        String name;
        friend bool operator==(const NameKey&, const NameKey&) = default;
    };
    struct NameKeyHash {
        std::size_t operator()(const NameKey& k) const {
            return std::hash<std::string_view>()(k.name.view()) * 31 + k.scope;
        }
    };
    std::unordered_map<NameKey, NodeId, NameKeyHash> names;
    std::size_t routeCount = 0;
    std::uint64_t linkEdits = 0;  // nodes that went, and routes and listeners that came or went: pointers to them end

    // ---- writing ----
    detail::StateHash hash;
    WrittenFields writtenTwice[2];
    WrittenFields *written = &writtenTwice[0], *sealed = &writtenTwice[1];  // this frame's, and the last one's
    /// Memory for more changes than this is given back when it is no longer used.
    static constexpr std::size_t kEntriesKept = 1u << 14;
    std::uint32_t firstNewId = 1;  // ids from here on were created since the last seal
    bool noting = true;            // false while a sealed set is applied: nothing of it is pending
    std::vector<DefinedType> newTypes;
    /// A node that was made, destroyed or renamed since the last seal, and whether the application did so.
    struct NodeEdit {
        NodeId node;
        bool external = true;
    };
    std::vector<NodeEdit> newNodes, destroyedNodes, renamedNodes;
    std::vector<Change> childOps, routeOps, events;
    std::map<std::pair<NodeId, FieldIndex>, std::size_t> childOpCounts;

    bool isNew(NodeId id) const { return id.value >= firstNewId; }
    bool isDirty(const Node& node, FieldIndex field) const;
    FieldKey keyOf(const Node& node, FieldIndex field) const { return types[node.typeIndex_.value].keys[field]; }
    Hash128 routeTerm(const Route& route) const;
    /// The term of the current value (zero for the default).
    Hash128 termOf(const Node& node, FieldIndex field) const;
    /// The term before the first write of this frame.
    Hash128 termBefore(const Node& node, const WrittenField& entry) const;
    WrittenField* entryOf(const Node& node, FieldIndex field);
    /// The entry of the last set, not the expected one, for a field about to be written, whose term is the value's;
    /// null if there is none.
    [[gnu::noinline]] WrittenField* knownElsewhere(Lane& lane, const Node& node, FieldIndex field) const;
    /// Adds an entry that holds what is known of the field before it is written: its term, or its bytes.
    WrittenField& newEntry(Lane& lane, Node& node, FieldIndex field, const FieldSlot& slot);
    /// The same for a field of plain bytes.
    WrittenField& newPlainEntry(Lane& lane, Node& node, FieldIndex field, const FieldSlot& slot);
    /// Writes a field of plain bytes as the last frame did: the one that came next in it, for the first time in this
    /// one. False, and nothing is done, if it is not that, or if somebody watches the node's place.
    bool writeAsBefore(Lane& lane, Node& node, FieldIndex field, const FieldSlot& slot, const void* value,
                       std::size_t size);
    void endPiece(Lane& lane);
    [[gnu::noinline]] void moreRoom(Lane& lane);
    /// The number of calls of newEntry since the last seal. Ends the piece of the scene's lane.
    std::size_t countWritten();
    template <class F>
    void forEachWritten(const F& visit) const {
        for (const WrittenFields::Piece& one : written->pieces())
            for (std::uint32_t i = 0; i < one.count; ++i) visit(one.begin[i]);
        for (const WrittenField* entry = pieceBegin; entry != nextEntry; ++entry) visit(*entry);
    }
    /// The entries of this set become those that the next one looks for.
    void keepTerms();
    /// Terms can no longer be found by number, because a number may belong to another node since the last seal.
    void forgetTerms();
    bool namesTwice = false;  // the set that is applied names a field twice, or may: none of its terms is to be found
    bool isNamedBefore(FieldIndex field, std::uint32_t newest) const;
    void beginWrite(Node& node, FieldIndex field);
    /// `isPlain`: it is known to be a field of plain bytes.
    template <bool isPlain = false>
    void beginWrite(Lane& lane, Node& node, FieldIndex field, const FieldSlot& slot);
    [[gnu::always_inline]] void noteAspect(Lane& lane, NodeId node, const FieldSlot& slot) {
        const std::uint32_t bit = aspectBit(slot.aspect);
        lane.touched |= bit;
        if ((bit & kTransformAspects) && affectsTransforms(slot)) noteMoved(lane, node);
    }
    /// A whole new value makes the insertions and removals noted so far void.
    void dropChildOps(const Node& node, FieldIndex field);
    bool setPlain(Node* node, FieldIndex field, FieldType type, const void* value);
    void prefetchSlot(NodeId id) const { nodeTable.prefetch(id); }
    /// Writes a value from a sealed set that is not plain: into the hash at once, and not pending.
    void writeSealed(Node& node, FieldIndex field, const Value& value);
    /// Writes the changes from the first on that are plain values of fields that exist; returns how many.
    std::size_t writeSealedRun(std::span<const Change> changes);
    struct KnownField;
    class NodesAhead;
    template <std::size_t size>
    std::size_t writeAlike(std::span<const Change> changes, std::size_t begin, NodesAhead& nodes,
                           const KnownField& known);
    bool lookUp(KnownField& known, const Node& node, FieldIndex field);
    template <std::size_t size>
    void writeSealedPlain(Node& node, const KnownField& known, const void* value, detail::TermSum& sum);
    const WrittenField* findSealed(const Node& node, FieldIndex field, std::uint32_t next);
    /// The same for a set that writes exactly what the last one wrote, in its order, as most sets of moving scenes do:
    /// the entries and the notes with nodes stay valid, and only terms and values are written.
    std::size_t rewriteSealed(std::span<const Change> changes);
    bool mayRepeat(std::span<const Change> changes) const;
    template <std::size_t size>
    std::size_t rewriteAlike(std::span<const Change> changes, std::span<WrittenField> entries, const KnownField& known);
    /// The addresses of the last set's plain values, for a set that gives all of them again (apply_again.cpp). From the
    /// second such set on this replaces the entries of the last set.
    struct Targets {
        struct Target {
            std::byte* at = nullptr;
            std::uint64_t seed = 0;  // of its term
        };
        /// Those of one field of nodes of one type that follow one another.
        struct Run {
            std::size_t count = 0;
            FieldIndex field = kNoField;
            FieldType type = FieldType::SFBool;
            std::uint32_t size = 0;
            const std::byte* fallback = nullptr;
        };
        std::vector<Target> all;
        std::vector<Run> runs;
        Hash128 terms;            // of all, their sum
        std::uint64_t state = 0;  // of the scene when these were written last: in another one they are void
        void clear();
    };
    Targets targets;
    bool areTargets(std::span<const PlainColumn> columns) const;
    /// Finds them by the entries of the last set. False if that gave something else, or its entries do not hold on.
    bool findTargets(std::span<const PlainColumn> columns);
    bool addTarget(const WrittenField& entry, const PlainColumn& column, bool beginsColumn);
    void writeTargets(std::span<const PlainColumn> columns);
    /// Stores only; precondition: beginWrite, or this comes from a sealed set.
    void store(Node& node, FieldIndex field, const void* value);
    void write(Lane& lane, Node& node, FieldIndex field, const void* value);  // writing.h
    void write(Node& node, FieldIndex field, const void* value) { write(*this, node, field, value); }
    void writeShared(Lane& lane, Node& node, FieldIndex field, const void* value);
    /// Those who asked for the place are asked again.
    [[gnu::always_inline]] void noteMoved(Lane& lane, NodeId node) {
        if (worldTransforms.isWatched(node)) [[unlikely]]
            noteWatchedMoved(lane, node);
    }
    [[gnu::noinline]] void noteWatchedMoved(Lane& lane, NodeId node) {
        if (lane.isBeside)
            lane.moved.push_back(node);
        else
            worldTransforms.noteMoved(node);
    }
    void addParent(Node& child, ParentRef parent);
    void removeParent(Node& child, ParentRef parent);
    /// Would `child` below `parent.field` close a cycle?
    bool closesCycle(const Node& parent, FieldIndex field, const Node& child) const;
    /// Applying a set passes through states that are none: there the check comes once, at the end.
    bool deferCycleCheck = false;
    /// No start contains itself.
    Result<> checkAcyclic(std::span<const NodeId> starts) const;
    bool isHierarchy(const Node& parent, FieldIndex field) const;
    Result<> checkNodes(const Node& node, FieldIndex field, const void* value) const;
    Result<> insertChild(Node& parent, FieldIndex field, Node& child, std::size_t index);
    void removeChildAt(Node& parent, FieldIndex field, std::size_t index);
    void setName(Node& node, std::string_view name);
    /// One direction of an IS connection: between a PROTO instance and a node of its own body, as table 4.4 allows.
    Result<> checkIs(const Route& route) const;
    void linkRoute(const Route& route, bool record);
    bool unlinkRoute(const Route& route, bool record);
    void recordRoute(ChangeKind kind, const Route& route);
    void detachEverything(Node& node);
    /// Its children have one parent less; the fields keep their values until destroy().
    void releaseChildren(Node& node);
    /// Precondition: detached, children released.
    void destroy(Node& node, bool record);
    Result<> checkThread() const;
    /// For calls that return no Result: counts those from other threads; reportForeign reports them on the scene's
    /// thread.
    bool refuseForeign();
    void reportForeign();
    std::atomic<std::size_t> foreignCalls{0};
    static constexpr DiagnosticCode kFromWithin{"from-within"};
    static constexpr std::size_t kMaxInDelivery = 1000;
    bool refuseFromWithin();
    bool refuseEndlessDelivery();
    /// For what replaces the state: an error inside a frame.
    Result<> checkOutsideFrame() const;
    bool onOwnThread() const { return thread == currentThread(); }
    /// Does what checkThread does, and notes an edit from within the cascade.
    Result<> checkEdit();
    bool hasPending() const;
    std::shared_ptr<const ChangeSet> seal();
    std::shared_ptr<const std::vector<Authored>> takeAuthors();
    /// After the first `behind` changes; later changes are overwritten.
    void appendFieldChanges(ChangeSet& set, std::size_t behind);
    /// The contribution of some entries to the hash.
    struct SealedPart {
        Hash128 grown;
        std::size_t voids = 0;  // changes of things that no longer exist, kNoField
    };
    SealedPart sealPiece(WrittenFields::Piece one, Change* changes);
    /// Entries that one part of a crew seals, and where among the changes theirs go.
    struct SealCut {
        WrittenFields::Piece piece;
        std::size_t at = 0;
    };
    struct SealPart {
        std::vector<SealCut> cuts;
        std::size_t count = 0;
        SealedPart result;
    };
    std::vector<SealPart> sealParts;
    void dealSeal(std::size_t count, unsigned parts);
    SealedPart sealPart(const SealPart& part, Change* changes);
    [[gnu::noinline]] Hash128 sealShared(const Node& node, WrittenField& entry, Change& change) const;
    void appendDefinitions(std::vector<Change>& out, std::span<const DefinedType> defined) const;
    void appendCreations(std::vector<Change>& out) const;
    /// Child lists, names, routes, destructions.
    void appendOtherEdits(std::vector<Change>& out);

    // ---- running ----
    double now = 0;
    bool started = false;
    bool behavioursEnabled = true;
    std::uint64_t sequence = 0;
    std::uint64_t stamp = 0;
    struct QueuedEvent {
        NodeId node;
        FieldIndex field;
        Value value;
        String author{};
    };
    std::vector<QueuedEvent> inputQueue;
    // ---- devices (device_input.cpp) ----
    static constexpr std::size_t kPointerRow = 9;  // of RtsgScene::_pointers: device, buttons, kind, bearing
    SpaceQueries* queries = nullptr;
    std::size_t collisionNodes = 0;
    std::vector<NodeId> pickSensors;  // ascending
    /// The corners of geometry by which pick sensors pick, kept until any geometry changes.
    std::map<NodeId, std::vector<Vec3d>> pickCorners;
    std::vector<QueuedEvent> deferredInput;  // for the frame after this one
    /// Before a frame at `t` begins: what of the queue it takes, what pointers and the avatar meet, and where the
    /// viewer goes.
    void prepareInput(double t);
    void deferPointers();
    void deferKeys();
    std::optional<NodeId> layerHeld(std::int32_t device) const;
    void castRays();
    void feelContacts();
    void pick();  // pick_sensors.cpp
    bool navigates = false;
    void navigate(double t);  // navigation.cpp
    static bool isPickSensor(TypeIndex type);
    // ---- what scripts have made (dropped.cpp) ----
    std::vector<NodeId> scriptCreated;  // that are still there, ascending
    /// Errors: scripts have made as many nodes as they may, or one more, or those of so long a text, would be too many.
    Result<> mayScriptsMake(std::size_t textBytes = 0);
    template <class Make>
    auto createdByScript(const Make& make) {
        const std::uint32_t first = nextId;
        auto created = make();
        for (std::uint32_t id = first; id < nextId; ++id)
            if (find(NodeId{id})) scriptCreated.push_back(NodeId{id});
        return created;
    }
    void serveRequests();
    std::size_t scriptCreatedBefore = 0;                    // of them, when they were last looked at
    std::unordered_map<std::uint32_t, std::uint32_t> held;  // by the application: how often
    /// Destroys what scripts have made and nothing refers to any longer, once there is enough that is new to look at.
    void destroyDropped();
    /// Marks those of the sorted `candidates` that something else refers to.
    std::vector<bool> findReferred(const std::vector<NodeId>& candidates);
    std::vector<Authored> authors;    // since the last seal
    std::vector<NodeId> active, due;  // nodes with onTime; active is sorted
    WorldTransforms worldTransforms{owner};
    bool asksLast = false;  // the time for those has come that wait until all others have come to rest
    /// Places, views, and which child is shown.
    static bool affectsTransforms(const FieldSlot& slot) {
        return slot.aspect == Aspect::transform || slot.aspect == Aspect::view ||
               (slot.aspect == Aspect::structure && slot.type == FieldType::SFInt32);
    }
    std::uint32_t touchedBefore = 0;  // as `touched`, of before the last seal
    bool viewerMoved = false;         // by devices, in the last frame
    static constexpr std::uint32_t aspectBit(Aspect aspect) { return 1u << static_cast<unsigned>(aspect); }
    static constexpr std::uint32_t kTransformAspects = 1u << static_cast<unsigned>(Aspect::structure) |
                                                       1u << static_cast<unsigned>(Aspect::transform) |
                                                       1u << static_cast<unsigned>(Aspect::view);
    std::priority_queue<Sleeper, std::vector<Sleeper>, std::greater<>> sleepers;
    EventListener listener;
    std::set<std::pair<NodeId, FieldIndex>> announced;  // outputs that the listener has heard at this timestamp
    Diagnostics diagnostics;
    std::set<std::pair<NodeId, std::string>> warned;
    // ---- recording and running inputs (input.cpp) ----
    static constexpr std::size_t kNoCall = SIZE_MAX;
    bool recording = false, cascading = false, editedWithin = false;
    std::shared_ptr<FrameInput> input;    // of the frame under way, while recording
    std::size_t currentCall = kNoCall;    // in input->calls: whose effects are being recorded
    const FrameInput* playing = nullptr;  // whose calls are played back
    std::size_t nextCall = 0, playDepth = 0;
    std::string playProblem;
    std::map<std::uint16_t, Behaviour> dormant;  // registered here, but not at the origin whose frames are run
    std::vector<BehaviourUse> uses, newUses;     // behaviours that the application has registered
    std::vector<std::shared_ptr<FrameInput>> inputPool;
    void captureInput(bool running);
    /// Completes the input of the set that is being sealed.
    std::shared_ptr<const FrameInput> finishInput(bool applied);
    RunState runState() const;
    void adoptRunState(const RunState& state);
    /// `all`: the list says everything that is registered at the origin.
    Result<> adoptUses(std::span<const BehaviourUse> list, bool all);
    void noteUse(TypeIndex type, const Behaviour& behaviour);
    void recordEffect(BehaviourEffect::Kind kind, NodeId node, FieldIndex field, const void* value);
    bool accepts(const Behaviour& behaviour, const Node& node, FieldIndex field, const void* value);
    void onEvent(const Behaviour& behaviour, Cascade& cascade, const Node& node, FieldIndex field, const void* value) {
        if (isTraced(behaviour)) return tracedOnEvent(behaviour, cascade, node, field, value);
        behaviour.onEvent(cascade, node, field, EventValue(node.type_->slot(field).type, value));
    }
    double onTime(const Behaviour& behaviour, Cascade& cascade, const Node& node) {
        return isTraced(behaviour) ? tracedOnTime(behaviour, cascade, node) : behaviour.onTime(cascade, node);
    }
    void tracedOnEvent(const Behaviour& behaviour, Cascade& cascade, const Node& node, FieldIndex field,
                       const void* value);
    double tracedOnTime(const Behaviour& behaviour, Cascade& cascade, const Node& node);
    /// Calls of it are recorded, or come from a record.
    bool isTraced(const Behaviour& behaviour) const { return (recording || playing) && !behaviour.deterministic; }
    std::size_t beginCall(BehaviourCall::Kind kind, NodeId node, FieldIndex field);
    const BehaviourCall* playCall(BehaviourCall::Kind kind, NodeId node, FieldIndex field);
    void playEffects(Cascade& cascade, const BehaviourCall& call);

    std::shared_ptr<const DocumentServices> documents;
    std::shared_ptr<const ScriptLanguage> scriptLanguage;
    ScriptOptions scriptOptions;
    bool resourcesGiven = false;              // by the application, in them
    std::unique_ptr<ScriptPrograms> scripts;  // made when the first Script runs
    std::size_t scriptNodes = 0;
    ScriptPhase scriptPhase = ScriptPhase::run;
    std::vector<std::shared_ptr<ChangeSet>> pool;  // sealed sets come back when no subscriber holds them

    void wakeMoved() {
        if (worldTransforms.anyMoved()) worldTransforms.takeConcerned(woken);
    }
    void wake(const Node& node) { wake(*this, node); }
    void wake(Lane& lane, const Node& node) {
        if (behavioursEnabled && types[node.typeIndex_.value].behaviour.onTime) lane.woken.push_back(node.id_);
    }
    void send(Lane& lane, Node& node, FieldIndex field);
    [[gnu::noinline]] void sendUnusual(Lane& lane, Node& node, FieldIndex field) { send(lane, node, field); }
    bool deliver(Cascade& cascade, Node& node, FieldIndex field, const void* value);
    bool mayRefuse(Node& node, FieldIndex field) const;
    bool bodyTakes(Cascade& cascade, Node& node, FieldIndex field, const void* value);
    void deliverInput(Cascade& cascade, Node& node, FieldIndex field, const void* value);
    bool deliverAtOnce(Cascade& cascade, Node& node, FieldIndex field, const FieldDef& def, const void* value);
    void deliverChildren(Cascade& cascade, Node& node, FieldIndex field, const void* value, const TypeEntry& entry);
    /// Whether the field takes nodes of these types (4.4.2.2); a PROTO instance counts as its first node.
    Result<> checkAccepted(const Node& node, FieldIndex field, const void* value) const;
    Result<> checkAccepted(const NodeType& type, FieldIndex field, NodeId child) const;
    /// Scripts that are new are initialised, all before any prepareEvents(); both before other events (29.2.2, 29.2.3).
    void beginScripts(Cascade& cascade);
    void dropSuperseded(std::vector<QueuedEvent>& queued) const;
    /// Until nothing is on its way.
    void runRoutes(Cascade& cascade);
    /// Emissions go along their routes, from the `first` on up to before `end`: the first one from its route
    /// `firstTarget` on, the last one up to before `endTarget`. Emissions that follow from these may be added to the
    /// list.
    void sendAlong(Cascade& cascade, const std::vector<Emission>& list, std::size_t first, std::size_t end,
                   std::size_t firstTarget = 0, std::size_t endTarget = SIZE_MAX);
    /// One emission along its routes, from the `first` of them on up to before `last`.
    void sendEach(Cascade& cascade, const Emission& emission, std::size_t first, std::size_t last);
    /// An event of `field` reaches the input at the end of one of its routes.
    void follow(Cascade& cascade, RouteTarget target, const Node& from, FieldIndex field);
    void gatherDue();
    void runTime(Cascade& cascade);
    void tick(Cascade& cascade, std::span<const NodeId> nodes);
    void fetchAhead(std::span<const NodeId> nodes) const;
    // ---- on several threads (side_by_side.cpp) ----
    unsigned threadsAsked = 1;
    static constexpr std::uint64_t kWorthDividing = 4096;  // as Lane::work counts
    std::uint64_t workSealed = 0;                          // `work` at the last seal
    std::unique_ptr<ThreadTeam> team;                      // made when it is first needed
    std::vector<std::unique_ptr<Lane>> lanes;
    Division division;
    std::uint64_t dividedAt = 0;  // linkEdits then
    std::vector<NodeId> sources;  // of the division, ascending
    unsigned patience = 2, untilDivided = 0, fullRounds = 0;
    /// Emissions at hand that go to one part: whole ones, except that the first and the last may lack some targets.
    struct Stretch {
        unsigned part = 0;
        std::size_t run = 0;  // of emissionRuns
        std::size_t first = 0, last = 0, firstTarget = 0, endTarget = SIZE_MAX;
    };
    std::vector<Stretch> stretches;
    /// The emissions at hand, in order: those of the scene's lane, and of lanes beside it.
    std::vector<const std::vector<Emission>*> emissionRuns;
    /// The emissions for which `stretches` were laid out: most frames send the same as the last one.
    std::vector<std::vector<Emission>> laidOut;
    bool isLaidOut(std::size_t run, const std::vector<Emission>& sentNow) const;
    bool areLaidOut() const;
    /// Puts all emissions at hand into the scene's lane.
    void joinEmissions();
    /// Nodes that areLocal() found so as long as linkEdits and asksLast are as they were.
    std::vector<NodeId> localNodes;
    std::uint64_t localAt = 0;
    bool localLast = false;
    bool areKnownLocal(std::span<const NodeId> nodes) const;
    std::vector<std::vector<std::size_t>> stretchesOf;  // by part
    /// The costs of the last frame's rounds. Later rounds are not divided.
    struct RoundWork {
        std::uint64_t ticks = 0, routes = 0;
    };
    std::array<RoundWork, 3> roundWork;
    /// Null if one thread is to do all.
    ThreadTeam* teamFor(std::uint64_t expectedWork);
    /// A frame begins: wakes the threads that are likely to have work in it.
    void callTeam();
    /// Whether the cascade may be divided now: nobody listens to it or edits data that others read.
    bool mayDivide() const;
    bool isLocal(const Behaviour& behaviour) const { return behaviour.local && behaviour.deterministic; }
    enum class Local : std::uint8_t { no, now, untilEdited };
    Local areLocal(std::span<const NodeId> nodes) const;
    bool areLocalBeside(std::span<const NodeId> nodes, ThreadTeam& some);
    /// Do what tick and runRoutes do, on several threads if that pays; `round` is as in runTime.
    void tickAll(Cascade& cascade, std::span<const NodeId> nodes, std::size_t round);
    void runAllRoutes(Cascade& cascade, std::size_t round);
    bool tickBeside(Cascade& cascade, std::span<const NodeId> nodes, ThreadTeam& some);
    bool runRoutesBeside(Cascade& cascade, ThreadTeam& some);
    void runStretches(Cascade& cascade, Lane& lane, std::span<const std::size_t> own);
    /// False if the emissions at hand are not to be divided.
    bool layOutStretches(unsigned parts);
    bool extendStretches(std::size_t run, std::size_t number);
    bool divideAnew(unsigned parts);
    bool gatherEdges(std::vector<Division::Edge>& edges) const;
    bool mayReachBeside(const Node& node, FieldIndex field) const;
    void beginBeside(Lane& lane);
    void mark(Lane& lane);
    /// Appends the lane's notes between the mark before this number and the mark of this number.
    void takeOver(Lane& lane, std::size_t number);
    void endBeside(Lane& lane);
    void warn(const Node& node, const std::string& text);
    std::shared_ptr<ChangeSet> freshSet();

    ChangeSet snapshot() const;
    /// `pending`: as an edit that is yet to be sealed; else as one that is.
    /// `pending`: as an edit of this scene's own, which the next set tells; else as part of a set that has told it.
    Result<> applyChange(const Change& change, bool pending);
    Result<> applyCreation(const Change& change, bool pending);
    /// Creates nodes for the changes from the first on that create nodes of one type in the order of their numbers,
    /// none of them pending; returns how many.
    std::size_t applyCreationRun(std::span<const Change> changes);
    Result<> applyField(Node& node, const Change& change, bool pending);
    Result<> applyChildOp(Node& node, const Change& change);
    Result<> applyRouteOp(const Node& node, const Change& change, bool pending);
    /// The bytes of the nodes that a set creates.
    std::size_t bytesToCome(std::span<const Change> changes) const;
    Result<> applyChanges(std::span<const Change> changes, std::span<const DefinedType> defined, bool pending);
    Result<> releaseDestroyed(std::span<const Change> changes);
};

}  // namespace rtsg
