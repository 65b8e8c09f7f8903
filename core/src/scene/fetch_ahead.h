// Fetching ahead: what a long list of nodes or events needs comes from memory while those before it are at work, each
// part of it as soon as the one that names it is near. Inlined into the loops of this folder.
#pragma once

#include "state.h"

namespace rtsg {

namespace fetching {

inline constexpr std::size_t kNode = 8, kLists = 4, kTargets = 11, kGroup = 14;

}  // namespace fetching

inline void Scene::State::fetchNode(NodeId id) const {
    const Node* node = find(id);
    if (!node) return;
    const auto* bytes = reinterpret_cast<const std::byte*>(node);
    for (std::size_t i = 0; i < 3; ++i) __builtin_prefetch(bytes + 64 * i, 1);
}

/// Precondition: its node is near.
inline void Scene::State::fetchLists(NodeId id) const {
    const Node* node = find(id);
    if (!node) return;
    if (node->links_) __builtin_prefetch(node->links_.get());
    for (const FieldIndex i : node->type_->sharedFields()) {
        const std::byte* header = nullptr;
        std::memcpy(&header, node->block() + node->type_->slot(i).offset, sizeof(header));
        if (header) __builtin_prefetch(header), __builtin_prefetch(header + 64);
    }
}

inline void Scene::State::fetchAhead(std::span<const NodeId> nodes, std::size_t i) const {
    if (i + fetching::kNode < nodes.size()) fetchNode(nodes[i + fetching::kNode]);
    if (i + fetching::kLists < nodes.size()) fetchLists(nodes[i + fetching::kLists]);
}

inline void Scene::State::fetchAhead(std::span<const OutgoingRoute> routes, std::size_t i) const {
    if (i + fetching::kNode < routes.size()) fetchNode(routes[i + fetching::kNode].to.node);
    if (i + fetching::kLists < routes.size()) fetchLists(routes[i + fetching::kLists].to.node);
}

inline void Scene::State::fetchAhead(std::span<const Emission> waiting, std::size_t i) const {
    const auto groupAt = [&](std::size_t ahead) -> const RouteGroup* {
        return i + ahead < waiting.size() && waiting[i + ahead].linkEdits == linkEdits ? waiting[i + ahead].group
                                                                                       : nullptr;
    };
    if (const RouteGroup* group = groupAt(fetching::kGroup)) __builtin_prefetch(group, 1);
    if (const RouteGroup* group = groupAt(fetching::kTargets)) __builtin_prefetch(group->targets.items().data());
    // Of several some may be another thread's.
    const auto target = [](const RouteGroup* group) {
        return group && group->targets.items().size() == 1 ? group->targets.items()[0].to.node : NodeId{};
    };
    if (const NodeId id = target(groupAt(fetching::kNode))) fetchNode(id);
    if (const NodeId id = target(groupAt(fetching::kLists))) fetchLists(id);
}

}  // namespace rtsg
