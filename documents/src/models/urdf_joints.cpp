// Writes the prototypes of joints, and their instances.
#include "urdf_joints.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <rtsg/core/portable_math.h>

#include "output_node.h"

namespace rtsg::detail {

namespace {

using Kind = UrdfJoint::Kind;

constexpr double kPi = 3.141592653589793;
/// A continuous joint turns this often each way: the interpolators of its prototype take whole turns off its angle in
/// two steps, first of this many turns, then of one.
constexpr int kAngles = 64;

float inFloat(double number) {
    return static_cast<float>(number);
}
Vec3f urdfVector(const std::array<double, 3>& numbers) {
    return {inFloat(numbers[0]), inFloat(numbers[1]), inFloat(numbers[2])};
}
Vec3f along(const UrdfJoint& joint, double distance) {
    return urdfVector({joint.axis[0] * distance, joint.axis[1] * distance, joint.axis[2] * distance});
}
Rotation about(const UrdfJoint& joint, double angle) {
    const Vec3f axis = urdfVector(joint.axis);
    return {axis.x, axis.y, axis.z, inFloat(angle)};
}

std::string_view protoName(Kind kind) {
    return kind == Kind::revolute ? "RevoluteJoint" : kind == Kind::continuous ? "ContinuousJoint" : "PrismaticJoint";
}

/// Keys from `lower` to `upper` that grow by eights away from 0: an interpolator finds its place between two keys as a
/// fraction, a float, which between -10,000 and 0 would know hundredths at best.
std::vector<double> wideningKeys(double lower, double upper) {
    std::vector<double> keys{lower, upper};
    if (lower < 0 && upper > 0) keys.push_back(0);
    for (const double end : {lower, upper})
        for (double key = end / 8; std::abs(key) > 1; key /= 8)
            if (key > lower && key < upper) keys.push_back(key);
    std::ranges::sort(keys);
    return keys;
}

/// A saw of `teeth` teeth on each side of the one round 0: the angle within `step` turns, as near to 0 as it can be.
void writeSaw(DocumentHandler& out, std::string_view def, int teeth, double step) {
    Array<float> key, value;
    const double half = step * kPi;
    for (int tooth = -teeth; tooth <= teeth; ++tooth)
        for (const double at : tooth == 0 ? wideningKeys(-half, half) : std::vector<double>{-half, 0, half}) {
            // The end of a tooth is the beginning of the next one, to the last bit.
            const int ends = at == -half ? -1 : at == half ? 1 : 0;
            key.push_back(inFloat(ends != 0 ? (2 * tooth + ends) * half : 2 * tooth * half + at));
            value.push_back(inFloat(at));
        }
    OutputNode saw(out, "ScalarInterpolator", {}, def);
    saw.set("key", std::move(key));
    saw.set("keyValue", std::move(value));
}

/// The keys of a turn from `lower` to `upper`: at most a quarter of a turn apart, as the shortest way between two
/// rotations is taken, and one at 0, where the joint rests.
std::vector<double> turningKeys(double lower, double upper) {
    std::vector<double> keys{lower};
    const auto goTo = [&](double to) {
        const double from = keys.back();
        const auto steps = std::max(1.0, std::ceil((to - from) / (kPi / 2)));
        for (double i = 1; i <= steps; ++i) keys.push_back(i == steps ? to : from + (to - from) * i / steps);
    };
    if (lower < 0 && upper > 0) goTo(0);
    if (upper > lower) goTo(upper);
    return keys;
}

void setKeys(DocumentHandler& out, const UrdfJoint& joint) {
    Array<float> key;
    const auto set = [&](std::string_view field, Value value) { out.setField(field, std::move(value), {}); };
    if (joint.kind == Kind::prismatic) {
        Array<Vec3f> positions;
        for (const double distance : {joint.lower, joint.upper}) {
            key.push_back(inFloat(distance));
            positions.push_back(along(joint, distance));
        }
        set("key", Value(std::move(key)));
        set("keyValue", Value(std::move(positions)));
        return;
    }
    const bool isEndless = joint.kind == Kind::continuous;
    Array<Rotation> rotations;
    for (const double angle : turningKeys(isEndless ? -kPi : joint.lower, isEndless ? kPi : joint.upper)) {
        key.push_back(inFloat(angle));
        rotations.push_back(about(joint, angle));
    }
    if (!isEndless) set("key", Value(std::move(key)));
    set("keyValue", Value(std::move(rotations)));
}

}  // namespace

std::array<double, 4> quaternionOf(const std::array<double, 3>& rpy) {
    const portable::SineCosine r = portable::sineCosine(rpy[0] / 2), p = portable::sineCosine(rpy[1] / 2),
                               y = portable::sineCosine(rpy[2] / 2);
    return {r.sine * p.cosine * y.cosine - r.cosine * p.sine * y.sine,
            r.cosine * p.sine * y.cosine + r.sine * p.cosine * y.sine,
            r.cosine * p.cosine * y.sine - r.sine * p.sine * y.cosine,
            r.cosine * p.cosine * y.cosine + r.sine * p.sine * y.sine};
}

Rotation rotationOfAngles(const std::array<double, 3>& rpy) {
    const std::array<double, 4> q = quaternionOf(rpy);
    const double s = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2]);
    if (!(s > 0)) return {};
    return {inFloat(q[0] / s), inFloat(q[1] / s), inFloat(q[2] / s), inFloat(2 * portable::atan2(s, q[3]))};
}

std::string_view valueField(Kind kind) {
    return kind == Kind::prismatic ? "position" : "angle";
}

void declareJoint(DocumentHandler& out, Kind kind) {
    const bool slides = kind == Kind::prismatic, isEndless = kind == Kind::continuous;
    const std::string_view value = valueField(kind), moved = slides ? "translation" : "rotation";
    const auto field = [&](Access access, FieldType type, std::string_view name, Value given) {
        out.declareField({access, type, std::string(name)}, std::move(given), {});
    };
    out.beginProto(protoName(kind), {});
    field(Access::inputOutput, FieldType::SFFloat, value, Value(0.0f));
    field(Access::inputOutput, FieldType::SFVec3f, "translation", Value(Vec3f(0, 0, 0)));
    field(Access::inputOutput, FieldType::SFRotation, "rotation", Value(Rotation()));
    if (slides) {
        field(Access::inputOutput, FieldType::SFVec3f, "pose", Value(Vec3f(0, 0, 0)));
        field(Access::initializeOnly, FieldType::MFVec3f, "keyValue", Value(Array<Vec3f>()));
    } else {
        field(Access::inputOutput, FieldType::SFRotation, "pose", Value(Rotation()));
        Array<Rotation> rotations;  // as many as the prototype itself has keys, about the z axis
        if (isEndless)
            for (const double angle : turningKeys(-kPi, kPi)) rotations.push_back({0, 0, 1, inFloat(angle)});
        field(Access::initializeOnly, FieldType::MFRotation, "keyValue", Value(std::move(rotations)));
    }
    if (!isEndless) field(Access::initializeOnly, FieldType::MFFloat, "key", Value(Array<float>()));
    field(Access::inputOutput, FieldType::MFNode, "children", Value(Array<NodeId>()));
    out.beginProtoBody({});
    {
        OutputNode frame(out, "Transform");
        frame.is("translation", "translation");
        frame.is("rotation", "rotation");
        OutputNode moving(out, "Transform", "children", "Moving");
        moving.is(moved, "pose");
        moving.is("children", "children");
    }
    {
        // A sensor that nobody touches: its offset keeps a value, and sends it on.
        OutputNode holder(out, "CylinderSensor", {}, "Value");
        holder.set("enabled", false);
        holder.is("offset", value);
    }
    if (isEndless) {
        writeSaw(out, "Turns", kAngles, kAngles);
        writeSaw(out, "Turn", kAngles / 2, 1);
    }
    {
        OutputNode last(out, slides ? "PositionInterpolator" : "OrientationInterpolator", {}, "Pose");
        if (isEndless) {
            Array<float> key;
            for (const double angle : turningKeys(-kPi, kPi)) key.push_back(inFloat(angle));
            last.set("key", std::move(key));
        } else {
            last.is("key", "key");
        }
        last.is("keyValue", "keyValue");
    }
    out.route("Value", "offset", isEndless ? "Turns" : "Pose", "set_fraction", {});
    if (isEndless) {
        out.route("Turns", "value_changed", "Turn", "set_fraction", {});
        out.route("Turn", "value_changed", "Pose", "set_fraction", {});
    }
    out.route("Pose", "value_changed", "Moving", moved, {});
    out.endProto({});
}

void beginJoint(DocumentHandler& out, const UrdfJoint& joint, std::string_view def) {
    out.beginNode(joint.hasValue() ? protoName(joint.kind) : "Transform", def, "children", joint.where);
    writePose(out, joint.origin);
    if (!joint.hasValue()) return;
    if (joint.start != 0) {
        out.setField(valueField(joint.kind), Value(inFloat(joint.start)), {});
        out.setField(
            "pose", joint.kind == Kind::prismatic ? Value(along(joint, joint.start)) : Value(about(joint, joint.start)),
            {});
    }
    setKeys(out, joint);
}

void writeMimic(DocumentHandler& out, const UrdfJoint& leader, const UrdfJoint::Mimic& mimic, std::string_view def) {
    constexpr double kMax = (2 * kAngles + 1) * kAngles * kPi;
    const bool isEndless = leader.kind == Kind::continuous;
    Array<float> key, value;
    for (const double at : wideningKeys(isEndless ? -kMax : leader.lower, isEndless ? kMax : leader.upper)) {
        key.push_back(inFloat(at));
        value.push_back(inFloat(at * mimic.multiplier + mimic.offset));
    }
    OutputNode follow(out, "ScalarInterpolator", {}, def);
    follow.set("key", std::move(key));
    follow.set("keyValue", std::move(value));
}

bool isIdentity(const UrdfPose& pose) {
    constexpr auto isZero = [](double number) { return number == 0; };
    return std::ranges::all_of(pose.xyz, isZero) && std::ranges::all_of(pose.rpy, isZero);
}

void writePose(DocumentHandler& out, const UrdfPose& pose) {
    if (std::ranges::any_of(pose.xyz, [](double n) { return n != 0; }))
        out.setField("translation", Value(urdfVector(pose.xyz)), {});
    if (std::ranges::any_of(pose.rpy, [](double n) { return n != 0; }))
        out.setField("rotation", Value(rotationOfAngles(pose.rpy)), {});
}

}  // namespace rtsg::detail
