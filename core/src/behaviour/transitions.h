// The viewer's way from one view to another (ISO/IEC 19775-1 V4.0, 23.3.1, 23.4.4): at once or animated, as the
// NavigationInfo of the layer says, and the end of it.
//
// What is under way is in fields of the viewpoint: `_transition` (when it began, how long it takes, 1 for ANIMATE; from
// and to, as offsets from the viewpoint), `_userPosition` and `_userTurn`.
#pragma once

#include <optional>

#include <rtsg/core/behaviour.h>
#include <rtsg/core/navigation.h>

namespace rtsg::behaviours {

/// In world coordinates; nothing if the node is no viewpoint.
std::optional<ViewerPose> worldView(const Scene& scene, NodeId viewpoint);

enum class ViewEntry : std::uint8_t {
    asAuthored,  // the user's offset is forgotten
    asLeft,      // it is as it was when the viewpoint was left
};
/// The viewpoint has been bound; the view was `from` before. Without `jump` it stays there.
void arriveAt(Cascade& cascade, const Node& viewpoint, const std::optional<ViewerPose>& from, ViewEntry entry,
              bool jump);
/// The viewpoint is no longer bound: its view stays as it is now.
void stopTransition(Cascade& cascade, const Node& viewpoint);
/// For onTime: returns when to go on, or kNever.
double goOnWithTransition(Cascade& cascade, const Node& viewpoint);

}  // namespace rtsg::behaviours
