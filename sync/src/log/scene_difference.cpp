// Finds the first difference of two scenes, preferring a cause to its effects.
#include <algorithm>
#include <tuple>

#include <fmt/format.h>

#include <rtsg/core/field_text.h>
#include <rtsg/sync/replay.h>

#include "codec/node_label.h"
#include "excerpt.h"

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

class Comparison {
  public:
    Comparison(const Scene& a, const Scene& b, DifferenceWords words) : a_(a), b_(b), words_(words) {}

    struct Found {
        std::string field, text;
    };
    std::optional<Found> compareNode(NodeId id) const {
        const Node *x = a_.find(id), *y = b_.find(id);
        if (!x || !y) return Found{"existence", fmt::format("a {} only in {}", (x ? x : y)->type().name, side(x))};
        if (x->type().name != y->type().name || x->type().fields.size() != y->type().fields.size())
            return Found{"type", differ(x->type().name, y->type().name)};
        if (x->scope() != y->scope())
            return Found{"scope", differ(nodeLabel(a_, x->scope()), nodeLabel(b_, y->scope()))};
        for (FieldIndex i = 0; i < x->type().fields.size(); ++i) {
            const FieldDef &f = x->type().fields[i], &g = y->type().fields[i];
            if (!haveOneType(f, g) || f.name != g.name) return Found{"type", "other fields"};
            if (!f.readable() || equalStorage(f.type, x->storage(i), y->storage(i))) continue;
            const std::string p = printFieldText(x->value(i)), q = printFieldText(y->value(i));
            return Found{f.name, differ(excerpt(p, q), excerpt(q, p))};
        }
        if (a_.name(id) != b_.name(id)) return Found{"name", differ(quoted(a_.name(id)), quoted(b_.name(id)))};
        const std::vector<Route> p = sortedRoutes(a_, id), q = sortedRoutes(b_, id);
        if (p == q) return std::nullopt;
        std::vector<Route> onlyA, onlyB;
        for (const Route& r : p)
            if (std::ranges::find(q, r) == q.end()) onlyA.push_back(r);
        for (const Route& r : q)
            if (std::ranges::find(p, r) == p.end()) onlyB.push_back(r);
        const bool first = !onlyA.empty();
        return Found{"routes", fmt::format("{} only in {}", routeText(first ? a_ : b_, (first ? onlyA : onlyB).front()),
                                           side(first))};
    }

  private:
    std::string_view side(bool first) const { return first ? words_.a : words_.b; }
    std::string differ(std::string_view x, std::string_view y) const {
        return fmt::format("{} {}, {} {}", words_.a, x, words_.b, y);
    }
    static std::string quoted(std::string_view text) { return fmt::format("'{}'", text); }
    static std::string routeText(const Scene& scene, const Route& r) {
        const auto field = [&](NodeId node, FieldIndex index) {
            return fmt::format("{}.{}", nodeLabel(scene, node), scene.node(node).type().fields[index].name);
        };
        return fmt::format("{} {} TO {}", r.isConnection ? "IS" : "ROUTE", field(r.fromNode, r.fromField),
                           field(r.toNode, r.toField));
    }

    const Scene &a_, &b_;
    DifferenceWords words_;
};

/// Only this many differences are searched for the cause.
constexpr std::size_t kMaxDifferences = 4096;

}  // namespace

std::string Divergence::format() const {
    const bool named = !node.empty() || !field.empty();
    const std::string what =
        named ? fmt::format("{}.{}", node.empty() ? "?" : node, field.empty() ? "?" : field) : std::string();
    if (frame == 0) return named ? fmt::format("{}: {}", what, text) : text;
    return fmt::format("frame {} (t = {} s){}{}: {}", frame, time, named ? ", " : "", what, text);
}

std::optional<Divergence> firstDifference(const Scene& a, const Scene& b, DifferenceWords words) {
    const std::vector<NodeId> ofA = nodesOf(a), ofB = nodesOf(b);
    std::vector<NodeId> all;
    std::ranges::set_union(ofA, ofB, std::back_inserter(all));
    const Comparison comparison(a, b, words);
    std::vector<std::pair<NodeId, Comparison::Found>> found;
    for (const NodeId id : all) {
        if (auto difference = comparison.compareNode(id)) found.emplace_back(id, std::move(*difference));
        if (found.size() == kMaxDifferences) break;
    }
    if (found.empty()) return std::nullopt;
    const auto differs = [&](NodeId id) {
        return std::ranges::binary_search(found, id, {}, [](const auto& f) { return f.first; });
    };
    auto cause = std::ranges::find_if(found, [&](const auto& f) {
        if (!a.find(f.first)) return true;
        return std::ranges::none_of(a.routesTo(f.first), [&](const Route& r) { return differs(r.fromNode); });
    });
    if (cause == found.end()) cause = found.begin();  // the routes form a circle
    return Divergence{a.sequence(), a.now(), nodeLabel(a.find(cause->first) ? a : b, cause->first),
                      std::move(cause->second.field), std::move(cause->second.text)};
}

}  // namespace rtsg
