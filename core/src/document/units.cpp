// Which fields have units, and the conversion of their values.
#include "units.h"

#include <array>
#include <charconv>
#include <cmath>
#include <span>
#include <type_traits>
#include <unordered_map>

namespace rtsg::detail {

namespace {

struct UnitRow {
    Unit unit;
    std::string_view type;    // built-in or abstract: then of every type that is one
    std::string_view fields;  // separated by spaces
};

/// What counts in no unit is not listed: ratios, directions, texture coordinates, geographic coordinates (clause 25 has
/// its own units for those), values of scalar interpolators, whose meaning depends on what they are routed to.
constexpr std::array kRows = std::to_array<UnitRow>({
    {Unit::length, "X3DBoundedObject", "bboxCenter bboxSize"},
    {Unit::length, "Transform", "center translation"},
    {Unit::length, "CADPart", "center translation"},
    {Unit::length, "EspduTransform", "center translation"},
    {Unit::length, "HAnimHumanoid", "center translation jointBindingPositions"},
    {Unit::length, "HAnimJoint", "center translation"},
    {Unit::length, "HAnimSite", "center translation"},
    {Unit::length, "HAnimSegment", "centerOfMass"},
    {Unit::mass, "HAnimSegment", "mass"},
    {Unit::length, "HAnimDisplacer", "displacements"},
    {Unit::length, "GeoTransform", "translation"},
    {Unit::length, "LOD", "center range"},
    {Unit::length, "GeoLOD", "range"},
    {Unit::length, "X3DFogObject", "visibilityRange"},
    {Unit::length, "FogCoordinate", "depth"},
    {Unit::angle, "X3DBackgroundNode", "groundAngle skyAngle"},
    {Unit::length, "X3DEnvironmentalSensorNode", "size center"},
    {Unit::length, "Arc2D", "radius"},
    {Unit::angle, "Arc2D", "startAngle endAngle"},
    {Unit::length, "ArcClose2D", "radius"},
    {Unit::angle, "ArcClose2D", "startAngle endAngle"},
    {Unit::length, "Circle2D", "radius"},
    {Unit::length, "Disk2D", "innerRadius outerRadius"},
    {Unit::length, "Polyline2D", "lineSegments"},
    {Unit::length, "Polypoint2D", "point"},
    {Unit::length, "Rectangle2D", "size"},
    {Unit::length, "TriangleSet2D", "vertices"},
    {Unit::length, "Box", "size"},
    {Unit::length, "Cone", "bottomRadius height"},
    {Unit::length, "Cylinder", "height radius"},
    {Unit::length, "Sphere", "radius"},
    {Unit::length, "ElevationGrid", "height xSpacing zSpacing"},
    {Unit::angle, "ElevationGrid", "creaseAngle"},
    {Unit::length, "Extrusion", "crossSection spine"},
    {Unit::angle, "Extrusion", "creaseAngle"},
    {Unit::angle, "IndexedFaceSet", "creaseAngle"},
    {Unit::angle, "GeoElevationGrid", "creaseAngle"},
    {Unit::length, "Coordinate", "point"},
    {Unit::length, "CoordinateDouble", "point"},
    {Unit::length, "CoordinateInterpolator", "keyValue"},
    {Unit::length, "CoordinateInterpolator2D", "keyValue"},
    {Unit::length, "PositionInterpolator", "keyValue"},
    {Unit::length, "PositionInterpolator2D", "keyValue"},
    {Unit::length, "SplinePositionInterpolator", "keyValue keyVelocity"},
    {Unit::length, "SplinePositionInterpolator2D", "keyValue keyVelocity"},
    {Unit::length, "CoordinateChaser", "initialDestination initialValue"},
    {Unit::length, "CoordinateDamper", "initialDestination initialValue"},
    {Unit::length, "PositionChaser", "initialDestination initialValue"},
    {Unit::length, "PositionChaser2D", "initialDestination initialValue"},
    {Unit::length, "PositionDamper", "initialDestination initialValue"},
    {Unit::length, "PositionDamper2D", "initialDestination initialValue"},
    {Unit::length, "PointLight", "location radius"},
    {Unit::length, "SpotLight", "location radius"},
    {Unit::angle, "SpotLight", "beamWidth cutOffAngle"},
    {Unit::length, "X3DViewpointNode", "nearDistance farDistance"},
    {Unit::length, "Viewpoint", "position centerOfRotation"},
    {Unit::angle, "Viewpoint", "fieldOfView"},
    {Unit::angle, "GeoViewpoint", "fieldOfView"},
    {Unit::length, "OrthoViewpoint", "position centerOfRotation fieldOfView"},
    {Unit::length, "ViewpointGroup", "center size"},
    {Unit::length, "NavigationInfo", "avatarSize visibilityLimit"},
    {Unit::speed, "NavigationInfo", "speed"},
    {Unit::angle, "CylinderSensor", "diskAngle maxAngle minAngle offset"},
    {Unit::length, "PlaneSensor", "maxPosition minPosition offset"},
    {Unit::length, "Sound", "location maxBack maxFront minBack minFront"},
    {Unit::length, "SpatialSound", "location maxDistance referenceDistance"},
    {Unit::angle, "SpatialSound", "coneInnerAngle coneOuterAngle"},
    {Unit::length, "ListenerPointSource", "position interauralDistance"},
    {Unit::length, "FontStyle", "size"},
    {Unit::length, "Text", "length maxExtent"},
    {Unit::length, "X3DTextureProjectorNode", "location nearDistance farDistance"},
    {Unit::angle, "TextureProjector", "fieldOfView"},
    {Unit::length, "TextureProjectorParallel", "fieldOfView"},
    {Unit::angle, "TextureTransform", "rotation"},
    {Unit::length, "X3DVolumeDataNode", "dimensions"},
    {Unit::mass, "X3DParticleEmitterNode", "mass"},
    {Unit::speed, "X3DParticleEmitterNode", "speed"},
    {Unit::area, "X3DParticleEmitterNode", "surfaceArea"},
    {Unit::angle, "ConeEmitter", "angle"},
    {Unit::length, "ConeEmitter", "position"},
    {Unit::length, "ExplosionEmitter", "position"},
    {Unit::length, "PointEmitter", "position"},
    {Unit::length, "ParticleSystem", "particleSize"},
    {Unit::force, "ForcePhysicsModel", "force"},
    {Unit::speed, "WindPhysicsModel", "speed"},
    {Unit::length, "X3DNBodyCollidableNode", "translation"},
    {Unit::length, "RigidBody", "centerOfMass position"},
    {Unit::mass, "RigidBody", "mass"},
    {Unit::force, "RigidBody", "forces"},
    {Unit::torque, "RigidBody", "torques"},
    {Unit::speed, "RigidBody", "linearVelocity disableLinearSpeed"},
    {Unit::angularRate, "RigidBody", "angularVelocity disableAngularSpeed"},
    {Unit::acceleration, "RigidBodyCollection", "gravity"},
    {Unit::speed, "RigidBodyCollection", "disableLinearSpeed maxCorrectionSpeed"},
    {Unit::angularRate, "RigidBodyCollection", "disableAngularSpeed"},
    {Unit::length, "RigidBodyCollection", "contactSurfaceThickness"},
    {Unit::speed, "CollisionCollection", "minBounceSpeed surfaceSpeed"},
    {Unit::length, "Contact", "depth position"},
    {Unit::speed, "Contact", "minBounceSpeed surfaceSpeed"},
    {Unit::length, "X3DRigidJointNode", "anchorPoint"},  // those that have one
    {Unit::angle, "SingleAxisHingeJoint", "maxAngle minAngle"},
    {Unit::angle, "DoubleAxisHingeJoint", "maxAngle1 minAngle1"},
    {Unit::angularRate, "DoubleAxisHingeJoint", "desiredAngularVelocity1 desiredAngularVelocity2"},
    {Unit::torque, "DoubleAxisHingeJoint", "maxTorque1 maxTorque2"},
    {Unit::force, "DoubleAxisHingeJoint", "suspensionForce"},
    {Unit::angle, "MotorJoint", "axis1Angle axis2Angle axis3Angle"},
    {Unit::torque, "MotorJoint", "axis1Torque axis2Torque axis3Torque"},
    {Unit::length, "SliderJoint", "maxSeparation minSeparation"},
    {Unit::force, "SliderJoint", "sliderForce"},
});

std::unordered_map<const FieldDef*, Unit> allUnits() {
    std::unordered_map<const FieldDef*, Unit> units;
    for (const auto& type : builtinTypes())
        for (const UnitRow& row : kRows) {
            if (!type->isA(row.type)) continue;
            for (std::string_view rest = row.fields; !rest.empty();) {
                const std::string_view name = rest.substr(0, rest.find(' '));
                rest.remove_prefix(std::min(name.size() + 1, rest.size()));
                if (const FieldIndex index = type->findExact(name); index != kNoField)
                    units[&type->fields[index]] = row.unit;
            }
        }
    return units;
}

/// Calls `convert(number)` for each number of the value that counts in the unit: of a rotation, the angle alone.
template <class Convert>
void forEachNumber(Value& value, const Convert& convert) {
    const auto numbers = [&](auto* first, std::size_t count) {
        for (std::size_t i = 0; i < count; ++i) convert(first[i]);
    };
    const auto change = [&]<class T, class S>(std::type_identity<T>, std::type_identity<S>) {
        if (value.holds<T>()) {
            T one = value.as<T>();
            numbers(reinterpret_cast<S*>(&one), sizeof(T) / sizeof(S));
            value = Value(one);
        } else {
            Array<T> all = value.as<Array<T>>();
            if (all.empty()) return;
            numbers(reinterpret_cast<S*>(all.mutableData()), all.size() * sizeof(T) / sizeof(S));
            value = Value(std::move(all));
        }
    };
    switch (sf(value.type())) {
        case FieldType::SFRotation:
            if (value.holds<Rotation>()) {
                Rotation one = value.as<Rotation>();
                convert(one.angle);
                value = Value(one);
            } else {
                Array<Rotation> all = value.as<Array<Rotation>>();
                for (std::size_t i = 0; i < all.size(); ++i) convert(all.mutableData()[i].angle);
                value = Value(std::move(all));
            }
            return;
        case FieldType::SFFloat:
            return change(std::type_identity<float>(), std::type_identity<float>());
        case FieldType::SFDouble:
            return change(std::type_identity<double>(), std::type_identity<double>());
        case FieldType::SFVec2f:
            return change(std::type_identity<Vec2f>(), std::type_identity<float>());
        case FieldType::SFVec3f:
            return change(std::type_identity<Vec3f>(), std::type_identity<float>());
        case FieldType::SFVec4f:
            return change(std::type_identity<Vec4f>(), std::type_identity<float>());
        case FieldType::SFVec2d:
            return change(std::type_identity<Vec2d>(), std::type_identity<double>());
        case FieldType::SFVec3d:
            return change(std::type_identity<Vec3d>(), std::type_identity<double>());
        default:
            return;
    }
}

template <class S>
S scaled(S number, double factor) {
    return static_cast<S>(static_cast<double>(number) * factor);
}

/// The shortest decimal of which `scaled` makes `number`.
template <class S>
S unscaled(S number, double factor) {
    const double quotient = static_cast<double>(number) / factor;
    if (!std::isfinite(quotient)) return number;
    for (int digits = 1; digits <= (sizeof(S) == 4 ? 9 : 17); ++digits) {
        std::array<char, 40> text{};
        const auto end =
            std::to_chars(text.data(), text.data() + text.size(), quotient, std::chars_format::scientific, digits - 1);
        S candidate{};
        std::from_chars(text.data(), end.ptr, candidate);
        if (scaled(candidate, factor) == number) return candidate;
    }
    return static_cast<S>(quotient);
}

/// -1 for "none" or "automatic" is no length.
bool isSentinel(const FieldDef* field, const Value& value) {
    return field && value == field->defaultValue &&
           ((value.holds<float>() && value.as<float>() < 0) || (value.holds<Vec3f>() && value.as<Vec3f>().x < 0));
}

}  // namespace

Unit unitOf(const FieldDef& field) {
    static const std::unordered_map<const FieldDef*, Unit> units = allUnits();
    const auto found = units.find(&field);
    return found == units.end() ? Unit::none : found->second;
}

void Units::set(std::string_view category, double factor) {
    if (category == "length") length_ = factor;
    if (category == "angle") angle_ = factor;
    if (category == "mass") mass_ = factor;
    if (category == "force") force_ = factor;
}

double Units::factor(Unit unit) const {
    switch (unit) {
        case Unit::length:
        case Unit::speed:
        case Unit::acceleration:
            return length_;
        case Unit::angle:
        case Unit::angularRate:
            return angle_;
        case Unit::mass:
            return mass_;
        case Unit::force:
            return force_;
        case Unit::area:
            return length_ * length_;
        case Unit::torque:
            return force_ * length_;
        case Unit::none:
            break;
    }
    return 1;
}

void Units::toStandard(const FieldDef* field, Value& value) const {
    if (areStandard() || !field || isSentinel(field, value)) return;
    const double by = sf(value.type()) == FieldType::SFRotation ? angle_ : factor(unitOf(*field));
    if (by != 1) forEachNumber(value, [&](auto& number) { number = scaled(number, by); });
}

void Units::fromStandard(const FieldDef* field, Value& value) const {
    if (areStandard() || !field || isSentinel(field, value)) return;
    const double by = sf(value.type()) == FieldType::SFRotation ? angle_ : factor(unitOf(*field));
    if (by != 1) forEachNumber(value, [&](auto& number) { number = unscaled(number, by); });
}

}  // namespace rtsg::detail
