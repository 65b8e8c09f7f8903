// Follows a shared world, uploads changes to the rasteriser, and asks it for pictures.
#include <rtsg/ogre/ogre_renderer.h>

#include <array>
#include <chrono>
#include <cmath>
#include <ctime>
#include <mutex>
#include <set>
#include <tuple>
#include <unordered_map>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include <rtsg/core/module.h>
#include <rtsg/renderers/surface_tables.h>

#include "delta_queue.h"
#include "raster_looks.h"
#include "raster_module.h"
#include "raster_scene.h"

namespace rtsg {

namespace {

Result<std::unique_ptr<RasterModule>> openRaster() {
#ifdef RTSG_NO_OGRE
    return fail("this program was built without a rasteriser: OGRE 1.12 was not there, or RTSG_OGRE was off");
#else
    const auto found = loadModule("rtsg_ogre_module", RTSG_OGRE_SYMBOL, "pictures by the rasteriser need");
    if (!found) return std::unexpected(found.error());
    std::string problem;
    auto module = reinterpret_cast<OpenRaster (*)()>(*found)()(problem);
    if (!module) return fail(fmt::format("there is no rasteriser here: {}", problem));
    return module;
#endif
}

/// Refuses options that a rasteriser does not support. `traces`: rays take part, so options that need no other primary
/// rays are accepted.
Result<> checkOptions(const ImageOptions& options, bool traces = false) {
    const RenderSettings& s = options.settings;
    constexpr int kMaxSide = 1 << 14;
    if (s.width < 1 || s.height < 1 || s.width > kMaxSide || s.height > kMaxSide)
        return fail(fmt::format("the rasteriser cannot draw {} x {} pixels; both must be from 1 to {}", s.width,
                                s.height, kMaxSide));
    if (s.samplesPerPixel < 1 || s.samplesPerPixel > 1 << 20)
        return fail(fmt::format("cannot take {} samples per pixel", s.samplesPerPixel));
    const auto refuse = [](const char* what) { return fail(fmt::format("the rasteriser draws no {}", what)); };
    if (!traces && (s.shadows == Shadows::all || s.shadows == Shadows::authored)) return refuse("shadows");
    if (traces && s.integrator == Integrator::path) return fail("hybrid pictures are by whitted, not by path");
    if (s.layers != 0) return refuse("layers of data");
    if (s.error > 0) return fail("the rasteriser does not estimate errors");
    if (!s.region.empty()) return refuse("parts of pictures");
    if (s.shutter > 0) return refuse("blur of motion");
    if (!traces && s.colorSpace != ColorSpace::automatic) return refuse("pictures in another colour space than auto");
    if (s.caps) return refuse("caps");
    if (options.panorama) return refuse("panoramas");
    if (options.lensRadius > 0) return refuse("blur of lenses");
    if (options.stereo != Stereo::none) return refuse("pictures for two eyes");
    return {};
}

/// The place of a sample in a pixel, from 0 to 1: the middle, or a row of places that fills it evenly. Pictures with
/// seeds of a row have other places, by the sequence R2 (Roberts 2018).
Vec2d positionOf(int sample, int samples, std::uint64_t seed) {
    if (samples == 1) return {.5, .5};
    double y = 0, fraction = .5;
    for (auto bits = static_cast<unsigned>(sample); bits; bits >>= 1, fraction /= 2) y += (bits & 1u) ? fraction : 0;
    const auto row = static_cast<double>((seed - RenderSettings().seed) & 0xFFFF);
    return glm::fract(Vec2d((sample + .5) / samples, y + .5 / samples) + row * Vec2d(0.7548776662, 0.5698402910));
}

glm::mat4 viewOf(const Camera& camera, const Vec3d& origin) {
    const glm::dmat3 steps = camera.steps();
    const glm::dmat3 rows = glm::transpose(steps);
    const Vec3d eye = camera.position - origin;
    const Vec3d axes[3] = {rows[0], rows[1], -rows[2]};
    glm::mat4 view(1.0f);
    for (int r = 0; r < 3; ++r) {
        for (int c = 0; c < 3; ++c) view[c][r] = static_cast<float>(axes[r][c]);
        view[3][r] = static_cast<float>(-glm::dot(axes[r], eye));
    }
    return view;
}

/// Fragments write their own depths; this matrix only cuts off the part behind the eye.
glm::mat4 projectionOf(const RasterView& view, bool orthographic) {
    const float width = view.rightEdge - view.left, height = view.top - view.bottom;
    glm::mat4 m(0.0f);
    m[0][0] = 2 / width, m[1][1] = 2 / height;
    const float x = (view.rightEdge + view.left) / width, y = (view.top + view.bottom) / height;
    if (orthographic) {
        m[3] = {-x, -y, 0, 1};
        m[2][2] = -1e-12f;  // far enough for all content, and not 0, since OGRE inverts the matrix
        return m;
    }
    constexpr float kNear = 1e-6f;
    m[2] = {x, y, -1, -1};
    m[3][2] = -2 * kNear;
    return m;
}

RasterView rasterView(const LayerView& layer, const Vec3d& origin, const Vec2d& point, int samples) {
    const Camera& camera = layer.camera;
    RasterView view;
    view.x = layer.left, view.y = layer.top, view.width = layer.width, view.height = layer.height;
    view.layer = camera.layer;
    const double across = (camera.rightEdge - camera.left) * (point.x - .5) / layer.width;
    const double upwards = (camera.top - camera.bottom) * (.5 - point.y) / layer.height;
    view.left = static_cast<float>(camera.left + across),
    view.rightEdge = static_cast<float>(camera.rightEdge + across);
    view.bottom = static_cast<float>(camera.bottom + upwards), view.top = static_cast<float>(camera.top + upwards);
    view.orthographic = camera.orthographic;
    view.viewFromWorld = viewOf(camera, origin);
    view.projection = projectionOf(view, camera.orthographic);
    view.eye = Vec3f(camera.position - origin), view.forward = Vec3f(camera.forward);
    view.right = Vec3f(camera.right), view.up = Vec3f(camera.up);
    const glm::dmat3 rows = glm::transpose(camera.steps()) * (camera.pixel(1) / (camera.top - camera.bottom));
    view.acrossPixels = Vec3f(rows[0]), view.upPixels = Vec3f(rows[1]);
    const auto pixel = static_cast<float>(camera.pixel(layer.height));
    view.pixelSpread = camera.orthographic ? 0 : pixel, view.pixelSize = camera.orthographic ? pixel : 0;
    const auto limit = [](double distance) { return static_cast<float>(std::min(distance, 1e30)); };
    view.nearDistance = limit(camera.nearDistance), view.farDistance = limit(camera.farDistance);
    view.visibilityLimit = limit(camera.visibilityLimit);
    view.uneven = !camera.isEven();
    const glm::dmat3 axes = camera.axes();
    view.square = glm::mat3(glm::dmat3(axes[0], axes[1], -axes[2]) * camera.steps());
    constexpr int kMaxSharing = 64;  // as the light tracer's
    view.sampleFraction = 1 / std::sqrt(static_cast<float>(std::min(samples, kMaxSharing)));
    return view;
}

}  // namespace

namespace {

/// The rasteriser's part of a state of a world.
struct RasterState {
    std::uint64_t deltas = 0;  // up to which number they count
    std::shared_ptr<const LightState> light;
};

}  // namespace

struct OgreRenderer::Impl {
    Impl(SharedWorld& w, LightRenderer::Options o)
        : world(w),
          options(std::move(o)),
          tables(w, options.resources),
          scene(std::make_unique<RasterScene>([this](const char* what) { lack(what); })) {}
    ~Impl() {
        if (module) module->run([this] { scene.reset(); });
    }

    SharedWorld& world;
    LightRenderer::Options options;
    // Used on the scene's thread.
    SurfaceTables tables;
    std::shared_ptr<const RasterState> frozen;
    std::string refused;
    Diagnostics said;
    std::size_t taken = 0;  // of the tables'
    DeltaQueue deltas;      // to the thread of the graphics
    // Used by the thread that makes pictures, and in module->run().
    std::unique_ptr<RasterModule> module;  // outlives the objects that it is given
    std::unique_ptr<RasterScene> scene;
    Picture frame;
    Camera camera;

    std::mutex mutex;  // guards the members below
    std::set<std::string> lacks;
    Diagnostics lackNews;
    std::optional<PictureSight> looked;  // by whoever looks on, last
    bool traces = false;                 // rays show the features that the rasteriser lacks
    double tracing = 0;                  // Counts::tracing
    double named = 0;                    // share of missing light that has been reported

    void lack(const char* what) {
        const std::scoped_lock lock(mutex);
        if (!traces && lacks.insert(what).second) lackNews.warning({}, fmt::format("the rasteriser: {}", what));
    }
    void takeDiagnostics() {
        const auto& news = tables.diagnostics().all();
        for (; taken < news.size(); ++taken) said.add(news[taken]);
        const std::scoped_lock lock(mutex);
        said.append(std::exchange(lackNews, Diagnostics()));
    }
    Result<> open() {
        if (!refused.empty()) return fail(refused);
        if (module) return {};
        auto opened = openRaster();
        if (!opened) return std::unexpected(opened.error());
        module = std::move(*opened);
        module->run([this] { scene->open(module.get()); });
        return {};
    }
    /// On the scene's thread: the present state.
    std::shared_ptr<const RasterState> freeze() {
        auto light = std::static_pointer_cast<const LightState>(tables.freeze());
        if (!frozen || frozen->deltas != deltas.newest() || frozen->light != light)
            frozen = std::make_shared<const RasterState>(RasterState{deltas.newest(), std::move(light)});
        return frozen;
    }

    // ---- in module->run() ------------------------------------------------------------------------------------
    /// False: the scene is in a later state.
    bool follow(const RasterState& state) {
        const auto news = deltas.take(state.deltas);
        if (!news) return false;
        for (const InstanceDelta& delta : *news) scene->follow(delta);
        return true;
    }
    Result<std::vector<LayerView>> views(const SurfaceState& state, const ImageOptions& asked, const OwnLook& look) {
        const RenderSettings& s = asked.settings;
        const bool isCoarse = look.wholeWidth > 0 && look.wholeHeight > 0;
        const double aspect = isCoarse ? static_cast<double>(look.wholeWidth) / look.wholeHeight
                                       : static_cast<double>(s.width) / s.height;
        const BoxOfLayer boxes = [this](std::uint16_t layer) { return scene->box(layer); };
        auto found = state.camera(boxes, aspect, asked.viewpoint);
        if (!found) return std::unexpected(found.error());
        camera = *found;
        if (look.eye) {
            camera = look.eye->shaped(aspect);
            camera.layer = found->layer;
        }
        return state.layers(boxes, camera, s.width, s.height);
    }
    std::vector<RasterView> viewsOf(const SurfaceState& state, const RenderSettings& s,
                                    const std::vector<LayerView>& layers, int sample) const;
    Result<std::vector<PrimarySight>> see(const RasterState& state, const RenderSettings& s,
                                          const std::vector<LayerView>& layers, int sample);
    void nameMissing(const RenderStats& stats, int depth);
    Picture draw(const SurfaceState& state, const RenderSettings& s, const std::vector<LayerView>& layers,
                 bool& cancelled);
    Result<Picture> finish(Result<Picture> picture) const {
        if (!picture) return picture;
        if (const std::string problem = module->problem(); !problem.empty())
            return fail(fmt::format("the rasteriser failed: {}", problem));
        return picture;
    }
};

OgreRenderer::OgreRenderer(SharedWorld& world, LightRenderer::Options options)
    : WorldRenderer(world), impl_(std::make_unique<Impl>(world, std::move(options))) {
    if (auto ok = attachToScene(world.scene()); !ok) impl_->refused = ok.error().text;
}

OgreRenderer::~OgreRenderer() {
    OgreRenderer::detachFromScene();
}

Result<> OgreRenderer::open() {
    return impl_->open();
}

Result<> OgreRenderer::follow(const Scene& scene, const ChangeSet& changes, const InstanceDelta& delta) {
    if (auto ok = impl_->tables.apply(scene, changes, delta); !ok) return ok;
    impl_->deltas.add(delta);
    return {};
}

std::shared_ptr<const void> OgreRenderer::freezeTables() {
    return impl_->freeze();
}

/// It is asked only where there are rays, too.
std::optional<PictureSight> OgreRenderer::looksFrom() {
    Impl& s = *impl_;
    {
        const std::scoped_lock lock(s.mutex);
        if (s.looked) return s.looked;
    }
    const RenderSettings& settings = s.options.image.settings;
    if (settings.width < 1 || settings.height < 1) return std::nullopt;
    const auto light = s.freeze()->light;
    const RayWorld& rays = world().rays();
    const auto camera = LightTracer::camera(*light, rays, static_cast<double>(settings.width) / settings.height,
                                            s.options.image.viewpoint);
    if (!camera) return std::nullopt;
    return PictureSight{EyePosition(camera->position, camera->up),
                        LightTracer::sights(LightTracer::layers(*light, rays, *camera, settings.width, settings.height),
                                            settings.width, settings.height)};
}

std::vector<RasterView> OgreRenderer::Impl::viewsOf(const SurfaceState& state, const RenderSettings& s,
                                                    const std::vector<LayerView>& layers, int sample) const {
    std::vector<RasterView> result;
    for (const LayerView& layer : layers) {
        result.push_back(
            rasterView(layer, scene->origin(), positionOf(sample, s.samplesPerPixel, s.seed), s.samplesPerPixel));
        result.back().headlight = state.headlight(layer.camera.layer);
        result.back().sky = scene->sky(result.size() - 1);
    }
    return result;
}

Picture OgreRenderer::Impl::draw(const SurfaceState& state, const RenderSettings& s,
                                 const std::vector<LayerView>& layers, bool& cancelled) {
    Picture picture(s.width, s.height);
    picture.space = ColorSpace::display;
    scene->bring(state, layers, camera.position);
    std::vector<Vec4f> drawn;
    for (int sample = 0; sample < s.samplesPerPixel && !cancelled; ++sample) {
        const std::vector<RasterView> rasterViews = viewsOf(state, s, layers, sample);
        module->draw(s.width, s.height, rasterViews, drawn);
        for (std::size_t i = 0; i < drawn.size(); ++i)
            picture.pixels[i] += drawn[i] / static_cast<float>(s.samplesPerPixel);
        cancelled = s.progress && !s.progress((sample + 1.0) / s.samplesPerPixel);
    }
    return picture;
}

namespace {

void fillStats(const RenderSettings& settings, std::chrono::steady_clock::time_point start, bool cancelled,
               RenderStats& stats) {
    stats = {};
    stats.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    stats.samples = settings.samplesPerPixel;
    stats.cancelled = cancelled;
}

}  // namespace

/// Brings the world up to date for the picture's eye, and finds its layers.
Result<std::vector<LayerView>> OgreRenderer::look(const ImageOptions& options) {
    Impl& s = *impl_;
    if (auto ok = s.open(); !ok) return std::unexpected(ok.error());
    if (auto ok = begin(); !ok) return std::unexpected(ok.error());
    Result<std::vector<LayerView>> layers;
    s.module->run([&] {
        const auto state = s.freeze();
        layers = s.follow(*state) ? s.views(SurfaceState(state->light), options, {})
                                  : Result<std::vector<LayerView>>(fail("the rasteriser shows a later state"));
    });
    if (!layers) return layers;
    std::vector<LayerSight> sights;
    if (world().flattener().usesPixels())
        sights = LightTracer::sights(*layers, options.settings.width, options.settings.height);
    if (auto ok = world().setViewer(EyePosition(s.camera.position, s.camera.up), std::move(sights)); !ok)
        return std::unexpected(ok.error());
    presentsNow();
    return layers;
}

Result<Picture> OgreRenderer::nextPicture(const ImageOptions& options, RenderStats* stats) {
    Impl& s = *impl_;
    if (auto ok = checkOptions(options); !ok) return std::unexpected(ok.error());
    const auto start = std::chrono::steady_clock::now();
    const auto layers = look(options);
    if (!layers) return std::unexpected(layers.error());
    bool cancelled = false;
    const auto state = s.freeze();
    Result<Picture> picture;
    s.module->run([&] {
        (void)s.follow(*state);  // the scene rests meanwhile
        picture = s.finish(s.draw(SurfaceState(state->light), options.settings, *layers, cancelled));
    });
    if (picture && stats) fillStats(options.settings, start, cancelled, *stats);
    return picture;
}

namespace {

/// The surfaces that were drawn in a layer, as the start of rays. The number of a drawn thing is twice its instance's
/// slot, or one more.
PrimarySight sightOf(const LayerView& layer, const Vec2d& point, int samples, const std::vector<Vec4f>& numbers,
                     std::vector<Vec4f> colors) {
    PrimarySight sight;
    sight.width = layer.width, sight.height = layer.height, sight.position = point, sight.samples = samples;
    sight.colors = std::move(colors);
    sight.instances.reserve(numbers.size()), sight.depths.reserve(numbers.size());
    for (const Vec4f& pixel : numbers) {
        const bool isNamed = pixel.x <= static_cast<float>(RasterModule::kMaxNamed);
        sight.instances.push_back(!(pixel.x >= 1) ? kNoInstance
                                  : isNamed       ? (static_cast<std::uint32_t>(pixel.x) - 1) / 2
                                                  : kUnnamedInstance);
        sight.depths.push_back(pixel.y);
    }
    return sight;
}

}  // namespace

Result<std::vector<PrimarySight>> OgreRenderer::Impl::see(const RasterState& state, const RenderSettings& s,
                                                          const std::vector<LayerView>& layers, int sample) {
    const SurfaceState surfaces(state.light);
    (void)follow(state);  // the scene rests meanwhile
    scene->bring(surfaces, layers, camera.position);
    std::vector<PrimarySight> result;
    std::vector<RasterView> all = viewsOf(surfaces, s, layers, sample);
    for (std::size_t i = 0; i < layers.size(); ++i) {
        RasterView& view = all[i];
        view.x = view.y = 0;
        std::vector<Vec4f> numbers, colors;
        module->drawNumbers(view.width, view.height, view, numbers);
        module->draw(view.width, view.height, {view}, colors);
        result.push_back(sightOf(layers[i], positionOf(sample, s.samplesPerPixel, s.seed), s.samplesPerPixel, numbers,
                                 std::move(colors)));
    }
    if (const std::string problem = module->problem(); !problem.empty())
        return fail(fmt::format("the rasteriser failed: {}", problem));
    return result;
}

/// Light that is missing is named, and again once it has doubled.
void OgreRenderer::Impl::nameMissing(const RenderStats& stats, int depth) {
    constexpr double kVisible = 2 / 255.0;
    const std::scoped_lock lock(mutex);
    if (!(stats.missingMaximum > std::max(kVisible, 2 * named))) return;
    named = stats.missingMaximum;
    lackNews.warning({},
                     fmt::format("rays were cut off after {} mirrorings and refractions: up to {:.2g} % of a pixel's "
                                 "light is missing, {:.2g} % of the picture's",
                                 depth, 100 * stats.missingMaximum, 100 * stats.missing));
}

namespace {

double processCpuSeconds() {
    timespec now{};
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

}  // namespace

Result<Picture> OgreRenderer::hybridPicture(const ImageOptions& options, RenderStats* stats) {
    Impl& s = *impl_;
    if (auto ok = checkOptions(options, true); !ok) return std::unexpected(ok.error());
    const auto start = std::chrono::steady_clock::now();
    s.traces = true;
    const RayWorld& rays = world().rays();
    const auto layers = look(options);
    if (!layers) return std::unexpected(layers.error());
    const auto state = s.freeze();
    const int samples = options.settings.samplesPerPixel;
    const float fraction = 1 / static_cast<float>(samples);
    RenderStats all;
    Picture picture;
    for (int sample = 0; sample < samples && !all.cancelled; ++sample) {
        Result<std::vector<PrimarySight>> seen;
        s.module->run([&] { seen = s.see(*state, options.settings, *layers, sample); });
        if (!seen) return std::unexpected(seen.error());
        RenderSettings own = options.settings;
        own.integrator = Integrator::whitted, own.samplesPerPixel = 1;
        if (own.progress)
            own.progress = [&](double done) { return options.settings.progress((sample + done) / samples); };
        RenderStats drawn;
        const double begun = processCpuSeconds();
        const auto traced = SurfaceState(state->light).trace(rays, s.camera, own, *seen, &drawn);
        s.tracing += processCpuSeconds() - begun;
        if (!traced) return std::unexpected(traced.error());
        if (sample == 0) picture = Picture(traced->width, traced->height), picture.space = traced->space;
        for (std::size_t i = 0; i < picture.pixels.size(); ++i) picture.pixels[i] += fraction * traced->pixels[i];
        all.primaryRays += drawn.primaryRays, all.secondaryRays += drawn.secondaryRays;
        all.shadowRays += drawn.shadowRays, all.missing += drawn.missing / samples;
        all.missingMaximum = std::max(all.missingMaximum, drawn.missingMaximum), all.cancelled = drawn.cancelled;
    }
    s.nameMissing(all, options.settings.maxDepth);
    if (!stats) return picture;
    *stats = all;
    stats->samples = samples;
    stats->seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return picture;
}

Result<Picture> OgreRenderer::nextPicture(const WorldState& state, const ImageOptions& options, const OwnLook& look,
                                          RenderStats& stats) {
    Impl& s = *impl_;
    if (auto ok = checkOptions(options); !ok) return std::unexpected(ok.error());
    if (auto ok = s.open(); !ok) return std::unexpected(ok.error());
    const auto own = std::static_pointer_cast<const RasterState>(begin(state));
    if (!own) return fail("the rasteriser: this state was made without it");
    const auto start = std::chrono::steady_clock::now();
    const RenderSettings& settings = options.settings;
    const int width = look.wholeWidth > 0 ? look.wholeWidth : settings.width;
    const int height = look.wholeHeight > 0 ? look.wholeHeight : settings.height;
    bool cancelled = false;
    Result<Picture> picture{Picture()};
    std::vector<LayerSight> sights;
    s.module->run([&] {
        cancelled = !s.follow(*own);
        if (cancelled) return;
        const SurfaceState surfaces(own->light);
        const auto layers = s.views(surfaces, options, look);
        if (!layers) {
            picture = std::unexpected(layers.error());
            return;
        }
        const BoxOfLayer boxes = [&](std::uint16_t layer) { return s.scene->box(layer); };
        if (state.sights) sights = LightTracer::sights(surfaces.layers(boxes, s.camera, width, height), width, height);
        picture = s.finish(s.draw(surfaces, settings, *layers, cancelled));
    });
    if (!picture) return picture;
    if (state.sights) {
        const std::scoped_lock lock(s.mutex);
        s.looked = PictureSight{EyePosition(s.camera.position, s.camera.up), sights};
    }
    world().lookFrom(EyePosition(s.camera.position, s.camera.up), std::move(sights));
    fillStats(settings, start, cancelled, stats);
    return picture;
}

Result<> OgreRenderer::renderFrame(const WorldState& state) {
    RenderStats stats;
    auto picture = nextPicture(state, impl_->options.image, {}, stats);
    if (!picture) return std::unexpected(picture.error());
    if (stats.cancelled && picture->pixels.empty()) return fail("the rasteriser has shown a later state already");
    impl_->frame = std::move(*picture);
    return {};
}

Result<> OgreRenderer::renderFrame() {
    auto picture = nextPicture(impl_->options.image);
    if (!picture) return std::unexpected(picture.error());
    impl_->frame = std::move(*picture);
    return {};
}

const Picture& OgreRenderer::frame() const {
    return impl_->frame;
}
const Camera& OgreRenderer::camera() const {
    return impl_->camera;
}
std::string OgreRenderer::driver() const {
    return impl_->module ? impl_->module->driver() : std::string();
}
OgreRenderer::Counts OgreRenderer::counts() const {
    Counts counts = impl_->scene->counts();
    counts.tracing = impl_->tracing;
    return counts;
}
RasterContent OgreRenderer::content() const {
    return impl_->scene->content();
}
const Diagnostics& OgreRenderer::diagnostics() const {
    impl_->takeDiagnostics();
    return impl_->said;
}

}  // namespace rtsg
