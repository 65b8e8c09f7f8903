// Finds out whether a change could make the origin open a file, by the field itself or along routes and IS connections.
#include "code_guard.h"

#include <string_view>
#include <vector>

#include <fmt/format.h>

namespace rtsg::mirror {

bool isScript(const NodeType& type) {
    // An instance of a PROTO that stands for a Script has only the fields that the PROTO's author exposes.
    const bool instance = type.kind == NodeType::Kind::proto || type.kind == NodeType::Kind::externProto;
    return !instance && type.isA("X3DScriptNode");
}

std::string nameIfLoading(const NodeType& type, FieldIndex field) {
    if (field >= type.fields.size()) return {};
    const std::string_view name = type.fields[field].name;
    // All fields that name files end like this (url, frontUrl, child1Url), in the standard and in authors' PROTOs.
    const bool url = name == "url" || name.ends_with("Url");
    const bool starts = name == "load" || name == "autoRefresh" || name == "autoRefreshTimeLimit";
    return url || (starts && type.isA("X3DUrlObject")) ? fmt::format("{}.{}", type.name, name) : std::string();
}

std::string CodeGuard::reachedFrom(NodeId node, FieldIndex field) {
    const auto key = [](NodeId n, FieldIndex f) { return std::uint64_t{n.value} << 16 | f; };
    std::vector<std::pair<NodeId, FieldIndex>> open{{node, field}};
    std::vector<std::uint64_t> seen;
    while (!open.empty()) {
        const auto [at, through] = open.back();
        open.pop_back();
        const Node* here = scene_.find(at);
        if (!here || !harmless_.insert(key(at, through)).second) continue;
        seen.push_back(key(at, through));
        if (std::string name = nameIfLoading(here->type(), through); !name.empty()) {
            for (const std::uint64_t k : seen) harmless_.erase(k);
            return name;
        }
        for (const Route& route : scene_.routesFrom(at))
            if (route.fromField == through) open.emplace_back(route.toNode, route.toField);
    }
    return {};
}

}  // namespace rtsg::mirror
