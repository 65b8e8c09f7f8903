// Follows which units are near a point, and counts for each node how many units need it.
#include "region.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>

#include <fmt/format.h>

#include <rtsg/core/navigation.h>
#include <rtsg/core/placement.h>

namespace rtsg {

namespace {

constexpr int kLongestChain = 1000;  // most nodes above the one at the centre

std::optional<double> numberIn(std::string_view text) {
    double value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) return std::nullopt;
    return value;
}

}  // namespace

Result<RegionWish> RegionWish::parse(std::string_view part) {
    const auto wrong = [&](std::string_view what) {
        return fail(fmt::format("part {}: {}; it is region:[NAME,|x,y,z,]radius[,margin]", part.substr(0, 80), what));
    };
    RegionWish wish;
    std::string_view rest = part.substr(std::string_view("region:").size());
    std::vector<double> numbers;
    for (bool isFirst = true, more = true; more; isFirst = false) {
        const std::size_t comma = rest.find(',');
        const std::string_view word = rest.substr(0, comma);
        more = comma != std::string_view::npos;
        if (more) rest.remove_prefix(comma + 1);
        if (const std::optional<double> number = numberIn(word))
            numbers.push_back(*number);
        else if (isFirst && !word.empty())
            wish.name = word;
        else
            return wrong(fmt::format("'{}' is no number", word.substr(0, 40)));
    }
    if (wish.name.empty() && numbers.size() >= 4) {
        wish.isFixed = true;
        wish.point = Vec3d(numbers[0], numbers[1], numbers[2]);
        numbers.erase(numbers.begin(), numbers.begin() + 3);
    }
    if (numbers.empty()) return wrong("the radius is missing");
    if (numbers.size() > 2) return wrong("as many numbers make no region");
    wish.radius = numbers[0];
    if (numbers.size() == 2) wish.margin = numbers[1];
    if (!(wish.radius > 0)) return wrong("the radius is more than 0");
    if (!(wish.margin >= 0 && wish.margin <= 10)) return wrong("the margin is a share of the radius, from 0 to 10");
    return wish;
}

// ---- counting ----------------------------------------------------------------------------------------------------

void Region::refer(NodeId id) {
    if (counts_[id.value]++ == 0) touched_.try_emplace(id.value, false);
}

void Region::drop(NodeId id) {
    const auto found = counts_.find(id.value);
    if (found == counts_.end() || --found->second > 0) return;
    counts_.erase(found);
    touched_.try_emplace(id.value, true);
}

void Region::count(EntryId id, std::span<const NodeId> nodes) {
    taken_[id].assign(nodes.begin(), nodes.end());
    for (const NodeId node : nodes) refer(node);
}

void Region::uncount(EntryId id) {
    const auto found = taken_.find(id);
    if (found == taken_.end()) return;
    for (const NodeId node : found->second) drop(node);
    taken_.erase(found);
}

/// Holds the group and all groups above it.
void Region::hold(const SpatialIndex& index, EntryId group) {
    for (; group != SpatialIndex::kNone; group = index.entry(group).parent) {
        if (held_[group]++ > 0) return;
        const SpatialIndex::Entry& entry = index.entry(group);
        count(group, index.nodesOf(entry.node));
        for (const EntryId id : entry.below)
            if (index.entry(id).kind == SpatialIndex::Kind::companion && !taken_.contains(id))
                count(id, index.nodesOf(index.entry(id).node));
    }
}

void Region::take(const SpatialIndex& index, EntryId id) {
    const SpatialIndex::Entry& entry = index.entry(id);
    count(id, index.nodesOf(entry.node));
    hold(index, entry.parent);
}

/// Releases a unit, and the groups that nothing else holds.
void Region::release(const SpatialIndex& index, EntryId id) {
    uncount(id);
    for (EntryId group = index.entry(id).parent; group != SpatialIndex::kNone; group = index.entry(group).parent) {
        if (--held_[group] > 0) return;
        held_.erase(group);
        uncount(group);
        for (const EntryId below : index.entry(group).below)
            if (index.entry(below).kind == SpatialIndex::Kind::companion) uncount(below);
    }
}

void Region::judge(const SpatialIndex& index, EntryId id) {
    const SpatialIndex::Entry& entry = index.entry(id);
    if (entry.isGone || entry.kind == SpatialIndex::Kind::group) return;
    const bool isIn = taken_.contains(id);
    if (entry.kind == SpatialIndex::Kind::companion) {
        if (!isIn && held_.contains(entry.parent)) count(id, index.nodesOf(entry.node));
        return;
    }
    const double reach = isIn ? wish_.radius * (1 + wish_.margin) : wish_.radius;
    const bool shall = entry.isUnbounded || (known_ && entry.box.distance(centre_) <= reach);
    if (shall && !isIn) take(index, id);
    if (!shall && isIn) release(index, id);
}

// ---- steps -------------------------------------------------------------------------------------------------------

/// Finds the centre. The path upwards follows first parents, as for viewpoints.
void Region::findCentre(const Scene& whole) {
    std::vector<NodeId> path;
    known_ = true;
    if (wish_.isFixed) {
        centre_ = wish_.point;
    } else if (wish_.name.empty()) {
        centre_ = viewerPose(whole).position;
    } else {
        const Node* node = whole.find(whole.findName(wish_.name));
        known_ = node != nullptr;
        glm::dvec4 at(0, 0, 0, 1);
        if (const auto view = node ? viewOf(*node) : std::nullopt) at = glm::dvec4(view->position, 1);
        while (node && path.size() < kLongestChain) {
            path.push_back(node->id());
            at = parentFromLocal(whole, *node) * at;
            const Node* above = nullptr;
            for (const ParentRef& parent : whole.parents(node->id()))
                if (!above && isTransform(whole.node(parent.node).type(), parent.field))
                    above = whole.find(parent.node);
            node = above;
        }
        centre_ = Vec3d(at);
    }
    known_ = known_ && std::isfinite(centre_.x) && std::isfinite(centre_.y) && std::isfinite(centre_.z);
    if (path == chain_) return;
    for (const NodeId id : path) refer(id);
    for (const NodeId id : chain_) drop(id);
    chain_ = std::move(path);
}

Region::Step Region::follow(const Scene& whole, const SpatialIndex& index, bool fresh) {
    const bool anew = fresh || index.beginning() != beginning_;
    beginning_ = index.beginning();
    touched_.clear();
    if (anew) {
        for (const auto& [id, times] : counts_) touched_.try_emplace(id, true);
        counts_.clear();
        taken_.clear();
        held_.clear();
        chain_.clear();
        hold(index, index.root());
    }
    const Vec3d before = centre_;
    const bool knownBefore = known_;
    findCentre(whole);
    if (!anew) {
        for (const EntryId id : index.removed()) {
            if (!taken_.contains(id)) continue;
            if (index.entry(id).kind == SpatialIndex::Kind::unit) release(index, id);
            if (index.entry(id).kind == SpatialIndex::Kind::companion) uncount(id);
        }
        for (const EntryId id : index.added()) judge(index, id);
        for (const EntryId id : index.moved()) judge(index, id);
    }
    if (anew || known_ != knownBefore || centre_ != before) {
        near_.clear();
        for (const auto& [id, nodes] : taken_) near_.push_back(id);
        if (known_) index.find(centre_, wish_.radius, near_);
        if (anew) append(near_, index.unbounded());
        for (const EntryId id : near_) judge(index, id);
    }
    Step step;
    step.anew = anew;
    for (const auto& [id, was] : touched_) {
        const bool is = counts_.contains(id);
        if (is && !was) step.entered.push_back(NodeId{id});
        if (was && !is) step.left.push_back(NodeId{id});
    }
    std::ranges::sort(step.entered);
    std::ranges::sort(step.left);
    return step;
}

}  // namespace rtsg
