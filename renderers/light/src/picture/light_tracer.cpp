// LightTracer: its tables, and queries before a picture is drawn.
#include <rtsg/renderers/light_tracer.h>

#include <chrono>
#include <cmath>
#include <memory>

#include <fmt/format.h>

#include <rtsg/renderers/picking.h>
#include <rtsg/renderers/shared_world.h>

#include "draw.h"
#include "seen_surfaces.h"
#include "tables/left_out.h"
#include "tables/light_tables.h"

namespace rtsg {

using namespace trace;

namespace {

Result<> checkPicture(const Camera& camera, const RenderSettings& settings) {
    constexpr int kMaxSide = 1 << 16;
    if (settings.width < 1 || settings.height < 1 || settings.width > kMaxSide || settings.height > kMaxSide)
        return fail(fmt::format("cannot render {} x {} pixels; both must be from 1 to {}", settings.width,
                                settings.height, kMaxSide));
    const PixelRegion& part = settings.region;
    if (part != PixelRegion() && (part.empty() || part.left < 0 || part.top < 0 ||
                                  part.width > settings.width - part.left || part.height > settings.height - part.top))
        return fail(fmt::format("a region of {} x {} pixels at {}, {} is not in a picture of {} x {}", part.width,
                                part.height, part.left, part.top, settings.width, settings.height));
    if (settings.samplesPerPixel < 1 || settings.samplesPerPixel > 1 << 20)
        return fail(fmt::format("cannot take {} samples per pixel", settings.samplesPerPixel));
    if (!(settings.error >= 0) || !std::isfinite(settings.error))
        return fail(fmt::format("cannot reach an error of {}", settings.error));
    if (settings.layers & ~kAllLayers) return fail("there is no such layer");
    if (settings.integrator == Integrator::raster)
        return fail("the rasteriser is not built in; there are whitted and path");
    if (settings.integrator == Integrator::path && settings.colorSpace == ColorSpace::display)
        return fail("paths are light: they cannot be computed in the display's space, only auto and linear");
    if (!(camera.lensRadius >= 0) || !(camera.focus > 0) || !std::isfinite(camera.lensRadius + camera.focus))
        return fail(fmt::format("a lens of radius {} focused at {} m cannot be", camera.lensRadius, camera.focus));
    if (camera.lensRadius > 0 && (camera.orthographic || camera.panorama)) return fail("only perspectives have a lens");
    if (!(settings.shutter >= 0) || settings.shutter > 1)
        return fail(
            fmt::format("a shutter is open for 0 to 1 of the time between two pictures, not for {}", settings.shutter));
    if (settings.shutter > 0 && settings.samplesPerPixel == 1)
        return fail("a shutter needs more than one sample a pixel, to be open at more than one instant");
    return {};
}

Picture drawWhole(const LightState& state, const RayView& world, const Camera& camera, const RenderSettings& settings,
                  RenderStats& stats, Trail* trail, std::span<const PrimarySight> seen = {}) {
    const auto start = std::chrono::steady_clock::now();
    stats = {};
    const Part whole{camera.forward, {}, false, true, seen.empty() ? nullptr : seen.data()};
    Picture picture = state.layers ? drawLayers(state, world, camera, settings, stats, trail, seen)
                                   : drawPart(state, world, camera, settings, whole, stats, trail);
    stats.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return picture;
}

}  // namespace

Result<Picture> LightTracer::render(const LightState& state, const RayView& world, const Camera& camera,
                                    const RenderSettings& settings, RenderStats* stats) {
    if (auto ok = checkPicture(camera, settings); !ok) return std::unexpected(ok.error());
    RenderStats drawn;
    Picture picture = drawWhole(state, world, camera, settings, drawn, nullptr);
    if (stats) *stats = drawn;
    return picture;
}

namespace {

Result<> checkSights(const Camera& camera, const RenderSettings& settings, const std::vector<LayerView>& views,
                     std::span<const PrimarySight> seen) {
    if (settings.integrator != Integrator::whitted || settings.samplesPerPixel != 1 || settings.error > 0 ||
        settings.layers != 0 || settings.caps || settings.shutter > 0 || camera.panorama || camera.lensRadius > 0)
        return fail(
            "what a rasteriser has seen says nothing of paths, several samples, errors to reach, layers of data, "
            "caps, shutters, panoramas and lenses");
    if (seen.size() != views.size())
        return fail(
            fmt::format("a picture of {} layers cannot start from what was seen of {}", views.size(), seen.size()));
    for (std::size_t i = 0; i < seen.size(); ++i) {
        const PrimarySight& sight = seen[i];
        const auto pixels = static_cast<std::size_t>(views[i].width) * static_cast<std::size_t>(views[i].height);
        if (sight.width != views[i].width || sight.height != views[i].height || sight.instances.size() != pixels ||
            sight.depths.size() != pixels || sight.colors.size() != pixels)
            return fail(
                fmt::format("what was seen of a layer is not of its {} x {} pixels", views[i].width, views[i].height));
        if (!(sight.position.x >= 0 && sight.position.x <= 1 && sight.position.y >= 0 && sight.position.y <= 1) ||
            sight.samples < 1)
            return fail("what was seen lies at no place of its pixels");
    }
    return {};
}

}  // namespace

Result<Picture> SurfaceState::trace(const RayView& world, const Camera& camera, const RenderSettings& settings,
                                    std::span<const PrimarySight> seen, RenderStats* stats) const {
    if (auto ok = checkPicture(camera, settings); !ok) return std::unexpected(ok.error());
    const auto views = LightTracer::layers(*state_, world, camera, settings.width, settings.height);
    if (auto ok = checkSights(camera, settings, views, seen); !ok) return std::unexpected(ok.error());
    RenderStats drawn;
    Picture picture = drawWhole(*state_, world, camera, settings, drawn, nullptr, seen);
    if (stats) *stats = drawn;
    return picture;
}

Result<Picture> trace::drawNext(const std::shared_ptr<const LightState>& state,
                                const std::shared_ptr<const WorldVersion>& world, const Camera& camera,
                                const RenderSettings& settings, RenderStats& stats, Trail& trail) {
    if (auto ok = checkPicture(camera, settings); !ok) return std::unexpected(ok.error());
    trail.begin(state, world, settings);
    Picture picture = drawWhole(*state, *world, camera, settings, stats, &trail);
    trail.end(!stats.cancelled);
    return picture;
}

struct LightTracer::Impl {
    explicit Impl(std::shared_ptr<TextureStore> textures) : tables(std::move(textures)) {}
    LightTables tables;
};

LightTracer::LightTracer(Resources resources)
    : impl_(std::make_unique<Impl>(std::make_shared<TextureStore>(std::move(resources)))) {}
LightTracer::LightTracer(SharedWorld& world, const Resources& resources)
    : impl_(std::make_unique<Impl>(sharedTextures(world, resources))) {}
LightTracer::~LightTracer() = default;

Result<> LightTracer::apply(const Scene& scene, const ChangeSet& changes, const InstanceDelta& delta) {
    impl_->tables.apply(scene, changes, delta);
    return {};
}

std::shared_ptr<const void> LightTracer::freeze() {
    return latest();
}
std::shared_ptr<const LightState> LightTracer::latest() {
    return impl_->tables.latest();
}

Result<Camera> LightTracer::camera(const RayView& world, double aspect, std::string_view name) const {
    return camera(impl_->tables.now(), world, aspect, name);
}
Result<Picture> LightTracer::render(const RayView& world, const Camera& camera, const RenderSettings& settings,
                                    RenderStats* stats) const {
    return render(impl_->tables.now(), world, camera, settings, stats);
}

namespace {

/// `cutFor`: what a view's eye does not see; `seenBy`: which surfaces it sees.
template <class CutFor, class SeenBy>
Result<Pick> pickIn(const Picker& picker, const std::vector<LayerView>& views, double x, double y, const CutFor& cutFor,
                    const SeenBy& seenBy) {
    for (auto view = views.rbegin(); view != views.rend(); ++view) {
        const double across = (x - view->left) / view->width, down = (y - view->top) / view->height;
        if (!(across >= 0 && across <= 1 && down >= 0 && down <= 1)) continue;
        const Camera& camera = view->camera;
        const Camera::WorldRay ray = camera.ray(across, down);
        const auto [from, to] = camera.reach(ray.direction);
        if (!(to > from)) continue;
        const std::shared_ptr<const RayFilter> cut = cutFor(camera);
        const std::shared_ptr<const SeenSurfaces> seen = seenBy(*view);
        auto found = picker.ray(ray.origin + from * ray.direction, ray.direction, camera.layer, to - from,
                                lensOf(picker.world(), camera, view->height), cut.get(), seen.get());
        if (found && *found) found->distance += from;
        if (!found || *found) return found;
    }
    return Pick();
}

/// By the tables.
class SeenInView final : public SurfacesInPicture {
  public:
    SeenInView(const LightState& state, const LayerView& view) : state_(state), view_(view) {}

  protected:
    Drawn drawn(const RayInstance& instance) const override {
        const std::uint32_t at = instance.info.id.slot;
        const SlotShading slot = at < state_.slots.size() ? state_.slots[at] : SlotShading();
        const std::shared_ptr<const MaterialEntry>& entry = state_.materials[slot.material];
        return {std::shared_ptr<const Material>(entry, &entry->material), slot};
    }
    bool mayBeClear(const RayInstance& instance) const override { return drawn(instance).material->transmits(); }
    TraceScene sceneFor(const RayView& view, const Ray&) const override {
        TraceScene scene;
        scene.pixelOf(view, view_.camera, view_.height);
        return scene;
    }

  private:
    const LightState& state_;
    const LayerView& view_;
};

}  // namespace

Result<Pick> LightTracer::pick(const Picker& picker, const std::vector<LayerView>& views, double x, double y) {
    return pickIn(
        picker, views, x, y, [](const Camera&) { return std::shared_ptr<const RayFilter>(); },
        [](const LayerView&) { return std::shared_ptr<const SeenSurfaces>(); });
}

Result<Pick> LightTracer::pick(const Picker& picker, const RayView& world, const std::vector<LayerView>& views,
                               double x, double y) const {
    const LightState state = impl_->tables.now();
    return pickIn(
        picker, views, x, y, [&](const Camera& camera) { return clipFilter(state, world, RenderSettings(), &camera); },
        [&](const LayerView& view) { return std::make_shared<const SeenInView>(state, view); });
}

std::vector<LayerView> LightTracer::layers(const RayView& world, const Camera& camera, int width, int height) const {
    return layers(impl_->tables.now(), world, camera, width, height);
}

LightTracer::Counts LightTracer::counts() const {
    return impl_->tables.counts();
}
const Diagnostics& LightTracer::diagnostics() const {
    impl_->tables.reportOfDamage();
    return impl_->tables.diagnostics();
}

}  // namespace rtsg
