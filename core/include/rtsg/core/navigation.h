// Navigation: moves the viewer by what keys, wheels and pointers do, as the bound NavigationInfo says.
//
// Scene::setNavigation() switches it on. The viewer's way from the bound viewpoint is a part of the scene, in hidden
// fields of that viewpoint; its position and orientation stay its author's. Walls and ground are looked for before a
// frame begins (SpaceQueries; without them there are none), and the result is an event of that frame: so replicas and
// replays follow without any geometry. The viewer neither moves nor falls before somebody has navigated. Lengths,
// speeds and "up" (+Y) are in the coordinates around the viewpoint. Threading: the scene's thread. Source: ISO/IEC
// 19775-1 V4.0 23.2, 23.3.1, 23.4.4, annex G.

//                 arrow keys                        pointer dragged    wheel
//     EXAMINE     go round centerOfRotation         the same           nearer to it, a tenth a step
//     LOOKAT      as EXAMINE; a shape that is clicked is gone to and becomes the centre
//     WALK        forwards, back, turn; with ALT    look round         forwards, speed / 4 a step
//                 sideways
//     FLY         the same, where one looks         look round         the same
// Sticks of gamepads are events of the wheel with two numbers more: radians by which to turn, to the right and up.
// HOME, END, PGUP, PGDN bind the first, last, previous, next viewpoint; HOME once more goes back to it.

// Example:
//     #include <rtsg/core/device_input.h>
//     #include <rtsg/core/navigation.h>
//     #include <rtsg/documents/loader.h>
//     rtsg::Scene scene;
//     rtsg::Diagnostics diagnostics;
//     rtsg::loadFile(scene, "hall.x3dv", diagnostics);
//     scene.setNavigation(true);
//     scene.newFrame(0);
//     (void)rtsg::sendKey(scene, *rtsg::KeyInput::named("UP", true));
//     scene.newFrame(1);
//     scene.newFrame(2);  // has walked for a second, and goes on until the key is let go
//     std::cout << rtsg::viewerPose(scene).position.z << '\n';
#pragma once

#include <optional>
#include <vector>

#include <rtsg/core/diagnostic.h>
#include <rtsg/core/value.h>
#include <rtsg/core/viewer_pose.h>

namespace rtsg {

class Scene;
class SpaceQueries;

enum class NavigationType : std::uint8_t { none, walk, fly, examine, lookAt };

/// The first type of the NavigationInfo that is bound in the active layer which is known here; ANY, and where none is
/// bound, is EXAMINE.
NavigationType navigationType(const Scene& scene);

/// In world coordinates; of the default viewpoint if none is bound.
ViewerPose viewerPose(const Scene& scene);

/// The viewpoints of the active layer that are for choosing, in document order: all but those in a ViewpointGroup that
/// is not displayed, or in whose box the viewer is not.
std::vector<NodeId> viewpoints(const Scene& scene);
enum class ViewpointChoice : std::uint8_t { first, previous, next, last };
/// Queues a set_bind for the next frame; next and previous go round. Error: there is no viewpoint.
Result<> bindViewpoint(Scene& scene, ViewpointChoice choice);

/// Queues that the viewer goes there (world coordinates) in the next frame; `animated`: as NavigationInfo's
/// transitionType says. Error: no viewpoint is bound, or it has no way there; numbers that are not finite.
Result<> moveViewer(Scene& scene, const ViewerPose& pose, bool animated = true);
/// The same, looking as now, to where the bounding box of all Shapes is seen whole. Error: as above; there are none.
Result<> viewAll(Scene& scene, SpaceQueries& queries);

}  // namespace rtsg
