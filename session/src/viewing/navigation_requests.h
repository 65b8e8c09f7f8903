// What people ask for in a window about how they move, done to the scene that holds their eye.
//
// Threading: the scene's thread.
#pragma once

#include <rtsg/core/device_input.h>
#include <rtsg/window/own_eye.h>
#include <rtsg/window/scene_window.h>

namespace rtsg {

/// Whether a request is about how one moves; others are not for these functions.
bool isAboutMoving(const SceneWindowRequest& request);
/// Queues the events that it takes; walls and ground are changed in `rules`. Errors: those of rtsg/core/navigation.h.
Result<> carryOut(const SceneWindowRequest& request, Scene& scene, SpaceQueries& space, ObstacleRules& rules);
/// The same for an own eye.
Result<> carryOut(const SceneWindowRequest& request, OwnEye& eye, ObstacleRules& rules);
void describeMoving(const Scene& scene, const ObstacleRules& rules, SceneWindowChoices& choices);

}  // namespace rtsg
