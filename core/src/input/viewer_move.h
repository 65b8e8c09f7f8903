// The place that the viewer has reached in a frame, as the value of an event of the scene's root, so that it is
// recorded and mirrored like events of devices; and the state from which navigation goes on in the next frame.
#pragma once

#include <optional>

#include <rtsg/core/diagnostic.h>
#include <rtsg/core/node_type.h>
#include <rtsg/core/viewer_pose.h>

namespace rtsg {

/// The content of RtsgScene::_navigation.
struct NavigationState {
    enum Key : std::uint32_t { kUp = 1, kDown = 2, kLeft = 4, kRight = 8, kAlt = 16, kAllKeys = 31 };
    NodeId viewpoint;        // whose user it is about
    std::uint32_t held = 0;  // keys that are down
    bool dragging = false;   // pointer 0 has hold of the picture
    bool dragged = false;    // and has moved it
    bool walking = false;    // somebody has walked, so that gravity counts
    Vec2d at{0};             // of the drag, in halves of the picture's smaller side
    double fallSpeed = 0;    // metres a second

    static constexpr std::size_t kNumbers = 8;
    Array<double> toValue() const;
    /// A value that is no such state counts as if nobody had navigated yet.
    static NavigationState fromValue(const Array<double>& value);
    friend bool operator==(const NavigationState&, const NavigationState&) = default;
};

struct ViewerMove {
    /// stay: only the state has changed. look: as animate, and `center` becomes the centre of rotation.
    enum class Kind : std::uint8_t { stay = 0, jump = 1, animate = 2, look = 3 } kind = Kind::stay;
    NodeId viewpoint;
    ViewerPose offset;  // from the viewpoint, in its own frame; its zoom is the value's last number, unless it is 1
    Vec3d center{0};    // in the coordinates around the viewpoint
    /// None: an application has moved the viewer.
    std::optional<NavigationState> state;

    Array<double> toValue() const;
    /// Error: not what toValue() makes; numbers that are not finite.
    static Result<ViewerMove> fromValue(const Array<double>& value);
};

}  // namespace rtsg
