// UrdfModel: the content of a URDF file: the links and joints of a robot, and their shapes.
//
// Invariant: links and joints form a forest, whose numbers are checked. Numbers are finite. Lower limits are not above
// upper ones. A joint that mimics another stands behind it. Lengths are metres and angles radians, as in the file.
// Faults are reported with their places, and the faulty parts are left out. Threading: one thread a model.
// Source: the URDF XML specification of ROS (wiki.ros.org/urdf/XML), as urdfdom 3.0 reads it.
#pragma once

#include <array>
#include <compare>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <rtsg/core/diagnostic.h>

namespace rtsg::detail {

/// A frame within another: first turned about the fixed axes x, y and z, then moved.
struct UrdfPose {
    std::array<double, 3> xyz{}, rpy{};
};

struct UrdfMaterial {
    std::string name;
    std::optional<std::array<double, 4>> color;  // red, green, blue, opacity
    std::string texture;                         // a url
    auto operator<=>(const UrdfMaterial&) const = default;
};

/// A visual or a collision.
struct UrdfShape {
    enum class Kind : std::uint8_t { box, cylinder, sphere, mesh };

    Kind kind = Kind::box;
    std::array<double, 3> size{1, 1,
                               1};  // of a box; radius and length of a cylinder; radius of a sphere; scale of a mesh
    std::string mesh;               // a url
    UrdfPose origin;
    std::string name;
    std::optional<UrdfMaterial> material;
    SourceLocation where;
};

struct UrdfLink {
    std::string name;
    std::vector<UrdfShape> visuals, collisions;
    std::vector<std::uint32_t> joints;  // that begin here
    SourceLocation where;
};

struct UrdfJoint {
    enum class Kind : std::uint8_t { fixed, revolute, continuous, prismatic, floating, planar };
    /// Its value is that of another joint, times `multiplier`, plus `offset`.
    struct Mimic {
        std::uint32_t joint = 0;
        double multiplier = 1, offset = 0;
    };

    std::string name;
    Kind kind = Kind::fixed;
    std::uint32_t parent = 0, child = 0;  // links
    UrdfPose origin;
    std::array<double, 3> axis{1, 0, 0};  // of length 1
    double lower = 0, upper = 0;          // of revolute and prismatic joints
    double start = 0;                     // its value at the beginning: 0, or the nearest allowed value
    std::optional<Mimic> mimic;
    SourceLocation where;

    /// It has one value, an angle or a position.
    bool hasValue() const { return kind == Kind::revolute || kind == Kind::continuous || kind == Kind::prismatic; }
};

struct UrdfModel {
    std::string name;
    std::vector<UrdfLink> links;
    std::vector<UrdfJoint> joints;
    std::vector<std::uint32_t> roots;       // links in which no joint ends
    std::vector<std::uint32_t> mimicOrder;  // the joints that mimic, behind those that they mimic
};

/// False, and reported, if there is no robot in it.
bool readUrdf(std::string_view text, UrdfModel& model, Diagnostics& diagnostics);

}  // namespace rtsg::detail
