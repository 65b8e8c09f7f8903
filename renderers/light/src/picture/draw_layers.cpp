// A LayerSet's layers: their rectangles in a picture, their eyes, and their composition.
#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "data_layers.h"
#include "draw.h"
#include "tables/active.h"

namespace rtsg {

using namespace trace;

namespace {

bool isSameView(const Camera& a, const Camera& b) {
    return a.position == b.position && a.right == b.right && a.up == b.up && a.forward == b.forward &&
           a.orthographic == b.orthographic && a.left == b.left && a.rightEdge == b.rightEdge && a.bottom == b.bottom &&
           a.top == b.top;
}

/// The part of a picture's region that a layer is seen in, in pixels of the layer.
PixelRegion partIn(const LayerView& view, const PixelRegion& region) {
    const int left = std::max(region.left, view.left), top = std::max(region.top, view.top);
    return {left - view.left, top - view.top, std::min(region.left + region.width, view.left + view.width) - left,
            std::min(region.top + region.height, view.top + view.height) - top};
}

/// Lays a picture over a part of another.
void layOver(const Picture& over, int left, int topmost, Picture& under) {
    const auto at = [](const Picture& p, int x, int y) {
        return static_cast<std::size_t>(y) * static_cast<std::size_t>(p.width) + static_cast<std::size_t>(x);
    };
    for (int y = 0; y < over.height; ++y)
        for (int x = 0; x < over.width; ++x) {
            const std::size_t to = at(under, left + x, topmost + y), from = at(over, x, y);
            const Vec4f& pixel = over.pixels[from];
            const float rest = 1 - std::clamp(pixel.a, 0.0f, 1.0f);
            under.pixels[to] = pixel + under.pixels[to] * rest;
            if (pixel.a > 0) copyLayerData(over, from, under, to);
            if (!under.interval.empty()) under.interval[to] = over.interval[from] + under.interval[to] * rest;
        }
}

/// The slots that are not of a layer; empty: none is.
std::vector<bool> outsideOf(std::uint16_t layer, const RayView& world) {
    std::vector<bool> outside(world.instances().size());
    bool any = false;
    for (std::uint32_t slot = 0; slot < outside.size(); ++slot) {
        const RayInstance& instance = world.instance(slot);
        outside[slot] = instance.info.layer != layer;
        any = any || (!outside[slot] && instance.info.id && instance.mesh);
    }
    return any ? outside : std::vector<bool>();
}

/// In place of drawing a layer in which nothing is.
void passOver(const LayerView& view, Trail& trail) {
    Trail::Part& part = trail.next(view.camera);
    part = {part.camera, Picture(), {}, {}, {}};
}

void addStats(const RenderStats& part, double fraction, RenderStats& sum) {
    sum.primaryRays += part.primaryRays, sum.shadowRays += part.shadowRays, sum.secondaryRays += part.secondaryRays;
    sum.missing += part.missing * fraction, sum.missingMaximum = std::max(sum.missingMaximum, part.missingMaximum);
    sum.error = std::hypot(sum.error, part.error * std::sqrt(fraction));
    sum.noise = std::hypot(sum.noise, part.noise * std::sqrt(fraction)), sum.mean += part.mean * fraction;
    sum.unreached += part.unreached * fraction, sum.samples += part.samples * fraction,
        sum.kept += part.kept * fraction;
    sum.hiddenLight = std::max(sum.hiddenLight, part.hiddenLight);
    sum.lostLight = std::max(sum.lostLight, part.lostLight);
    sum.cancelled = sum.cancelled || part.cancelled;
}

}  // namespace

Picture trace::drawLayers(const LightState& state, const RayView& world, const Camera& camera,
                          const RenderSettings& settings, RenderStats& stats, Trail* trail,
                          std::span<const PrimarySight> seen) {
    const auto views = LightTracer::layers(state, world, camera, settings.width, settings.height);
    const PixelRegion region =
        settings.region.empty() ? PixelRegion{0, 0, settings.width, settings.height} : settings.region;
    Picture picture(region.width, region.height);
    picture.space = settings.colorSpace == ColorSpace::linear || settings.integrator == Integrator::path
                        ? ColorSpace::linear
                        : ColorSpace::display;
    if (settings.error > 0) picture.interval.resize(picture.pixels.size(), Vec3f(0));
    if (settings.layers != 0) addLayers(world, settings, picture);
    for (std::size_t i = 0; i < views.size() && !stats.cancelled; ++i) {
        const LayerView& view = views[i];
        std::vector<bool> outside = outsideOf(view.camera.layer, world);
        const PixelRegion shown = partIn(view, region);
        const bool isEmpty = i > 0 && outside.empty() && !active<SkyEntry>(state, view.camera.layer);
        if (isEmpty || shown.empty()) {
            if (trail) passOver(view, *trail);
            const double done = (static_cast<double>(i) + 1) / static_cast<double>(views.size());
            if (settings.progress && !settings.progress(done)) stats.cancelled = true;
            continue;
        }
        outside.resize(world.instances().size(), true);
        RenderSettings own = settings;
        own.width = view.width, own.height = view.height, own.region = shown;
        if (settings.before && !isSameView(view.camera, camera))  // of other eyes nothing is known of the time before
            own.before = std::make_shared<const PictureBefore>(PictureBefore{settings.before->world, view.camera});
        if (settings.progress)
            own.progress = [&](double done) {
                return settings.progress((static_cast<double>(i) + done) / static_cast<double>(views.size()));
            };
        const Part part{.headlight = view.camera.forward,
                        .hidden = std::move(outside),
                        .over = i > 0,
                        .sight = seen.empty() ? nullptr : &seen[i]};
        RenderStats drawn;
        const Picture layer = drawPart(state, world, view.camera, own, part, drawn, trail);
        const double fraction = double{1} * shown.width * shown.height / (double{1} * region.width * region.height);
        addStats(drawn, fraction, stats);
        layOver(layer, view.left + shown.left - region.left, view.top + shown.top - region.top, picture);
    }
    return picture;
}

std::vector<LayerView> LightTracer::layers(const LightState& state, const RayView& world, const Camera& camera,
                                           int width, int height) {
    return findLayers(state, boxesOf(state, world), camera, width, height);
}

std::vector<LayerView> trace::findLayers(const LightState& state, const BoxOfLayer& boxes, const Camera& camera,
                                         int width, int height) {
    if (!state.layers) return {{camera, 0, 0, width, height}};
    std::vector<LayerView> result;
    for (const LayerList::Layer& layer : state.layers->order) {
        const auto at = [](float fraction, int size) {
            return static_cast<int>(std::lround(fraction * static_cast<float>(size)));
        };
        LayerView view;
        view.left = at(layer.clip[0], width), view.width = at(layer.clip[1], width) - view.left;
        view.top = height - at(layer.clip[3], height), view.height = height - at(layer.clip[2], height) - view.top;
        if (view.width < 1 || view.height < 1) continue;
        const double aspect = static_cast<double>(view.width) / view.height;
        const bool whole = view.width == width && view.height == height;
        const auto ofLayer = [&](double shape) {
            return cameraOf(state, boxes, active<View>(state, layer.number), layer.number, shape);
        };
        if (layer.number != camera.layer)
            view.camera = ofLayer(aspect);
        else if (whole)
            view.camera = camera;
        else  // of an eye that is no viewpoint's it is not known what must be seen
            view.camera = isSameView(camera, ofLayer(static_cast<double>(width) / height)) ? ofLayer(aspect)
                                                                                           : camera.shaped(aspect);
        result.push_back(view);
    }
    return result;
}

}  // namespace rtsg
