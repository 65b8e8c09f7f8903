// Keeps the places of shapes in step with a scene, in a grid with several cell sizes.
#include "shape_places.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>

#include <rtsg/core/placement.h>
#include <rtsg/core/x3d.h>

namespace rtsg {

namespace {

constexpr int kLowestLevel = -40, kHighestLevel = 100;  // cells are 2^level metres wide
constexpr double kFarthestCell = 1e15;                  // in cells from the origin; farther units share the last cell

bool comesWithItsGroup(const NodeType& type) {
    return type.role == "sensor" || type.role == "clipPlane" || type.role == "localFog";
}

std::int64_t cellAlong(double at, double size) {
    return static_cast<std::int64_t>(std::floor(std::clamp(at / size, -kFarthestCell, kFarthestCell)));
}

/// A hash of a cell's three coordinates. If two cells share one, a search finds too much, never too little.
std::uint64_t cellKey(std::int64_t x, std::int64_t y, std::int64_t z) {
    std::uint64_t key = 0;
    for (const std::int64_t part : {x, y, z}) {
        key = (key ^ static_cast<std::uint64_t>(part)) * 0x9E3779B97F4A7C15u;
        key ^= key >> 29;
    }
    return key;
}

int levelFor(double size, int smallest) {
    const int level = size > 0 ? static_cast<int>(std::ceil(std::log2(size))) : smallest;
    return std::clamp(level, smallest, kHighestLevel);
}

}  // namespace

void ShapePlaces::coverRadius(double smallest) {
    smallestLevel_ =
        std::clamp(static_cast<int>(std::floor(std::log2(std::max(smallest, 1e-9)))) - 1, kLowestLevel, kHighestLevel);
    root_ = kNone;
}

void ShapePlaces::clear() {
    places_.clear();
    free_.clear();
    tops_.clear();
    insideOf_.clear();
    unbounded_.clear();
    levels_.clear();
    added_.clear();
    removed_.clear();
    moved_.clear();
    edges_.clear();
    tooMany_ = false;
    root_ = kNone;
}

FieldIndex ShapePlaces::listOf(const NodeType& type) {
    static constexpr std::array kGroups{"RtsgScene",    "Group",     "Transform",     "StaticGroup",
                                        "Anchor",       "Collision", "PickableGroup", "GeoLocation",
                                        "GeoTransform", "Inline",    "CADPart",       "CADAssembly"};
    if (type.kind != NodeType::Kind::builtin || type.below.size() != 1) return kNoField;
    const FieldIndex list = type.below.front();
    if (type.fields[list].type != FieldType::MFNode) return kNoField;
    return std::ranges::find(kGroups, std::string_view(type.name)) != kGroups.end() ? list : kNoField;
}

std::span<const NodeId> ShapePlaces::nodesOf(NodeId top) const {
    const auto found = tops_.find(top.value);
    return found == tops_.end() ? std::span<const NodeId>() : std::span<const NodeId>(found->second.unit.nodes);
}

bool ShapePlaces::isListed(NodeId node, FieldIndex field) const {
    const auto found = tops_.find(node.value);
    return found != tops_.end() && found->second.kind == Kind::group && found->second.list == field &&
           found->second.born < step_;
}

std::uint32_t ShapePlaces::count(NodeId group, NodeId child) const {
    const auto found = tops_.find(group.value);
    if (found == tops_.end()) return 0;
    const auto times = found->second.children.find(child.value);
    return times == found->second.children.end() ? 0 : times->second;
}

// ---- tops and their places ---------------------------------------------------------------------------------------

ShapePlaces::Top& ShapePlaces::topOf(const Scene& whole, NodeId id) {
    const auto [found, fresh] = tops_.try_emplace(id.value);
    Top& top = found->second;
    if (!fresh) return top;
    const Node& node = whole.node(id);
    top.id = id;
    top.born = step_;
    top.list = listOf(node.type());
    if (top.list == kNoField) {
        top.kind = comesWithItsGroup(node.type()) ? Kind::companion : Kind::unit;
        top.unit = shapeUnit(whole, id);
    } else {
        for (const NodeId child : node.get(Field<Array<NodeId>>{top.list}))
            if (child) ++top.children[child.value];
        std::vector<NodeId> others;
        appendBelow(whole, node, top.list, others);
        // The scene's own fields refer to nodes that stand elsewhere.
        if (id == whole.root()) others.clear();
        top.unit.nodes = allBelow(whole, std::move(others));
        if (!std::ranges::binary_search(top.unit.nodes, id))
            top.unit.nodes.insert(std::ranges::lower_bound(top.unit.nodes, id), id);
    }
    for (const NodeId inner : top.unit.nodes) insideOf_[inner.value].push_back(&top);
    return top;
}

void ShapePlaces::forget(NodeId id) {
    const auto top = tops_.find(id.value);
    for (const NodeId inner : top->second.unit.nodes) {
        const auto owners = insideOf_.find(inner.value);
        std::erase(owners->second, &top->second);
        if (owners->second.empty()) insideOf_.erase(owners);
    }
    tops_.erase(top);
}

ShapePlaces::PlaceId ShapePlaces::addPlace(const Scene& whole, NodeId node, PlaceId parent) {
    if (places_.size() - free_.size() >= most_) tooMany_ = true;
    if (tooMany_ || !whole.find(node)) return kNone;
    PlaceId id = static_cast<PlaceId>(places_.size());
    if (free_.empty()) {
        places_.emplace_back();
    } else {
        id = free_.back();
        free_.pop_back();
        places_[id] = {};
    }
    Top& top = topOf(whole, node);
    top.places.push_back(id);
    Place& p = places_[id];
    p.node = node;
    p.parent = parent;
    p.top = &top;
    p.kind = top.kind;
    p.born = step_;
    if (parent != kNone) {
        Place& above = places_[parent];
        p.depth = above.depth + 1;
        p.slot = static_cast<std::uint32_t>(above.below.size());
        above.below.push_back(id);
    }
    added_.push_back(id);
    if (p.kind == Kind::group) {
        const glm::dmat4 above = parent == kNone ? glm::dmat4(1) : places_[parent].worldFromLocal;
        p.worldFromLocal = above * parentFromLocal(whole, whole.node(node));
    } else if (p.kind == Kind::unit) {
        placeUnit(id);
    }
    return id;
}

/// Adds a place for the node below `parent`, and for all groups and units below it.
void ShapePlaces::addPlaces(const Scene& whole, NodeId node, PlaceId parent) {
    std::vector<std::pair<NodeId, PlaceId>> pending{{node, parent}};
    while (!pending.empty()) {
        const auto [one, above] = pending.back();
        pending.pop_back();
        const PlaceId id = addPlace(whole, one, above);
        if (id == kNone || places_[id].kind != Kind::group) continue;
        for (const auto& [child, times] : tops_.find(one.value)->second.children)
            pending.emplace_back(NodeId{child}, id);
    }
}

/// Removes the place and all places below it.
void ShapePlaces::removePlaces(PlaceId top) {
    const PlaceId parent = places_[top].parent;
    if (parent != kNone) {
        std::vector<PlaceId>& siblings = places_[parent].below;
        const PlaceId last = siblings.back();
        siblings[places_[top].slot] = last;
        places_[last].slot = places_[top].slot;
        siblings.pop_back();
    }
    std::vector<PlaceId> pending{top};
    while (!pending.empty()) {
        const PlaceId id = pending.back();
        pending.pop_back();
        Place& p = places_[id];
        append(pending, p.below);
        p.below.clear();
        takeOutOfCell(id);
        unbounded_.erase(id);
        removed_.push_back(id);
        p.isGone = true;
        const auto owner = tops_.find(p.node.value);
        std::erase(owner->second.places, id);
        if (owner->second.places.empty()) forget(p.node);
    }
}

// ---- the grid ----------------------------------------------------------------------------------------------------

ShapePlaces::Cell ShapePlaces::cellOf(const ShapeBounds& box) const {
    const Vec3d size = box.high - box.low, at = (box.low + box.high) * .5;
    const int level = levelFor(std::max({size.x, size.y, size.z}), smallestLevel_);
    const double edge = std::ldexp(1., level);
    return {level, cellKey(cellAlong(at.x, edge), cellAlong(at.y, edge), cellAlong(at.z, edge))};
}

/// Puts the unit where it is now. Most moving units stay in their cell.
void ShapePlaces::placeUnit(PlaceId id) {
    Place& p = places_[id];
    const ShapeUnit& unit = p.top->unit;
    ShapeBounds box = unit.box.through(places_[p.parent].worldFromLocal);
    const bool lost = !unit.box.empty() && (box.empty() || !std::isfinite(glm::length(box.high - box.low)) ||
                                            !std::isfinite(glm::length(box.high + box.low)));
    const bool isUnbounded = unit.isUnbounded || lost;
    if (isUnbounded) box = {};
    if (std::exchange(p.isUnbounded, isUnbounded) != isUnbounded) {
        if (isUnbounded)
            unbounded_.insert(id);
        else
            unbounded_.erase(id);
    }
    const Cell cell = box.empty() ? Cell() : cellOf(box);
    if (!box.empty() && !p.box.empty() && cell.level == p.level && cell.key == p.cell) {
        p.box = box;
        return;
    }
    takeOutOfCell(id);
    p.box = box;
    if (!box.empty()) putInCell(id, cell);
}

void ShapePlaces::putInCell(PlaceId id, const Cell& at) {
    Place& p = places_[id];
    p.level = at.level;
    p.cell = at.key;
    std::vector<PlaceId>& cell = levels_[p.level][p.cell];
    p.cellSlot = static_cast<std::uint32_t>(cell.size());
    cell.push_back(id);
}

void ShapePlaces::takeOutOfCell(PlaceId id) {
    Place& p = places_[id];
    if (p.kind != Kind::unit || p.box.empty()) return;
    const auto level = levels_.find(p.level);
    const auto cell = level->second.find(p.cell);
    const PlaceId last = cell->second.back();
    cell->second[p.cellSlot] = last;
    places_[last].cellSlot = p.cellSlot;
    cell->second.pop_back();
    if (cell->second.empty()) level->second.erase(cell);
    if (level->second.empty()) levels_.erase(level);
    p.box = {};
}

void ShapePlaces::find(const Vec3d& center, double radius, std::vector<PlaceId>& out) const {
    for (const auto& [level, cells] : levels_) {
        // A box reaches at most half a cell beyond the cell of its centre.
        const double edge = std::exp2(level), reach = radius + edge * .5;
        std::array<std::int64_t, 3> low{}, high{};
        double number = 1;
        for (int i = 0; i < 3; ++i) {
            low[std::size_t(i)] = cellAlong(center[i] - reach, edge);
            high[std::size_t(i)] = cellAlong(center[i] + reach, edge);
            number *= static_cast<double>(high[std::size_t(i)] - low[std::size_t(i)]) + 1;
        }
        if (!(number <= static_cast<double>(cells.size()))) {
            for (const auto& [key, here] : cells) append(out, here);
            continue;
        }
        for (std::int64_t x = low[0]; x <= high[0]; ++x)
            for (std::int64_t y = low[1]; y <= high[1]; ++y)
                for (std::int64_t z = low[2]; z <= high[2]; ++z)
                    if (const auto here = cells.find(cellKey(x, y, z)); here != cells.end()) append(out, here->second);
    }
}

// ---- steps -------------------------------------------------------------------------------------------------------

/// Notes a change in the list of a group that existed before this step.
void ShapePlaces::noteList(const Change& change) {
    Top& top = tops_.find(change.node.value)->second;
    const auto touch = [&](NodeId child) -> std::uint32_t& {
        std::uint32_t& times = top.children[child.value];
        edgesBefore_.try_emplace({change.node.value, child.value}, times);
        return times;
    };
    if (change.kind == ChangeKind::insertChild) {
        ++touch(change.other);
    } else if (change.kind == ChangeKind::removeChild) {
        --touch(change.other);
    } else {
        for (auto& [child, times] : top.children) {
            edgesBefore_.try_emplace({change.node.value, child}, times);
            times = 0;
        }
        for (const NodeId child : change.value.as<Array<NodeId>>())
            if (child) ++touch(child);
    }
}

void ShapePlaces::note(const Scene& whole, const Change& change) {
    const bool isList = change.kind == ChangeKind::insertChild || change.kind == ChangeKind::removeChild;
    if (change.kind != ChangeKind::setField && !isList) return;
    const bool refers = isList || sf(change.value.type()) == FieldType::SFNode;
    const bool listed = refers && isListed(change.node, change.field);
    if (listed) noteList(change);
    const auto owners = insideOf_.find(change.node.value);
    if (owners == insideOf_.end()) return;
    const Node* node = whole.find(change.node);
    if (!refers && node) {
        const Aspect aspect = node->type().fields[change.field].aspect;
        if (aspect != Aspect::transform && aspect != Aspect::geometry && aspect != Aspect::structure &&
            !node->is(x3d::Text::type))
            return;
    }
    for (Top* top : owners->second) {
        // A group may also be inside a unit.
        if (top->born == step_ || (listed && top->id == change.node)) continue;
        if (top->kind == Kind::group && std::exchange(top->turned, step_) != step_) turned_.push_back(top->id.value);
        if (top->kind != Kind::group || refers) changed_.insert(top->id.value);
    }
}

void ShapePlaces::applyEdges(const Scene& whole) {
    for (const auto& [edge, before] : edgesBefore_) {
        const auto [group, child] = edge;
        const auto top = tops_.find(group);
        if (top == tops_.end()) continue;
        const auto times = top->second.children.find(child);
        const std::uint32_t now = times == top->second.children.end() ? 0 : times->second;
        if (now == 0 && times != top->second.children.end()) top->second.children.erase(times);
        edges_.push_back({NodeId{group}, NodeId{child}, before, now});
    }
    edgesBefore_.clear();
    for (const Edge& e : edges_) {
        if (e.before == 0 || e.now != 0) continue;
        const auto top = tops_.find(e.child.value);
        if (top == tops_.end()) continue;
        std::vector<PlaceId> gone;
        for (const PlaceId id : top->second.places)
            if (places_[id].parent != kNone && places_[places_[id].parent].node == e.group) gone.push_back(id);
        for (const PlaceId id : gone) removePlaces(id);
    }
    for (const Edge& e : edges_) {
        if (e.before != 0 || e.now == 0) continue;
        const auto top = tops_.find(e.group.value);
        if (top == tops_.end()) continue;
        // Places that were made in this step have everything below them already.
        const std::vector<PlaceId> above = top->second.places;
        for (const PlaceId id : above)
            if (places_[id].born != step_) addPlaces(whole, e.child, id);
    }
}

/// Updates units whose fields changed, and groups that have other nodes beside their list.
void ShapePlaces::renew(const Scene& whole) {
    for (const std::uint32_t number : changed_) {
        const auto found = tops_.find(number);
        const NodeId id{number};
        if (found == tops_.end() || found->second.born == step_ || !whole.find(id) || id == whole.root()) continue;
        Top& top = found->second;
        if (top.kind != Kind::group) {
            ShapeUnit now = shapeUnit(whole, id);
            if (now.nodes == top.unit.nodes) {
                if (now == top.unit) continue;
                top.unit = std::move(now);
                for (const PlaceId place : top.places) {
                    if (top.kind != Kind::unit) break;
                    placeUnit(place);
                    if (std::exchange(places_[place].moved, step_) != step_) moved_.push_back(place);
                }
                continue;
            }
        }
        // With other nodes it becomes another unit.
        std::vector<PlaceId> parents;
        const std::vector<PlaceId> old = top.places;
        for (const PlaceId place : old) parents.push_back(places_[place].parent);
        for (const PlaceId place : old) removePlaces(place);
        for (const PlaceId parent : parents) addPlaces(whole, id, parent);
    }
    changed_.clear();
}

void ShapePlaces::move(const Scene& whole) {
    std::vector<PlaceId> tops;
    for (const std::uint32_t number : turned_)
        if (const auto found = tops_.find(number); found != tops_.end() && whole.find(NodeId{number}))
            append(tops, found->second.places);
    turned_.clear();
    if (!std::ranges::is_sorted(tops, {}, [this](PlaceId id) { return places_[id].depth; }))
        std::ranges::sort(tops, {}, [this](PlaceId id) { return places_[id].depth; });
    std::vector<PlaceId> pending;
    for (const PlaceId top : tops) {
        pending.push_back(top);
        while (!pending.empty()) {
            const PlaceId id = pending.back();
            pending.pop_back();
            Place& p = places_[id];
            if (p.kind == Kind::companion || (p.kind == Kind::group && p.moved == step_)) continue;
            if (p.kind == Kind::unit) {
                placeUnit(id);
                if (std::exchange(p.moved, step_) != step_) moved_.push_back(id);
                continue;
            }
            p.moved = step_;
            const glm::dmat4 above = p.parent == kNone ? glm::dmat4(1) : places_[p.parent].worldFromLocal;
            p.worldFromLocal = above * parentFromLocal(whole, whole.node(p.node));
            append(pending, p.below);
        }
    }
}

bool ShapePlaces::follow(const Scene& whole, const ChangeSet* set) {
    static std::atomic<std::uint64_t> beginnings{0};  // counts beginnings of all objects
    ++step_;
    const bool anew = !set || set->isSnapshot() || set->from != state_ || root_ == kNone || tooMany_;
    state_ = whole.sequence();
    append(free_, removed_);
    added_.clear();
    removed_.clear();
    moved_.clear();
    edges_.clear();
    if (anew) {
        clear();
        beginning_ = ++beginnings;
        root_ = static_cast<PlaceId>(0);
        addPlaces(whole, whole.root(), kNone);
    } else {
        for (const Change& change : set->changes) note(whole, change);
        applyEdges(whole);
        renew(whole);
        move(whole);
    }
    return !tooMany_;
}

}  // namespace rtsg
