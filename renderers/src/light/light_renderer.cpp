// Pictures from the shared world: camera, levels of detail for it, tracing, then what node renderers draw themselves.
#include <rtsg/renderers/light_renderer.h>

#include <utility>

namespace rtsg {

struct LightRenderer::Impl {
    Impl(SharedWorld& world, Options o) : options(std::move(o)), rays(world.rays()), tracer(options.resources) {}

    Options options;
    const RayWorld& rays;
    LightTracer tracer;
    std::string refused;  // why it could not be attached
    Picture frame;
    Camera camera;
    RenderStats stats;
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
    return impl_->tracer.apply(scene, changes, delta);
}

Result<> LightRenderer::make(const ImageOptions& options) {
    Impl& s = *impl_;
    if (!s.refused.empty()) return fail(s.refused);
    if (auto ok = begin(); !ok) return ok;
    if (options.settings.width < 1 || options.settings.height < 1)
        return fail("a picture's width and height must be positive");
    const double aspect = static_cast<double>(options.settings.width) / options.settings.height;
    auto camera = s.tracer.camera(s.rays, aspect, options.viewpoint);
    if (!camera) return std::unexpected(camera.error());
    s.camera = *camera;
    if (auto ok = world().setViewer(s.camera.position); !ok) return ok;
    s.stats = {};
    auto picture = s.tracer.render(s.rays, s.camera, options.settings, &s.stats);
    if (!picture) return std::unexpected(picture.error());
    s.frame = std::move(*picture);
    return renderOwnNodes(kDraw);
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
    return impl_->tracer.diagnostics();
}

}  // namespace rtsg
