// Draws a copy of a scene.
#include <memory>
#include <utility>

#include <rtsg/session/output_maker.h>

namespace rtsg {

Result<Picture> pictureOf(const Scene& scene, const OutputOptions& options, const Resources& resources) {
    Scene copy;
    copy.setBehavioursEnabled(false);
    if (auto ok = copy.apply(std::make_shared<const ChangeSet>(scene.snapshot())); !ok)
        return std::unexpected(ok.error());
    WorldOnDemand world(copy, resources, options.context);
    if (auto ok = world.cut(options.tessellation); !ok) return std::unexpected(ok.error());
    ImageOptions image = options.image;
    image.settings.progress = [&](double) { return !options.context.interrupted(); };
    LightRenderer light(world.get(), LightRenderer::Options(resources, image));
    options.context.extensions().registerWith(light);
    if (!light.attached()) return fail(light.failure());
    RenderStats stats;
    Result<Picture> picture = light.picture(image, &stats);
    if (picture && stats.cancelled) return fail("interrupted");
    return picture;
}

}  // namespace rtsg
