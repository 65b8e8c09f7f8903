// UNIT statements: values come in and go out in the document's units, and are metres, radians, kilograms and newtons
// between.
#include <cmath>
#include <numbers>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <rtsg/documents/loader.h>
#include <rtsg/documents/writer.h>

#include "commands/units.h"
#include "core/scene_check.h"

namespace rtsg {
namespace {

using test::allText;
using testing::HasSubstr;
using testing::Not;

constexpr const char* kDegreesAndCentimetres = R"(#X3D V3.3 utf8
PROFILE Immersive
UNIT angle degree 0.017453292519943295
UNIT length cm 0.01
DEF T Transform { rotation 0 1 0 90 translation 100 -25.4 0 scale 2 2 2 children Shape {
  geometry DEF E Extrusion { creaseAngle 30 crossSection [ 10 0 0 10 ] orientation [ 0 0 1 45, 1 0 0 -7.3 ] }
} }
DEF S SpotLight { cutOffAngle 45 location 1 2 3 direction 0 1 0 }
DEF V Viewpoint { fieldOfView 60 position 0 0 1000 nearDistance -1 }
DEF C CoordinateDouble { point [ 1 2 0.1 ] }
DEF I ScalarInterpolator { key [ 0 1 ] keyValue [ 0 90 ] }
)";

void expectStandard(const Scene& scene) {
    const auto field = [&](std::string_view def, std::string_view name) {
        const Node& node = scene.node(scene.findName(def));
        return node.value(node.type().find(name));
    };
    constexpr double degree = std::numbers::pi / 180;
    EXPECT_FLOAT_EQ(field("T", "rotation").as<Rotation>().angle, float(90 * degree));
    EXPECT_EQ(field("T", "rotation").as<Rotation>().y, 1.0f);
    EXPECT_FLOAT_EQ(field("T", "translation").as<Vec3f>().x, 1.0f);
    EXPECT_FLOAT_EQ(field("T", "translation").as<Vec3f>().y, -.254f);
    EXPECT_EQ(field("T", "scale").as<Vec3f>(), Vec3f(2, 2, 2));
    EXPECT_FLOAT_EQ(field("E", "creaseAngle").as<float>(), float(30 * degree));
    EXPECT_FLOAT_EQ(field("E", "crossSection").as<Array<Vec2f>>()[0].x, .1f);
    EXPECT_FLOAT_EQ(field("E", "orientation").as<Array<Rotation>>()[0].angle, float(45 * degree));
    EXPECT_FLOAT_EQ(field("E", "orientation").as<Array<Rotation>>()[1].angle, float(-7.3 * degree));
    EXPECT_FLOAT_EQ(field("S", "cutOffAngle").as<float>(), float(45 * degree));
    EXPECT_EQ(field("S", "direction").as<Vec3f>(), Vec3f(0, 1, 0));
    EXPECT_FLOAT_EQ(field("V", "fieldOfView").as<float>(), float(60 * degree));
    EXPECT_FLOAT_EQ(field("V", "position").as<Vec3f>().z, 10.0f);
    EXPECT_EQ(field("V", "nearDistance").as<float>(), -1.0f) << "that is no distance";
    EXPECT_DOUBLE_EQ(field("C", "point").as<Array<Vec3d>>()[0].y, .02);
    EXPECT_EQ(field("I", "keyValue").as<Array<float>>()[1], 90.0f) << "what it is routed to decides";
}

// The meaning of a rotation does not depend on its declaration; that of a number does, and nobody states it.
TEST(DocumentUnits, RotationsOfPrototypesAndScriptsAreAngles) {
    constexpr const char* text = R"(#X3D V3.3 utf8
PROFILE Immersive
UNIT angle degree 0.017453292519943295
PROTO Turned [ inputOutput SFRotation turn 0 1 0 180 inputOutput SFFloat size 90 ] { Transform { rotation IS turn } }
DEF BY_DEFAULT Turned { }
DEF GIVEN Turned { turn 0 1 0 90 size 45 }
DEF S Script { initializeOnly MFRotation ways [ 0 1 0 45, 1 0 0 -7.3 ] }
)";
    std::string first;
    for (const Encoding encoding : {Encoding::classicVrml, Encoding::xml, Encoding::json}) {
        Diagnostics diagnostics;
        std::string written;
        const auto writer = makeWriter(encoding, [&](std::string_view piece) { written += piece; }, diagnostics);
        readDocument(text, *writer, diagnostics);
        Scene scene;
        ASSERT_TRUE(loadText(scene, written, diagnostics)) << written << allText(diagnostics);
        EXPECT_EQ(diagnostics.all().size(), 0u) << allText(diagnostics);
        const auto field = [&](std::string_view def, std::string_view name) {
            const Node& node = scene.node(scene.findName(def));
            return node.value(node.type().find(name));
        };
        constexpr double degree = std::numbers::pi / 180;
        EXPECT_FLOAT_EQ(field("BY_DEFAULT", "turn").as<Rotation>().angle, float(180 * degree));
        EXPECT_FLOAT_EQ(field("GIVEN", "turn").as<Rotation>().angle, float(90 * degree));
        EXPECT_EQ(field("GIVEN", "size").as<float>(), 45.0f);
        EXPECT_FLOAT_EQ(field("S", "ways").as<Array<Rotation>>()[1].angle, float(-7.3 * degree));
        for (const char* digits : {"0 1 0 180", "0 1 0 90", "1 0 0 -7.3"})
            EXPECT_THAT(written, testing::AnyOf(HasSubstr(digits), HasSubstr("1,0,0,-7.3")))
                << "as the author wrote it";
    }
}

TEST(DocumentUnits, ValuesAreTheStandardsInsideAndTheDocumentsInEveryEncoding) {
    std::string first;
    for (const Encoding encoding : {Encoding::classicVrml, Encoding::xml, Encoding::json}) {
        Scene scene;
        Diagnostics diagnostics;
        std::string text = kDegreesAndCentimetres;
        if (encoding != Encoding::classicVrml) {
            text.clear();
            const auto writer = makeWriter(encoding, [&](std::string_view piece) { text += piece; }, diagnostics);
            readDocument(kDegreesAndCentimetres, *writer, diagnostics);
        }
        ASSERT_TRUE(loadText(scene, text, diagnostics)) << allText(diagnostics);
        EXPECT_EQ(diagnostics.all().size(), 0u) << allText(diagnostics);
        expectStandard(scene);
        std::string back;
        const auto writer =
            makeWriter(Encoding::classicVrml, [&](std::string_view piece) { back += piece; }, diagnostics);
        readDocument(text, *writer, diagnostics);
        for (const char* digits : {"rotation 0 1 0 90", "translation 100 -25.4 0", "creaseAngle 30", "1 0 0 -7.3",
                                   "fieldOfView 60", "nearDistance -1", "1 2 0.1"})
            EXPECT_THAT(back, HasSubstr(digits));
    }
}

TEST(DocumentUnits, Vrml97HasNoneSoValuesAreWrittenInMetres) {
    Diagnostics diagnostics;
    std::string text;
    const auto writer = makeWriter(Encoding::vrml97, [&](std::string_view piece) { text += piece; }, diagnostics);
    readDocument(kDegreesAndCentimetres, *writer, diagnostics);
    EXPECT_THAT(text, HasSubstr("position 0 0 10"));
    EXPECT_THAT(text, Not(HasSubstr("UNIT")));
    EXPECT_THAT(allText(diagnostics), HasSubstr("UNIT cannot be written"));
}

TEST(DocumentUnits, RangesAreThoseOfTheConvertedValues) {
    test::Loaded good("UNIT angle degree 0.017453292519943295\nSpotLight { cutOffAngle 89 }");
    EXPECT_EQ(good.problems(), "");
    test::Loaded bad("UNIT angle degree 0.017453292519943295\nSpotLight { cutOffAngle 91 }");
    EXPECT_THAT(bad.problems(), HasSubstr("outside the range"));
}

TEST(DocumentUnits, EveryRowOfTheTableNamesAFieldOfNumbers) {
    std::size_t with = 0;
    for (const auto& type : builtinTypes())
        for (const FieldDef& field : type->fields) {
            if (field.unit == Unit::none) continue;
            ++with;
            const FieldType element = sf(field.type);
            EXPECT_TRUE(element == FieldType::SFFloat || element == FieldType::SFDouble ||
                        element == FieldType::SFVec2f || element == FieldType::SFVec3f ||
                        element == FieldType::SFVec4f || element == FieldType::SFVec3d || element == FieldType::SFVec2d)
                << type->name << '.' << field.name;
        }
    EXPECT_GT(with, 200u);
    const auto unit = [](std::string_view type, std::string_view name) {
        const NodeType* found = findBuiltinType(type);
        return found->fields[found->findExact(name)].unit;
    };
    EXPECT_EQ(unit("Inline", "bboxSize"), Unit::length);
    EXPECT_EQ(unit("ProximitySensor", "center"), Unit::length);
    EXPECT_EQ(unit("BallJoint", "anchorPoint"), Unit::length);
    EXPECT_EQ(unit("Transform", "scale"), Unit::none);
}

TEST(DocumentUnits, OnlyTheDefaultThatIsNoLengthStaysAsItIs) {
    test::Loaded l(
        "UNIT length cm 0.01\n"
        "DEF A Viewpoint { nearDistance -1 farDistance -2 } DEF B Group { bboxSize -1 -1 -1 }\n"
        "DEF C Group { bboxSize -2 -2 -2 } DEF D Sphere { radius 1 } DEF E Transform { translation -100 0 0 }");
    EXPECT_EQ(l.get("A", "nearDistance"), "-1");
    EXPECT_EQ(l.get("A", "farDistance"), "-0.02");
    EXPECT_EQ(l.get("B", "bboxSize"), "-1 -1 -1");
    EXPECT_EQ(l.get("C", "bboxSize"), "-0.02 -0.02 -0.02");
    EXPECT_EQ(l.get("D", "radius"), "0.01") << "the default, but a length";
    EXPECT_EQ(l.get("E", "translation"), "-1 0 0");
}

/// The value that the field has in a document of the standard's units, and back in a document of these.
template <class T>
T thereAndBack(const detail::Units& units, const FieldDef& field, T inDocument) {
    Value value(inDocument);
    units.toStandard(&field, value);
    const Value standard = value;
    units.fromStandard(&field, value);
    Value again = value;
    units.toStandard(&field, again);
    EXPECT_EQ(again, standard);
    return value.as<T>();
}

TEST(DocumentUnits, WhatIsWrittenIsReadAsTheVeryValue) {
    const auto field = [](std::string_view type, std::string_view name) -> const FieldDef& {
        const NodeType* found = findBuiltinType(type);
        return found->fields[found->findExact(name)];
    };
    const std::uint64_t seed = 20260811;
    SCOPED_TRACE(seed);
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> exponent(-9, 9);
    for (const double factor : {0.01, 0.3048, 1.0 / 3, 1609.344}) {
        detail::Units units;
        units.set("length", factor);
        units.set("mass", factor);
        for (int i = 0; i < 2000; ++i) {
            const double number = std::pow(10, exponent(random));
            thereAndBack(units, field("Sphere", "radius"), static_cast<float>(number));
            thereAndBack(units, field("CoordinateDouble", "point"), Array<Vec3d>{{number, -number, 0}});
        }
    }
}

TEST(DocumentUnits, NumbersTooLargeForTheDocumentsUnitsStay) {
    const NodeType* type = findBuiltinType("CoordinateDouble");
    const FieldDef& points = type->fields[type->findExact("point")];
    detail::Units units;
    units.set("length", 0.01);
    Value value(Array<Vec3d>{{1e308, 1, 0}});
    units.fromStandard(&points, value);
    EXPECT_EQ(value.as<Array<Vec3d>>()[0], Vec3d(1e308, 100, 0));
}

TEST(DocumentUnits, DerivedUnitsFollowFromTheFour) {
    test::Loaded l(
        "UNIT length km 1000\nUNIT force kN 1000\nUNIT mass t 1000\n"
        "DEF B RigidBody { mass 2 linearVelocity 1 0 0 torques [ 1 0 0 ] forces [ 0 1 0 ] }\n"
        "UNIT angle degree 0.5\n"
        "DEF R RigidBody { angularVelocity 4 0 0 }\nDEF G RigidBodyCollection { gravity 0 -2 0 }\n"
        "DEF E PointEmitter { surfaceArea 2 }");
    EXPECT_EQ(l.get("R", "angularVelocity"), "2 0 0");
    EXPECT_EQ(l.get("G", "gravity"), "0 -2000 0");
    EXPECT_EQ(l.get("B", "mass"), "2000");
    EXPECT_EQ(l.get("B", "linearVelocity"), "1000 0 0");
    EXPECT_EQ(l.get("B", "torques"), "[1e+06 0 0]");
    EXPECT_EQ(l.get("B", "forces"), "[0 1000 0]");
    EXPECT_EQ(l.get("E", "surfaceArea"), "2e+06");
}

}  // namespace
}  // namespace rtsg
