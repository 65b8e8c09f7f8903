// Tables and engine put together on one thread.
#include <rtsg/audio/acoustic_renderer.h>

#include <rtsg/renderers/ray_world.h>

#include "acoustic_engine.h"

namespace rtsg {

struct AcousticRenderer::Impl {
    AcousticTables tables;
    const RayWorld& rays;
    std::unique_ptr<AcousticEngine> engine;
};

AcousticRenderer::AcousticRenderer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
AcousticRenderer::~AcousticRenderer() = default;

Result<std::unique_ptr<AcousticRenderer>> AcousticRenderer::create(const RayWorld& world, const Options& options) {
    auto engine = AcousticEngine::create(options);
    if (!engine) return std::unexpected(engine.error());
    return std::unique_ptr<AcousticRenderer>(new AcousticRenderer(std::unique_ptr<Impl>(new Impl{
        AcousticTables(world, options.defaultMaterial, options.resources, options.keepStreams, options.materials),
        world, std::move(*engine)})));
}

Result<> AcousticRenderer::apply(const Scene& scene, const ChangeSet& changes, const InstanceDelta& delta) {
    return impl_->tables.apply(scene, changes, delta);
}

Result<> AcousticRenderer::render(double untilSeconds, SoundBuffer& sound) {
    return impl_->engine->render(*impl_->tables.latest(), impl_->rays, untilSeconds, sound);
}

AcousticTables& AcousticRenderer::tables() const {
    return impl_->tables;
}
AcousticEngine& AcousticRenderer::engine() const {
    return *impl_->engine;
}
const SoundScene& AcousticRenderer::scene() const {
    return impl_->tables.scene();
}

OpenedGeometry AcousticRenderer::geometryFor(const glm::dvec3& source) const {
    return impl_->engine->geometryFor(*impl_->tables.latest(), impl_->rays, source);
}
TraceResult AcousticRenderer::trace(const glm::dvec3& source, const glm::dvec3& listener,
                                    const TraceOptions& options) const {
    const OpenedGeometry room = geometryFor(source);
    return AcousticTracer(room).trace(source, listener, options);
}

Air AcousticRenderer::air() const {
    return impl_->engine->airOf(*impl_->tables.latest());
}

Diagnostics AcousticRenderer::diagnostics() const {
    Diagnostics all;
    all.append(scene().diagnostics());
    all.append(impl_->engine->diagnostics());
    return all;
}

}  // namespace rtsg
