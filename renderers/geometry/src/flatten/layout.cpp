// Reads Layout nodes and places their rectangles; says how wide a pixel is.
#include "layout.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include <rtsg/core/portable_math.h>
#include <rtsg/core/x3d.h>

namespace rtsg::flatten {

namespace {

using Unit = LayoutParams::Unit;
using Scale = LayoutParams::Scale;

/// Used without a picture: its size, and the width of a pixel outside of a LayoutLayer (96 to the inch).
constexpr int kUnknownWidth = 1280, kUnknownHeight = 720;
constexpr double kUnknownPixel = .0254 / 96;

template <class T>
struct Word {
    std::string_view text;
    T meaning;
};
constexpr Word<int> kAcross[] = {{"CENTER", 0}, {"LEFT", -1}, {"RIGHT", 1}};
constexpr Word<int> kUpwards[] = {{"CENTER", 0}, {"BOTTOM", -1}, {"TOP", 1}};
constexpr Word<Unit> kUnits[] = {{"WORLD", Unit::world}, {"FRACTION", Unit::fraction}, {"PIXEL", Unit::pixel}};
constexpr Word<Scale> kScales[] = {
    {"NONE", Scale::none}, {"FRACTION", Scale::fraction}, {"STRETCH", Scale::stretch}, {"PIXEL", Scale::pixel}};

/// Reads one Layout and reports its faults.
class Reader {
  public:
    Reader(const Scene& scene, const Node& node, Diagnostics& problems)
        : scene_(scene), node_(node), problems_(problems) {}

    LayoutParams read() {
        using L = x3d::Layout;
        LayoutParams p;
        const Array<String>& align = node_.get(L::align);
        count("align", align.size());
        for (std::size_t axis = 0; axis < std::min<std::size_t>(align.size(), 2); ++axis)
            p.align[axis] = word("align", align[axis].view(), axis == 0 ? kAcross : kUpwards);
        words("offsetUnits", node_.get(L::offsetUnits), kUnits, p.offsetUnits);
        words("sizeUnits", node_.get(L::sizeUnits), kUnits, p.sizeUnits);
        words("scaleMode", node_.get(L::scaleMode), kScales, p.scale);
        numbers("offset", node_.get(L::offset), p.offset);
        numbers("size", node_.get(L::size), p.size);
        for (double& size : p.size)
            if (!(size > 0)) {
                report(fmt::format("size {} is not above 0: nothing in the rectangle is drawn", size));
                size = 0;
            }
        return p;
    }

  private:
    void report(const std::string& what) {
        const std::string_view name = scene_.name(node_.id());
        problems_.warningAt(scene_.locationOf(node_.id()),
                            fmt::format("Layout{}{}: {}", name.empty() ? "" : " ", name, what));
    }
    void count(std::string_view field, std::size_t values) {
        if (values == 0) report(fmt::format("{} has no values: it is taken as the default", field));
        if (values > 2) report(fmt::format("{} has {} values: the first 2 count", field, values));
    }
    template <class T, std::size_t N>
    T word(std::string_view field, std::string_view text, const Word<T> (&table)[N]) {
        const auto* found = std::ranges::find(table, text, &Word<T>::text);
        if (found != std::end(table)) return found->meaning;
        std::string known;
        for (const Word<T>& one : table) known += fmt::format("{}{}", known.empty() ? "" : ", ", one.text);
        report(fmt::format("{} \"{}\" is none of {}: taken as {}", field, text, known, table[0].text));
        return table[0].meaning;
    }
    /// One value is both.
    template <class T, std::size_t N>
    void words(std::string_view field, const Array<String>& values, const Word<T> (&table)[N], std::array<T, 2>& out) {
        count(field, values.size());
        for (std::size_t axis = 0; axis < 2 && !values.empty(); ++axis)
            out[axis] = word(field, values[std::min(axis, values.size() - 1)].view(), table);
    }
    void numbers(std::string_view field, const Array<float>& values, std::array<double, 2>& out) {
        count(field, values.size());
        for (std::size_t axis = 0; axis < 2 && !values.empty(); ++axis) {
            const float value = values[std::min(axis, values.size() - 1)];
            if (std::isfinite(value))
                out[axis] = value;
            else
                report(fmt::format("{} {} is no finite number: taken as {}", field, value, out[axis]));
        }
    }

    const Scene& scene_;
    const Node& node_;
    Diagnostics& problems_;
};

}  // namespace

LayoutParams readLayout(const Scene& scene, const Node& layout, Diagnostics& problems) {
    return Reader(scene, layout, problems).read();
}

Region wholeRegion(const LayerSight* sight) {
    const Vec2d pixels(sight ? sight->width : kUnknownWidth, sight ? sight->height : kUnknownHeight);
    const double pixel = 2 / std::min(pixels.x, pixels.y);
    return {pixels * pixel, Vec2d(pixel)};
}

Region layOut(LayoutParams p, bool outermost, const Region& around, WorldFromLocal& m) {
    Vec2d size, center, scale(1);
    for (int i = 0; i < 2; ++i) {
        const auto axis = static_cast<std::size_t>(i);
        if (outermost) {
            if (p.sizeUnits[axis] == Unit::world) p.sizeUnits[axis] = Unit::fraction;
            if (p.offsetUnits[axis] == Unit::world) p.offsetUnits[axis] = Unit::fraction;
            if (p.scale[axis] == Scale::none) p.scale[axis] = Scale::fraction;
        }
        const auto length = [&](double value, Unit unit) {
            return value * (unit == Unit::fraction ? around.size[i] : unit == Unit::pixel ? around.pixel[i] : 1);
        };
        size[i] = length(p.size[axis], p.sizeUnits[axis]);
        center[i] = p.align[axis] * (around.size[i] - size[i]) / 2 + length(p.offset[axis], p.offsetUnits[axis]);
        if (p.scale[axis] == Scale::fraction) scale[i] = size[i];
        if (p.scale[axis] == Scale::pixel) scale[i] = around.pixel[i];
    }
    m = WorldFromLocal(Vec3d(0), Vec3d(0), Vec3d(0), Vec3d(center, 0));
    if (!(size.x > 0 && size.y > 0)) return {Vec2d(0), around.pixel};
    const bool across = p.scale[0] == Scale::stretch, upwards = p.scale[1] == Scale::stretch;
    if (across && upwards)
        scale = std::max(size.x / around.pixel.x, size.y / around.pixel.y) * around.pixel;
    else if (across)
        scale.x = scale.y / around.pixel.y * around.pixel.x;
    else if (upwards)
        scale.y = scale.x / around.pixel.x * around.pixel.y;
    const Region own{size / scale, around.pixel / scale};
    // The depth is scaled like the smaller direction, so that evenly scaled content keeps its shape.
    const double depth = std::max(around.pixel.x, around.pixel.y) / std::max(own.pixel.x, own.pixel.y);
    m[0].x = scale.x, m[1].y = scale.y, m[2].z = depth;
    return own;
}

const LayerSight* sightOf(std::span<const LayerSight> sights, std::uint16_t layer) {
    const auto found = std::ranges::find(sights, layer, &LayerSight::layer);
    return found == sights.end() ? nullptr : &*found;
}

double pixelAt(const LayerSight* sight, bool laidOut, const Vec3d& position) {
    if (laidOut) return wholeRegion(sight).pixel.x;
    if (!sight) return kUnknownPixel;
    switch (sight->kind) {
        case LayerSight::Kind::parallel:
            return sight->pixel();
        case LayerSight::Kind::around:
            return sight->pixel() * glm::length(position - sight->eye);
        default:
            return sight->pixel() * std::abs(glm::dot(position - sight->eye, sight->forward));
    }
}

bool scaleToPixels(const WorldFromLocal& worldFromParent, double pixel, WorldFromLocal& m) {
    m = identityTransform();
    if (!(pixel > 0) || determinantSign(worldFromParent) == 0) return false;
    for (int axis = 0; axis < 3; ++axis) m[axis][axis] = pixel / glm::length(worldFromParent[axis]);
    return true;
}

}  // namespace rtsg::flatten

namespace rtsg {

bool areOfOneSize(const std::vector<LayerSight>& a, const std::vector<LayerSight>& b) {
    return std::ranges::equal(a, b, [](const LayerSight& one, const LayerSight& other) {
        return one.layer == other.layer && one.width == other.width && one.height == other.height;
    });
}

LayerSight::Ray LayerSight::ray(double x, double y) const {
    const double u = edges[0] + (edges[1] - edges[0]) * x, v = edges[3] + (edges[2] - edges[3]) * y;
    if (kind == Kind::parallel) return {eye + u * right + v * up, forward};
    if (kind == Kind::around)
        return {eye,
                portable::cos(v) * (portable::cos(u) * forward + portable::sin(u) * right) + portable::sin(v) * up};
    return {eye, glm::normalize(forward + u * right + v * up)};
}

}  // namespace rtsg
