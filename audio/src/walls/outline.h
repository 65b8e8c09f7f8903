// Outlines: flat polygons with their moments, and planes through places, of the openings of rooms.
//
// Threading: plain values; pure functions.
#pragma once

#include <optional>
#include <vector>

#include <glm/glm.hpp>

namespace rtsg::opening {

/// A unit vector at right angles to a unit vector.
glm::dvec3 anyAcross(const glm::dvec3& d);

/// A flat polygon about a place, and what belongs to its moments.
struct Outline {
    glm::dvec3 center{0}, along{1, 0, 0}, across{0, 1, 0}, normal{0, 0, 1};
    double halfLength = 0, halfWidth = 0;  // of a rectangle with its moments
    double area = 0;
    std::vector<glm::dvec2> corners;  // metres along and across, from `center`

    glm::dvec3 position(const glm::dvec2& at) const { return center + along * at.x + across * at.y; }
    glm::dvec2 flat(const glm::dvec3& p) const { return {glm::dot(p - center, along), glm::dot(p - center, across)}; }
    /// Whether a place before or behind it lies within `slack` of what is `scale` times as large.
    bool holds(const glm::dvec3& p, double scale, double slack) const;
    /// Sides of a rectangle about it, m; by its axes, or where it has none of its own (a square's are any) by the
    /// directions in which that is smallest.
    double length() const;
    double width() const;

  private:
    double extent(double angle) const;
    glm::dvec2 rectangle() const;
};

/// With the centre and the axes of its area; `corners` in order.
Outline outlineOf(const std::vector<glm::dvec3>& corners, const glm::dvec3& normal);

/// A plane through most of some places.
struct FittedPlane {
    glm::dvec3 middle{0}, normal{0, 0, 1};
    double across = 0, off = 0;  // root mean squares, along its shorter axis and off it
};

/// By least squares of the three fifths that lie best on it. None of less than eight places.
std::optional<FittedPlane> planeOf(std::vector<glm::dvec3> positions);

}  // namespace rtsg::opening
