// Which of several nodes of a kind counts: viewpoints, backgrounds, fogs, navigation.
//
// Threading: re-entrant. Source: ISO/IEC 19775-1 V4.0 7.2.2 (bindable nodes).
#pragma once

#include <algorithm>
#include <span>
#include <tuple>
#include <variant>

#include "light_tables.h"

namespace rtsg::trace {

/// The bound one of a kind, else the one that comes first in the document. A node that several paths lead to is
/// seen through one of them: which is up to us (7.2.2), but must not depend on the order in which they came.
template <class T>
const PlacedEntry* active(const LightState& state, std::uint16_t layer) {
    const auto rank = [](const PlacedEntry& entry) {
        const double* matrix = &entry.placed.worldFromLocal[0][0];
        return std::tuple(!std::get<T>(entry.what).bound, entry.placed.node, std::span<const double, 12>(matrix, 12));
    };
    const auto before = [&](const PlacedEntry& a, const PlacedEntry& b) {
        const auto [unboundA, nodeA, matrixA] = rank(a);
        const auto [unboundB, nodeB, matrixB] = rank(b);
        if (unboundA != unboundB) return unboundB;
        if (nodeA != nodeB) return nodeA < nodeB;
        return std::ranges::lexicographical_compare(matrixA, matrixB);
    };
    const PlacedEntry* best = nullptr;
    for (std::size_t i = 0; i < state.placed.size(); ++i)
        if (const PlacedEntry* entry = state.placed[i].get())
            if (std::holds_alternative<T>(entry->what) && entry->placed.layer == layer &&
                (!best || before(*entry, *best)))
                best = entry;
    return best;
}

/// What the viewpoint brings counts unless another one is bound (23.3.1); null: there is none.
inline const Navigation* activeNavigation(const LightState& state, std::uint16_t layer) {
    const PlacedEntry* placed = active<Navigation>(state, layer);
    const Navigation* own = placed ? &std::get<Navigation>(placed->what) : nullptr;
    const PlacedEntry* view = active<View>(state, layer);
    if (!view) return own;
    const auto& brought = std::get<View>(view->what).navigation;
    return brought && (brought->bound || !own || !own->bound) ? &*brought : own;
}

}  // namespace rtsg::trace
