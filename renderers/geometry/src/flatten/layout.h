// Computes how a Layout places a rectangle in its parent, and the width of a pixel at a position.
//
// Invariant: pure functions of fields and a picture's size; who knows no picture has one of 1280 by 720 pixels.
// Lengths of a Region are in the units of what lies in it: Transforms between two of them need not be known.
// Threading: re-entrant.
// Source: ISO/IEC 19775-1 V4.0 36.2, 36.4; where the clause leaves it open, docs/layout.md.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>

#include <rtsg/core/diagnostic.h>
#include <rtsg/core/scene.h>
#include <rtsg/renderers/flattener.h>

namespace rtsg::flatten {

/// The rectangle that something is laid out in; its middle is the origin.
struct Region {
    Vec2d size{0};   // width and height
    Vec2d pixel{1};  // of one pixel
    friend bool operator==(const Region&, const Region&) = default;
};

/// The fields of a Layout, across and upwards.
struct LayoutParams {
    enum class Unit : std::uint8_t { world, fraction, pixel };
    enum class Scale : std::uint8_t { none, fraction, stretch, pixel };
    std::array<int, 2> align{0, 0};  // -1 left or bottom, 0 middle, 1 right or top
    std::array<double, 2> offset{0, 0}, size{1, 1};
    std::array<Unit, 2> offsetUnits{Unit::world, Unit::world}, sizeUnits{Unit::world, Unit::world};
    std::array<Scale, 2> scale{Scale::none, Scale::none};
};

/// Reads the fields of a Layout. Wrong ones are reported to `problems`, with the value that is taken instead; an
/// impossible size becomes 0. Precondition: it is a Layout.
LayoutParams readLayout(const Scene& scene, const Node& layout, Diagnostics& problems);

/// A layer's whole rectangle, seen by the implicit eye of a LayoutLayer: its smaller side is 2 m.
Region wholeRegion(const LayerSight* sight);

/// The rectangle in `around`, with its content; `aroundFromLocal` is flat if the rectangle has no size. `outermost`: of
/// a LayoutLayer, for which WORLD and NONE are FRACTION.
Region layOut(LayoutParams params, bool outermost, const Region& around, WorldFromLocal& aroundFromLocal);

/// The sight of a layer, if there is one.
const LayerSight* sightOf(std::span<const LayerSight> sights, std::uint16_t layer);

/// Metres a pixel at a place in the world; `laidOut`: in a LayoutLayer.
double pixelAt(const LayerSight* sight, bool laidOut, const Vec3d& position);

/// Scales so that one unit is `pixel` metres in every direction; false where there is no way to.
bool scaleToPixels(const WorldFromLocal& worldFromParent, double pixel, WorldFromLocal& parentFromLocal);

}  // namespace rtsg::flatten
