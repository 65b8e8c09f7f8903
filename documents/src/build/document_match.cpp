// Pairs the nodes of two versions of a document, top down from their roots.
#include "document_match.h"

#include <algorithm>
#include <iterator>
#include <string_view>

#include <rtsg/core/hash_terms.h>
#include <rtsg/core/x3d.h>

namespace rtsg {

namespace {

/// Two gaps whose sizes have at most this product are compared node by node.
constexpr std::size_t kMaxComparisons = 4096;
/// Children of a node that count when two nodes are compared.
constexpr std::size_t kMaxChildren = 64;

std::uint64_t mixed(std::uint64_t hash, std::uint64_t with) {
    hash = (hash ^ with) * 0x9E3779B97F4A7C15ull;
    return hash ^ (hash >> 32);
}

bool hasBody(const NodeType& type) {
    return type.body() != kNoField;
}

/// Compares the url fields of Inlines: with another url, the loader would load another document.
bool hasSameUrl(const Node& a, const Node& b) {
    if (a.type().kind != NodeType::Kind::builtin || !hasBody(a.type())) return true;
    const FieldIndex url = a.type().findExact("url");
    return url == kNoField || a.value(url) == b.value(url);
}

/// IS connections between a node of a body and the instance around it, in order.
std::vector<std::pair<FieldIndex, FieldIndex>> connectionsOf(const Scene& scene, const Node& node) {
    std::vector<std::pair<FieldIndex, FieldIndex>> result;
    constexpr FieldIndex kOutwards = 0x8000;  // tells both directions apart
    for (const Route& one : scene.routesTo(node.id()))
        if (one.isConnection && one.fromNode == node.scope()) result.emplace_back(one.fromField, one.toField);
    for (const Route& one : scene.routesFrom(node.id()))
        if (one.isConnection && one.toNode == node.scope())
            result.emplace_back(one.toField, static_cast<FieldIndex>(one.fromField | kOutwards));
    std::ranges::sort(result);
    return result;
}

}  // namespace

bool isOfDocument(const NodeType& type, const FieldDef& field) {
    // Hidden fields of the root that begin with '_' belong to the running scene.
    if (field.hidden) return field.readable() && !(type.internal && field.name.starts_with('_'));
    return field.access == Access::initializeOnly || field.access == Access::inputOutput;
}

std::vector<NodeId> nodesIn(const Node& node, FieldIndex field) {
    if (node.type().fields[field].type == FieldType::SFNode) {
        const NodeId only = node.get(Field<NodeId>{field});
        return only ? std::vector<NodeId>{only} : std::vector<NodeId>();
    }
    const auto& all = node.get(Field<Array<NodeId>>{field});
    return {all.begin(), all.end()};
}

std::string_view nameInDocument(const NodeType& type) {
    const std::string_view name = type.name;
    const std::size_t at = name.rfind('#');
    const bool isCount = at != name.npos && name.find_first_not_of("0123456789", at + 1) == name.npos;
    return isCount ? name.substr(0, at) : name;
}

bool isSameType(const NodeType& a, const NodeType& b) {
    return a.kind == b.kind && nameInDocument(a) == nameInDocument(b) && a.declaration == b.declaration &&
           a.implements == b.implements &&
           std::ranges::equal(a.fields, b.fields, [](const FieldDef& x, const FieldDef& y) {
               return x.name == y.name && haveOneType(x, y) && x.access == y.access && x.hidden == y.hidden &&
                      x.defaultValue == y.defaultValue;
           });
}

DocumentMatch::DocumentMatch(const Scene& before, const Scene& after)
    : beforeScene_(before),
      afterScene_(after),
      beforeDigests_(digestsOf(before)),
      afterDigests_(digestsOf(after)),
      typeBefore_(after.typeCount()),
      before_(afterDigests_.size()),
      after_(beforeDigests_.size()) {
    for (std::size_t i = 0; i < typeBefore_.size(); ++i) {
        const TypeIndex index{static_cast<std::uint16_t>(i)};
        if (i < builtinTypes().size()) {
            typeBefore_[i] = index;
            continue;
        }
        for (std::size_t k = builtinTypes().size(); k < before.typeCount() && typeBefore_[i] == TypeIndex(); ++k) {
            const TypeIndex other{static_cast<std::uint16_t>(k)};
            if (isSameType(before.type(other), after.type(index))) typeBefore_[i] = other;
        }
    }
    before.forEachNode([&](const Node& node) {
        if (before.parents(node.id()).empty() && node.id() != before.root())
            looseBefore_[node.scope().value].push_back(node.id());
    });
    after.forEachNode([&](const Node& node) {
        if (!after.name(node.id()).empty()) named_[node.scope().value].push_back(node.id());
        if (after.parents(node.id()).empty() && node.id() != after.root())
            looseAfter_[node.scope().value].push_back(node.id());
    });
    pair(before.root(), after.root());
    descend();
    pairElsewhere();
    partUnequalConnections();
}

DocumentMatch::Digests DocumentMatch::digestsOf(const Scene& scene) {
    struct Frame {
        const Node* node;
        std::vector<NodeId> below;
        std::size_t next = 0;
    };
    std::uint32_t last = 0;
    scene.forEachNode([&](const Node& node) { last = node.id().value; });
    Digests digests(std::size_t{last} + 1);
    std::vector<bool> begun(digests.size());
    std::vector<Frame> path;
    const auto begin = [&](const Node& node) {
        if (begun[node.id().value]) return;
        begun[node.id().value] = true;
        Frame& frame = path.emplace_back(Frame{&node, {}});
        for (const FieldIndex field : node.type().nodeFields())
            if (isOfDocument(node.type(), node.type().fields[field]))
                std::ranges::copy(nodesIn(node, field), std::back_inserter(frame.below));
    };
    const auto end = [&](const Node& node) {
        std::uint64_t hash = hashOfText(nameInDocument(node.type()));
        hash = mixed(hash, hashOfText(scene.name(node.id())));
        for (FieldIndex i = 0; i < node.type().fields.size(); ++i) {
            const FieldDef& def = node.type().fields[i];
            if (!isOfDocument(node.type(), def) || node.isDefault(i)) continue;
            hash = mixed(hash, i);
            if (sf(def.type) != FieldType::SFNode)
                hash = mixed(hash, hashOfValue(def.type, node.storage(i), 1).low);
            else  // of one that a Script above refers to, and that is not known yet: 0
                for (const NodeId child : nodesIn(node, i)) hash = mixed(hash, digests[child.value]);
        }
        digests[node.id().value] = hash;
    };
    scene.forEachNode([&](const Node& start) {
        begin(start);
        while (!path.empty()) {
            Frame& top = path.back();
            if (top.next < top.below.size()) {
                begin(scene.node(top.below[top.next++]));  // may move `top`
                continue;
            }
            end(*top.node);
            path.pop_back();
        }
    });
    return digests;
}

bool DocumentMatch::mayPair(NodeId before, NodeId after) const {
    if (!before || !after || after_[before.value] || before_[after.value]) return false;
    const Node &b = beforeScene_.node(before), &a = afterScene_.node(after);
    if (typeBefore_[a.typeIndex().value] != b.typeIndex()) return false;
    const bool isInScope = a.scope() ? before_[a.scope().value] == b.scope() && b.scope() : !b.scope();
    return isInScope && hasSameUrl(b, a);
}

/// Paired already; or the same with all below.
bool DocumentMatch::isEqual(NodeId before, NodeId after) const {
    if (after_[before.value] || before_[after.value]) return before_[after.value] == before;
    return beforeDigests_[before.value] == afterDigests_[after.value] && mayPair(before, after);
}

bool DocumentMatch::pair(NodeId before, NodeId after) {
    if (!mayPair(before, after)) return false;
    after_[before.value] = after;
    before_[after.value] = before;
    waiting_.emplace_back(before, after);
    return true;
}

void DocumentMatch::descend() {
    while (!waiting_.empty()) {
        const auto [before, after] = waiting_.front();
        waiting_.pop_front();
        alignBelow(before, after);
    }
}

void DocumentMatch::alignBelow(NodeId before, NodeId after) {
    const Node &b = beforeScene_.node(before), &a = afterScene_.node(after);
    const bool isRoot = after == afterScene_.root();
    const NodeId scopeBefore = isRoot ? NodeId{} : before, scopeAfter = isRoot ? NodeId{} : after;
    if (isRoot || hasBody(a.type()))
        if (const auto found = named_.find(scopeAfter.value); found != named_.end())
            for (const NodeId id : found->second) pair(beforeScene_.findName(afterScene_.name(id), scopeBefore), id);
    for (const FieldIndex field : a.type().nodeFields())
        if (isOfDocument(a.type(), a.type().fields[field])) align(nodesIn(b, field), nodesIn(a, field));
    if (isRoot || hasBody(a.type())) align(looseBefore_[scopeBefore.value], looseAfter_[scopeAfter.value]);
}

std::uint64_t DocumentMatch::tokenOf(NodeId pairedWith, std::uint64_t digest) const {
    return pairedWith ? mixed(1, pairedWith.value) : mixed(2, digest);
}

void DocumentMatch::align(std::span<const NodeId> before, std::span<const NodeId> after) {
    while (!before.empty() && !after.empty() && isEqual(before.front(), after.front())) {
        pair(before.front(), after.front());
        before = before.subspan(1);
        after = after.subspan(1);
    }
    while (!before.empty() && !after.empty() && isEqual(before.back(), after.back())) {
        pair(before.back(), after.back());
        before = before.first(before.size() - 1);
        after = after.first(after.size() - 1);
    }
    if (before.empty() || after.empty()) return;
    const auto run = commonRun(before, after);
    for (const auto& [b, a] : run) pair(before[b], after[a]);
    std::size_t atBefore = 0, atAfter = 0;
    for (const auto& [b, a] : run) {
        alignGap(before.subspan(atBefore, b - atBefore), after.subspan(atAfter, a - atAfter));
        atBefore = b + 1;
        atAfter = a + 1;
    }
    alignGap(before.subspan(atBefore), after.subspan(atAfter));
}

/// The longest run of equal nodes that stand in the same order in both, as far as those that are there several times
/// are taken in turn.
std::vector<std::pair<std::size_t, std::size_t>> DocumentMatch::commonRun(std::span<const NodeId> before,
                                                                          std::span<const NodeId> after) const {
    struct Occurrences {
        std::vector<std::size_t> all;
        std::size_t taken = 0;
    };
    std::unordered_map<std::uint64_t, Occurrences> indices;
    for (std::size_t i = 0; i < before.size(); ++i) {
        const NodeId id = before[i];
        indices[tokenOf(after_[id.value] ? id : NodeId{}, beforeDigests_[id.value])].all.push_back(i);
    }
    // The longest increasing sequence of their places before, after Schensted: `ends` has for each length the candidate
    // that ends at the smallest place.
    struct Candidate {
        std::size_t before, after, previous;
    };
    constexpr std::size_t kNone = SIZE_MAX;
    std::vector<Candidate> candidates;
    std::vector<std::size_t> ends;
    for (std::size_t i = 0; i < after.size(); ++i) {
        const NodeId id = after[i];
        const auto found = indices.find(tokenOf(before_[id.value], afterDigests_[id.value]));
        if (found == indices.end() || found->second.taken == found->second.all.size()) continue;
        const std::size_t index = found->second.all[found->second.taken++];
        if (!isEqual(before[index], id)) continue;
        const auto at = std::ranges::lower_bound(ends, index, {}, [&](std::size_t c) { return candidates[c].before; });
        candidates.push_back({index, i, at == ends.begin() ? kNone : *std::prev(at)});
        if (at == ends.end())
            ends.push_back(candidates.size() - 1);
        else
            *at = candidates.size() - 1;
    }
    std::vector<std::pair<std::size_t, std::size_t>> run;
    for (std::size_t c = ends.empty() ? kNone : ends.back(); c != kNone; c = candidates[c].previous)
        run.emplace_back(candidates[c].before, candidates[c].after);
    std::ranges::reverse(run);
    return run;
}

/// How much two nodes of a type have in common; at least 1.
int DocumentMatch::likeness(NodeId before, NodeId after) const {
    const Node &b = beforeScene_.node(before), &a = afterScene_.node(after);
    int result = 1;
    for (FieldIndex i = 0; i < a.type().fields.size(); ++i) {
        const FieldDef& def = a.type().fields[i];
        if (!isOfDocument(a.type(), def) || a.isDefault(i) || b.isDefault(i)) continue;
        if (sf(def.type) != FieldType::SFNode) {
            result += a.value(i) == b.value(i) ? 2 : 0;
            continue;
        }
        std::vector<std::uint64_t> x, y, common;
        for (const NodeId id : nodesIn(b, i))
            x.push_back(tokenOf(after_[id.value] ? id : NodeId{}, beforeDigests_[id.value]));
        for (const NodeId id : nodesIn(a, i)) y.push_back(tokenOf(before_[id.value], afterDigests_[id.value]));
        x.resize(std::min(x.size(), kMaxChildren));
        y.resize(std::min(y.size(), kMaxChildren));
        std::ranges::sort(x);
        std::ranges::sort(y);
        std::ranges::set_intersection(x, y, std::back_inserter(common));
        result += 4 * static_cast<int>(common.size());
    }
    return result;
}

/// Nodes between two that are the same: pairs of a type, so that in their order they have as much in common as can be.
void DocumentMatch::alignGap(std::span<const NodeId> before, std::span<const NodeId> after) {
    const std::size_t n = before.size(), m = after.size();
    if (n == 0 || m == 0) return;
    if (n <= kMaxComparisons / m) {
        std::vector<int> like(n * m), best((n + 1) * (m + 1));
        const auto bestOf = [&](std::size_t i, std::size_t k) -> int& { return best[i * (m + 1) + k]; };
        for (std::size_t i = n; i-- > 0;)
            for (std::size_t k = m; k-- > 0;) {
                int& one = like[i * m + k] = mayPair(before[i], after[k]) ? likeness(before[i], after[k]) : 0;
                bestOf(i, k) = std::max({bestOf(i + 1, k), bestOf(i, k + 1), one ? one + bestOf(i + 1, k + 1) : 0});
            }
        for (std::size_t i = 0, k = 0; i < n && k < m;) {
            const int one = like[i * m + k];
            if (one && bestOf(i, k) == one + bestOf(i + 1, k + 1))
                pair(before[i++], after[k++]);
            else
                bestOf(i, k) == bestOf(i + 1, k) ? ++i : ++k;
        }
    } else {
        std::size_t next = 0;
        for (const NodeId id : after)
            for (std::size_t i = next; i < std::min(n, next + kMaxChildren); ++i)
                if (pair(before[i], id)) {
                    next = i + 1;
                    break;
                }
        if (n > kMaxComparisons || m > kMaxComparisons) return;
    }
    // Those that changed their order as well.
    for (const NodeId id : after)
        if (!before_[id.value]) (void)std::ranges::any_of(before, [&](NodeId one) { return pair(one, id); });
}

void DocumentMatch::pairElsewhere() {
    struct Left {
        NodeId before, after;
        int countBefore = 0, countAfter = 0;
    };
    std::unordered_map<std::uint64_t, Left> left;
    beforeScene_.forEachNode([&](const Node& node) {
        if (after_[node.id().value]) return;
        Left& one = left[beforeDigests_[node.id().value]];
        one.before = node.id();
        ++one.countBefore;
    });
    Nodes news;
    afterScene_.forEachNode([&](const Node& node) {
        if (before_[node.id().value]) return;
        news.push_back(node.id());
        Left& one = left[afterDigests_[node.id().value]];
        one.after = node.id();
        ++one.countAfter;
    });
    for (const NodeId id : news) {  // parents come before their children
        const Left& one = left[afterDigests_[id.value]];
        if (one.countBefore != 1 || one.countAfter != 1 || !pair(one.before, id)) continue;
        descend();
    }
}

/// A node of a body keeps its IS connections for ever: with others it is another node, and so is all in its own body.
void DocumentMatch::partUnequalConnections() {
    afterScene_.forEachNode([&](const Node& node) {  // scopes come before their nodes
        const NodeId partner = before(node.id());
        if (!partner || !node.scope()) return;
        const bool isInScope = before(node.scope()) == beforeScene_.node(partner).scope() && before(node.scope());
        if (isInScope && connectionsOf(afterScene_, node) == connectionsOf(beforeScene_, beforeScene_.node(partner)))
            return;
        before_[node.id().value] = after_[partner.value] = {};
    });
}

}  // namespace rtsg
