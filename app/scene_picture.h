// A picture of one state of a scene that somebody else drives.
#pragma once

#include <rtsg/renderers/picture.h>

#include "outputs.h"

namespace rtsg::app {

/// A picture of a copy of the scene, as --render would make it but for its exposure: `scene` itself gets no subscriber.
/// Errors: those of LightRenderer::picture(); a scene that cannot be copied.
Result<Picture> pictureOf(const Scene& scene, const OutputArguments& outputs, const Resources& resources);

}  // namespace rtsg::app
