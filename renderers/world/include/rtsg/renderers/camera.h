// Camera: the eye of a picture.
//
// Invariant: forward is a unit vector. right and up are orthonormal with it and right-handed (right x up = -forward),
// unless the transforms above the viewpoint scale unevenly, shear or mirror. Then right and up are the images of one
// step to the right and up in the viewpoint's own space, so that things below the same transforms are seen as if there
// were none (23.3.1: viewpoints lie in the transformation hierarchy; browsers draw it so). Positions are double until
// rays are made. Threading: plain data, const members are re-entrant. Source: ISO/IEC 19775-1 V4.0 23.3.1, 23.4.5
// (OrthoViewpoint), 23.4.6 (Viewpoint).
#pragma once

#include <array>
#include <cstdint>
#include <limits>

#include <rtsg/core/value.h>
#include <rtsg/renderers/instance_delta.h>

namespace rtsg {

/// The horizontal and vertical viewing angles in radians, the smaller of which is `fieldOfView`; `aspect` = width /
/// height.
struct ViewingAngles {
    double horizontal = 0, vertical = 0;
};
ViewingAngles viewingAngles(double fieldOfView, double aspect);

struct Camera {
    Vec3d position{0, 0, 10};
    Vec3d right{1, 0, 0}, up{0, 1, 0}, forward{0, 0, -1};  // right, up: steps in the picture plane at distance 1
    bool orthographic = false;
    /// A panorama of all directions: longitudes across and latitudes down, forward in the middle.
    bool panorama = false;
    /// The picture's edges: at distance 1 from the eye; for orthographic cameras in metres, for panoramas in radians.
    double left = -1, rightEdge = 1, bottom = -1, top = 1;
    /// Things farther away than this are not seen (NavigationInfo.visibilityLimit); infinite unless given.
    double visibilityLimit = std::numeric_limits<double>::infinity();
    /// The range in which things are seen (a viewpoint's nearDistance and farDistance), measured along the view; in
    /// panoramas, along the ray.
    double nearDistance = 0, farDistance = std::numeric_limits<double>::infinity();
    /// The radius of a thin lens around `position`, in metres; 0 is a pinhole, with which everything is sharp. `focus`
    /// is the distance along the view that is sharp. Only perspectives have a lens.
    double lensRadius = 0, focus = 1;
    std::uint16_t layer = 0;  // the layer that it looks at: a position in LayerSet.layers, from 1; 0: the scene outside
                              // any layer
    NodeId viewpoint;         // the viewpoint that it belongs to; none: the default viewpoint, or an eye without a
                              // viewpoint
    bool nowhere = false;     // the viewpoint is too far away or not at a finite position, so `position` is the default
                              // one

    /// The same eye for a picture with another aspect = width / height. A perspective keeps its smaller angle, an
    /// orthographic camera its middle square.
    Camera shaped(double aspect) const;

    /// `orientation` as in Viewpoint; fieldOfView is clamped into (0, pi).
    static Camera perspective(const WorldFromLocal& worldFromLocal, const Vec3d& position, const Rotation& orientation,
                              double fieldOfView, double aspect);
    /// `extent` is minimum x, minimum y, maximum x, maximum y in the local frame. One side grows so that all of it is
    /// visible.
    static Camera parallel(const WorldFromLocal& worldFromLocal, const Vec3d& position, const Rotation& orientation,
                           const std::array<double, 4>& extent, double aspect);

    /// A panorama from the same position.
    Camera around() const;
    /// The eye `offset` metres to the right of this one, for stereoscopic pictures. Points at `distance` metres along
    /// the view are at the same place in the pictures of all such eyes (infinity: points infinitely far away). The axes
    /// stay parallel. Precondition: a perspective; distance > 0.
    Camera beside(double offset, double distance) const;

    /// The eye between `before` (t = 0) and this one (t = 1): it moves straight and turns evenly, and edges and focus
    /// change evenly. If `before` belongs to another viewpoint or is another kind of eye, the result is this eye: a cut
    /// is no motion.
    Camera since(const Camera& before, double t) const;
    /// The directions right, up and back without scaling: orthonormal.
    glm::dmat3 axes() const;
    /// The matrix that takes a world vector to its components along `right`, `up` and `forward`.
    glm::dmat3 steps() const;
    /// Whether its pixels are square in the world; they are not if the viewpoint is below an uneven scale.
    bool isEven() const;
    /// The height of a pixel in the middle of a picture with `rows` rows: for a perspective at distance 1, for a
    /// parallel projection in metres. If the axes are scaled, the smaller one counts, so that a line with a width in
    /// pixels is no wider in any direction.
    double pixel(int rows) const;
    /// The position of a point in the picture, as `x` and `y` of ray(); infinite for a point behind a perspective's
    /// eye.
    Vec2d project(const Vec3d& world) const;

    /// Moves back, keeping the direction of view, until all of `world` is within the picture and centred in it. Does
    /// nothing when `world` is empty.
    void frame(const Vec3d& lower, const Vec3d& upper);

    /// X3DViewpointNode.viewAll (23.3.1): turns to the middle of `world`, with `upright` upwards in the picture, and
    /// moves along that line. A perspective moves until the ball around `world` is as high as the picture's smaller
    /// side, and further away if that cuts a corner off. It does nothing if `world` is empty, and turns no view with
    /// scaled axes.
    void viewAll(const Vec3d& lower, const Vec3d& upper, const Vec3d& upright);

    struct WorldRay {
        Vec3d origin, direction;  // a unit vector
    };
    /// The ray through `x`, `y`, from 0 (left, top) to 1 (right, bottom). With a lens, the ray through its middle.
    WorldRay ray(double x, double y) const;
    /// The part of a ray with this unit direction in which things are visible, in metres.
    struct Reach {
        double from, to;
    };
    Reach reach(const Vec3d& direction) const;
    /// Whether reach() is other than from 0 to infinity.
    bool isBounded() const;

    friend bool operator==(const Camera&, const Camera&) = default;
};

/// A rotation close to the linear part: its columns, orthonormalised beginning with the third (the axis of view); the
/// identity for a singular matrix.
glm::dmat3 turningOf(const WorldFromLocal& m);

}  // namespace rtsg
