// Navigation: moves the viewer by keys, wheels and pointers, as the bound NavigationInfo says.
//
// Scene::setNavigation() switches it on. The viewer's motion away from the bound viewpoint is part of the scene, in
// hidden fields of that viewpoint; its position and orientation stay as the author wrote them. Walls and ground are
// found before a frame begins (SpaceQueries; without them there are none), and the result is an event of that frame, so
// replicas and replays follow without geometry. The viewer neither moves nor falls before somebody has navigated.
// Lengths, speeds and "up" (+Y) are in the coordinates around the viewpoint. Threading: the scene's thread. Source:
// ISO/IEC 19775-1 V4.0 23.2, 23.3.1, 23.4.4, annex G.

//                 arrow keys                        pointer dragged    wheel
//     EXAMINE     go round centerOfRotation; with   the same; with     nearer to it, a tenth a step; an OrthoViewpoint
//                 ALT along the picture             another button     zooms
//                                                   along the picture
//     LOOKAT      as EXAMINE; a shape that is clicked is gone to and becomes the centre
//     WALK        forwards, back, turn; with ALT    look round         forwards, speed / 4 a step
//                 sideways
//     FLY         the same, where one looks         look round         the same
// Sticks of gamepads are events of the wheel with two more numbers: the radians to turn to the right and up.
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
#include <span>
#include <string_view>
#include <vector>

#include <rtsg/core/diagnostic.h>
#include <rtsg/core/value.h>
#include <rtsg/core/viewer_pose.h>

namespace rtsg {

class Scene;
class SpaceQueries;

enum class NavigationType : std::uint8_t { none, walk, fly, examine, lookAt };

/// The first type of the bound NavigationInfo, in the active layer that is known here. ANY counts as EXAMINE, and so
/// does no bound NavigationInfo.
NavigationType navigationType(const Scene& scene);

/// The pose in world coordinates; that of the default viewpoint if none is bound.
ViewerPose viewerPose(const Scene& scene);

/// The viewpoints of the active layer that a user may choose, in document order: all but those in a ViewpointGroup that
/// is not displayed, or whose box the viewer is not in.
std::vector<NodeId> viewpoints(const Scene& scene);
enum class ViewpointChoice : std::uint8_t { first, previous, next, last };
/// Queues a set_bind for the next frame; next and previous wrap around. Error: there is no viewpoint.
Result<> bindViewpoint(Scene& scene, ViewpointChoice choice);

/// Queues a move of the viewer to a pose (world coordinates) in the next frame; `animated`: as NavigationInfo's
/// transitionType says. Error: no viewpoint is bound, or no path leads to it; numbers that are not finite.
Result<> moveViewer(Scene& scene, const ViewerPose& pose, bool animated = true);
/// Queues a move, without a turn, to where the bounding box of all Shapes is in full view. Error: as above; no Shapes.
Result<> viewAll(Scene& scene, SpaceQueries& queries);
/// Queues a turn about the direction of view, until +Y is upwards. Error: as moveViewer().
Result<> straightenViewer(Scene& scene);

/// Whether the shape at the end of a path from a root node stops avatars: no Collision on the path is disabled, and if
/// a Collision has a proxy, the path leads through the proxy (23.4.2).
bool stopsAvatars(const Scene& scene, std::span<const NodeId> path);

/// "EXAMINE" and so on.
std::string_view nameOf(NavigationType type);
/// Metres a second, of the bound NavigationInfo; 1 if there is none.
double navigationSpeed(const Scene& scene);
/// Queue an event for the bound NavigationInfo, so that the user moves in this way, or so fast (metres a second); if
/// none is bound, one is made and bound. Errors: a speed of 0 or below; the scene refuses the edit.
Result<> chooseNavigation(Scene& scene, NavigationType type);
Result<> chooseSpeed(Scene& scene, double speed);

}  // namespace rtsg
