// Keeps the places of shapes in step with a scene, in a grid with several cell sizes.
#include "spatial_index.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>

#include <rtsg/core/placement.h>
#include <rtsg/core/portable_math.h>
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
    const int level = size > 0 ? static_cast<int>(std::ceil(portable::log2(size))) : smallest;
    return std::clamp(level, smallest, kHighestLevel);
}

}  // namespace

void SpatialIndex::coverRadius(double smallest) {
    smallestLevel_ = std::clamp(static_cast<int>(std::floor(portable::log2(std::max(smallest, 1e-9)))) - 1,
                                kLowestLevel, kHighestLevel);
    root_ = kNone;
}

void SpatialIndex::clear() {
    entries_.clear();
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

FieldIndex SpatialIndex::listOf(const NodeType& type) {
    static constexpr std::array kGroups{"RtsgScene",    "Group",     "Transform",     "StaticGroup",
                                        "Anchor",       "Collision", "PickableGroup", "GeoLocation",
                                        "GeoTransform", "Inline",    "CADPart",       "CADAssembly"};
    if (type.kind != NodeType::Kind::builtin || type.below.size() != 1) return kNoField;
    const FieldIndex list = type.below.front();
    if (type.fields[list].type != FieldType::MFNode) return kNoField;
    return std::ranges::find(kGroups, std::string_view(type.name)) != kGroups.end() ? list : kNoField;
}

std::span<const NodeId> SpatialIndex::nodesOf(NodeId top) const {
    const auto found = tops_.find(top.value);
    return found == tops_.end() ? std::span<const NodeId>() : std::span<const NodeId>(found->second.unit.nodes);
}

bool SpatialIndex::isListed(NodeId node, FieldIndex field) const {
    const auto found = tops_.find(node.value);
    return found != tops_.end() && found->second.kind == Kind::group && found->second.list == field &&
           found->second.born < step_;
}

std::uint32_t SpatialIndex::count(NodeId group, NodeId child) const {
    const auto found = tops_.find(group.value);
    if (found == tops_.end()) return 0;
    const auto times = found->second.children.find(child.value);
    return times == found->second.children.end() ? 0 : times->second;
}

// ---- tops and their places ---------------------------------------------------------------------------------------

SpatialIndex::Top& SpatialIndex::topOf(const Scene& whole, NodeId id) {
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

void SpatialIndex::forget(NodeId id) {
    const auto top = tops_.find(id.value);
    for (const NodeId inner : top->second.unit.nodes) {
        const auto owners = insideOf_.find(inner.value);
        std::erase(owners->second, &top->second);
        if (owners->second.empty()) insideOf_.erase(owners);
    }
    tops_.erase(top);
}

SpatialIndex::EntryId SpatialIndex::insertEntry(const Scene& whole, NodeId node, EntryId parent) {
    if (entries_.size() - free_.size() >= maximum_) tooMany_ = true;
    if (tooMany_ || !whole.find(node)) return kNone;
    EntryId id = static_cast<EntryId>(entries_.size());
    if (free_.empty()) {
        entries_.emplace_back();
    } else {
        id = free_.back();
        free_.pop_back();
        entries_[id] = {};
    }
    Top& top = topOf(whole, node);
    top.entries.push_back(id);
    Entry& p = entries_[id];
    p.node = node;
    p.parent = parent;
    p.top = &top;
    p.kind = top.kind;
    p.born = step_;
    if (parent != kNone) {
        Entry& above = entries_[parent];
        p.depth = above.depth + 1;
        p.slot = static_cast<std::uint32_t>(above.below.size());
        above.below.push_back(id);
    }
    added_.push_back(id);
    if (p.kind == Kind::group) {
        const glm::dmat4 above = parent == kNone ? glm::dmat4(1) : entries_[parent].worldFromLocal;
        p.worldFromLocal = above * parentFromLocal(whole, whole.node(node));
    } else if (p.kind == Kind::unit) {
        putUnit(id);
    }
    return id;
}

/// Adds a place for the node below `parent`, and for all groups and units below it.
void SpatialIndex::insertEntries(const Scene& whole, NodeId node, EntryId parent) {
    std::vector<std::pair<NodeId, EntryId>> pending{{node, parent}};
    while (!pending.empty()) {
        const auto [one, above] = pending.back();
        pending.pop_back();
        const EntryId id = insertEntry(whole, one, above);
        if (id == kNone || entries_[id].kind != Kind::group) continue;
        for (const auto& [child, times] : tops_.find(one.value)->second.children)
            pending.emplace_back(NodeId{child}, id);
    }
}

/// Removes the place and all places below it.
void SpatialIndex::removeEntries(EntryId top) {
    const EntryId parent = entries_[top].parent;
    if (parent != kNone) {
        std::vector<EntryId>& siblings = entries_[parent].below;
        const EntryId last = siblings.back();
        siblings[entries_[top].slot] = last;
        entries_[last].slot = entries_[top].slot;
        siblings.pop_back();
    }
    std::vector<EntryId> pending{top};
    while (!pending.empty()) {
        const EntryId id = pending.back();
        pending.pop_back();
        Entry& p = entries_[id];
        append(pending, p.below);
        p.below.clear();
        takeOutOfCell(id);
        unbounded_.erase(id);
        removed_.push_back(id);
        p.isGone = true;
        const auto owner = tops_.find(p.node.value);
        std::erase(owner->second.entries, id);
        if (owner->second.entries.empty()) forget(p.node);
    }
}

// ---- the grid ----------------------------------------------------------------------------------------------------

SpatialIndex::Cell SpatialIndex::cellOf(const ShapeBounds& box) const {
    const Vec3d size = box.high - box.low, at = (box.low + box.high) * .5;
    const int level = levelFor(std::max({size.x, size.y, size.z}), smallestLevel_);
    const double edge = std::ldexp(1., level);
    return {level, cellKey(cellAlong(at.x, edge), cellAlong(at.y, edge), cellAlong(at.z, edge))};
}

/// Puts the unit where it is now. Most moving units stay in their cell.
void SpatialIndex::putUnit(EntryId id) {
    Entry& p = entries_[id];
    const ShapeUnit& unit = p.top->unit;
    ShapeBounds box = unit.box.through(entries_[p.parent].worldFromLocal);
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

void SpatialIndex::putInCell(EntryId id, const Cell& at) {
    Entry& p = entries_[id];
    p.level = at.level;
    p.cell = at.key;
    std::vector<EntryId>& cell = levels_[p.level][p.cell];
    p.cellSlot = static_cast<std::uint32_t>(cell.size());
    cell.push_back(id);
}

void SpatialIndex::takeOutOfCell(EntryId id) {
    Entry& p = entries_[id];
    if (p.kind != Kind::unit || p.box.empty()) return;
    const auto level = levels_.find(p.level);
    const auto cell = level->second.find(p.cell);
    const EntryId last = cell->second.back();
    cell->second[p.cellSlot] = last;
    entries_[last].cellSlot = p.cellSlot;
    cell->second.pop_back();
    if (cell->second.empty()) level->second.erase(cell);
    if (level->second.empty()) levels_.erase(level);
    p.box = {};
}

void SpatialIndex::find(const Vec3d& center, double radius, std::vector<EntryId>& out) const {
    for (const auto& [level, cells] : levels_) {
        // A box reaches at most half a cell beyond the cell of its centre.
        const double edge = std::ldexp(1, level), reach = radius + edge * .5;
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
void SpatialIndex::noteList(const Change& change) {
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

void SpatialIndex::note(const Scene& whole, const Change& change) {
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

void SpatialIndex::applyEdges(const Scene& whole) {
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
        std::vector<EntryId> gone;
        for (const EntryId id : top->second.entries)
            if (entries_[id].parent != kNone && entries_[entries_[id].parent].node == e.group) gone.push_back(id);
        for (const EntryId id : gone) removeEntries(id);
    }
    for (const Edge& e : edges_) {
        if (e.before != 0 || e.now == 0) continue;
        const auto top = tops_.find(e.group.value);
        if (top == tops_.end()) continue;
        // Places that were made in this step have everything below them already.
        const std::vector<EntryId> above = top->second.entries;
        for (const EntryId id : above)
            if (entries_[id].born != step_) insertEntries(whole, e.child, id);
    }
}

/// Updates units whose fields changed, and groups that have other nodes beside their list.
void SpatialIndex::renew(const Scene& whole) {
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
                for (const EntryId entryId : top.entries) {
                    if (top.kind != Kind::unit) break;
                    putUnit(entryId);
                    if (std::exchange(entries_[entryId].moved, step_) != step_) moved_.push_back(entryId);
                }
                continue;
            }
        }
        // With other nodes it becomes another unit.
        std::vector<EntryId> parents;
        const std::vector<EntryId> old = top.entries;
        for (const EntryId entryId : old) parents.push_back(entries_[entryId].parent);
        for (const EntryId entryId : old) removeEntries(entryId);
        for (const EntryId parent : parents) insertEntries(whole, id, parent);
    }
    changed_.clear();
}

void SpatialIndex::move(const Scene& whole) {
    std::vector<EntryId> tops;
    for (const std::uint32_t number : turned_)
        if (const auto found = tops_.find(number); found != tops_.end() && whole.find(NodeId{number}))
            append(tops, found->second.entries);
    turned_.clear();
    if (!std::ranges::is_sorted(tops, {}, [this](EntryId id) { return entries_[id].depth; }))
        std::ranges::sort(tops, {}, [this](EntryId id) { return entries_[id].depth; });
    std::vector<EntryId> pending;
    for (const EntryId top : tops) {
        pending.push_back(top);
        while (!pending.empty()) {
            const EntryId id = pending.back();
            pending.pop_back();
            Entry& p = entries_[id];
            if (p.kind == Kind::companion || (p.kind == Kind::group && p.moved == step_)) continue;
            if (p.kind == Kind::unit) {
                putUnit(id);
                if (std::exchange(p.moved, step_) != step_) moved_.push_back(id);
                continue;
            }
            p.moved = step_;
            const glm::dmat4 above = p.parent == kNone ? glm::dmat4(1) : entries_[p.parent].worldFromLocal;
            p.worldFromLocal = above * parentFromLocal(whole, whole.node(p.node));
            append(pending, p.below);
        }
    }
}

bool SpatialIndex::follow(const Scene& whole, const ChangeSet* set) {
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
        root_ = static_cast<EntryId>(0);
        insertEntries(whole, whole.root(), kNone);
    } else {
        for (const Change& change : set->changes) note(whole, change);
        applyEdges(whole);
        renew(whole);
        move(whole);
    }
    return !tooMany_;
}

}  // namespace rtsg
