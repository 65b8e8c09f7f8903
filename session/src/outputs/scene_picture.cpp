// Draws a copy of a scene.
#include "scene_picture.h"

#include <memory>
#include <utility>

#include "extensions.h"

namespace rtsg::app {

Result<Picture> pictureOf(const Scene& scene, const OutputArguments& outputs, const Resources& resources) {
    Scene copy;
    copy.setBehavioursEnabled(false);
    if (auto ok = copy.apply(std::make_shared<const ChangeSet>(scene.snapshot())); !ok)
        return std::unexpected(ok.error());
    WorldOnDemand world(copy, resources);
    if (auto ok = world.cut(outputs.picture.tessellationError()); !ok) return std::unexpected(ok.error());
    ImageOptions image = outputs.picture.parse();
    image.settings.progress = [](double) { return !interrupted(); };
    LightRenderer light(world.get(), LightRenderer::Options(resources, image));
    extensions().registerWith(light);
    if (!light.attached()) return fail(light.failure());
    RenderStats stats;
    Result<Picture> picture = light.picture(image, &stats);
    if (picture && stats.cancelled) return fail("interrupted");
    return picture;
}

}  // namespace rtsg::app
