// Finds the extent of a robot, and places the eye.
#include "urdf_view.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <rtsg/core/portable_math.h>

#include "output_node.h"
#include "urdf_joints.h"

namespace rtsg::detail {

namespace {

using Vector = std::array<double, 3>;

/// x y z w
Vector turnedBy(const std::array<double, 4>& q, const Vector& v) {
    const auto cross = [&](const Vector& a) -> Vector {
        return {q[1] * a[2] - q[2] * a[1], q[2] * a[0] - q[0] * a[2], q[0] * a[1] - q[1] * a[0]};
    };
    const Vector once = cross(v), twice = cross(once);
    return {v[0] + 2 * (q[3] * once[0] + twice[0]), v[1] + 2 * (q[3] * once[1] + twice[1]),
            v[2] + 2 * (q[3] * once[2] + twice[2])};
}
std::array<double, 4> product(const std::array<double, 4>& a, const std::array<double, 4>& b) {
    return {
        a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1], a[3] * b[1] - a[0] * b[2] + a[1] * b[3] + a[2] * b[0],
        a[3] * b[2] + a[0] * b[1] - a[1] * b[0] + a[2] * b[3], a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2]};
}

struct Frame {
    std::uint32_t link;
    Vector position{};
    std::array<double, 4> rotation{0, 0, 0, 1};

    Frame at(std::uint32_t child, const UrdfPose& pose) const {
        Vector moved = turnedBy(rotation, pose.xyz);
        for (std::size_t i = 0; i < 3; ++i) moved[i] += position[i];
        return {child, moved, product(rotation, quaternionOf(pose.rpy))};
    }
};

class Extent {
  public:
    void add(const Vector& position, double radius) {
        for (std::size_t i = 0; i < 3; ++i) {
            low_[i] = std::min(low_[i], position[i] - radius);
            high_[i] = std::max(high_[i], position[i] + radius);
        }
    }
    Vector middle() const { return {(low_[0] + high_[0]) / 2, (low_[1] + high_[1]) / 2, (low_[2] + high_[2]) / 2}; }
    double radius() const {
        double sum = 0;
        for (std::size_t i = 0; i < 3; ++i) sum += (high_[i] - low_[i]) * (high_[i] - low_[i]);
        return std::sqrt(sum) / 2;
    }

  private:
    Vector low_{HUGE_VAL, HUGE_VAL, HUGE_VAL}, high_{-HUGE_VAL, -HUGE_VAL, -HUGE_VAL};
};

double radiusOf(const UrdfShape& shape) {
    const Vector& size = shape.size;
    switch (shape.kind) {
        case UrdfShape::Kind::box:
            return std::sqrt(size[0] * size[0] + size[1] * size[1] + size[2] * size[2]) / 2;
        case UrdfShape::Kind::cylinder:
            return std::sqrt(size[0] * size[0] + size[1] * size[1] / 4);
        case UrdfShape::Kind::sphere:
            return size[0];
        case UrdfShape::Kind::mesh:
            break;
    }
    return 0;
}

Extent extentOf(const UrdfModel& model) {
    Extent extent;
    std::vector<Frame> open;
    for (const std::uint32_t root : model.roots) open.push_back({root});
    while (!open.empty()) {
        const Frame frame = open.back();
        open.pop_back();
        const UrdfLink& link = model.links[frame.link];
        extent.add(frame.position, 0);
        for (const UrdfShape& shape : link.visuals) extent.add(frame.at(0, shape.origin).position, radiusOf(shape));
        for (const std::uint32_t number : link.joints)
            open.push_back(frame.at(model.joints[number].child, model.joints[number].origin));
    }
    return extent;
}

}  // namespace

void writeViewpoint(DocumentHandler& out, const UrdfModel& model) {
    constexpr double kField = .785398, kMargin = 1.15, kMin = .2, kUnknown = 1, kSide = .8, kAbove = .35;
    const Extent extent = extentOf(model);
    double radius = extent.radius();
    if (!(radius > 0)) radius = kUnknown;
    const double distance = std::max(radius, kMin) * kMargin / portable::sin(kField / 2);
    const Vector robot = extent.middle();
    const Vector middle{robot[0], robot[2], -robot[1]};  // where y points up
    const portable::SineCosine side = portable::sineCosine(kSide), above = portable::sineCosine(kAbove);
    const Vector displacement{side.sine * above.cosine, above.sine, side.cosine * above.cosine};
    const auto number = [](double value) { return static_cast<float>(value); };
    OutputNode view(out, "Viewpoint");
    view.set("centerOfRotation", Vec3f(number(middle[0]), number(middle[1]), number(middle[2])));
    view.set("description", String(model.name.empty() ? std::string("robot") : model.name));
    view.set("fieldOfView", number(kField));
    view.set("orientation", rotationOfAngles({-kAbove, kSide, 0}));
    view.set("position",
             Vec3f(number(middle[0] + distance * displacement[0]), number(middle[1] + distance * displacement[1]),
                   number(middle[2] + distance * displacement[2])));
}

}  // namespace rtsg::detail
