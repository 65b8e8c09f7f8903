// Scene picture: makes one picture of a state of a scene that runs elsewhere in the program.
#pragma once

#include <rtsg/renderers/picture.h>

#include "outputs.h"

namespace rtsg::app {

/// Draws a copy of the scene as --render would, apart from the exposure. `scene` itself gets no subscriber. Errors:
/// those of LightRenderer::picture(); a scene that cannot be copied.
Result<Picture> pictureOf(const Scene& scene, const OutputArguments& outputs, const Resources& resources);

}  // namespace rtsg::app
