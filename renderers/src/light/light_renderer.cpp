// Pictures from the shared world: camera, levels of detail for it, tracing, then what node renderers draw themselves.
#include <rtsg/renderers/light_renderer.h>

#include <algorithm>
#include <atomic>
#include <mutex>
#include <utility>

#include <fmt/format.h>

#include "undrawn.h"

namespace rtsg {

struct LightRenderer::Impl {
    Impl(SharedWorld& world, Options o) : options(std::move(o)), rays(world.rays()), tracer(world, options.resources) {}

    Options options;
    const RayWorld& rays;
    LightTracer tracer;
    std::string refused;  // why it could not be attached
    Picture frame;
    Camera camera;
    RenderStats stats;
    Undrawn undrawn;
    Diagnostics said;                        // the tracer's and its own
    std::size_t taken = 0;                   // of the tracer's
    std::atomic<std::uint64_t> prepared{0};  // the last prepare()'s moment
    std::mutex mutex;                        // of what follows: pictures of states are made on other threads
    Diagnostics lacks;                       // of pictures, not yet in `said`
    double named = 0;                        // share of missing light that has been reported

    void takeDiagnostics() {
        const auto& news = tracer.diagnostics().all();
        for (; taken < news.size(); ++taken) said.add(news[taken].severity, news[taken].where, news[taken].text);
        const std::lock_guard lock(mutex);
        said.append(std::exchange(lacks, Diagnostics()));
    }
    /// Light that is missing is named; again only once it has doubled, or a film would repeat it frame by frame.
    void nameMissing(const RenderSettings& settings) {
        constexpr double kVisible = 2 / 255.0;
        const std::lock_guard lock(mutex);
        if (!(stats.missingMost > std::max(kVisible, 2 * named))) return;
        named = stats.missingMost;
        const bool path = settings.integrator == Integrator::path;
        lacks.warning({},
                      fmt::format("rays were cut off after {} {}: up to {:.2g} % of a pixel's light is missing, {:.2g} "
                                  "% of the picture's{}",
                                  path ? 10'000 : settings.maxDepth, path ? "bounces" : "mirrorings and refractions",
                                  100 * stats.missingMost, 100 * stats.missing,
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
    impl_->undrawn.follow(scene, changes, impl_->said);
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

}  // namespace

Result<Camera> LightRenderer::look(const ImageOptions& options) {
    Impl& s = *impl_;
    if (!s.refused.empty()) return fail(s.refused);
    if (auto ok = begin(); !ok) return std::unexpected(ok.error());
    auto camera = s.tracer.camera(s.rays, aspectOf(options.settings), options.viewpoint);
    if (!camera) return camera;
    if (auto ok = world().setViewer(camera->position); !ok) return std::unexpected(ok.error());
    return camera;
}

Result<std::shared_ptr<const WorldState>> LightRenderer::prepare() {
    if (auto camera = look(impl_->options.image); !camera) return std::unexpected(camera.error());
    auto state = world().present();
    if (state) impl_->prepared = (*state)->moment;
    return state;
}

Result<> LightRenderer::make(const ImageOptions& options) {
    Impl& s = *impl_;
    auto camera = look(options);
    if (!camera) return std::unexpected(camera.error());
    presentsNow();
    s.camera = *camera;
    s.stats = {};
    if (auto ok = take(s.tracer.render(s.rays, s.camera, options.settings, &s.stats), options.settings); !ok) return ok;
    return renderOwnNodes(kDraw);
}

Result<> LightRenderer::renderFrame(const WorldState& state) {
    Impl& s = *impl_;
    if (ownsNodes()) return fail("light renderer: nodes that it draws itself are drawn on the scene's thread only");
    const auto* tables = static_cast<const LightState*>(begin(state));
    if (!tables || !state.rays) return fail("light renderer: this state was made without it");
    const ImageOptions& options = s.options.image;
    auto camera = LightTracer::camera(*tables, *state.rays, aspectOf(options.settings), options.viewpoint);
    if (!camera) return std::unexpected(camera.error());
    s.camera = *camera;
    if (state.moment != s.prepared) world().lookFrom(s.camera.position);
    s.stats = {};
    return take(LightTracer::render(*tables, *state.rays, s.camera, options.settings, &s.stats), options.settings);
}

Result<> LightRenderer::take(Result<Picture> picture, const RenderSettings& settings) {
    if (!picture) return std::unexpected(picture.error());
    impl_->nameMissing(settings);
    impl_->frame = std::move(*picture);
    return {};
}

Result<> LightRenderer::renderFrame() {
    return make(impl_->options.image);
}

Result<Picture> LightRenderer::picture(const ImageOptions& options, RenderStats* stats) {
    if (auto ok = make(options); !ok) return std::unexpected(ok.error());
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
