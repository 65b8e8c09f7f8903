// Components by union-find over the routes, dealt out to parts in order.
#include "division.h"

#include <algorithm>

namespace rtsg {

std::uint32_t Division::findRoot(std::uint32_t i) {
    while (root_[i] != i) i = root_[i] = root_[root_[i]];
    return i;
}

void Division::unite(std::span<const Edge> edges) {
    for (const Edge& edge : edges) reached_[indexOf(edge.to)] = 1;
    for (const Edge& edge : edges) {
        const std::uint32_t from = indexOf(edge.from);
        if (!reached_[from]) continue;
        const std::uint32_t a = findRoot(from), b = findRoot(indexOf(edge.to));
        root_[std::max(a, b)] = std::min(a, b);
    }
}

std::size_t Division::deal(std::span<const Edge> edges, unsigned parts) {
    for (const Edge& edge : edges) ++weight_[findRoot(indexOf(edge.to))];
    std::size_t dealt = 0;
    std::vector<std::size_t> load(parts);
    for (const Edge& edge : edges) {
        const std::uint32_t root = findRoot(indexOf(edge.to));
        if (partOfRoot_[root] != kNone) continue;
        const auto part = static_cast<std::uint8_t>(dealt * parts / edges.size());
        partOfRoot_[root] = part;
        dealt += weight_[root];
        load[part] += weight_[root];
    }
    return *std::ranges::max_element(load);
}

void Division::name(std::span<const NodeId> sources, std::span<const Edge> edges) {
    for (const Edge& edge : edges) {
        const std::uint8_t part = partOfRoot_[findRoot(indexOf(edge.to))];
        parts_[edge.to.value] = part;
        std::uint8_t& from = parts_[edge.from.value];
        if (reached_[indexOf(edge.from)]) continue;
        from = from == kNone || from == part ? part : kSeveral;
    }
    // A source that only listeners hear goes to the part of the source before it.
    std::uint8_t last = 0;
    for (const NodeId id : sources) {
        if (parts_[id.value] == kNone) parts_[id.value] = last;
        if (parts_[id.value] != kSeveral) last = parts_[id.value];
    }
}

bool Division::divide(std::span<const NodeId> sources, std::span<const Edge> edges, unsigned parts) {
    parts_.clear();
    std::uint32_t maximum = 0, count = 0;
    for (const NodeId id : sources) maximum = std::max(maximum, id.value);
    for (const Edge& edge : edges) maximum = std::max(maximum, edge.to.value);
    // Numbers with large gaps (from a file, or a peer) are left alone.
    if (edges.empty() || parts < 2 || parts > kMaxParts || maximum / 64 > 1024 + edges.size()) return false;
    constexpr std::uint32_t kNew = UINT32_MAX;
    index_.assign(std::size_t{maximum} + 1, kNew);
    const auto number = [&](NodeId id) {
        if (indexOf(id) == kNew) indexOf(id) = count++;
    };
    for (const NodeId id : sources) number(id);
    for (const Edge& edge : edges) number(edge.to);
    root_.resize(count);
    for (std::uint32_t i = 0; i < count; ++i) root_[i] = i;
    weight_.assign(count, 0);
    reached_.assign(count, 0);
    partOfRoot_.assign(count, kNone);
    unite(edges);
    const std::size_t largest = deal(edges, parts);
    if (4 * largest > 3 * edges.size()) return false;
    parts_.assign(std::size_t{maximum} + 1, kNone);
    name(sources, edges);
    return true;
}

}  // namespace rtsg
