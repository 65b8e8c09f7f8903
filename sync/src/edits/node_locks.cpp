// Gives, renews and checks leases of nodes, and forgets those that have ended.
#include "node_locks.h"

#include <vector>

#include <fmt/format.h>

#include "codec/node_label.h"

namespace rtsg::mirror {

Result<> NodeLocks::lock(const Scene& scene, std::string_view author, std::span<const NodeId> nodes,
                         std::chrono::milliseconds lease, Clock::time_point now) {
    std::erase_if(locks_, [&](const auto& entry) { return entry.second.until <= now; });
    for (const NodeId node : nodes) {
        if (!scene.find(node)) return fail(fmt::format("no node {}", node.value));
        if (std::string why = refusal(scene, node, author, now); !why.empty()) return fail(std::move(why));
    }
    if (lease > std::chrono::milliseconds(0) && locks_.size() + nodes.size() > kMax)
        return fail("too many nodes are locked");
    for (const NodeId node : nodes) {
        if (lease > std::chrono::milliseconds(0))
            locks_.insert_or_assign(node.value, Lock{std::string(author), now + lease});
        else
            locks_.erase(node.value);
    }
    return {};
}

std::string NodeLocks::refusal(const Scene& scene, NodeId node, std::string_view author, Clock::time_point now) const {
    const auto found = locks_.find(node.value);
    if (found == locks_.end() || found->second.until <= now || found->second.author == author) return {};
    const std::chrono::duration<double> left = found->second.until - now;
    return fmt::format("{} is locked by {} for another {:.1f} s", nodeLabel(scene, node), found->second.author,
                       left.count());
}

std::string NodeLocks::refusal(const Scene& scene, const Change& change, std::string_view author,
                               Clock::time_point now) const {
    std::vector<NodeId> touched{change.node};
    const Node* node = scene.find(change.node);
    if (change.kind == ChangeKind::addRoute || change.kind == ChangeKind::removeRoute) {
        touched.push_back(change.other);
    } else if (change.kind == ChangeKind::setName && change.value.holds<String>()) {
        touched.push_back(scene.findName(change.value.as<String>().view(), node ? node->scope() : NodeId{}));
    } else if (change.kind == ChangeKind::destroyNode && node) {
        for (const ParentRef& parent : scene.parents(change.node)) touched.push_back(parent.node);
        for (const Route& route : scene.routesFrom(change.node)) touched.push_back(route.toNode);
        for (const Route& route : scene.routesTo(change.node)) touched.push_back(route.fromNode);
    }
    for (const NodeId one : touched)
        if (std::string why = refusal(scene, one, author, now); !why.empty()) return why;
    return {};
}

}  // namespace rtsg::mirror
