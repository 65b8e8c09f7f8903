// Functions that measure media for a scene where documents alone do not tell: lengths of films, sizes of texts.
//
// Threading: the scene's thread.
#pragma once

#include <functional>
#include <optional>

#include <rtsg/core/resource.h>
#include <rtsg/core/scene.h>

namespace rtsg {

/// The length in seconds of the sound or film in a file; nothing if it is unknown.
using MediaLength = std::function<std::optional<double>(const Resource& file)>;

/// Measures a Text in its own units, by its fields and fonts: width and height of the whole, the upper left corner (x,
/// y, z), then width and height of each line. The result is empty if it cannot be measured.
using TextMeasure = std::function<Array<float>(const Scene& scene, const Node& text)>;

}  // namespace rtsg
