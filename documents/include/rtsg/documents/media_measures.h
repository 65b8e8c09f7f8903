// Who measures what a scene's urls lead to, where documents alone do not tell: lengths of films, sizes of texts.
//
// Threading: the scene's thread.
#pragma once

#include <functional>
#include <optional>

#include <rtsg/core/resource.h>
#include <rtsg/core/scene.h>

namespace rtsg {

/// How many seconds the sound or film in a file plays; nothing if that cannot be told.
using MediaLength = std::function<std::optional<double>(const Resource& file)>;

/// What a Text's fields and fonts make of it, in its own units: width and height of all of it, its upper left corner
/// (x, y, z), width and height of each line; empty if that cannot be told.
using TextMeasure = std::function<Array<float>(const Scene& scene, const Node& text)>;

}  // namespace rtsg
