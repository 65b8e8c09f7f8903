// Canonical text of a scene's whole state: one line a node, field, name and route, in NodeId order.
#include <algorithm>

#include <fmt/format.h>

#include <rtsg/core/field_text.h>

#include "state.h"

namespace rtsg {

std::string Scene::dump() const {
    std::string text = fmt::format("state {} t {} hash {}\n", sequence(), now(), hash().hex());
    for (std::size_t i = builtinTypes().size(); i < typeCount(); ++i) {
        const NodeType& t = type(TypeIndex{static_cast<std::uint16_t>(i)});
        text += fmt::format("type {} {} kind {}\n", i, t.name, static_cast<int>(t.kind));
        for (const FieldDef& f : t.fields)
            text += fmt::format("  {} {} access {}\n", info(f.type).name, f.name, static_cast<int>(f.access));
    }
    forEachNode([&](const Node& node) {
        text += fmt::format("node {} {}", node.id().value, node.type().name);
        if (node.scope()) text += fmt::format(" in {}", node.scope().value);
        if (const auto n = name(node.id()); !n.empty()) text += fmt::format(" DEF {}", n);
        text += '\n';
        for (FieldIndex i = 0; i < node.type().fields.size(); ++i) {
            const FieldDef& def = node.type().fields[i];
            if (!def.readable() || node.isDefault(i)) continue;
            text += fmt::format("  {} ", def.name);
            if (sf(def.type) == FieldType::SFNode) {
                const auto append = [&](NodeId id) { text += fmt::format("#{} ", id.value); };
                if (def.type == FieldType::SFNode)
                    append(*static_cast<const NodeId*>(node.storage(i)));
                else
                    for (const NodeId id : *static_cast<const Array<NodeId>*>(node.storage(i))) append(id);
            } else {
                appendFieldText(text, node.value(i), TextSyntax::classicVrml);
            }
            text += '\n';
        }
        // The order among routes of different fields is no part of the state; that among routes of one field is.
        std::vector<Route> routes = routesFrom(node.id());
        std::ranges::stable_sort(routes, {}, &Route::fromField);
        for (const Route& r : routes)
            text += fmt::format("  {} {} -> #{} {}\n", r.isConnection ? "IS" : "ROUTE",
                                node.type().fields[r.fromField].name, r.toNode.value,
                                this->node(r.toNode).type().fields[r.toField].name);
    });
    return text;
}

}  // namespace rtsg
