// Files that libassimp reads: what they become, and that those which break it are errors.
#include <random>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "documents/import/imported.h"

namespace rtsg {
namespace {

using test::Imported;
using test::put;
using testing::HasSubstr;
using testing::Not;

constexpr std::string_view kTile = R"(<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="centimeter" meter="0.01"/><up_axis>Z_UP</up_axis></asset>
<library_images><image id="wood"><init_from>wood.png</init_from></image></library_images>
<library_effects>
<effect id="red_fx"><profile_COMMON><technique sid="c"><phong><diffuse><color>0.8 0.1 0.2 1</color></diffuse></phong>
</technique></profile_COMMON></effect>
<effect id="wood_fx"><profile_COMMON>
<newparam sid="s"><surface type="2D"><init_from>wood</init_from></surface></newparam>
<newparam sid="t"><sampler2D><source>s</source></sampler2D></newparam>
<technique sid="c"><lambert><diffuse><texture texture="t" texcoord="UV"/></diffuse></lambert></technique>
</profile_COMMON></effect></library_effects>
<library_materials><material id="red" name="red"><instance_effect url="#red_fx"/></material>
<material id="board" name="board"><instance_effect url="#wood_fx"/></material></library_materials>
<library_geometries><geometry id="tile" name="tile"><mesh>
<source id="p"><float_array id="pa" count="12">0 0 0 100 0 0 100 50 0 0 50 0</float_array><technique_common>
<accessor source="#pa" count="4" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source>
<source id="u"><float_array id="ua" count="8">0 .25 1 .25 1 1 0 1</float_array><technique_common>
<accessor source="#ua" count="4" stride="2"><param name="S" type="float"/><param name="T" type="float"/></accessor>
</technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles material="m1" count="1"><input semantic="VERTEX" source="#v" offset="0"/>
<input semantic="TEXCOORD" source="#u" offset="1" set="0"/><p>0 0 1 1 2 2</p></triangles>
<triangles material="m2" count="1"><input semantic="VERTEX" source="#v" offset="0"/>
<input semantic="TEXCOORD" source="#u" offset="1" set="0"/><p>0 0 2 2 3 3</p></triangles>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s0" name="s0"><node id="lid" name="lid"><translate>0 0 30</translate>
<instance_geometry url="#tile"><bind_material><technique_common>
<instance_material symbol="m1" target="#red"/><instance_material symbol="m2" target="#board">
<bind_vertex_input semantic="UV" input_semantic="TEXCOORD" input_set="0"/></instance_material>
</technique_common></bind_material></instance_geometry></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s0"/></scene></COLLADA>)";

TEST(ImportCollada, NamesMaterialsTexturesUnitsAndWhatPointsUpAreThere) {
    const Imported tile(kTile);
    EXPECT_TRUE(tile.good);
    EXPECT_EQ(tile.problems, "");
    EXPECT_THAT(tile.commands, HasSubstr("meta translated=from Collada\n"));
    EXPECT_THAT(tile.commands, HasSubstr("set rotation SFRotation -1 0 0 1.570796"));
    EXPECT_THAT(tile.commands, HasSubstr("set scale SFVec3f 0.01 0.01"));
    EXPECT_THAT(tile.commands, HasSubstr("begin Transform DEF lid in children"));
    EXPECT_THAT(tile.commands, HasSubstr("set translation SFVec3f 0 0 30"));
    EXPECT_THAT(tile.commands, HasSubstr("begin Material DEF red in material"));
    EXPECT_THAT(tile.commands, HasSubstr("set diffuseColor SFColor 0.8 0.1 0.2"));
    EXPECT_THAT(tile.commands, HasSubstr("begin Material DEF board in material"));
    EXPECT_THAT(tile.commands, HasSubstr("begin ImageTexture DEF texture0 in diffuseTexture"));
    EXPECT_THAT(tile.commands, HasSubstr("set url MFString [\"wood.png\"]"));
    EXPECT_THAT(tile.commands, HasSubstr("set point MFVec3f [0 0 0, 100 0 0, 100 50 0]"));
    EXPECT_THAT(tile.commands, HasSubstr("set point MFVec2f [0 0.25, 1 0.25, 1 1]"));
    EXPECT_THAT(tile.commands, Not(HasSubstr("PhysicalMaterial")));
}

/// A polygon of these points in OFF, beside a triangle.
std::string polygonFile(const std::vector<std::pair<int, int>>& points) {
    std::string text = fmt::format("OFF\n{} 2 0\n0 0 1\n1 0 1\n0 1 1\n", points.size() + 3), corners;
    for (std::size_t i = 0; i < points.size(); ++i) {
        text += fmt::format("{} {} 0\n", points[i].first, points[i].second);
        corners += fmt::format(" {}", i + 3);
    }
    return text + fmt::format("3 0 1 2\n{}{}\n", points.size(), corners);
}

TEST(ImportModeller, APolygonThatCrossesItselfIsAFaultIfAreaIsMissing) {
    const Imported whole(
        polygonFile({{1000, 0}, {-901, 434}, {623, -782}, {-223, 975}, {-223, -975}, {623, 782}, {-901, -434}}));
    EXPECT_TRUE(whole.good);
    EXPECT_EQ(
        whole.problems,
        "test: warning: the OFF file: a polygon has edges that cross or touch: its triangles are a guess [parse]\n");
    const Imported less(polygonFile({{0, 1}, {3, 2}, {1, 5}, {2, 2}, {3, 4}, {3, 4}, {5, 4}, {5, 0}}));
    EXPECT_TRUE(less.good);
    EXPECT_THAT(less.problems,
                testing::ContainsRegex("test: error: the OFF file is damaged: a polygon .* % of the area of all faces "
                                       "is missing"));
    const Imported plain(polygonFile({{0, 0}, {4, 0}, {4, 1}, {1, 1}, {1, 4}, {0, 4}}));
    EXPECT_EQ(plain.problems, "");
}

std::string chunk(std::uint16_t id, const std::string& content) {
    std::string bytes;
    put(bytes, id);
    put(bytes, static_cast<std::uint32_t>(content.size() + 6));
    return bytes + content;
}

/// A triangle, as 3D Studio writes one.
std::string threeDs() {
    std::string points, faces;
    put(points, std::uint16_t{3});
    for (const float number : {0.f, 0.f, 0.f, 1.f, 0.f, 0.f, 0.f, 1.f, 0.f}) put(points, number);
    put(faces, std::uint16_t{1});
    for (const int index : {0, 1, 2, 7}) put(faces, static_cast<std::uint16_t>(index));
    const std::string mesh = chunk(0x4100, chunk(0x4110, points) + chunk(0x4120, faces));
    return chunk(0x4D4D, chunk(0x3D3D, chunk(0x4000, std::string("tile\0", 5) + mesh)));
}

constexpr std::string_view kFbx = R"(; FBX 7.3.0 project file
FBXHeaderExtension:  { FBXHeaderVersion: 1003
 FBXVersion: 7300 }
GlobalSettings:  { Version: 1000
 Properties70:  { P: "UnitScaleFactor", "double", "Number", "",100 } }
Definitions:  { Version: 100
 Count: 3 }
Objects:  {
 Geometry: 10, "Geometry::tile", "Mesh" {
  Vertices: *9 { a: 0,0,0,1,0,0,0,1,0 }
  PolygonVertexIndex: *3 { a: 0,1,-3 }
  GeometryVersion: 124 }
 Model: 20, "Model::tile", "Mesh" { Version: 232
  Properties70:  { P: "Lcl Translation", "Lcl Translation", "", "A",0,0,3 } }
}
Connections:  {
 C: "OO",20,0
 C: "OO",10,20
}
)";

TEST(ImportModeller, OtherKindsAreReadToo) {
    const Imported off("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
    EXPECT_EQ(off.problems, "");
    EXPECT_THAT(off.commands, HasSubstr("set point MFVec3f [0 0 0, 1 0 0, 0 1 0]"));
    const Imported studio(threeDs());
    EXPECT_EQ(studio.problems, "");
    EXPECT_THAT(studio.commands, HasSubstr("meta translated=from 3DS\n"));
    EXPECT_THAT(studio.commands, HasSubstr("begin IndexedTriangleSet"));
    const Imported fbx(kFbx);
    EXPECT_EQ(fbx.problems, "");
    EXPECT_THAT(fbx.commands, HasSubstr("meta translated=from FBX\n"));
    EXPECT_THAT(fbx.commands, HasSubstr("begin Transform DEF tile"));
}

TEST(ImportModeller, WhatIsBrokenIsAnErrorAndNoMore) {
    for (const std::string_view text :
         {std::string_view("<COLLADA/>"), std::string_view("<COLLADA><asset>"), std::string_view("OFF\n-1 -1 -1\n"),
          std::string_view("OFF\n4000000000 4000000000 0\n"), std::string_view("; FBX 7.3.0\n"),
          std::string_view("; FBX 7.3.0\nObjects: {{{{"),
          std::string_view("Kaydara FBX Binary  \0\x1a\0\xe8\x1c\0\0\xff\xff\xff\xff", 31)}) {
        const Imported broken(text);
        EXPECT_THAT(broken.problems, HasSubstr("error: the ")) << text;
        EXPECT_THAT(broken.problems, HasSubstr(" file cannot be read: ")) << text;
    }
}

// libassimp goes on with another point.
TEST(ImportModeller, WhatTheLibraryTakesForSomethingElseIsTold) {
    const Imported beyond("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 99\n");
    EXPECT_THAT(beyond.problems, HasSubstr("test: error: the OFF file is damaged: "));
    EXPECT_THAT(beyond.problems, HasSubstr("index"));
    EXPECT_THAT(beyond.commands, HasSubstr("begin IndexedTriangleSet"));
}

TEST(ImportModeller, CountsThatNoMemoryHoldsAreTold) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    GTEST_SKIP() << "the sanitizer ends a process that asks for so much";
#endif
    EXPECT_THAT(Imported("OFF\n2000000000 2000000000 0\n0 0 0\n").problems,
                HasSubstr("what it counts takes more memory than may be had"));
}

TEST(ImportModeller, AFileThatIsDamagedAnywhereIsReadOrTold) {
    std::mt19937 dice(7);
    for (const std::string& whole : {std::string(kTile), threeDs(), std::string(kFbx)})
        for (int i = 0; i < 25; ++i) {
            std::string damaged = whole;
            for (unsigned k = 0; k <= dice() % 4; ++k)
                damaged[10 + dice() % (damaged.size() - 10)] = static_cast<char>(dice() % 256);
            if (i % 3 == 0) damaged.resize(60 + dice() % (damaged.size() - 60));
            const Imported file(damaged);
            EXPECT_TRUE(file.good || file.problems.contains("error")) << i;
        }
}

}  // namespace
}  // namespace rtsg
