// Reads the haptic properties of a surface from the metadata of an Appearance.
#include <rtsg/haptics/touch_surface.h>

#include <cmath>
#include <utility>

#include <fmt/format.h>

#include <rtsg/core/x3d.h>

namespace rtsg {

namespace {

constexpr std::pair<std::string_view, double TouchSurface::*> kNames[] = {
    {"stiffness", &TouchSurface::stiffness},
    {"damping", &TouchSurface::damping},
    {"staticFriction", &TouchSurface::staticFriction},
    {"dynamicFriction", &TouchSurface::dynamicFriction},
};

template <class Metadata>
void take(const Node& node, TouchSurface& surface, Diagnostics* diagnostics) {
    const std::string_view name = node.get(Metadata::name).view();
    for (const auto& [known, field] : kNames) {
        if (name != known) continue;
        const auto& values = node.get(Metadata::value);
        const double value = values.size() == 1 ? static_cast<double>(values[0]) : -1;
        if (std::isfinite(value) && value >= 0)
            surface.*field = value;
        else if (diagnostics)
            diagnostics->warning({},
                                 fmt::format("{} of a surface to touch is one number from 0 on; it is left out", name));
    }
}

}  // namespace

TouchSurface readTouchSurface(const Scene& scene, NodeId appearance, const TouchSurface& otherwise,
                              Diagnostics* diagnostics) {
    TouchSurface surface = otherwise;
    const Node* node = scene.find(appearance);
    if (!node || !node->is(x3d::Appearance::type)) return surface;
    const Node* set = scene.find(node->get(x3d::Appearance::metadata));
    if (!set || !set->is(x3d::MetadataSet::type)) return surface;
    const auto read = [&](const Node& ours) {
        for (const NodeId id : ours.get(x3d::MetadataSet::value)) {
            const Node* entry = scene.find(id);
            if (!entry) continue;
            if (entry->is(x3d::MetadataFloat::type)) take<x3d::MetadataFloat>(*entry, surface, diagnostics);
            if (entry->is(x3d::MetadataDouble::type)) take<x3d::MetadataDouble>(*entry, surface, diagnostics);
        }
    };
    if (set->get(x3d::MetadataSet::name) == String("RTSG")) return read(*set), surface;
    for (const NodeId id : set->get(x3d::MetadataSet::value)) {
        const Node* inner = scene.find(id);
        if (inner && inner->is(x3d::MetadataSet::type) && inner->get(x3d::MetadataSet::name) == String("RTSG"))
            read(*inner);
    }
    return surface;
}

}  // namespace rtsg
