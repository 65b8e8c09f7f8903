// Chooses the active one among several nodes of a kind: viewpoints, backgrounds, fogs, navigation.
//
// Threading: re-entrant. Source: ISO/IEC 19775-1 V4.0 7.2.2 (bindable nodes).
#pragma once

#include <algorithm>
#include <span>
#include <tuple>
#include <variant>

#include "light_tables.h"

namespace rtsg::trace {

/// The bound one of a kind; where none has been bound yet, the one that comes first in the document; null: none counts.
/// A node that several paths lead to is seen through one of them: which is up to us (7.2.2), but must not depend on the
/// order in which they came.
template <class T>
const PlacedEntry* active(const LightState& state, std::uint16_t layer) {
    const auto rank = [](const PlacedEntry& entry) {
        const double* matrix = &entry.placed.worldFromLocal[0][0];
        return std::tuple(std::get<T>(entry.what).binding, entry.placed.node, std::span<const double, 12>(matrix, 12));
    };
    const auto before = [&](const PlacedEntry& a, const PlacedEntry& b) {
        const auto [bindingA, nodeA, matrixA] = rank(a);
        const auto [bindingB, nodeB, matrixB] = rank(b);
        if (bindingA != bindingB) return bindingA < bindingB;
        if (nodeA != nodeB) return nodeA < nodeB;
        return std::ranges::lexicographical_compare(matrixA, matrixB);
    };
    const PlacedEntry* best = nullptr;
    bool anyUnbound = false;
    for (std::size_t i = 0; i < state.placed.size(); ++i) {
        const PlacedEntry* entry = state.placed[i].get();
        if (!entry || !std::holds_alternative<T>(entry->what) || entry->placed.layer != layer) continue;
        anyUnbound = anyUnbound || std::get<T>(entry->what).binding == Binding::unbound;
        if (!best || before(*entry, *best)) best = entry;
    }
    if (!best || std::get<T>(best->what).binding == Binding::bound) return best;
    return std::get<T>(best->what).binding == Binding::first && !anyUnbound ? best : nullptr;
}

/// The NavigationInfo that counts: the one that the viewpoint brings, unless another is bound (23.3.1); null if there
/// is none.
inline const Navigation* activeNavigation(const LightState& state, std::uint16_t layer) {
    const PlacedEntry* placed = active<Navigation>(state, layer);
    const Navigation* own = placed ? &std::get<Navigation>(placed->what) : nullptr;
    const PlacedEntry* view = active<View>(state, layer);
    if (!view) return own;
    const auto& brought = std::get<View>(view->what).navigation;
    const auto isBound = [](const Navigation& navigation) { return navigation.binding == Binding::bound; };
    return brought && (isBound(*brought) || !own || !isBound(*own)) ? &*brought : own;
}

/// 23.4.4: whether the eye of a layer has a light of its own.
inline bool hasHeadlight(const LightState& state, std::uint16_t layer) {
    const Navigation* navigation = activeNavigation(state, layer);
    return !navigation || navigation->headlight;
}

/// The background that counts; null: there is none.
inline const Sky* skyOf(const LightState& state, std::uint16_t layer) {
    const PlacedEntry* sky = active<SkyEntry>(state, layer);
    return sky ? &std::get<SkyEntry>(sky->what).sky : nullptr;
}

/// Calls `take` with each light that is on in this scope, those around it not included, and in the layer.
template <class Take>
void eachLight(const LightState& state, std::uint32_t scope, std::uint16_t layer, const Take& take) {
    if (scope >= state.scopes.size()) return;
    if (const auto& lights = state.scopes[scope].lights)
        for (const std::uint32_t slot : *lights)
            if (state.placed[slot]->placed.layer == layer) take(std::get<Light>(state.placed[slot]->what));
}

}  // namespace rtsg::trace
