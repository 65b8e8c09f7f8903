// Finds the differences of two documents by walking both trees side by side.
#include <algorithm>
#include <set>
#include <unordered_map>
#include <unordered_set>

#include <fmt/format.h>

#include <rtsg/core/field_text.h>
#include <rtsg/sync/field_comparison.h>

#include "excerpt.h"

namespace rtsg {

namespace {

class TreeDifference {
  public:
    TreeDifference(const Scene& a, const Scene& b, std::size_t maximum, DifferenceWords words)
        : a_(a), b_(b), maximum_(maximum), words_(words) {}

    std::vector<Divergence> run() {
        // Uses its own stack, because documents may be deeper than the call stack allows.
        push(a_.root(), b_.root(), "");
        while (!waiting_.empty() && !full()) {
            const Pair pair = std::move(waiting_.back());
            waiting_.pop_back();
            compare(pair);
        }
        if (!full()) compareRoutes();
        return std::move(found_);
    }

  private:
    struct Pair {
        NodeId a, b;
        std::string path;  // how to name the node if it has no DEF name
    };
    using Nodes = Array<NodeId>;

    bool full() const { return found_.size() >= maximum_; }
    void note(std::string node, std::string field, std::string text) {
        if (!full()) found_.push_back({a_.sequence(), a_.now(), std::move(node), std::move(field), std::move(text)});
    }
    std::string both(std::string_view x, std::string_view y) const {
        return fmt::format("{} {}, {} {}", words_.a, x, words_.b, y);
    }
    static std::string label(const Scene& scene, NodeId id, const std::string& path) {
        const std::string_view name = scene.name(id);
        return name.empty() ? path : std::string(name);
    }
    static std::string kind(const Scene& scene, NodeId id) {
        if (!id) return "NULL";
        const std::string_view name = scene.name(id);
        return name.empty() ? scene.node(id).type().name : fmt::format("{} {}", scene.node(id).type().name, name);
    }
    /// Compares each pair once, even if it is used in several places. Of a long way only the end is kept, or a deep
    /// document would take memory by the square of its depth.
    void push(NodeId x, NodeId y, std::string path) {
        constexpr std::size_t longest = 2000, kept = 1000;
        if (path.size() > longest) {
            const std::size_t dot = path.find('.', path.size() - kept);
            path = "..." + path.substr(dot == path.npos ? path.size() - kept : dot);
        }
        if (seen_.insert(std::uint64_t{x.value} << 32 | y.value).second) waiting_.push_back({x, y, std::move(path)});
    }

    void compare(const Pair& pair) {
        const Node &x = a_.node(pair.a), &y = b_.node(pair.b);
        const std::string where = label(a_, pair.a, pair.path);
        if (a_.name(pair.a) != b_.name(pair.b))
            note(where.empty() ? pair.path : where, "name",
                 both(fmt::format("'{}'", a_.name(pair.a)), fmt::format("'{}'", b_.name(pair.b))));
        for (FieldIndex i = 0; i < x.type().fields.size(); ++i) {
            const FieldDef& f = x.type().fields[i];
            if (!f.readable() || f.hidden) continue;
            const FieldIndex k = y.type().findExact(f.name);
            if (k == kNoField || !haveOneType(y.type().fields[k], f)) {
                note(where, f.name, fmt::format("a field only in {}", words_.a));
                continue;
            }
            const std::string path = where.empty() ? f.name : fmt::format("{}.{}", where, f.name);
            if (f.type == FieldType::MFNode)
                compareChildren(x.value(i).as<Nodes>(), y.value(k).as<Nodes>(), where, f.name, path);
            else if (f.type == FieldType::SFNode)
                compareChild(x.value(i).as<NodeId>(), y.value(k).as<NodeId>(), where, f.name, path);
            else if (!equalStorage(f.type, x.storage(i), y.storage(k)))
                compareValues(x.value(i), y.value(k), where, f.name);
        }
    }
    void compareValues(const Value& x, const Value& y, const std::string& where, const std::string& field) {
        const std::string p = printFieldText(x), q = printFieldText(y);
        note(where, field, both(excerpt(p, q), excerpt(q, p)));
    }
    void compareChild(NodeId x, NodeId y, const std::string& where, const std::string& field, const std::string& path) {
        if (!x && !y) return;
        if (x && y && a_.node(x).type().name == b_.node(y).type().name) return push(x, y, path);
        note(where, field, both(kind(a_, x), kind(b_, y)));
    }

    /// Finds for each of `ours` its partner in `theirs`: first nodes of the same name, then nameless ones in order by
    /// type.
    std::vector<std::size_t> pairUp(const Nodes& ours, const Nodes& theirs) const {
        std::vector<std::size_t> partner(ours.size(), SIZE_MAX);
        std::vector<bool> taken(theirs.size());
        const auto take = [&](std::size_t i, std::size_t k) {
            partner[i] = k;
            taken[k] = true;
        };
        std::unordered_map<std::string_view, std::vector<std::size_t>>
            named;  // in reverse order; a node may stand twice
        for (std::size_t k = theirs.size(); k-- > 0;)
            if (const std::string_view name = b_.name(theirs[k]); !name.empty()) named[name].push_back(k);
        for (std::size_t i = 0; i < ours.size(); ++i) {
            const std::string_view name = a_.name(ours[i]);
            const auto found = name.empty() ? named.end() : named.find(name);
            if (found == named.end() || found->second.empty() ||
                a_.node(ours[i]).type().name != b_.node(theirs[found->second.back()]).type().name)
                continue;
            take(i, found->second.back());
            found->second.pop_back();
        }
        std::unordered_map<std::string_view, std::vector<std::size_t>> byType;  // in reverse order
        for (std::size_t k = theirs.size(); k-- > 0;)
            if (!taken[k]) byType[b_.node(theirs[k]).type().name].push_back(k);
        for (std::size_t i = 0; i < ours.size(); ++i) {
            if (partner[i] != SIZE_MAX) continue;
            auto& left = byType[a_.node(ours[i]).type().name];
            // Nodes with names in both documents are not paired with nodes of other names.
            if (left.empty() || (!a_.name(ours[i]).empty() && !b_.name(theirs[left.back()]).empty())) continue;
            take(i, left.back());
            left.pop_back();
        }
        return partner;
    }
    void compareChildren(const Nodes& ours, const Nodes& theirs, const std::string& where, const std::string& field,
                         const std::string& path) {
        const std::vector<std::size_t> partner = pairUp(ours, theirs);
        std::vector<bool> taken(theirs.size());
        std::size_t highest = 0;
        bool moved = false;
        for (std::size_t i = 0; i < ours.size(); ++i) {
            const std::size_t k = partner[i];
            if (k == SIZE_MAX) {
                note(where, field, fmt::format("{} at {} only in {}", kind(a_, ours[i]), i, words_.a));
                continue;
            }
            taken[k] = true;
            moved |= k < highest;
            highest = std::max(highest, k);
        }
        for (std::size_t k = 0; k < theirs.size(); ++k)
            if (!taken[k]) note(where, field, fmt::format("{} at {} only in {}", kind(b_, theirs[k]), k, words_.b));
        if (moved) note(where, field, "the same nodes in another order");
        for (std::size_t i = ours.size(); i-- > 0;)  // the stack is popped from its end
            if (partner[i] != SIZE_MAX) push(ours[i], theirs[partner[i]], fmt::format("{}[{}]", path, i));
    }

    std::set<std::string> routesOf(const Scene& scene) const {
        std::set<std::string> routes;
        scene.forEachNode([&](const Node& node) {
            for (const Route& r : scene.routesFrom(node.id())) {
                if (r.isConnection || scene.node(r.fromNode).scope()) continue;
                const auto end = [&](NodeId id, FieldIndex field) {
                    return fmt::format("{}.{}", label(scene, id, scene.node(id).type().name),
                                       scene.node(id).type().fields[field].name);
                };
                routes.insert(fmt::format("{} TO {}", end(r.fromNode, r.fromField), end(r.toNode, r.toField)));
            }
        });
        return routes;
    }
    void compareRoutes() {
        const std::set<std::string> x = routesOf(a_), y = routesOf(b_);
        for (const std::string& r : x)
            if (!y.contains(r)) note("", "routes", fmt::format("ROUTE {} only in {}", r, words_.a));
        for (const std::string& r : y)
            if (!x.contains(r)) note("", "routes", fmt::format("ROUTE {} only in {}", r, words_.b));
    }

    const Scene &a_, &b_;
    std::size_t maximum_;
    DifferenceWords words_;
    std::vector<Pair> waiting_;
    std::unordered_set<std::uint64_t> seen_;
    std::vector<Divergence> found_;
};

}  // namespace

std::vector<Divergence> sceneDifferences(const Scene& a, const Scene& b, std::size_t maximum, DifferenceWords words) {
    return TreeDifference(a, b, maximum, words).run();
}

}  // namespace rtsg
