// One change of somebody else's, done to a scene by its public edits. Threading: the scene's thread, between frames.
#pragma once

#include <string_view>

#include <rtsg/core/scene.h>

namespace rtsg::mirror {

/// Says whose wish it was, too (Scene::attribute()). Errors: the scene's; a child that is not there; a new node, an
/// event or a type, which are no edits of what is there.
Result<> edit(Scene& scene, const Change& change, std::string_view author);

}  // namespace rtsg::mirror
