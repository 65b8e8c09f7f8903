// Tables and engine put together on one thread.
#include <rtsg/audio/acoustic_renderer.h>

namespace rtsg {

AcousticRenderer::AcousticRenderer(const RayWorld& world, const Options& options,
                                   std::unique_ptr<AcousticEngine> engine)
    : tables_(world, options.defaultMaterial, options.resources, options.keepStreams, options.materials),
      rays_(&world),
      engine_(std::move(engine)) {}
AcousticRenderer::~AcousticRenderer() = default;

Result<std::unique_ptr<AcousticRenderer>> AcousticRenderer::create(const RayWorld& world, const Options& options) {
    auto engine = AcousticEngine::create(options);
    if (!engine) return std::unexpected(engine.error());
    return std::unique_ptr<AcousticRenderer>(new AcousticRenderer(world, options, std::move(*engine)));
}

Result<> AcousticRenderer::apply(const Scene& scene, const ChangeSet& changes, const InstanceDelta& delta) {
    return tables_.apply(scene, changes, delta);
}

Result<> AcousticRenderer::render(double untilSeconds, SoundBuffer& sound) {
    return engine_->render(*tables_.latest(), *rays_, untilSeconds, sound);
}

OpenedGeometry AcousticRenderer::geometryFor(const glm::dvec3& source) {
    return engine_->geometryFor(*tables_.latest(), *rays_, source);
}

Air AcousticRenderer::air() {
    return engine_->airOf(*tables_.latest());
}

Diagnostics AcousticRenderer::diagnostics() const {
    Diagnostics all;
    all.append(tables_.scene().diagnostics());
    all.append(engine_->diagnostics());
    return all;
}

}  // namespace rtsg
