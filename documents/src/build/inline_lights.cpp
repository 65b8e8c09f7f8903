// Finds the lights that end at an Inline, and checks whether making them local has the same effect.
#include "inline_lights.h"

#include <algorithm>
#include <unordered_map>
#include <unordered_set>

#include <fmt/format.h>

#include <rtsg/core/x3d.h>

namespace rtsg::detail {

namespace {

class InlineLights {
  public:
    InlineLights(Scene& scene, const std::vector<SourceLocation>& locations, Diagnostics& diagnostics)
        : scene_(scene), diagnostics_(diagnostics) {
        std::vector<NodeId> own;
        scene.forEachNode([&](const Node& node) {
            if (node.is(x3d::Inline::type) && !node.scope()) own.push_back(node.id());
        });
        // A node that was refused would make others' places wrong.
        if (own.size() != locations.size()) return;
        for (std::size_t i = 0; i < own.size(); ++i) locations_.emplace(own[i].value, locations[i]);
    }

    void keep() {
        std::vector<NodeId> lights;
        scene_.forEachNode([&](const Node& node) {
            if (isGlobalLight(node)) lights.push_back(node.id());
        });
        for (const NodeId light : lights) keepLight(light);
    }

  private:
    static bool isGlobalLight(const Node& node) {
        if (!node.type().isA("X3DLightNode")) return false;
        const FieldIndex global = node.type().findExact("global");
        return global != kNoField && *static_cast<const bool*>(node.storage(global));
    }
    bool isLimit(NodeId id) const {
        const Node& node = scene_.node(id);
        return node.is(x3d::Inline::type) && !node.get(x3d::Inline::global);
    }

    /// Visits the nodes below a node in the hierarchy; below a PROTO instance that is the first node of its body.
    template <class Visit>
    static void forEachBelow(const Node& node, const Visit& visit) {
        const NodeType& type = node.type();
        const bool isInstance = type.kind == NodeType::Kind::proto || type.kind == NodeType::Kind::externProto;
        const auto see = [&](FieldIndex field) {
            if (type.fields[field].type == FieldType::SFNode) {
                visit(*static_cast<const NodeId*>(node.storage(field)));
                return;
            }
            const auto& nodes = *static_cast<const Array<NodeId>*>(node.storage(field));
            for (std::size_t i = 0; i < (isInstance ? std::min<std::size_t>(nodes.size(), 1) : nodes.size()); ++i)
                visit(nodes[i]);
        };
        if (isInstance && type.body() != kNoField) return see(type.body());
        for (const FieldIndex field : type.below) see(field);
    }
    std::vector<NodeId> parentsOf(NodeId id) const {
        std::vector<NodeId> result;
        for (const ParentRef& parent : scene_.parents(id)) {
            bool isBelow = false;
            const Node& node = scene_.node(parent.node);
            forEachBelow(node, [&](NodeId child) { isBelow = isBelow || child == id; });
            if (isBelow) result.push_back(parent.node);
        }
        return result;
    }

    /// Whether there is anything at or below a node that light falls on.
    bool hasLit(NodeId top) {
        std::vector<NodeId> waiting{top};
        std::unordered_set<std::uint32_t> seen;
        while (!waiting.empty()) {
            const Node* node = scene_.find(waiting.back());
            waiting.pop_back();
            if (!node || !seen.insert(node->id().value).second) continue;
            if (node->type().role == "shape" || node->type().isA("X3DShapeNode")) return true;
            forEachBelow(*node, [&](NodeId id) { waiting.push_back(id); });
        }
        return false;
    }

    /// Whether all that is lit below `top` is below `inner`, to which there is one way only.
    bool holdsAll(NodeId inner, NodeId top) {
        while (inner != top) {
            const std::vector<NodeId> parents = parentsOf(inner);
            if (parents.size() != 1) return false;
            bool besides = false;
            forEachBelow(scene_.node(parents[0]), [&](NodeId id) { besides = besides || (id != inner && hasLit(id)); });
            if (besides) return false;
            inner = parents[0];
        }
        return true;
    }

    /// The Inlines that a light's reach ends at; an invalid one stands for the document.
    std::vector<NodeId> limitsOf(NodeId light) const {
        std::vector<NodeId> limits, waiting{light};
        std::unordered_set<std::uint32_t> seen;
        while (!waiting.empty()) {
            const NodeId id = waiting.back();
            waiting.pop_back();
            if (!seen.insert(id.value).second) continue;
            if (isLimit(id))
                limits.push_back(id);
            else if (id == scene_.root())
                limits.emplace_back();
            else
                for (const NodeId parent : parentsOf(id)) waiting.push_back(parent);
        }
        return limits;
    }

    bool canBeLocal(NodeId light, NodeId limit) {
        const Node& node = scene_.node(light);
        const FieldIndex global = node.type().findExact("global");
        // A light in a PROTO's body cannot be changed here: the body is declared once for all instances.
        for (NodeId scope = node.scope(); scope; scope = scene_.node(scope).scope())
            if (!scene_.node(scope).is(x3d::Inline::type)) return false;
        if (std::ranges::any_of(scene_.routesTo(light), [&](const Route& r) { return r.toField == global; }))
            return false;
        const std::vector<NodeId> parents = parentsOf(light);
        return parents.size() == 1 && holdsAll(parents[0], limit);
    }

    void keepLight(NodeId light) {
        const std::vector<NodeId> limits = limitsOf(light);
        if (std::ranges::none_of(limits, [](NodeId limit) { return static_cast<bool>(limit); })) return;
        if (limits.size() == 1) {
            if (canBeLocal(light, limits[0])) {
                const FieldIndex global = scene_.node(light).type().findExact("global");
                if (scene_.setField(light, global, Value(false))) return;
            }
            if (holdsAll(limits[0], scene_.root())) return;
        }
        for (const NodeId limit : limits)
            if (limit) report(light, limit);
    }

    void report(NodeId light, NodeId limit) {
        NodeId outermost = limit;
        while (const NodeId scope = scene_.node(outermost).scope()) outermost = scope;
        if (!reported_.insert(outermost.value).second) return;
        const auto found = locations_.find(outermost.value);
        const auto named = [&](NodeId id) {
            const std::string_view name = scene_.name(id);
            return fmt::format("{}{}{}", scene_.node(id).type().name, name.empty() ? "" : " ", name);
        };
        diagnostics_.warning(found == locations_.end() ? SourceLocation{} : found->second,
                             fmt::format("{} of the {} shines beyond it now, as no local light has the same effect",
                                         named(light), named(outermost)));
    }

    Scene& scene_;
    Diagnostics& diagnostics_;
    std::unordered_map<std::uint32_t, SourceLocation> locations_;
    std::unordered_set<std::uint32_t> reported_;
};

}  // namespace

void keepInlineLights(Scene& scene, const std::vector<SourceLocation>& locations, Diagnostics& diagnostics) {
    InlineLights(scene, locations, diagnostics).keep();
}

}  // namespace rtsg::detail
