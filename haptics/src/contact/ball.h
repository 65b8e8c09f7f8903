// A small ball among triangles: its contacts, how far it can move, and where it slides to.
//
// Positions are in metres from a nearby origin, in double precision. Triangles have no thickness and two sides: the
// ball stays on its side. Invariant: wherever a function here moves the ball to, the way there was free.
// Source: D. C. Ruspini, K. Kolarov, O. Khatib, "The haptic display of complex graphical environments", 1997: a proxy
// with a radius; C. Ericson, "Real-time collision detection", 2005, 5.1.5: the closest point of a triangle.
#pragma once

#include <cstdint>
#include <vector>

#include <rtsg/core/value.h>

namespace rtsg::haptics {

struct NearTriangle {
    Vec3d corners[3];
    Vec3d before[3];  // where they were at the last tick; the same unless `moves`
    std::uint32_t slot = 0, triangle = 0;
    bool moves = false;
};

/// A triangle that the ball touches.
struct Touching {
    Vec3d normal{0, 0, 1};     // unit, from the triangle to the ball's middle
    std::size_t triangle = 0;  // place in the list
    double distance = 0;       // of the middle, metres
    Vec3d position{0};         // on the triangle
};

/// A ball stops this far before contact, and counts as touching up to twice this distance; metres.
constexpr double kSkin = 1e-7;

Vec3d closestOnTriangle(const Vec3d& p, const Vec3d (&corners)[3]);

/// The share of `way`, at most 1, that a ball may go from `from` until it is kSkin from the triangle. A ball that is
/// closer already may go away from it and along it.
double freeFraction(const Vec3d& from, const Vec3d& displacement, double radius, const NearTriangle& triangle);
/// The same among all of them.
double freeFraction(const Vec3d& from, const Vec3d& displacement, double radius,
                    const std::vector<NearTriangle>& triangles);

/// The triangles within radius + 2 kSkin; those whose normals are the same count once. `slack`: what touches
/// is so much farther away, metres.
std::vector<Touching> touched(const Vec3d& at, double radius, const std::vector<NearTriangle>& triangles,
                              double slack = 0);

/// The vector next to `way` that leads against none of the normals.
Vec3d alongAll(const Vec3d& displacement, const std::vector<Touching>& touching);

/// The position that a ball reaches when it is drawn from `from` towards `goal` and slides along surfaces: the nearest
/// position to `goal` that it can reach in this way.
Vec3d slide(const Vec3d& from, const Vec3d& goal, double radius, const std::vector<NearTriangle>& triangles);

}  // namespace rtsg::haptics
