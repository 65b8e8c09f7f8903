// Outputs that tell how large something is: Text's bounds (ISO/IEC 19775-1 V4.0, 15.4.2) and the aspectRatio of texture
// projectors (42.3.1). Whoever loads finds out between frames (InlineLoader) and writes it into hidden fields; so
// replays and replicas need neither fonts nor pictures.
#include <rtsg/core/x3d.h>

#include "behaviours.h"

namespace rtsg::behaviours {

namespace {

template <class N>
double sendAspectRatio(Cascade& cascade, const Node& node) {
    const float ratio = node.get(N::_aspectRatio);
    if (ratio > 0 && ratio != node.get(N::aspectRatio)) cascade.emit(node, N::aspectRatio, ratio);
    return kNever;
}

double sendTextSizes(Cascade& cascade, const Node& node) {
    using T = x3d::Text;
    constexpr std::size_t kHead = 5;  // textBounds and origin
    const Array<float> sizes = node.get(T::_measured);
    // A Text without glyphs, or that nobody has measured, has no lines and no size.
    const bool isKnown = sizes.size() >= kHead;
    const Vec2f bounds = isKnown ? Vec2f(sizes[0], sizes[1]) : Vec2f(0);
    const Vec3f origin = isKnown ? Vec3f(sizes[2], sizes[3], sizes[4]) : Vec3f(0);
    Array<Vec2f> lines;
    for (std::size_t i = kHead; i + 1 < sizes.size(); i += 2) lines.push_back(Vec2f(sizes[i], sizes[i + 1]));
    if (lines != node.get(T::lineBounds)) cascade.emit(node, T::lineBounds, lines);
    if (origin != node.get(T::origin)) cascade.emit(node, T::origin, origin);
    if (bounds != node.get(T::textBounds)) cascade.emit(node, T::textBounds, bounds);
    return kNever;
}

}  // namespace

void appendMeasures(std::vector<BuiltinBehaviour>& table) {
    table.push_back({x3d::Text::type, {.onTime = sendTextSizes}});
    table.push_back({x3d::TextureProjector::type, {.onTime = sendAspectRatio<x3d::TextureProjector>}});
    table.push_back({x3d::TextureProjectorParallel::type, {.onTime = sendAspectRatio<x3d::TextureProjectorParallel>}});
}

}  // namespace rtsg::behaviours
