// Ranks values of merged frames by the distance of their nodes from the viewer, and delays far values.
#include "near_first.h"

#include <algorithm>
#include <cmath>
#include <unordered_map>

#include <glm/gtc/quaternion.hpp>

#include <rtsg/core/change_composer.h>
#include <rtsg/core/geospatial.h>
#include <rtsg/core/navigation.h>
#include <rtsg/core/rotation.h>
#include <rtsg/core/x3d.h>

#include "columns/budget.h"

namespace rtsg {

namespace {

constexpr std::uint64_t kPlainChange = 16;      // approximate bytes of a change without an array
constexpr int kDeepest = 1000;                  // parents that are followed at most
constexpr double kBehind = 4;                   // factor on the distance of what is behind the viewer
constexpr std::size_t kMaxPositions = 1 << 20;  // remembered while a set is ranked

bool refersToNodes(FieldType type) {
    return sf(type) == FieldType::SFNode;
}

/// True for changes after which other nodes may move viewers and sounds.
bool movesCarriers(const Change& c) {
    return c.kind == ChangeKind::createNode || c.kind == ChangeKind::destroyNode || c.kind == ChangeKind::insertChild ||
           c.kind == ChangeKind::removeChild || (c.kind == ChangeKind::setField && refersToNodes(c.value.type()));
}

/// Finds the distances of nodes from the viewer, by each node's first parents.
class Ranks {
  public:
    explicit Ranks(const Scene& scene) : scene_(scene), viewer_(viewerPose(scene)) {}

    /// The distance from the viewer, made longer for what is behind.
    double of(NodeId id) {
        const glm::dvec3 to = positionOf(id) - viewer_.position;
        const double distance = glm::length(to);
        if (!std::isfinite(distance)) return std::numeric_limits<double>::max();
        return glm::dot(to, viewer_.orientation * glm::dvec3(0, 0, -1)) < 0 ? kBehind * distance : distance;
    }

  private:
    /// The position of a node's origin in the world.
    glm::dvec3 positionOf(NodeId id) {
        if (const auto known = positions_.find(id.value); known != positions_.end()) return known->second;
        glm::dvec3 at(0);
        NodeId above = id;
        for (int depth = 0; above && depth < kDeepest; ++depth) {
            const Node* node = scene_.find(above);
            if (!node) break;
            if (node->is(x3d::Transform::type)) at = through(*node, at);
            if (isGeoTransform(node->type()))
                at = geoTransform(scene_, *node).value_or(glm::dmat4(1)) * glm::dvec4(at, 1);
            const std::vector<ParentRef> parents = scene_.parents(above);
            above = parents.empty() ? NodeId{} : parents.front().node;
        }
        if (positions_.size() < kMaxPositions) positions_[id.value] = at;
        return at;
    }
    static glm::dvec3 through(const Node& node, const glm::dvec3& point) {
        using T = x3d::Transform;
        const glm::dvec3 center(node.get(T::center));
        const glm::dquat stretch = toQuaternion(node.get(T::scaleOrientation));
        const glm::dvec3 scaled = glm::dvec3(node.get(T::scale)) * (glm::conjugate(stretch) * (point - center));
        return glm::dvec3(node.get(T::translation)) + center + toQuaternion(node.get(T::rotation)) * (stretch * scaled);
    }

    const Scene& scene_;
    const ViewerPose viewer_;
    std::unordered_map<std::uint32_t, glm::dvec3> positions_;
};

}  // namespace

Result<std::unique_ptr<NearFirst>> NearFirst::of(const Scene& whole) {
    std::unique_ptr<NearFirst> result(new NearFirst);
    if (auto ok = result->scene_.apply(std::make_shared<ChangeSet>(whole.snapshot())); !ok)
        return std::unexpected(ok.error());
    return result;
}

/// Finds all nodes above the viewers and sounds.
void NearFirst::findCarriers(const Scene& origin) {
    carriersKnown_ = true;
    carriers_.clear();
    std::vector<NodeId> above;
    origin.forEachNode([&](const Node& node) {
        if (node.type().isA("X3DViewpointNode") || node.type().isA("X3DSoundNode")) above.push_back(node.id());
    });
    while (!above.empty()) {
        const NodeId id = above.back();
        above.pop_back();
        if (!carriers_.insert(id.value).second) continue;
        for (const ParentRef& parent : origin.parents(id)) above.push_back(parent.node);
    }
}

bool NearFirst::canWait(const Change& change, const Scene& origin) const {
    if (change.kind != ChangeKind::setField || refersToNodes(change.value.type())) return false;
    const Node* node = origin.find(change.node);
    if (!node || change.field >= node->type().fields.size() || carriers_.contains(change.node.value)) return false;
    const Aspect aspect = node->type().fields[change.field].aspect;
    return aspect == Aspect::transform || aspect == Aspect::geometry || aspect == Aspect::appearance ||
           aspect == Aspect::light;
}

/// Takes the changes that can wait out of the set.
void NearFirst::split(ChangeSet& set, const Scene& origin, std::uint64_t budget) {
    struct Ranked {
        double distance;
        std::size_t index;
    };
    Ranks ranks(origin);
    std::vector<Ranked> waiting;
    const auto costOf = [](const Change& c) { return kPlainChange + wire::costOf(c.value); };
    std::uint64_t used = 0;
    for (std::size_t i = 0; i < set.changes.size(); ++i) {
        const Change& c = set.changes[i];
        if (canWait(c, origin))
            waiting.push_back({ranks.of(c.node), i});
        else
            used += costOf(c);
    }
    std::ranges::stable_sort(waiting, {}, &Ranked::distance);
    std::vector<bool> waits(set.changes.size());
    for (bool isFirst = true; const Ranked& one : waiting) {
        used += costOf(set.changes[one.index]);
        waits[one.index] = used > budget && !isFirst;  // the nearest change is always sent
        isFirst = false;
    }
    if (std::ranges::find(waits, true) == waits.end()) return;
    later_.clear();
    std::vector<Change> first;
    for (std::size_t i = 0; i < set.changes.size(); ++i)
        (waits[i] ? later_.changes : first).push_back(std::move(set.changes[i]));
    set.changes = std::move(first);
    later_.from = set.to - 1;
    later_.to = set.to;
    later_.time = set.time;
    later_.hash = set.hash;
    set.to -= 1;
}

Result<std::shared_ptr<const ChangeSet>> NearFirst::next(std::span<const ChangeSet> frames, const Scene& origin,
                                                         std::uint64_t budget, bool all, Clock::time_point now) {
    ChangeComposer composer;
    std::uint64_t state = scene_.sequence();
    const bool waited = waits();
    if (waited) {
        composer.add(later_);
        state = later_.to;
    } else {
        waitingSince_ = now;
    }
    for (const ChangeSet& frame : frames) {
        if (frame.from != state) return fail("frames that do not follow");
        composer.add(frame);
        state = frame.to;
        carriersKnown_ = carriersKnown_ && std::ranges::none_of(frame.changes, movesCarriers);
    }
    if (composer.empty()) return fail("nothing to go on with");
    auto set = std::make_shared<ChangeSet>(composer.take(&origin));
    later_ = {};
    if (!all && set->to - set->from > 1 && now - waitingSince_ < kLongestWait) {
        if (!carriersKnown_) findCarriers(origin);
        split(*set, origin, budget);
    }
    if (auto ok = scene_.apply(set); !ok) return std::unexpected(ok.error());
    if (!waits() && scene_.hash() != set->hash) return fail("frames that lead elsewhere than they say");
    set->hash = scene_.hash();
    return std::shared_ptr<const ChangeSet>(std::move(set));
}

}  // namespace rtsg
