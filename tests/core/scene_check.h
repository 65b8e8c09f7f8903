// Helpers for tests of documents: text to scene, a canonical text of a scene that does not depend on node numbers.
#pragma once

#include <algorithm>
#include <map>
#include <set>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <rtsg/core/field_text.h>
#include <rtsg/core/scene.h>
#include <rtsg/documents/loader.h>

namespace rtsg::test {

inline std::string allText(const Diagnostics& diagnostics) {
    std::string text;
    for (const Diagnostic& one : diagnostics.all()) text += one.format() + '\n';
    return text;
}

/// The whole scene by structure: nodes are numbered in the order of a walk from the root, so two loads of one
/// document, or of it and its saved copy, agree whatever numbers their nodes got.
class CanonicalText {
  public:
    explicit CanonicalText(const Scene& scene) : scene_(scene) {
        visit(scene.root());
        for (const Node* node : order_) routesOf(*node);
        std::ranges::sort(routes_);
        for (const std::string& route : routes_) text_ += route;
    }
    const std::string& text() const { return text_; }

  private:
    std::string label(NodeId id) {
        if (!id) return "NULL";
        const auto found = numbers_.find(id.value);
        return found == numbers_.end() ? "?" : fmt::format("#{}", found->second);
    }
    void visit(NodeId start) {
        std::vector<NodeId> pending{start};
        while (!pending.empty()) {
            const NodeId id = pending.back();
            pending.pop_back();
            if (!numbers_.emplace(id.value, numbers_.size()).second) continue;
            const Node& node = scene_.node(id);
            order_.push_back(&node);
            std::vector<NodeId> children;
            for (const FieldIndex f : node.type().nodeFields()) {
                if (!node.type().fields[f].readable()) continue;
                if (node.type().fields[f].type == FieldType::SFNode) {
                    if (const NodeId one = *static_cast<const NodeId*>(node.storage(f))) children.push_back(one);
                } else {
                    for (const NodeId one : *static_cast<const Array<NodeId>*>(node.storage(f)))
                        children.push_back(one);
                }
            }
            pending.insert(pending.end(), children.rbegin(), children.rend());
        }
        for (const Node* node : order_) describe(*node);
    }
    void describe(const Node& node) {
        text_ += fmt::format("{} {} {} in {}\n", label(node.id()), node.type().name, scene_.name(node.id()),
                             label(node.scope()));
        for (std::size_t i = 0; i < node.type().fields.size(); ++i) {
            const auto f = static_cast<FieldIndex>(i);
            const FieldDef& def = node.type().fields[i];
            if (!def.readable() || node.isDefault(f)) continue;
            // Writers must name a profile: Full where the scene has none.
            if (def.hidden && def.name == "profile" && node.value(f) == Value(String("Full"))) continue;
            text_ += fmt::format("  {}{} ", def.hidden ? "." : "", def.name);
            if (def.type == FieldType::SFNode) {
                text_ += label(*static_cast<const NodeId*>(node.storage(f)));
            } else if (def.type == FieldType::MFNode) {
                for (const NodeId one : *static_cast<const Array<NodeId>*>(node.storage(f))) text_ += label(one) + ' ';
            } else {
                text_ += printFieldText(node.value(f));
            }
            text_ += '\n';
        }
    }
    void routesOf(const Node& node) {
        for (const Route& route : scene_.routesFrom(node.id()))
            routes_.push_back(fmt::format("{} {}.{} TO {}.{}\n", route.isConnection ? "IS" : "ROUTE", label(node.id()),
                                          node.type().fields[route.fromField].name, label(route.toNode),
                                          scene_.node(route.toNode).type().fields[route.toField].name));
    }

    const Scene& scene_;
    std::map<std::uint32_t, std::size_t> numbers_;
    std::vector<const Node*> order_;
    std::vector<std::string> routes_;
    std::string text_;
};

inline std::string canonicalText(const Scene& scene) {
    return CanonicalText(scene).text();
}

/// A scene from ClassicVRML without its header; the header's line counts as line 1.
struct Loaded {
    Scene scene;
    Diagnostics diagnostics{"test.x3dv"};
    bool usable = false;

    explicit Loaded(std::string_view body, const std::filesystem::path& base = {}) {
        usable = loadText(scene, "#X3D V4.0 utf8\n" + std::string(body), diagnostics, base);
    }
    NodeId named(std::string_view name, NodeId scope = {}) const { return scene.findName(name, scope); }
    FieldIndex field(NodeId id, std::string_view name) const { return scene.node(id).type().find(name); }
    /// ClassicVRML text of a field; nodes as #number.
    std::string get(NodeId id, std::string_view name) const {
        return printFieldText(scene.node(id).value(field(id, name)));
    }
    std::string get(std::string_view def, std::string_view name) const { return get(named(def), name); }
    Array<NodeId> nodes(NodeId id, std::string_view name) const {
        return scene.node(id).value(scene.node(id).type().findExact(name)).as<Array<NodeId>>();
    }
    NodeId only(NodeId id, std::string_view name) const { return scene.node(id).value(field(id, name)).as<NodeId>(); }
    std::string problems() const { return allText(diagnostics); }
    std::vector<NodeId> roots() const {
        const Array<NodeId> all = nodes(scene.root(), "children");
        return {all.begin(), all.end()};
    }
};

}  // namespace rtsg::test
