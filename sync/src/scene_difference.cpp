#include <algorithm>

#include <fmt/format.h>

#include <rtsg/sync/replay.h>

#include "node_label.h"

namespace rtsg {

std::string nodeLabel(const Scene& scene, NodeId node) {
    const std::string_view name = scene.name(node);
    return name.empty() ? fmt::format("#{}", node.value) : std::string(name);
}

namespace {

std::vector<NodeId> nodesOf(const Scene& scene) {
    std::vector<NodeId> result;
    result.reserve(scene.nodeCount());
    scene.forEachNode([&](const Node& node) { result.push_back(node.id()); });
    return result;
}

std::vector<Route> sortedRoutes(const Scene& scene, NodeId node) {
    std::vector<Route> routes = scene.routesFrom(node);
    std::ranges::sort(routes, {},
                      [](const Route& r) { return std::tuple(r.fromField, r.toNode, r.toField, r.isConnection); });
    return routes;
}

/// Name of what differs and how, or an empty name.
std::pair<std::string, std::string> compareNode(const Scene& a, const Scene& b, NodeId id) {
    const Node *x = a.find(id), *y = b.find(id);
    if (!x || !y) return {"existence", fmt::format("only in the {}", x ? "first" : "second")};
    if (x->type().name != y->type().name || x->type().fields.size() != y->type().fields.size())
        return {"type", fmt::format("{} and {}", x->type().name, y->type().name)};
    if (x->scope() != y->scope()) return {"scope", fmt::format("#{} and #{}", x->scope().value, y->scope().value)};
    for (FieldIndex i = 0; i < x->type().fields.size(); ++i) {
        const FieldDef &f = x->type().fields[i], &g = y->type().fields[i];
        if (f.type != g.type || f.name != g.name) return {"type", "other fields"};
        if (f.readable() && !equalStorage(f.type, x->storage(i), y->storage(i))) return {f.name, "other value"};
    }
    if (a.name(id) != b.name(id)) return {"name", fmt::format("'{}' and '{}'", a.name(id), b.name(id))};
    if (sortedRoutes(a, id) != sortedRoutes(b, id)) return {"routes", "other routes"};
    return {};
}

}  // namespace

std::optional<Divergence> firstDifference(const Scene& a, const Scene& b) {
    const std::vector<NodeId> ofA = nodesOf(a), ofB = nodesOf(b);
    std::vector<NodeId> all;
    std::ranges::set_union(ofA, ofB, std::back_inserter(all));
    for (const NodeId id : all) {
        auto [field, text] = compareNode(a, b, id);
        if (field.empty()) continue;
        return Divergence{a.sequence(), a.now(), nodeLabel(a.find(id) ? a : b, id), std::move(field), std::move(text)};
    }
    return std::nullopt;
}

}  // namespace rtsg
