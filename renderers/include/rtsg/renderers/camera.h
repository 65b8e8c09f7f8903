// Camera and Sky: where the picture is seen from, and what is seen where nothing is hit.
//
// Invariant: forward is a unit vector. right and up are orthonormal with it and right-handed (right x up = -forward),
// unless what is above the viewpoint scales unevenly, shears or mirrors: then they are what one step to the right and
// up in the viewpoint's own space has become, so that what stands below the same transforms is seen as if those were
// not there (23.3.1: viewpoints lie in the transformation hierarchy; browsers draw it so). Positions stay in
// double until rays are made. Threading: plain data, const members re-entrant. Source: ISO/IEC 19775-1
// V4.0 23.3.1, 23.4.5 (OrthoViewpoint), 23.4.6 (Viewpoint), 24.2.1, 24.3.1 (backgrounds).
#pragma once

#include <array>
#include <memory>
#include <vector>

#include <rtsg/core/value.h>
#include <rtsg/renderers/instance_delta.h>
#include <rtsg/renderers/mesh.h>
#include <rtsg/renderers/texture.h>

namespace rtsg {

/// The viewing angles (radians) across and down, of which the smaller is `fieldOfView`; `aspect` = width / height.
struct ViewingAngles {
    double horizontal = 0, vertical = 0;
};
ViewingAngles viewingAngles(double fieldOfView, double aspect);

struct Camera {
    Vec3d position{0, 0, 10};
    Vec3d right{1, 0, 0}, up{0, 1, 0}, forward{0, 0, -1};  // right, up: of the picture, for 1 ahead
    bool orthographic = false;
    /// All directions: longitudes across and latitudes down, forward in the middle.
    bool panorama = false;
    /// The picture's edges: at distance 1 before the eye, for orthographic cameras in metres, for panoramas in radians.
    double left = -1, rightEdge = 1, bottom = -1, top = 1;
    /// Things farther away than this are not seen (NavigationInfo.visibilityLimit); infinite unless given.
    double visibilityLimit = std::numeric_limits<double>::infinity();
    /// The range in which things are seen (a viewpoint's nearDistance and farDistance), measured along the view; in
    /// panoramas, along the ray.
    double nearDistance = 0, farDistance = std::numeric_limits<double>::infinity();
    /// The radius of a thin lens around `position`, in metres; 0 is a pinhole, with which everything is sharp. `focus`
    /// is the distance along the view that is sharp. Only perspectives have a lens.
    double lensRadius = 0, focus = 1;
    std::uint16_t layer = 0;  // that it looks at: a place in LayerSet.layers, from 1; 0: what is in none
    NodeId viewpoint;         // whose it is; none: the standard's default one, or an eye of one's own
    bool nowhere = false;     // its viewpoint lies beyond all bounds, or at no number: `position` is the default one

    /// The same eye for a picture of another shape: `aspect` = width / height. The smaller angle of a perspective, and
    /// the middle square of an orthographic camera, stay.
    Camera shaped(double aspect) const;

    /// `orientation` as in Viewpoint; fieldOfView is clamped into (0, pi).
    static Camera perspective(const WorldFromLocal& worldFromLocal, const Vec3d& position, const Rotation& orientation,
                              double fieldOfView, double aspect);
    /// `extent`: least x, least y, greatest x, greatest y in the local frame. One side grows so that all of it shows.
    static Camera parallel(const WorldFromLocal& worldFromLocal, const Vec3d& position, const Rotation& orientation,
                           const std::array<double, 4>& extent, double aspect);

    /// All that is around the same eye.
    Camera around() const;
    /// An eye beside this one, `offset` metres to the right, of a stereoscopic picture: what is `distance` metres along
    /// the view lies at the same place in the pictures of all such eyes (infinity: what is infinitely far). The axes
    /// stay parallel. Precondition: a perspective; distance > 0.
    Camera beside(double offset, double distance) const;

    /// The eye on its straight way from `before` (t = 0) to this one (1): it turns evenly, and edges and focus change
    /// so. This one, if `before` is another viewpoint's or another kind of eye: a cut is no motion.
    Camera since(const Camera& before, double t) const;
    /// Right, up and back as a turned viewer has them: orthonormal, whatever is scaled.
    glm::dmat3 axes() const;
    /// Takes a vector of the world to how many of `right`, `up` and `forward` it is made of.
    glm::dmat3 steps() const;
    /// Whether its pixels are square in the world: not those of a viewpoint below an uneven scale.
    bool isEven() const;
    /// The height of a pixel in the middle of a picture with that many rows: of a perspective at distance 1, of a
    /// parallel projection in metres. If the axes are scaled, the smaller one counts, so that a line of some pixels'
    /// width is no wider in any direction.
    double pixel(int rows) const;
    /// The place in the picture at which a point is seen, as `x` and `y` of ray(). It is infinite for a point behind a
    /// perspective's eye.
    Vec2d place(const Vec3d& world) const;

    /// Moves back, keeping the direction of view, until all of `world` is within the picture and centred in it. Does
    /// nothing when `world` is empty.
    void frame(const Vec3d& lower, const Vec3d& upper);

    /// X3DViewpointNode.viewAll (23.3.1): turns to the middle of `world`, with `upright` upwards in the picture, and
    /// goes back or on along that line: a perspective until the ball around `world` is as high as the picture's smaller
    /// side, and farther where that cuts a corner off. Does nothing when `world` is empty; turns no view with scaled
    /// axes.
    void viewAll(const Vec3d& lower, const Vec3d& upper, const Vec3d& upright);

    struct WorldRay {
        Vec3d origin, direction;  // a unit vector
    };
    /// The ray through `x`, `y`, from 0 (left, top) to 1 (right, bottom). With a lens, the ray through its middle.
    WorldRay ray(double x, double y) const;
    /// The stretch of a ray of this unit direction in which things are seen, in metres.
    struct Reach {
        double from, to;
    };
    Reach reach(const Vec3d& direction) const;
    /// Whether reach() is other than from 0 to infinity.
    bool isBounded() const;

    friend bool operator==(const Camera&, const Camera&) = default;
};

/// The bound Background or TextureBackground. Without colours: black.
struct Sky {
    std::vector<Vec3f> skyColors{Vec3f(0)}, groundColors;
    /// Radians from the zenith, from the nadir, ascending; one less than colours.
    std::vector<float> skyAngles, groundAngles;
    float alpha = 1;  // 1 - transparency
    /// Front, back, left, right, top, bottom of the panorama; null where there is none.
    std::array<std::shared_ptr<const Texture>, 6> panorama;
    glm::mat3 localFromWorld{1.0f};  // only its turning counts (24.2.1)

    /// Colour, premultiplied, and coverage towards a unit direction in world space. The fields hold display values and
    /// mix as such; `space` (linear or display) is that of the result.
    Vec4f color(const Vec3f& direction, ColorSpace space = ColorSpace::display) const;
    /// Whether all directions have one colour, so that color() needs none.
    bool uniform() const;
    /// Two pictures are equal if they are the same object.
    friend bool operator==(const Sky&, const Sky&) = default;
};

/// The rotation nearest in meaning to the linear part: its columns, orthonormalised from the third (the axis of view)
/// on; the identity for a singular matrix.
glm::dmat3 turningOf(const WorldFromLocal& m);

}  // namespace rtsg
