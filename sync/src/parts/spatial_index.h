// SpatialIndex: where everything drawn in a scene stands. Kept in step with the scene and searched by spheres, for
// regions.
//
// The hierarchy is cut into groups, which only move what is below them, and units below these, which enter and leave as
// a whole. Units are shapes, and nodes whose children depend on each other or on their order. Each path from the root
// to a group or unit is a place. A step costs what the set changes, and the places below what it moves. One object
// serves all regions.
// Invariant: following step by step gives the same as building anew, apart from the numbers of places.
// Threading: one thread.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <unordered_map>
#include <unordered_set>
#include <utility>
#include <vector>

#include <rtsg/core/scene.h>

#include "shape_bounds.h"

namespace rtsg {

class SpatialIndex {
    struct Top;

  public:
    using EntryId = std::uint32_t;
    static constexpr EntryId kNone = 0xFFFFFFFF;
    enum class Kind : std::uint8_t { group, unit, companion };  // a companion comes with its group

    struct Entry {
        NodeId node;
        EntryId parent = kNone;
        Kind kind = Kind::group;
        bool isUnbounded = false, isGone = false;
        std::uint32_t depth = 0;
        std::uint64_t born = 0, moved = 0;  // numbers of steps
        glm::dmat4 worldFromLocal{1};       // for groups
        ShapeBounds box;                    // for units, in the world
        std::vector<EntryId> below;         // for groups
        std::uint32_t slot = 0;             // index in the parent's `below`
        std::uint64_t cell = 0;             // for units with a box: the cell, its level, and the index in it
        int level = 0;
        std::uint32_t cellSlot = 0;
        const Top* top = nullptr;  // of `node`; null when it is gone
    };
    /// A change in a group's list: the child was in it `before` times and is in it `now` times.
    struct Edge {
        NodeId group, child;
        std::uint32_t before = 0, now = 0;
    };

    /// With more places than `most`, follow() fails.
    explicit SpatialIndex(std::size_t maximum = std::size_t{1} << 22) : maximum_(maximum) {}

    /// Sets the smallest radius that is searched for; cells are at least half as large. The next step begins anew.
    void coverRadius(double smallest);

    /// Goes to the state of `whole`, whose last step was `set`. If that is null or does not fit, everything is built
    /// anew. Returns false if there are too many places; then nothing is known.
    bool follow(const Scene& whole, const ChangeSet* set);

    std::uint64_t state() const { return state_; }
    /// Changes each time that everything is built anew. An EntryId from before is then invalid.
    std::uint64_t beginning() const { return beginning_; }
    /// Places that the last step added and removed. Removed places can still be looked at, and may be among the added
    /// ones.
    std::span<const EntryId> added() const { return added_; }
    std::span<const EntryId> removed() const { return removed_; }
    std::span<const EntryId> moved() const { return moved_; }
    std::span<const Edge> edges() const { return edges_; }

    EntryId root() const { return root_; }
    const Entry& entry(EntryId id) const { return entries_[id]; }
    const std::unordered_set<EntryId>& unbounded() const { return unbounded_; }
    /// The nodes that a place of `top` holds. For a group: itself and the nodes in fields other than its list.
    std::span<const NodeId> nodesOf(NodeId top) const;
    /// True if the field is a group's list as in edges(), before the last step.
    bool isListed(NodeId node, FieldIndex field) const;
    /// The list field of a group type whose children are independent. kNoField for other types.
    static FieldIndex listOf(const NodeType& type);
    /// How many times the child is in the group's list.
    std::uint32_t count(NodeId group, NodeId child) const;
    /// Finds all units whose boxes are within the radius, and possibly others.
    void find(const Vec3d& center, double radius, std::vector<EntryId>& out) const;

  private:
    struct Top {
        NodeId id;
        std::uint64_t turned = 0;  // number of the step
        Kind kind = Kind::group;
        FieldIndex list = kNoField;
        std::uint64_t born = 0;
        std::unordered_map<std::uint32_t, std::uint32_t> children;  // of a group, with how often each is in it
        std::vector<EntryId> entries;
        ShapeUnit unit;  // for a group its nodes only
    };
    using Cells = std::unordered_map<std::uint64_t, std::vector<EntryId>>;

    void clear();
    Top& topOf(const Scene& whole, NodeId id);
    void forget(NodeId id);
    void insertEntries(const Scene& whole, NodeId node, EntryId parent);
    EntryId insertEntry(const Scene& whole, NodeId node, EntryId parent);
    void removeEntries(EntryId top);
    struct Cell {
        int level = 0;
        std::uint64_t key = 0;
    };
    Cell cellOf(const ShapeBounds& box) const;
    void putInCell(EntryId id, const Cell& cell);
    void takeOutOfCell(EntryId id);
    void putUnit(EntryId id);
    void noteList(const Change& change);
    void note(const Scene& whole, const Change& change);
    void applyEdges(const Scene& whole);
    void renew(const Scene& whole);
    void move(const Scene& whole);

    std::size_t maximum_;
    int smallestLevel_ = 0;
    std::uint64_t state_ = 0, step_ = 0, beginning_ = 0;
    bool tooMany_ = false;
    EntryId root_ = kNone;
    std::vector<Entry> entries_;
    std::vector<EntryId> free_;
    std::unordered_map<std::uint32_t, Top> tops_;
    std::unordered_map<std::uint32_t, std::vector<Top*>> insideOf_;  // the tops that have the node in `unit.nodes`
    std::unordered_set<EntryId> unbounded_;
    std::map<int, Cells> levels_;
    std::vector<EntryId> added_, removed_, moved_;
    std::vector<Edge> edges_;
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> edgesBefore_;
    std::unordered_set<std::uint32_t> changed_;  // tops to be updated
    std::vector<std::uint32_t> turned_;          // groups that moved
};

}  // namespace rtsg
