// Levels of detail: the visible one and the one for sound, and updates when an eye has moved.
#include <rtsg/core/x3d.h>

#include "flattener_impl.h"

namespace rtsg {

Flattener::Impl::Levels Flattener::Impl::levelsOf(std::uint32_t index) {
    const Node& node = scene->node(tree[index].node);
    const TypeRole& role = roles.of(node);
    const auto child = [&](std::uint32_t level) {
        std::vector<NodeId> one;
        flatten::desiredChildren(node, role, level, one);
        return one.empty() ? NodeId{} : one[0];
    };
    const NodeId seen = child(tree[index].level);
    return {seen, tree[index].level == 0 ? seen : child(0)};
}

void Flattener::Impl::setSenses(Occurrence& child, const Occurrence& parent) {
    child.seen = parent.seen && !child.isProxy;
    child.heard = parent.heard && !child.isProxy;
    child.felt = parent.felt;
}

void Flattener::Impl::setSenses(Occurrence& child, const Occurrence& parent, const Levels& shown) {
    child.seen = parent.seen && child.node == shown.seen;
    child.heard = parent.heard && child.node == shown.heard;
    child.felt = parent.felt && child.node == shown.seen;
}

void Flattener::Impl::chooseChildren(std::uint32_t index, const Node& node, const TypeRole& role) {
    wanted.clear();
    if (role.role != Role::level) {
        flatten::desiredChildren(node, role, tree[index].level, wanted);
        if (role.role == Role::all && node.is(x3d::Viewport::type)) wanted.push_back(node.id());
        if (tree[index].hasProxy)
            if (const NodeId proxy = flatten::proxyOf(node, role)) wanted.push_back(proxy);
        return;
    }
    const Levels shown = levelsOf(index);
    if (shown.seen && tree[index].felt) wanted.push_back(shown.seen);
    if (shown.heard && tree[index].heard && (shown.heard != shown.seen || !tree[index].felt))
        wanted.push_back(shown.heard);
}

bool Flattener::Impl::isSensed(const Occurrence& o, PlacedKind kind) {
    return kind == PlacedKind::sound || kind == PlacedKind::listener ? o.heard : o.seen;
}

void Flattener::Impl::spreadSenses(std::uint32_t level) {
    const Levels shown = levelsOf(level);
    std::vector<std::uint32_t> path;
    const auto below = [&](std::uint32_t index) {
        for (std::uint32_t c = tree[index].firstChild; c != kNone; c = tree[c].next) path.push_back(c);
    };
    below(level);
    while (!path.empty()) {
        const std::uint32_t index = path.back();
        path.pop_back();
        Occurrence& o = tree[index];
        const bool seen = o.seen, heard = o.heard, felt = o.felt;
        const Occurrence& parent = tree[o.parent];
        if (o.parent == level)
            setSenses(o, parent, shown);
        else
            setSenses(o, parent);
        if (o.seen == seen && o.heard == heard && o.felt == felt) continue;
        touchBoxes(index);
        if (o.role == Role::level) {
            reconciling.push_back(index);
            continue;
        }
        const Node& node = scene->node(o.node);
        if (o.role == Role::shape && o.slot != kNone) {
            Instance& instance = instances.records[o.slot];
            instance.seen = o.seen, instance.heard = isHeard(o), instance.felt = o.felt;
            instances.markRebound(o.slot, stamp);
        } else if (o.role == Role::placed && isSensed(o, roles.of(node).kind) != (o.slot != kNone)) {
            dropPlaced(index);
            makePlaced(index, node, roles.of(node));
        }
        below(index);
    }
}

}  // namespace rtsg
