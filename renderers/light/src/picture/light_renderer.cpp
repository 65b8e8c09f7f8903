// Pictures from the shared world: camera, levels of detail for it, tracing, then what node renderers draw themselves.
#include <rtsg/renderers/light_renderer.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <mutex>
#include <thread>
#include <tuple>
#include <utility>

#include <fmt/format.h>

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>

#include "data_layers.h"
#include "draw.h"

namespace rtsg {

using namespace trace;

struct LightRenderer::Impl {
    Impl(SharedWorld& world, Options o) : options(std::move(o)), rays(world.rays()), tracer(world, options.resources) {}

    Options options;
    const RayWorld& rays;
    LightTracer tracer;
    std::string refused;           // why it could not be attached
    std::thread::id scenesThread;  // that last told of changes
    Picture frame;
    Camera camera;
    RenderStats stats;
    std::shared_ptr<const PictureBefore> before;  // of the next picture, where one is asked for
    std::array<trace::Trail, 2> trails;           // of each eye, where pixels are kept
    Diagnostics said;                             // the tracer's and its own
    std::size_t taken = 0;                        // of the tracer's
    std::atomic<std::uint64_t> prepared{0};       // the last prepare()'s moment
    std::mutex mutex;                             // guards the members below: pictures of states are made on other
                                                  // threads
    Diagnostics lacks;                            // of pictures, not yet in `said`
    double named = 0;                             // share of missing light that has been reported
    bool reportedOfEye = false;                   // that sees nothing of the scene where it is
    std::optional<PictureSight> looked;           // by whoever looks on, last

    /// Whether the pictures of a series may leave a trail. Layers of paths are kept with them, but for what hangs on
    /// names or on the picture before.
    static bool keeps(const ImageOptions& options) {
        const RenderSettings& settings = options.settings;
        const std::uint32_t kept = settings.integrator == Integrator::path ? kDepth | kPosition | kNormal | kAlbedo : 0;
        return options.keep && settings.shutter == 0 && !(settings.layers & ~kept);
    }
    void look(PictureSight sight) {
        const std::lock_guard lock(mutex);
        looked = std::move(sight);
    }
    std::optional<PictureSight> ownLook() {
        const std::lock_guard lock(mutex);
        return looked;
    }
    void takeDiagnostics() {
        const auto& news = tracer.diagnostics().all();
        for (; taken < news.size(); ++taken) said.add(news[taken]);
        const std::lock_guard lock(mutex);
        said.append(std::exchange(lacks, Diagnostics()));
    }
    /// An eye so far away that no ray starts there, or nowhere, is named; again once it was elsewhere.
    void nameFarEye(const RayView& world) {
        const Vec3d from = glm::abs(camera.position - world.origin());
        const bool tooFar = std::max({from.x, from.y, from.z}) > double{RayView::kMaxCoordinate};
        const std::lock_guard lock(mutex);
        if (!camera.nowhere && !tooFar) {
            reportedOfEye = false;
        } else if (!std::exchange(reportedOfEye, true)) {
            lacks.warning({}, camera.nowhere
                                  ? "the viewpoint's place is no number, or more than 1e18 m away: the picture is seen "
                                    "from 0 0 10"
                                  : fmt::format("the eye is more than {:g} m from the scene: nothing of it is seen",
                                                RayView::kMaxCoordinate));
        }
    }
    /// Two digits, but of 100 all three.
    static std::string percent(double fraction) {
        return fraction < .1 ? fmt::format("{:.2g}", 100 * fraction) : fmt::format("{:.0f}", 100 * fraction);
    }
    /// Light that is missing is named; again only once it has doubled, or a film would repeat it frame by frame.
    void nameMissing(const RenderSettings& settings) {
        constexpr double kVisible = 2 / 255.0;
        const std::lock_guard lock(mutex);
        if (!(stats.missingMaximum > std::max(kVisible, 2 * named))) return;
        named = stats.missingMaximum;
        const bool path = settings.integrator == Integrator::path;
        lacks.warning({},
                      fmt::format("rays were cut off after {} {}: up to {} % of a pixel's light is missing, {} "
                                  "% of the picture's{}",
                                  path ? 10'000 : settings.maxDepth, path ? "bounces" : "mirrorings and refractions",
                                  percent(stats.missingMaximum), percent(stats.missing),
                                  path || settings.maxDepth >= 250 ? "" : "; --depth raises the limit"));
    }
};

LightRenderer::LightRenderer(SharedWorld& world) : LightRenderer(world, Options()) {}
LightRenderer::LightRenderer(SharedWorld& world, Options options)
    : WorldRenderer(world), impl_(std::make_unique<Impl>(world, std::move(options))) {
    if (auto ok = attachToScene(world.scene()); !ok) impl_->refused = ok.error().text;
}
LightRenderer::~LightRenderer() {
    LightRenderer::detachFromScene();
}

Result<> LightRenderer::follow(const Scene& scene, const ChangeSet& changes, const InstanceDelta& delta) {
    impl_->scenesThread = std::this_thread::get_id();
    return impl_->tracer.apply(scene, changes, delta);
}

std::shared_ptr<const void> LightRenderer::freezeTables() {
    return impl_->tracer.latest();
}

namespace {

/// Width over height; 0 for sizes that no picture has.
double aspectOf(const RenderSettings& settings) {
    if (settings.width < 1 || settings.height < 1) return 0;
    return static_cast<double>(settings.width) / settings.height;
}

/// The camera with the options that concern the eye.
Camera equipped(Camera camera, const ImageOptions& options) {
    if (options.panorama) return camera.around();
    camera.lensRadius = options.lensRadius;
    if (options.focus > 0) camera.focus = options.focus;
    return camera;
}

/// Joins two pictures of one size, with their statistics.
Picture joined(const Picture& first, const Picture& second, bool beside) {
    Picture both(first.width * (beside ? 2 : 1), first.height * (beside ? 1 : 2));
    both.space = first.space, both.notes = first.notes;
    if (!first.interval.empty()) both.interval.resize(both.pixels.size());
    for (const PictureLayer& layer : first.layers)
        both.layers.push_back({layer.channels, layer.integers, std::vector<float>(2 * layer.values.size())});
    const auto width = static_cast<std::size_t>(first.width);
    for (int eye = 0; eye < 2; ++eye) {
        const Picture& from = eye == 0 ? first : second;
        const std::size_t start = eye == 0 ? 0 : beside ? width : from.pixels.size();
        for (std::size_t i = 0; i < from.pixels.size(); ++i) {
            const std::size_t to = start + i / width * static_cast<std::size_t>(both.width) + i % width;
            both.pixels[to] = from.pixels[i];
            if (!from.interval.empty()) both.interval[to] = from.interval[i];
            trace::copyLayerData(from, i, both, to);
        }
    }
    return both;
}

bool asksForMotion(const RenderSettings& settings) {
    return settings.shutter > 0 || (settings.layers & kMotion);
}

/// `draw(eye, camera, settings)`: a picture, and its counts added; the eye is 0, of two the right one is 1.
template <class Draw>
Result<Picture> eachEye(const Camera& camera, const ImageOptions& options, const RenderSettings& settings,
                        const Draw& draw) {
    if (options.stereo == Stereo::none) return draw(0, camera, settings);
    if (!settings.region.empty()) return fail("two eyes' pictures are made whole, without a region");
    if (camera.orthographic || camera.panorama) return fail("only perspectives have two eyes");
    const double distance = options.focus > 0 ? options.focus : std::numeric_limits<double>::infinity();
    const auto one = [&](int eye, double offset) {
        RenderSettings own = settings;
        if (const PictureBefore* before = settings.before.get())
            own.before = std::make_shared<const PictureBefore>(
                PictureBefore{before->world, before->camera.beside(offset, distance)});
        return draw(eye, camera.beside(offset, distance), own);
    };
    auto left = one(0, -options.eyeDistance / 2);
    if (!left) return left;
    auto right = one(1, options.eyeDistance / 2);
    if (!right) return right;
    return joined(*left, *right, options.stereo == Stereo::beside);
}

/// Over two pictures of one size.
void addCounts(const RenderStats& of, RenderStats& sum) {
    const double before = sum.samples > 0 ? .5 : 0, now = 1 - before;
    sum.primaryRays += of.primaryRays, sum.shadowRays += of.shadowRays, sum.secondaryRays += of.secondaryRays;
    sum.seconds += of.seconds;
    sum.missing = before * sum.missing + now * of.missing,
    sum.missingMaximum = std::max(sum.missingMaximum, of.missingMaximum);
    sum.error = std::sqrt(before * sum.error * sum.error + now * of.error * of.error);
    sum.unreached = before * sum.unreached + now * of.unreached, sum.kept = before * sum.kept + now * of.kept;
    sum.noise = std::sqrt(before * sum.noise * sum.noise + now * of.noise * of.noise);
    sum.mean = before * sum.mean + now * of.mean;
    sum.samples = before * sum.samples + now * of.samples;
    sum.hiddenLight = std::max(sum.hiddenLight, of.hiddenLight);
    sum.lostLight = std::max(sum.lostLight, of.lostLight);
    sum.cancelled = sum.cancelled || of.cancelled;
}

/// By which files name things: a node's DEF name; else of an Appearance that of its material, of all else that of the
/// nearest one around it.
std::string authorsName(const Scene& scene, NodeId id) {
    constexpr int kMaxLevels = 1000;
    if (const Node* node = scene.effectiveNode(id); node && node->is(x3d::Appearance::type)) {
        const std::string_view own = scene.name(id);
        return std::string(own.empty() ? scene.name(node->get(x3d::Appearance::material)) : own);
    }
    for (int level = 0; id && level < kMaxLevels; ++level) {
        if (const std::string_view name = scene.name(id); !name.empty()) return std::string(name);
        const auto parents = scene.parents(id);
        id = parents.empty() ? NodeId() : parents.front().node;
    }
    return {};
}

std::vector<LayerSight> sightsOf(const LightTracer& tracer, const RayView& rays, const Camera& camera,
                                 const RenderSettings& settings) {
    return LightTracer::sights(tracer.layers(rays, camera, settings.width, settings.height), settings.width,
                               settings.height);
}

/// Node renderers are code of others, and who takes the picture goes by its size.
template <class Draw>
Result<> keepingSize(Picture& frame, const Draw& draw) {
    const auto size = [&] { return std::tuple(frame.width, frame.height, frame.pixels.size()); };
    const auto before = size();
    auto ok = draw();
    if (size() == before) return ok;
    frame = Picture();
    return fail("light renderer: a node renderer has changed the size of the picture");
}

}  // namespace

std::optional<PictureSight> LightRenderer::looksFrom() {
    Impl& s = *impl_;
    if (auto own = s.ownLook()) return own;
    const ImageOptions& options = s.options.image;
    const auto camera = s.tracer.camera(s.rays, aspectOf(options.settings), options.viewpoint);
    if (!camera) return std::nullopt;
    const Camera eye = equipped(*camera, options);
    return PictureSight{EyePosition(eye.position, eye.up), sightsOf(s.tracer, s.rays, eye, options.settings)};
}

Result<Camera> LightRenderer::look(const ImageOptions& options) {
    Impl& s = *impl_;
    if (!s.refused.empty()) return fail(s.refused);
    if (auto ok = begin(); !ok) return std::unexpected(ok.error());
    auto camera = s.tracer.camera(s.rays, aspectOf(options.settings), options.viewpoint);
    if (!camera) return camera;
    *camera = equipped(*camera, options);
    std::vector<LayerSight> sights;
    if (world().flattener().usesPixels()) sights = sightsOf(s.tracer, s.rays, *camera, options.settings);
    if (auto ok = world().setViewer(EyePosition(camera->position, camera->up), std::move(sights)); !ok)
        return std::unexpected(ok.error());
    return camera;
}

Result<std::shared_ptr<const WorldState>> LightRenderer::prepare() {
    if (auto camera = look(impl_->options.image); !camera) return std::unexpected(camera.error());
    auto state = world().present();
    if (state) impl_->prepared = (*state)->moment;
    return state;
}

Result<> LightRenderer::make(const ImageOptions& options, bool inSeries) {
    Impl& s = *impl_;
    auto camera = look(options);
    if (!camera) return std::unexpected(camera.error());
    presentsNow();
    s.camera = *camera;
    s.nameFarEye(s.rays);
    s.stats = {};
    RenderSettings settings = options.settings;
    if (ownsNodes() && !settings.region.empty())
        return fail("light renderer: nodes that it draws itself are drawn in whole pictures only");
    if (!settings.nameOf) settings.nameOf = [&](NodeId id) { return authorsName(world().scene(), id); };
    if (asksForMotion(settings) && !settings.before) settings.before = s.before;
    std::shared_ptr<const WorldState> state;  // null: this one's pixels are not kept, or cannot be
    if (inSeries && Impl::keeps(options)) state = world().present().value_or(nullptr);
    for (trace::Trail& trail : s.trails) trail.refine(options.refine);
    const auto draw = [&](int number, const Camera& eye, const RenderSettings& own) {
        RenderStats drawn;
        auto picture = state ? drawNext(s.tracer.latest(), state->rays, eye, own, drawn,
                                        s.trails[static_cast<std::size_t>(number)])
                             : s.tracer.render(s.rays, eye, own, &drawn);
        addCounts(drawn, s.stats);
        return picture;
    };
    if (auto ok = take(eachEye(s.camera, options, settings, draw), settings); !ok) return ok;
    if (auto ok = keepBefore(settings); !ok) return ok;
    return keepingSize(s.frame, [&] { return renderOwnNodes(kDraw); });
}

Result<> LightRenderer::keepBefore(const RenderSettings& settings) {
    Impl& s = *impl_;
    s.before.reset();  // older states no longer need memory
    if (!asksForMotion(settings)) return {};
    const auto state = world().present();
    if (!state) return std::unexpected(state.error());
    s.before = std::make_shared<const PictureBefore>(PictureBefore{(*state)->rays, s.camera});
    return {};
}

Result<> LightRenderer::remember(const ImageOptions& options) {
    auto camera = look(options);
    if (!camera) return std::unexpected(camera.error());
    impl_->camera = *camera;
    return keepBefore(options.settings);
}

Result<> LightRenderer::renderFrame(const WorldState& state) {
    return makeOf(state, impl_->options.image, nullptr);
}

Result<Picture> LightRenderer::nextPicture(const WorldState& state, const ImageOptions& options, const OwnLook& look,
                                           RenderStats* stats) {
    if (auto ok = makeOf(state, options, &look); !ok) return std::unexpected(ok.error());
    if (stats) *stats = impl_->stats;
    return std::exchange(impl_->frame, Picture());
}

Result<> LightRenderer::makeOf(const WorldState& state, const ImageOptions& options, const OwnLook* look) {
    Impl& s = *impl_;
    if (ownsNodes() && std::this_thread::get_id() != s.scenesThread)
        return fail("light renderer: nodes that it draws itself are drawn on the scene's thread only");
    const auto tables = std::static_pointer_cast<const LightState>(begin(state));
    if (!tables || !state.rays) return fail("light renderer: this state was made without it");
    RenderSettings whole;
    const bool isCoarse = look && look->wholeWidth > 0 && look->wholeHeight > 0;
    whole.width = isCoarse ? look->wholeWidth : options.settings.width;
    whole.height = isCoarse ? look->wholeHeight : options.settings.height;
    auto camera = LightTracer::camera(*tables, *state.rays, aspectOf(whole), options.viewpoint);
    if (!camera) return std::unexpected(camera.error());
    if (look && look->eye) {
        const std::uint16_t layer = camera->layer;
        *camera = look->eye->shaped(aspectOf(whole));
        camera->layer = layer;
    }
    s.camera = equipped(*camera, options);
    const EyePosition eyePosition(s.camera.position, s.camera.up);
    std::vector<LayerSight> sights;
    if (state.sights)
        sights = LightTracer::sights(LightTracer::layers(*tables, *state.rays, s.camera, whole.width, whole.height),
                                     whole.width, whole.height);
    // The world looks from here anyway when it lays a state out for this size.
    const bool fits = !state.sights || areOfOneSize(*state.sights, sights);
    if (look && state.sights) s.look(PictureSight{eyePosition, sights});
    if (look || !fits || (!state.sights && state.moment != s.prepared))
        world().lookFrom(eyePosition, std::move(sights));
    if (!look && !fits) return fail("light renderer: this state is laid out for a picture of another size");
    s.nameFarEye(*state.rays);
    s.stats = {};
    RenderSettings settings = options.settings;
    if (asksForMotion(settings) && !settings.before) settings.before = s.before;
    const bool keeps = Impl::keeps(options);
    for (trace::Trail& trail : s.trails) trail.refine(options.refine);
    const auto draw = [&](int number, const Camera& eye, const RenderSettings& own) {
        RenderStats drawn;
        auto picture = keeps ? drawNext(tables, state.rays, eye, own, drawn, s.trails[static_cast<std::size_t>(number)])
                             : LightTracer::render(*tables, *state.rays, eye, own, &drawn);
        addCounts(drawn, s.stats);
        return picture;
    };
    auto picture = eachEye(s.camera, options, settings, draw);
    s.before =
        asksForMotion(settings) ? std::make_shared<const PictureBefore>(PictureBefore{state.rays, s.camera}) : nullptr;
    if (auto ok = take(std::move(picture), options.settings); !ok) return ok;
    return keepingSize(s.frame, [&] { return renderOwnNodes(kDraw); });
}

Result<> LightRenderer::take(Result<Picture> picture, const RenderSettings& settings) {
    if (!picture) return std::unexpected(picture.error());
    impl_->nameMissing(settings);
    impl_->frame = std::move(*picture);
    return {};
}

Result<> LightRenderer::renderFrame() {
    return make(impl_->options.image, true);
}

Result<Picture> LightRenderer::picture(const ImageOptions& options, RenderStats* stats) {
    if (auto ok = make(options, false); !ok) return std::unexpected(ok.error());
    if (stats) *stats = impl_->stats;
    return std::exchange(impl_->frame, Picture());
}

Result<Picture> LightRenderer::nextPicture(const ImageOptions& options, RenderStats* stats) {
    if (auto ok = make(options, true); !ok) return std::unexpected(ok.error());
    if (stats) *stats = impl_->stats;
    return std::exchange(impl_->frame, Picture());
}

Picture& LightRenderer::frame() {
    return impl_->frame;
}
const Camera& LightRenderer::camera() const {
    return impl_->camera;
}
const RenderStats& LightRenderer::stats() const {
    return impl_->stats;
}
const LightTracer& LightRenderer::tracer() const {
    return impl_->tracer;
}

const Diagnostics& LightRenderer::diagnostics() const {
    impl_->takeDiagnostics();
    return impl_->said;
}

}  // namespace rtsg
