// Values that a Script computes with: rotations, lists, matrices, and how they are made. ISO/IEC 19777-1 V3.3 clause 7.
#include <cmath>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <rtsg/core/custom_field.h>
#include <rtsg/core/field_text.h>

#include "script_scene.h"

namespace rtsg {
namespace {

using test::evaluated;
using test::ScriptScene;

TEST(ScriptValues, RotationsAgreeWithDoublePrecisionFormulas) {
    ScriptScene s(
        "outputOnly SFVec3f turned outputOnly SFRotation product outputOnly SFRotation half outputOnly SFRotation "
        "between",
        R"(
        function initialize() {
            var a = new SFRotation(0, 0, 1, Math.PI / 2), b = new SFRotation(1, 0, 0, Math.PI / 2);
            turned = a.multVec(new SFVec3f(1, 0, 0));
            product = a.multiply(b);
            half = new SFRotation(0, 1, 0, 0).slerp(new SFRotation(0, 1, 0, 1), 0.5);
            between = new SFRotation(new SFVec3f(1, 0, 0), new SFVec3f(-2, 0, 0));
        })");
    s.frame();
    const Vec3f turned = s.get<Vec3f>("turned");
    EXPECT_NEAR(turned.x, 0, 1e-6);
    EXPECT_NEAR(turned.y, 1, 1e-6);
    // Quaternions (0 0 s c)(s 0 0 c) = (1/2 1/2 1/2 1/2): 120 degrees about the diagonal.
    const Rotation product = s.get<Rotation>("product");
    EXPECT_NEAR(product.x, std::sqrt(1 / 3.0), 1e-6);
    EXPECT_NEAR(product.y, std::sqrt(1 / 3.0), 1e-6);
    EXPECT_NEAR(product.angle, 2 * M_PI / 3, 1e-6);
    EXPECT_NEAR(s.get<Rotation>("half").angle, 0.5, 1e-6);
    EXPECT_NEAR(s.get<Rotation>("between").angle, M_PI, 1e-6);
    EXPECT_NEAR(s.get<Rotation>("between").x, 0, 1e-6);
}

TEST(ScriptValues, ValuesAreMadeWithNewOrWithout) {
    EXPECT_EQ(evaluated("SFVec3f(1, 2, 3).add(new SFVec3f(1, 1, 1))"), "2 3 4");
    EXPECT_EQ(evaluated("SFVec3f(1, 2, 3) instanceof SFVec3f && new SFVec3f().constructor === SFVec3f"), "true");
    EXPECT_EQ(evaluated("SFRotation(0, 1, 0, 2)"), "0 1 0 2");
    EXPECT_EQ(evaluated("SFColor(.5, 0, 1)"), "0.5 0 1");
    EXPECT_EQ(evaluated("SFImage(1, 1, 1, [7])"), "1 1 1 7");
    EXPECT_EQ(evaluated("MFInt32(1, 2, 3)"), "[1, 2, 3]");
    EXPECT_EQ(evaluated("MFVec3f(SFVec3f(1, 2, 3))[0].y"), "2");
    EXPECT_EQ(evaluated("(class extends SFVec3f { twice() { return this.multiply(2); } }) && "
                        "new (class extends SFVec3f { twice() { return this.multiply(2); } })(1, 2, 3).twice()"),
              "2 4 6");
}

TEST(ScriptValues, ArraysHaveNoHoles) {
    EXPECT_EQ(evaluated("(m => { m[3] = new SFVec3f(1, 2, 3); m[1].x = 5; return m; })(new MFVec3f())"),
              "[0 0 0, 5 0 0, 0 0 0, 1 2 3]");
    EXPECT_EQ(evaluated("(m => { m[5] = 1; return m.length + ' ' + m[2] + ' ' + m[9]; })(MFInt32(7))"),
              "6 0 undefined");
    EXPECT_EQ(evaluated("(m => { m[2] = 'c'; return m; })(MFString('a'))"), R"(["a", "", "c"])");
    EXPECT_EQ(evaluated("MFString('a' + String.fromCharCode(34) + 'b', String.fromCharCode(92))"), R"(["a\"b", "\\"])");
    ScriptScene s("outputOnly MFString names outputOnly MFVec2f points outputOnly MFBool flags",
                  "function initialize() { names[2] = 'c'; points[1] = new SFVec2f(1, 2); flags[1] = true; }");
    s.frame();
    EXPECT_EQ(s.get<Array<String>>("names"), (Array<String>{String(""), String(""), String("c")}));
    EXPECT_EQ(s.get<Array<Vec2f>>("points"), (Array<Vec2f>{{0, 0}, {1, 2}}));
    EXPECT_EQ(s.get<Array<bool>>("flags"), (Array<bool>{false, true}));
    EXPECT_EQ(s.problems(), "");
}

TEST(ScriptValues, MatricesHaveTheirMethods) {
    const std::string rounded = ".components().map(c => Math.round(c * 1e6) / 1e6 + 0).join(' ')";
    const std::string created =
        "(m => { m.setTransform(SFVec3f(1, 2, 3), SFRotation(0, 0, 1, Math.PI / 2), SFVec3f(2, 3, 4)); return m; })"
        "(new SFMatrix4d())";
    // A point is a row from the left: scaled, turned about z, moved.
    EXPECT_EQ(evaluated(created + ".multVecMatrix(SFVec3d(1, 1, 1))" + rounded), "-2 4 7");
    EXPECT_EQ(evaluated(created + ".multVecMatrix(SFVec3f(0, 0, 0))" + rounded), "1 2 3");
    // A direction is turned and scaled, and stays where it is.
    EXPECT_EQ(evaluated(created + ".multDirMatrix(SFVec3d(1, 1, 1))" + rounded), "-3 2 4");
    EXPECT_EQ(evaluated(created + ".multMatrixDir(SFVec3f(1, 1, 1))" + rounded), "2 -3 4");
    EXPECT_EQ(evaluated("(m => { try { return m.multDirMatrix(SFVec2f(1, 1)); } catch (e) { return e.name; } })"
                        "(SFMatrix4f())"),
              "TypeError");
    EXPECT_EQ(evaluated(created + ".det4().toFixed(6)"), "24.000000");
    EXPECT_EQ(evaluated("(m => m.multRight(m.inverse()))(" + created + ")" + rounded),
              "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1");
    EXPECT_EQ(evaluated(created + ".transpose()" + rounded), "0 -3 0 1 2 0 0 2 0 0 4 3 0 0 0 1");
    EXPECT_EQ(evaluated("((m, t, r, s) => { m.getTransform(t, r, s); return [t, r.angle.toFixed(6), s" + rounded +
                        "].join(', '); })(" + created + ", SFVec3d(), SFRotation(), SFVec3d())"),
              "1 2 3, 1.570796, 2 3 4");
    EXPECT_EQ(evaluated("SFMatrix3f(SFVec3f(1, 2, 3), SFVec3f(4, 5, 6), SFVec3f(7, 8, 9))"), "1 2 3 4 5 6 7 8 9");
    const std::string plane =
        "(m => { m.setTransform(SFVec2f(1, 2), Math.PI / 2, SFVec2f(2, 3)); return m; })"
        "(new SFMatrix3d())";
    EXPECT_EQ(evaluated(plane + ".multVecMatrix(SFVec2d(1, 1))" + rounded), "-2 4");
    EXPECT_EQ(evaluated(plane + ".multDirMatrix(SFVec2d(1, 1))" + rounded), "-3 2");
    EXPECT_EQ(evaluated("((m, t, r, s) => { m.getTransform(t, r, s); return [t, r.z.toFixed(6), s" + rounded +
                        "].join(', '); })(" + plane + ", SFVec2d(), SFVec3d(), SFVec2d())"),
              "1 2, 1.570796, 2 3");
    EXPECT_EQ(evaluated("SFMatrix3f(0, 1, 0, 1, 0, 0, 0, 0, 1).inverse()"), "0 1 0 1 0 0 0 0 1");
    EXPECT_EQ(evaluated("SFMatrix3f(0, 1, 0, 1, 0, 0, 0, 0, 1).det3()"), "-1");
    EXPECT_EQ(evaluated("SFMatrix3f(1, 2, 3, 4, 5, 6, 7, 8, 10).multMatrixVec(SFVec3f(1, 0, 0))"), "1 4 7");
    EXPECT_EQ(evaluated("SFMatrix3f(1, 2, 3, 4, 5, 6, 7, 8, 10).multVecMatrix(SFVec3f(1, 0, 0))"), "1 2 3");
    EXPECT_EQ(evaluated("(m => { try { return m.inverse(); } catch (e) { return e.name; } })"
                        "(SFMatrix3f(1, 1, 1, 1, 1, 1, 1, 1, 1))"),
              "RangeError");
}

/// 19777-1 clause 7 and 14772-1 C.6.19: matrices that are no field's value, by row and column.
TEST(ScriptValues, MatricesByRowAndColumn) {
    EXPECT_EQ(evaluated("X3DMatrix3()"), "1 0 0 0 1 0 0 0 1");
    EXPECT_EQ(evaluated("new X3DMatrix4(1, 2)"), "1 2 0 0 0 1 0 0 0 0 1 0 0 0 0 1");
    EXPECT_EQ(evaluated("(m => { m[1][2] = 5; return [m[0][1], m[1][2], m, m.transpose()].join(', '); })"
                        "(X3DMatrix3(1, 2, 3, 4, 9, 6, 7, 8, 10))"),
              "2, 5, 1 2 3 4 9 5 7 8 10, 1 4 7 2 9 8 3 5 10");
    EXPECT_EQ(evaluated("(m => { const row = m[3]; m.setTransform(SFVec3f(1, 2, 3)); row[0] += 4; return m; })"
                        "(new VrmlMatrix())"),
              "1 0 0 0 0 1 0 0 0 0 1 0 5 2 3 1");
    EXPECT_EQ(evaluated("VrmlMatrix(1, 2, 3, 4, 0, 1, 0, 2, 0, 0, 1, 5, -2, 4, 0, 1).multRight("
                        "X3DMatrix4(1, 0, 0, 0, 0, 2, 0, 0, 0, 0, 3, 0, 0, 0, 0, 4))"),
              "1 4 9 16 0 2 0 8 0 0 3 20 -2 8 0 4");
    EXPECT_EQ(evaluated("X3DMatrix3(0, 1, 0, 1, 0, 0, 0, 0, 1).inverse() instanceof X3DMatrix3"), "true");
    EXPECT_EQ(evaluated("(m => { m[0] = ['2', 3, 4]; m[1] = SFVec3f(5, 6, 7); m[2] = m[0]; return m; })(X3DMatrix3())"),
              "2 3 4 5 6 7 2 3 4");
    EXPECT_EQ(evaluated("(m => { try { m[0] = [1]; } catch (e) { return e.message; } })(VrmlMatrix())"),
              "a row of VrmlMatrix has 4 numbers");
    EXPECT_EQ(evaluated("SFMatrix3f(X3DMatrix3(1, 2, 3, 4, 5, 6, 7, 8, 9))"), "1 2 3 4 5 6 7 8 9");
    EXPECT_EQ(evaluated("X3DMatrix4(SFMatrix4f()).equals(X3DMatrix4())"), "true");
}

/// 19777-1 clause 7: a rotation's components that are not given are 0, but for y.
TEST(ScriptValues, NamesAndDefaultsOfTheStandard) {
    EXPECT_EQ(evaluated("SFRotation()"), "0 1 0 0");
    EXPECT_EQ(evaluated("new SFRotation(1)"), "1 1 0 0");
    EXPECT_EQ(evaluated("(r => { r.length = 1; return r[0]; })(new MFRotation())"), "0 0 1 0") << "the field's default";
    EXPECT_EQ(evaluated("SFVec3d(1, 2, 3).multiple(2)"), "2 4 6");
    EXPECT_EQ(evaluated("(v => [v.x, v.y].map(c => c.toFixed(6)).join(' '))"
                        "(SFRotation(0, 0, 1, Math.PI / 2).multiVec(SFVec3f(1, 0, 0)))"),
              "0.000000 1.000000");
}

/// 19777-1, 6.2: what is assigned to a field becomes of its type. So it reads alike in this call and in the next one.
TEST(ScriptValues, WhatIsAssignedToAFieldIsOfItsTypeAtOnce) {
    const struct {
        const char *type, *assigned, *read;
    } cases[] = {
        {"SFInt32", "f = 2.9;", "2"},
        {"SFInt32", "f = -2.9;", "-2"},
        {"SFInt32", "f = 4294967298;", "2"},
        {"SFInt32", "f = true;", "1"},
        {"SFInt32", "f = '7';", "7"},
        {"SFFloat", "f = ' 3.5 ';", "3.5"},
        {"SFDouble", "f = '1e3';", "1000"},
        {"SFTime", "f = false;", "0"},
        {"SFBool", "f = 5;", "true"},
        {"SFBool", "f = '';", "false"},
        {"SFString", "f = 5;", "5"},
        {"SFColor", "f = [1, '0.5', true];", "1 0.5 1"},
        {"SFVec3f", "f = new SFVec3d(1, 2, 3);", "1 2 3"},
        {"SFVec3f", "f.x = '5'; f[1] = true; f.z = 2;", "5 1 2"},
        {"SFMatrix3f", "f[1] = '5';", "1 5 0 0 1 0 0 0 1"},
        {"SFImage", "f = new SFImage('1', 2.9, 1, [7.9, '8']);", "1 2 1 7 8"},
        {"SFImage", "f.width = 1; f.height = 1.5; f.comp = '1'; f.array = [3.5];", "1 1 1 3"},
        {"SFImage", "f = new SFImage(1, 1, 1, [3]); f.array[0] = 4.7;", "1 1 1 4"},
        {"MFInt32", "f[0] = 2.9; f[1] = '3'; f.push(4.9); f[4] = 5;", "[2, 3, 4, 0, 5]"},
        {"MFInt32", "f = [1.5, true, '7'];", "[1, 1, 7]"},
        {"MFInt32", "f = [3, 1, 2]; f.sort(); f.reverse(); f.fill(9.9, 2); f.unshift(0.5);", "[0, 3, 2, 9]"},
        {"MFInt32", "Object.defineProperty(f, 0, {value: 1.5, writable: true, enumerable: true, configurable: true});",
         "[1]"},
        {"MFBool", "f[0] = 5; f[1] = '';", "[true, false]"},
        {"MFFloat", "f[0] = '1.5'; f[1] = undefined;", "[1.5, 0]"},
        {"MFTime", "f[0] = '2';", "[2]"},
        {"MFString", "f[0] = 5; f.push(true);", R"(["5", "true"])"},
        {"MFVec3f", "f[0] = [1, 2, 3]; f[1] = new SFVec3d(4, 5, 6); f[1].y = '7';", "[1 2 3, 4 7 6]"},
        {"MFVec3f", "const v = new SFVec3f(1, 2, 3); f[0] = v; v.x = 9;", "[1 2 3]"},  // copied
        {"MFVec3f", "f[0] = new SFVec3f(1, 2, 3); f[1] = f[0]; f[1].x = 9;", "[1 2 3, 9 2 3]"},
        {"MFImage", "f[0] = new SFImage(1, 1, 1, [3]); f[0].array[0] = 4.7;", "[1 1 1 4]"},
    };
    for (const auto& c : cases) {
        SCOPED_TRACE(std::string(c.type) + ": " + c.assigned);
        for (const char* access : {"outputOnly", "inputOutput"}) {
            const std::string type = c.type, initial = access == std::string_view("outputOnly") ? ""
                                                       : type.starts_with("MF")                 ? "[]"
                                                       : type == "SFBool"                       ? "FALSE"
                                                       : type == "SFString"                     ? "\"\""
                                                       : type == "SFImage"                      ? "0 0 0"
                                                       : type == "SFMatrix3f"                   ? "1 0 0 0 1 0 0 0 1"
                                                       : type == "SFColor" || type == "SFVec3f" ? "0 0 0"
                                                                                                : "0";
            ScriptScene s(std::string(access) + ' ' + type + " f " + initial + " inputOnly SFBool again",
                          std::string("function initialize() { ") + c.assigned +
                              " print(typeof f, f); } function again() { print(typeof f, f); }");
            s.frame();
            s.send("again", true);
            s.frame();
            EXPECT_EQ(s.problems(), "");
            const auto end = s.printed.find('\n');
            ASSERT_NE(end, std::string::npos);
            EXPECT_EQ(s.printed.substr(s.printed.find(' ') + 1, end - s.printed.find(' ') - 1), c.read);
            EXPECT_EQ(s.printed.substr(end + 1), s.printed.substr(0, end + 1)) << "the next call reads it otherwise";
        }
    }
}

TEST(ScriptValues, WhatIsAssignedToAnotherNodesFieldIsOfItsTypeAtOnce) {
    ScriptScene s("directOutput TRUE initializeOnly SFNode faces USE FACES initializeOnly SFNode points USE POINTS",
                  "function initialize() { faces.set_coordIndex = [0, 1.9, '2', -1]; points.point[1] = [4, 5, 6]; "
                  "points.point[0].x = '7'; print(points.point, points.point[0].x + 1); }",
                  "Shape { geometry DEF FACES IndexedFaceSet { coord DEF POINTS Coordinate { point [ 1 2 3 ] } } }");
    s.frame();
    EXPECT_EQ(s.problems(), "");
    EXPECT_EQ(s.printed, "[7 2 3, 4 5 6] 8\n");
    EXPECT_EQ(s.get<Array<Vec3f>>("point", "POINTS"), (Array<Vec3f>{{7, 2, 3}, {4, 5, 6}}));
    EXPECT_EQ(s.get<Array<std::int32_t>>("coordIndex", "FACES"), (Array<std::int32_t>{0, 1, 2, -1}));
}

TEST(ScriptValues, WhatIsInAVariableIsOfItsTypeAtOnce) {
    EXPECT_EQ(evaluated("(m => { m[0] = 2.9; m[1] = '3'; m.push(4.9); return m[0] * 10 + ' ' + m; })(MFInt32(1.5, 2))"),
              "20 [2, 3, 4]");
    EXPECT_EQ(evaluated("MFBool(1, '', 'a')"), "[true, false, true]");
    EXPECT_EQ(evaluated("MFInt32.from([1.5, 2])"), "[1, 2]");
    EXPECT_EQ(evaluated("new (class extends MFInt32 { twice() { return this[0] * 2; } })(1.5).twice()"), "2");
    EXPECT_EQ(evaluated("(v => { v.x = '2'; v[1] = true; return v.x + 1 + ' ' + v.add(v); })(SFVec3f())"), "3 4 2 0");
    EXPECT_EQ(evaluated("(c => { c.g = '.5'; return c.g + 1; })(SFColor())"), "1.5");
    EXPECT_EQ(evaluated("(m => { m[0] = '2'; return m.multRight(m)[0]; })(SFMatrix3f())"), "4");
    EXPECT_EQ(evaluated("(v => { const keys = []; for (const k in v) keys.push(k); return keys + JSON.stringify(v); })"
                        "(SFVec2f(1, 2))"),
              "x,y{\"x\":1,\"y\":2}");
    EXPECT_EQ(evaluated("(m => m instanceof MFInt32 && Array.isArray(m) && m.concat([5]).length)(MFInt32(1))"), "2");
}

TEST(ScriptValues, WhatHasNoPlaceInATypeIsAnErrorAtItsLine) {
    const struct {
        const char *type, *assigned, *why;
    } cases[] = {
        {"SFInt32", "f = 'seven';", "SFInt32 cannot hold string"},
        {"SFFloat", "f = '';", "SFFloat cannot hold string"},
        {"SFFloat", "f = null;", "SFFloat cannot hold null"},
        {"SFInt32", "f = Browser.currentScene.getNamedNode('S');", "SFInt32 cannot hold Script"},
        {"MFInt32", "f[0] = 'seven';", "SFInt32 cannot hold string"},
        {"MFInt32", "f.push({});", "SFInt32 cannot hold Object"},
        {"MFVec3f", "f[0] = [1, 2];", "SFVec3f cannot hold Array"},
        {"MFNode", "f[0] = 'S';", "SFNode cannot hold string"},
        {"MFImage", "f[0] = 5;", "SFImage cannot hold number"},
    };
    for (const auto& c : cases) {
        ScriptScene s(std::string("outputOnly ") + c.type + " f",
                      std::string("function initialize() {\n") + c.assigned + " print('goes on'); }");
        s.frame();
        EXPECT_EQ(s.problems(), std::string("Script S: line 2: TypeError: ") + c.why + "\n") << c.assigned;
        EXPECT_EQ(s.printed, "");
    }
}

/// Field types from outside: a number, a frozen array of numbers, or a text.
TEST(ScriptValues, OfTypesFromOutsideAreReplacedAsAWhole) {
    using Of = CustomLayout::Of;
    const auto before = fieldTypeRegistry();
    const auto pair = registerFieldType("SFPair", {Of::float64, 2}).value();
    ASSERT_TRUE(registerFieldType("SFMass", {Of::float32, 1}));
    ASSERT_TRUE(registerFieldType("SFTag", {Of::bytes, 0}));
    CustomFunctions named;
    named.print = [](const CustomValue& value) { return customNumbers(value)[0] > 0 ? "on" : "off"; };
    named.parse = [](const CustomType& type, std::string_view text) -> Result<CustomValue> {
        const double number[] = {text == "on" ? 1.0 : 0.0};
        if (text != "on" && text != "off") return fail("neither on nor off");
        return type.value(number);
    };
    named.scriptsSeeText = true;
    ASSERT_TRUE(registerFieldType("SFState", {Of::int32, 1}, named));
    ScriptScene s(
        "inputOnly SFPair pair_in outputOnly SFPair pair field MFPair pairs [ 1 2, 3 4 ] outputOnly SFMass mass "
        "outputOnly MFMass masses field SFTag tag 0x0aff field SFState state \"on\" outputOnly SFString said",
        R"(
        function pair_in(value) {
            pair = [value[0] * 2, value[1]];
            pairs = new Array(value, pair, [7, 8]);
            pairs[1] = [5, 6];
            mass = 2.5;
            masses = [mass, 3];
            said = [state, tag, value.length, Object.isFrozen(value), pairs.length].join(' ');
            state = 'off';
            tag = '0x01';
        })");
    const double numbers[] = {1.5, -2};
    s.send("pair_in", Value(pair->value(numbers).value()));
    s.frame();
    EXPECT_EQ(s.problems(), "");
    const auto text = [&](std::string_view name) {
        return printFieldText(s.scene.node(s.script()).value(s.field("S", name)));
    };
    EXPECT_EQ(text("pair"), "3 -2");
    EXPECT_EQ(text("pairs"), "[1.5 -2, 5 6, 7 8]");
    EXPECT_EQ(text("mass"), "2.5");
    EXPECT_EQ(text("masses"), "[2.5, 3]");
    EXPECT_EQ(text("said"), "\"on 0x0aff 2 true 3\"");
    EXPECT_EQ(text("state"), "\"off\"");
    EXPECT_EQ(text("tag"), "0x01");
    ScriptScene wrong("inputOnly SFBool go field SFPair pair 1 2 field SFState state \"on\"", R"(
        function go(value) {
            for (const given of [null, 1, [1], [1, 2, 3], {}, 'x']) {
                try { pair = given; } catch (error) { print(error.message); }
            }
            try { state = 'maybe'; } catch (error) { print(error.message); }
        })");
    wrong.send("go", true);
    wrong.frame();
    const Node& node = wrong.scene.node(wrong.script());
    EXPECT_EQ(printFieldText(node.value(wrong.field("S", "pair"))), "1 2") << wrong.printed << wrong.problems();
    EXPECT_EQ(printFieldText(node.value(wrong.field("S", "state"))), "\"on\"");
    EXPECT_NE((wrong.printed + wrong.problems()).find("SFPair was expected"), std::string::npos)
        << wrong.printed << wrong.problems();
    restoreFieldTypes(before);
}

}  // namespace
}  // namespace rtsg
