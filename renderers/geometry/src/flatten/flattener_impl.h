// The inside of Flattener: the tree of occurrences and what the current apply() has touched.
//
// An occurrence is one visit of a node on a path from the root; its children are linked through indices, and so are
// all occurrences of one node. Occurrences never change parents: re-parenting takes one out and makes another.
// Freed indices and slots come back with the next apply(), so that within one delta a number means one thing.
#pragma once

#include <algorithm>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <unordered_map>
#include <unordered_set>

#include <rtsg/core/mobility.h>
#include <rtsg/renderers/flattener.h>
#include <rtsg/renderers/tessellator.h>

#include "bounding_boxes.h"
#include "flattener_roles.h"
#include "layout.h"
#include "mesh/report_once.h"
#include "node_states.h"
#include "skin.h"

namespace rtsg {

using flatten::Role;
using flatten::TypeRole;

constexpr std::uint32_t kNone = 0xFFFFFFFF;

struct Occurrence {
    NodeId node;  // none: free
    std::uint32_t parent = kNone, firstChild = kNone, next = kNone, previous = kNone;
    std::uint32_t nextOfNode = kNone, previousOfNode = kNone;
    std::uint32_t frame = 0;     // of its content: its own when it has a transform, else its parent's
    std::uint32_t slot = kNone;  // of its instance or placed thing; LOD, and what turns: its index in the list of those
    std::uint32_t depth = 0;
    std::uint32_t created = 0;      // apply() number
    std::uint32_t updated = 0;      // apply() number of the last transform update
    std::uint32_t scope = 0;        // occurrence whose local lights reach its content; 0: none but the root's
    std::uint32_t localLights = 0;  // lights whose scope it is
    std::uint32_t level = 0;        // LOD: the chosen one; a local light: the occurrence whose content it reaches
    std::uint32_t rigid = 0;  // innermost one around its content that is a mover or has been seen to move; 0: none
    Role role = Role::none;
    bool ownsFrame = false, hidden = false, isLocal = false;
    bool seen = true, heard = true, felt = true;  // as Instance has them
    bool hasProxy = false, isProxy = false;       // a Collision with such a field; its content
    bool isMover = false;                         // its transform or choice may change by itself
    bool wasSeen = false;                         // its transform has changed though that was not foreseen
    bool moving = false;                          // it or one around it is a mover
    bool turned = false;                          // it or one around it follows the picture: a Billboard, a layout ...
    bool isLayer = false;                         // it is in a LayerSet
    std::uint16_t layer = 0;
};

/// Instances or placed things: slots, generations, and what happened to them in this apply().
template <class Record>
struct SlotTable {
    struct State {
        std::uint32_t occurrence = kNone, generation = 0, created = 0, moved = 0, rebound = 0;
    };
    std::vector<Record> records;
    std::vector<State> states;
    std::vector<std::uint32_t> free, freedNow, createdNow, movedNow, reboundNow;
    std::vector<InstanceId> removedNow;
    std::size_t live = 0;

    std::uint32_t create(std::uint32_t occurrence, std::uint32_t stamp) {
        std::uint32_t slot;
        if (free.empty()) {
            slot = static_cast<std::uint32_t>(records.size());
            records.emplace_back();
            states.emplace_back();
        } else {
            slot = free.back();
            free.pop_back();
        }
        State& state = states[slot];
        state.occurrence = occurrence;
        state.created = stamp;
        state.moved = state.rebound = 0;
        records[slot] = Record{};
        records[slot].id = {slot, state.generation};
        createdNow.push_back(slot);
        ++live;
        return slot;
    }
    void remove(std::uint32_t slot, std::uint32_t stamp) {
        State& state = states[slot];
        if (state.created != stamp) removedNow.push_back(records[slot].id);
        records[slot] = Record{};
        state.occurrence = kNone;
        ++state.generation;
        freedNow.push_back(slot);
        --live;
    }
    void markMoved(std::uint32_t slot, std::uint32_t stamp) {
        if (states[slot].created == stamp || states[slot].moved == stamp) return;
        states[slot].moved = stamp;
        movedNow.push_back(slot);
    }
    void markRebound(std::uint32_t slot, std::uint32_t stamp) {
        if (states[slot].created == stamp || states[slot].rebound == stamp) return;
        states[slot].rebound = stamp;
        reboundNow.push_back(slot);
    }
    /// Fills the delta's lists and gets ready for the next.
    void report(std::vector<InstanceId>& removed, std::vector<Record>& added, std::vector<InstanceDelta::Moved>& moved,
                std::vector<Record>& rebound) {
        removed.assign(removedNow.begin(), removedNow.end());
        for (const std::uint32_t slot : createdNow)
            if (records[slot].id) added.push_back(records[slot]);
        for (const std::uint32_t slot : movedNow)
            if (records[slot].id) moved.push_back({records[slot].id, records[slot].worldFromLocal});
        for (const std::uint32_t slot : reboundNow)
            if (records[slot].id) rebound.push_back(records[slot]);
        free.insert(free.end(), freedNow.begin(), freedNow.end());
        freedNow.clear(), createdNow.clear(), movedNow.clear(), reboundNow.clear(), removedNow.clear();
    }
};

struct Flattener::Impl {
    struct NodeState {
        std::uint32_t firstOccurrence = kNone;
        std::uint32_t geometryUses = 0, appearanceUses = 0, acousticsUses = 0;
        std::uint32_t visited = 0;   // by this upward walk
        std::uint32_t reported = 0;  // in this apply() as changed
        std::uint32_t queued = 0;    // in this apply() for reconciling
        bool meshSent = false, meshStale = false, touched = false;
        /// Nothing of it outlasts this apply().
        bool isIdle() const {
            return firstOccurrence == kNone && geometryUses == 0 && appearanceUses == 0 && acousticsUses == 0 &&
                   !meshSent && !meshStale && !touched;
        }
    };
    /// The level of detail of a geometry that is cut from something curved.
    struct Detail {
        std::optional<int> level;  // none: as the Tessellator has it by itself
        double needed = 0;         // for the last viewer
        bool chosen = false;       // in this apply(); the mesh is to follow
    };
    /// One that bboxDisplay shows, by the occurrence that has it.
    struct DisplayedBox {
        std::optional<Bounds> authored;  // in the space of its content; none: it goes around the leaves below
        std::uint32_t around = kNone;    // the next one outwards that has leaves
        std::uint32_t depth = 0, slot = kNone;
        bool whole = false;           // to be put together anew
        flatten::WorldBox content;    // as the one around it knows it
        flatten::WorldBox next = {};  // including the changes since
    };
    /// A shape below one that has leaves.
    struct BoxLeaf {
        std::uint32_t box = kNone;  // the innermost
        NodeId geometry;
        std::shared_ptr<const Mesh> mesh;
        glm::dmat3 linear{0.0};
        flatten::WorldBox turned, world;  // the mesh through `linear`, and at its place
    };
    struct Boxes {
        std::map<std::uint32_t, DisplayedBox> shown;
        std::unordered_map<std::uint32_t, BoxLeaf> leaves;
        std::set<std::pair<NodeId, std::uint32_t>> leavesOf;  // by geometry
        std::size_t instances = 0;
        NodeId geometry;  // that their edges were sent as; none: they are not
        // In this apply(): occurrences that may have one, and where anything else may have changed.
        std::vector<std::uint32_t> noted, touched;
        std::vector<std::uint32_t> stale;                         // leaves
        std::set<std::pair<std::uint32_t, std::uint32_t>> due{};  // boxes, deeper ones first
    };
    struct ChildOp {
        NodeId group, child;
        int count;
        friend auto operator<=>(const ChildOp&, const ChildOp&) = default;
    };

    // flattener.cpp: following the changes
    void begin(const Scene& scene, std::uint64_t sequence);
    void startOver();
    void follow(const ChangeSet& changes);
    void sortOut(const Change& change);
    void runChildOps();
    bool becomesClear(const Node& node, FieldIndex field);
    void reconcileOnce(NodeId group);
    /// Processes the updates that possible changes require.
    void runMobility();
    void shapesAbove(NodeId changed);
    void runTransforms();
    void runShapes();
    void runLights();
    void runViewer();
    void runLevels();
    void rotateBillboards();
    void runScopes();
    /// Tells all nodes that hold `changed`, directly or through others, that its content has changed.
    void walkUp(NodeId changed, bool structural, bool marksSkins = true);
    void followSkins();
    void report(NodeId node, std::vector<NodeId>& list);
    std::shared_ptr<const Mesh> makeMesh(NodeId geometry);
    /// Of a source that others have set; null after it threw.
    std::shared_ptr<const Mesh> ownMesh(const std::string& type, MeshSource& source, NodeId geometry);
    flatten::Skins skins;
    Tessellator tessellator;  // unless the options have something else
    void finish();

    // flattener_pixels.cpp: what depends on the picture
    /// localOf() for nodes that turn to the viewer and for text in points.
    bool localForEye(std::uint32_t occurrence, const Node& node, const TypeRole& role,
                     const WorldFromLocal& worldFromParent, WorldFromLocal& parentFromLocal);
    /// The region of the innermost layout from this occurrence outwards; null if it is in no LayoutLayer.
    const flatten::Region* regionAround(std::uint32_t occurrence) const;
    /// Marks the nodes that `layoutsChanged`, or another viewer, lays out anew.
    void followLayouts();
    /// Gives a Shape a frame of its own if its geometry is text in points, and takes it if not.
    void followScreened(std::uint32_t shape);
    /// Mesh::anchor of a shape that has one; else null.
    const Vec3d* anchorOf(const Occurrence& shape) const;
    void noteAnchor(NodeId geometry, const Vec3d& anchor);
    void noteScreenText(NodeId geometry, bool inPixels);
    void runScreened();
    /// Null if it is no ParticleSystem.
    std::shared_ptr<const Mesh> particleMesh(NodeId geometry);
    /// The viewer's place in a ParticleSystem's own space. If the system stands in several places, the one with the
    /// lowest path counts.
    std::optional<Vec3d> eyeOf(NodeId system);
    /// The eye of a layer: its own, if the sights have one; none without a viewer.
    std::optional<EyePosition> eyeIn(std::uint16_t layer) const;
    /// Marks those that the viewer has moved for, or that have moved.
    void followSprites();

    // flattener_detail.cpp: how finely what is curved is cut
    /// The level at which the geometry's chords are as near as asked for, as a real number.
    double levelNeeded(const Instance& instance, const Detail& detail, const Mesh& mesh) const;
    /// The one to cut at, given the one it is cut at; none: nothing is known to go by.
    std::optional<int> nextLevel(double needed, std::optional<int> now) const;
    void chooseLevel(NodeId geometry, Detail& detail);
    /// A new or changed mesh at the level that it is needed at.
    std::shared_ptr<const Mesh> atItsLevel(NodeId geometry, std::shared_ptr<const Mesh> mesh);
    /// Marks geometries that need another level: all for a new eye, otherwise those that are new or have moved.
    void followDetails();

    // flattener_boxes.cpp: bounding boxes that are displayed
    void noteBoxes(NodeId changed);
    /// Something about this occurrence is not as it was. Nothing where no box is displayed.
    void touchBoxes(std::uint32_t index) {
        if (!boxes.shown.empty()) boxes.touched.push_back(index);
    }
    void touchBoxesBelow(std::uint32_t top);
    /// Finds the nodes that display a box, and the content of the box; called before meshes are made.
    void followBoxes();
    /// Sets the sizes of the boxes; called when meshes are there.
    void updateBoxes();
    bool displaysBox(std::uint32_t index);
    void makeBox(std::uint32_t index);
    void dropBox(std::uint32_t index);
    /// The innermost from this occurrence outwards that has leaves.
    std::uint32_t boxAround(std::uint32_t index) const;
    /// The shapes from here down to the next boxes that have leaves, and these.
    template <class OnBox, class OnShape>
    void visitContent(std::uint32_t top, const OnBox& onBox, const OnShape& onShape) const;
    void handLeaves(std::uint32_t top, std::uint32_t box);
    void setLeaf(std::uint32_t index, std::uint32_t box);
    void forgetLeaf(std::uint32_t index);
    void followLeaf(std::uint32_t index);
    void measureLeaf(std::uint32_t index);
    /// Notes that the bounds of something in the box have changed.
    void changeBox(std::uint32_t index, const flatten::WorldBox& was, const flatten::WorldBox& now);
    flatten::WorldBox boxOfContent(std::uint32_t top) const;
    void showBox(std::uint32_t index, DisplayedBox& box);

    // flattener_tree.cpp: occurrences
    NodeState& state(NodeId id) {
        NodeState* quick = nodes.dense(id.value);
        return quick ? *quick : nodes.at(id.value, scene->nodeCount());
    }
    std::uint32_t newOccurrence(const Node& node, const TypeRole& role, std::uint32_t parent);
    /// Adds `child` and everything below it under `parent`.
    void grow(std::uint32_t parent, NodeId child);
    void growContent(std::uint32_t top);
    /// Takes out the occurrence and everything below it.
    void prune(std::uint32_t top);
    void pruneContent(std::uint32_t occurrence);
    void release(std::uint32_t occurrence);
    /// Makes the children those that the scene has now, and those of LODs below it as far as that concerns them.
    void reconcile(std::uint32_t occurrence);
    void reconcileChildren(std::uint32_t occurrence);
    std::uint32_t findChild(std::uint32_t parent, NodeId child) const;
    /// The children of an LOD that have occurrences: the one that is seen and the one that is heard.
    struct Levels {
        NodeId seen, heard;
    };
    Levels levelsOf(std::uint32_t occurrence);
    /// Whether eyes, ears or avatars meet the child, as a child of this parent; of an LOD: that shows these levels.
    static void setSenses(Occurrence& child, const Occurrence& parent);
    static void setSenses(Occurrence& child, const Occurrence& parent, const Levels& levels);
    /// Passes the senses on to the children of an LOD that were there before, and to all below them; reports those that
    /// differ.
    void spreadSenses(std::uint32_t level);
    /// Whether a placed thing is there only for sensors.
    static bool isSensed(const Occurrence& o, PlacedKind kind);
    void dropPlaced(std::uint32_t occurrence);
    /// The children that there are occurrences of, into `wanted`.
    void chooseChildren(std::uint32_t occurrence, const Node& node, const TypeRole& role);
    /// See flatten::proxyOf().
    NodeId proxyBelow(std::uint32_t occurrence) {
        const Node& node = scene->node(tree[occurrence].node);
        return flatten::proxyOf(node, roles.of(node));
    }
    /// Those of the node that were there before this apply(), into `found`.
    void oldOccurrences(NodeId node, std::vector<std::uint32_t>& found) const;
    void makeInstance(std::uint32_t occurrence, const Node& node, const TypeRole& role);
    void dropInstance(std::uint32_t occurrence);
    void makePlaced(std::uint32_t occurrence, const Node& node, const TypeRole& role);
    /// Sets geometry, appearance ... from the shape's fields; true if anything differs.
    bool bind(Instance& instance, const Node& shape, const TypeRole& role, const Occurrence& occurrence);
    void use(NodeId node, std::uint32_t NodeState::* uses, int change);
    void touchGeometry(NodeId geometry);
    void updateFrames(std::uint32_t top);
    static ScopeId scopeOf(std::uint32_t occurrence) { return ScopeId{occurrence}; }
    /// The occurrence that something placed shines, cuts or hides within, if there is one that limits it.
    std::uint32_t limitOf(std::uint32_t placed, const Node& node, const TypeRole& role) const;
    void relight(NodeId inlined);
    /// The role of a node below this one. It is its type's, except for the viewport of a LayoutGroup, and for the part
    /// of a Viewport among children that cuts the rest: it stands below itself.
    const TypeRole& roleBelow(std::uint32_t parent, const Node& node);
    /// The frame of something placed. For the viewport of a LayoutGroup, the rectangle that it divides is a square of
    /// side 1; it has no size if there is no rectangle.
    WorldFromLocal placedFrame(std::uint32_t index) const;
    void changeLocalLights(std::uint32_t light, int change);
    bool mayChange(const Node& node, Aspect aspect) const {
        return (mobility.mayChange(node) & aspectBit(aspect)) != 0;
    }
    /// Sound does not meet what turns to the eye, since a picture must not change the sound.
    static bool isHeard(const Occurrence& o) { return o.heard && !(o.turned && o.seen); }
    bool isMover(const Node& node, const TypeRole& role) const;
    /// False when it is the identity.
    bool localOf(std::uint32_t occurrence, const Node& node, const TypeRole& role,
                 const WorldFromLocal& worldFromParent, WorldFromLocal& parentFromLocal) {
        if (role.role == Role::shape)
            if (const Vec3d* anchor = anchorOf(tree[occurrence]))
                return parentFromLocal = flatten::movedBy(*anchor), true;
        if (role.facesViewer || role.role == Role::shape)
            return localForEye(occurrence, node, role, worldFromParent, parentFromLocal);
        if (role.geographic) reportPosition(node);
        return role.hasTransform && flatten::localTransform(*scene, node, role, parentFromLocal);
    }
    /// Reports a wrong geographic place once.
    void reportPosition(const Node& node);
    bool deforms(NodeId geometry) const;
    /// Sets the transform that moves it; true if that has changed.
    bool setMotion(std::uint32_t occurrence);
    /// The same for all below it, and tells of those that differ.
    void spreadMotion(std::uint32_t top);
    /// Instance::pivot.
    Vec3f pivotOf(const Occurrence& occurrence);
    std::vector<NodeId> path(std::uint32_t occurrence) const;

    Options options;
    std::map<std::string, MeshSource, std::less<>> ownMeshes;  // by type
    Mobility mobility;
    flatten::RoleTable roles;
    std::vector<Occurrence> tree;
    std::vector<std::uint32_t> freeOccurrences, freedOccurrences;
    std::vector<WorldFromLocal> frames{identityTransform()};
    std::vector<std::uint32_t> freeFrames;
    flatten::NodeStates<NodeState> nodes;
    SlotTable<Instance> instances;
    SlotTable<Placed> placed;
    std::unordered_map<std::uint32_t, std::shared_ptr<const Mesh>> meshes;
    std::vector<std::uint32_t> levels;                                // occurrences of LODs
    std::vector<std::uint32_t> billboards;                            // occurrences of what turns
    std::size_t layerCount = 0;                                       // occurrences of layers of a LayerSet
    std::unordered_map<std::uint32_t, flatten::Region> regions;       // of occurrences that lay out
    bool regionChanged = false;                                       // of the last that localForEye() laid out
    std::unordered_set<std::uint32_t> clearMaterials;                 // of shapes that show nothing, maybe gone by now
    std::unordered_set<std::uint32_t> screenTexts;                    // geometry nodes whose unit is a pixel
    std::unordered_map<std::uint32_t, Vec3d> anchors;                 // of geometry nodes that have one
    std::unordered_map<std::uint32_t, std::optional<Vec3d>> sprites;  // particles that face an eye, by node, and which
    std::unordered_map<std::uint32_t, Detail> details;                // by geometry node
    std::uint64_t detailsCreated = 0;
    bool detailsDue = false;  // by a new eye
    Boxes boxes;
    std::set<std::uint32_t> screenGroups;  // occurrences
    std::set<std::uint32_t> screened;      // occurrences of Shapes that have one
    std::vector<LayerSight> sights;
    std::optional<EyePosition> viewer;
    bool viewerMoved = false;
    std::uint32_t stamp = 0, walk = 0;
    std::size_t live = 0;  // occurrences
    bool overflow = false;
    bool startedOver = false;      // in the last call
    const Scene* scene = nullptr;  // during a call only
    InstanceDelta delta;
    Diagnostics diagnostics;
    ReportOnce reportOnce;

    // The things that the current change set touches; the lists are kept for their memory.
    std::vector<ChildOp> childOps;
    std::vector<NodeId> reconciled, transformed, shapes, lights, inlinesChanged, geometries, layoutsChanged, rescreened;
    struct Content {
        NodeId node;
        bool structural;
    };
    std::vector<Content> contents;
    std::vector<std::uint32_t> reconciling;  // occurrences whose turn is to come
    std::vector<std::uint32_t> scopeDirty, movedLevels, found, growing, walking;
    std::vector<NodeId> wanted, climbing;
};

}  // namespace rtsg
