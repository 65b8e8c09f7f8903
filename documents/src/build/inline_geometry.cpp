// Finds the geometry of an InlineGeometry, and removes the rest of its document.
#include "inline_geometry.h"

#include <algorithm>
#include <numbers>
#include <set>

#include <fmt/format.h>

#include <rtsg/core/resource.h>
#include <rtsg/core/x3d.h>

#include "commands/document_head.h"
#include "document_match.h"

namespace rtsg {

namespace {

using Holder = x3d::InlineGeometry;

/// All geometries in the order of the document, each once. Not those in bodies of PROTOs and Inlines, but the instance
/// of a PROTO whose body is a geometry.
std::vector<NodeId> geometriesBelow(const Scene& scene, std::span<const NodeId> roots) {
    std::vector<NodeId> found, pending(roots.rbegin(), roots.rend());
    std::set<std::uint32_t> seen;
    while (!pending.empty()) {
        const Node* node = scene.find(pending.back());
        pending.pop_back();
        if (!node || !seen.insert(node->id().value).second) continue;
        const Node* meant = scene.effectiveNode(node->id());
        if (node->type().isA("X3DGeometryNode") || (meant && meant->type().isA("X3DGeometryNode"))) {
            found.push_back(node->id());
            continue;
        }
        std::vector<NodeId> below;
        for (const FieldIndex field : node->type().nodeFields()) {
            const FieldDef& def = node->type().fields[field];
            if (def.hidden || !def.readable()) continue;
            std::ranges::copy(nodesIn(*node, field), std::back_inserter(below));
        }
        pending.insert(pending.end(), below.rbegin(), below.rend());
    }
    return found;
}

template <class T>
bool setHint(Scene& scene, const Node& node, std::string_view name, FieldType type, T wanted) {
    const FieldIndex field = node.type().find(name);
    if (field == kNoField || node.type().fields[field].type != type) return false;
    if (*static_cast<const T*>(node.storage(field)) == wanted) return false;
    return scene.setField(node.id(), field, Value(wanted)).has_value();
}

}  // namespace

std::vector<NodeId> ownContent(const Scene& scene, NodeId holder, std::span<const NodeId> roots) {
    std::set<std::uint32_t> inside{holder.value};
    std::vector<NodeId> pending(roots.begin(), roots.end()), own;
    while (!pending.empty()) {
        const Node* node = scene.find(pending.back());
        pending.pop_back();
        if (!node || !inside.contains(node->scope().value) || !inside.insert(node->id().value).second) continue;
        own.push_back(node->id());
        for (const FieldIndex field : node->type().nodeFields())
            if (node->type().fields[field].readable())
                std::ranges::copy(nodesIn(*node, field), std::back_inserter(pending));
    }
    return own;
}

bool keepGeometry(Scene& scene, NodeId holder, std::string_view url, Diagnostics& diagnostics, SourceLocation where) {
    const Array<NodeId> roots = scene.node(holder).get(Holder::body);
    std::vector<NodeId> gone = ownContent(scene, holder, roots);
    const std::vector<NodeId> geometries = geometriesBelow(scene, roots);
    const std::span<const NodeId> kept = std::span(geometries).first(std::min<std::size_t>(geometries.size(), 1));
    std::set<std::uint32_t> stays;
    for (const NodeId id : ownContent(scene, holder, kept)) stays.insert(id.value);
    setHidden(scene, holder, Holder::body.index, Value(Array<NodeId>(kept)));
    std::erase_if(gone, [&](NodeId id) { return stays.contains(id.value); });
    for (const NodeId id : gone)
        if (auto ok = scene.destroyNode(id); !ok) diagnostics.error({}, ok.error().text);
    if (kept.empty()) {
        setHidden(scene, holder, Holder::loadedUrl.index, Value(String()));
        diagnostics.error(where, fmt::format("InlineGeometry: '{}' has no geometry", urlForMessage(url)));
        return false;
    }
    if (geometries.size() > 1)
        diagnostics.warning(where, fmt::format("InlineGeometry: '{}' has {} geometries: the first one is taken",
                                               urlForMessage(url), geometries.size()));
    applyGeometryHints(scene, scene.node(holder));
    return true;
}

bool applyGeometryHints(Scene& scene, const Node& holder) {
    const Node* geometry = scene.effectiveNode(holder.id());
    if (!geometry) return false;
    const bool smooth = holder.get(Holder::smooth);
    bool changed = setHint(scene, *geometry, "solid", FieldType::SFBool, holder.get(Holder::solid));
    const FieldIndex normal = geometry->type().find("normal");
    const bool hasNormals = normal != kNoField && geometry->type().fields[normal].type == FieldType::SFNode &&
                            *static_cast<const NodeId*>(geometry->storage(normal));
    const float crease = smooth ? std::numbers::pi_v<float> : 0;
    if (geometry->type().find("creaseAngle") != kNoField)
        changed = setHint(scene, *geometry, "creaseAngle", FieldType::SFFloat, crease) || changed;
    else if (!hasNormals && geometry->type().isA("X3DComposedGeometryNode"))
        changed = setHint(scene, *geometry, "normalPerVertex", FieldType::SFBool, smooth) || changed;
    return changed;
}

}  // namespace rtsg
