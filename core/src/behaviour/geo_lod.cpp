// GeoLOD: ISO/IEC 19775-1 V4.0, 25.3.4. The nodes of its urls hang below Inlines of its own, which a reader makes; they
// are loaded and let go between frames as all Inlines are. The root stays until the children have been loaded.
#include <algorithm>
#include <cmath>

#include <rtsg/core/geospatial.h>
#include <rtsg/core/x3d.h>

#include "behaviours.h"

namespace rtsg::behaviours {

namespace {

double geoLodOnTime(Cascade& cascade, const Node& node) {
    using N = x3d::GeoLOD;
    const Scene& scene = cascade.scene();
    const auto reference = GeoReference::of(scene, node);
    if (!reference) return cascade.warn(node, reference.error().text), kNever;
    const glm::dvec3 viewer = cascade.viewer(node).position;
    const glm::dmat4& world = cascade.worldFromLocal(node, node);
    const double volume = glm::determinant(world);
    if (volume == 0 || !std::isfinite(volume)) return kUntilMoved;
    const glm::dvec3 local = glm::inverse(world) * glm::dvec4(viewer, 1);
    const Array<NodeId>& tiles = node.get(N::_tiles);
    const bool isNear = glm::length(local - reference->toScene(node.get(N::center))) < double{node.get(N::range)};
    std::int32_t level = isNear && !tiles.empty() ? 1 : 0;
    bool waits = false;
    for (const NodeId tile : tiles) {
        const Node* inlined = scene.find(tile);
        if (!inlined || !inlined->is(x3d::Inline::type) || inlined->get(x3d::Inline::load) == (level == 1)) continue;
        (void)cascade.deliver(tile, x3d::Inline::load.index, Value(level == 1));
        waits = waits || level == 1;
    }
    // Between this frame and the next one they are loaded, or cannot be.
    if (waits) level = node.get(N::level_changed);
    const Array<NodeId>& roots = node.get(N::rootNode).empty() ? node.get(N::_root) : node.get(N::rootNode);
    const Array<NodeId>& wanted = level == 1 ? tiles : roots;
    if (node.get(N::level_changed) != level || !std::ranges::equal(node.get(N::children), wanted)) {
        cascade.emit(node, N::level_changed, level);
        cascade.emit(node, N::children, wanted);
    }
    return waits ? cascade.now() : kUntilMoved;
}

}  // namespace

void appendGeoLod(std::vector<BuiltinBehaviour>& table) {
    table.push_back({x3d::GeoLOD::type, {.onTime = geoLodOnTime, .last = true}});
}

}  // namespace rtsg::behaviours
