// Where everything that is drawn in a scene stands, kept in step with it, and found by spheres: for parts by region.
//
// The hierarchy is cut into groups that only move what is below them, and units below these, which come and go as a
// whole: shapes, and all whose children depend on each other or on their order. Each path from the root to one is a
// place. A step costs what the set changes, and the places below what it moves. One object serves all regions.
// Invariant: followed step by step == made from scratch, but for the numbers of places. Threading: one thread.
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

class ShapePlaces {
    struct Top;

  public:
    using PlaceId = std::uint32_t;
    static constexpr PlaceId kNone = 0xFFFFFFFF;
    enum class Kind : std::uint8_t { group, unit, companion };  // companions come with their group

    struct Place {
        NodeId node;
        PlaceId parent = kNone;
        Kind kind = Kind::group;
        bool isUnbounded = false, isGone = false;
        std::uint32_t depth = 0;
        std::uint64_t born = 0, moved = 0;  // in which step
        glm::dmat4 worldFromLocal{1};       // of a group
        ShapeBounds box;                    // of a unit, in the world
        std::vector<PlaceId> below;         // of a group
        std::uint32_t slot = 0;             // in the parent's `below`
        std::uint64_t cell = 0;             // of a unit with a box: which one, on which level, and where in it
        int level = 0;
        std::uint32_t cellSlot = 0;
        const Top* top = nullptr;  // of `node`, until it is gone
    };
    /// A child was put into a group's list, or taken out, so that it is there `now` times.
    struct Edge {
        NodeId group, child;
        std::uint32_t before = 0, now = 0;
    };

    /// More places than `most` are not followed.
    explicit ShapePlaces(std::size_t most = std::size_t{1} << 22) : most_(most) {}

    /// Cells are no smaller than half of this, the smallest radius that is asked for. The next step begins from
    /// scratch.
    void coverRadius(double smallest);

    /// To the state of `whole`, whose last step `set` was; null, or one that does not fit: from scratch. False: there
    /// are more places than may be, and nothing is known any more.
    bool follow(const Scene& whole, const ChangeSet* set);

    std::uint64_t state() const { return state_; }
    /// Of the last step that began from scratch; other places have other numbers. PlaceIds from before mean nothing.
    std::uint64_t beginning() const { return beginning_; }
    /// Of the last step. What was removed is still there to be looked at; it may be among the others too.
    std::span<const PlaceId> added() const { return added_; }
    std::span<const PlaceId> removed() const { return removed_; }
    std::span<const PlaceId> moved() const { return moved_; }
    std::span<const Edge> edges() const { return edges_; }

    PlaceId root() const { return root_; }
    const Place& place(PlaceId id) const { return places_[id]; }
    const std::unordered_set<PlaceId>& unbounded() const { return unbounded_; }
    /// The nodes that a place of it holds: of a group itself and what is in fields other than its list.
    std::span<const NodeId> nodesOf(NodeId top) const;
    /// Whether it is a group's list that edges() tells of, as it was before the last step.
    bool isListed(NodeId node, FieldIndex field) const;
    /// The field whose nodes a group of this type holds one beside the other; kNoField for all that are no such groups.
    static FieldIndex listOf(const NodeType& type);
    /// How often a group's list has the child.
    std::uint32_t count(NodeId group, NodeId child) const;
    /// All units with a box no farther than that, and maybe others.
    void find(const Vec3d& center, double radius, std::vector<PlaceId>& out) const;

  private:
    struct Top {
        NodeId id;
        std::uint64_t turned = 0;  // in which step
        Kind kind = Kind::group;
        FieldIndex list = kNoField;
        std::uint64_t born = 0;
        std::unordered_map<std::uint32_t, std::uint32_t> children;  // of a group, with their number
        std::vector<PlaceId> places;
        ShapeUnit unit;  // of a group: its nodes only
    };
    using Cells = std::unordered_map<std::uint64_t, std::vector<PlaceId>>;

    void clear();
    Top& topOf(const Scene& whole, NodeId id);
    void forget(NodeId id);
    void addPlaces(const Scene& whole, NodeId node, PlaceId parent);
    PlaceId addPlace(const Scene& whole, NodeId node, PlaceId parent);
    void removePlaces(PlaceId top);
    struct Cell {
        int level = 0;
        std::uint64_t key = 0;
    };
    Cell cellOf(const ShapeBounds& box) const;
    void putInCell(PlaceId id, const Cell& cell);
    void takeOutOfCell(PlaceId id);
    void placeUnit(PlaceId id);
    void noteList(const Change& change);
    void note(const Scene& whole, const Change& change);
    void applyEdges(const Scene& whole);
    void renew(const Scene& whole);
    void move(const Scene& whole);

    std::size_t most_;
    int smallestLevel_ = 0;
    std::uint64_t state_ = 0, step_ = 0, beginning_ = 0;
    bool tooMany_ = false;
    PlaceId root_ = kNone;
    std::vector<Place> places_;
    std::vector<PlaceId> free_;
    std::unordered_map<std::uint32_t, Top> tops_;
    std::unordered_map<std::uint32_t, std::vector<Top*>> insideOf_;  // the tops whose `unit.nodes` have the node
    std::unordered_set<PlaceId> unbounded_;
    std::map<int, Cells> levels_;
    std::vector<PlaceId> added_, removed_, moved_;
    std::vector<Edge> edges_;
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> edgesBefore_;
    std::unordered_set<std::uint32_t> changed_;  // tops to be looked at again
    std::vector<std::uint32_t> turned_;          // groups that moved
};

}  // namespace rtsg
