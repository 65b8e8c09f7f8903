// glTF files: what they become, where it moves and how its textures are looked up, and what is wrong with them.
#include <array>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <map>
#include <numbers>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>
#include <glm/glm.hpp>
#include <glm/gtc/matrix_transform.hpp>

#include <rtsg/core/web_address.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>

#include "core/scene_check.h"
#include "documents/import/imported.h"
#include "gltf/gltf_curve.h"
#include "gltf/gltf_file.h"
#include "gltf_parts.h"
#include "import/import.h"

namespace rtsg {
namespace {

using test::binaryStl;
using test::GltfParts;
using test::Imported;
using test::put;
using testing::HasSubstr;
using testing::Not;

/// One triangle, a camera, a light and an animation; the buffer is built beside it.
struct Gltf {
    std::string buffer;
    std::string json(const std::string& uri) const {
        return R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[
          {"name":"root","children":[1,2],"rotation":[0,0,0.7071067811865476,0.7071067811865476],"translation":[1,2,3],"mesh":0},
          {"camera":0,"matrix":[0,0,-2,0, 0,2,0,0, 2,0,0,0, 5,6,7,1]},
          {"mesh":0,"extensions":{"KHR_lights_punctual":{"light":0}}}],
          "cameras":[{"type":"perspective","perspective":{"yfov":1,"aspectRatio":0.5,"znear":0.1}}],
          "extensions":{"KHR_lights_punctual":{"lights":[{"type":"spot","color":[1,0.5,0],"intensity":7,"spot":{"outerConeAngle":0.5}}]}},
          "meshes":[{"primitives":[{"attributes":{"POSITION":0,"TEXCOORD_0":2},"indices":1,"material":0}]}],
          "materials":[{"doubleSided":true,"alphaMode":"MASK","alphaCutoff":0.25,"pbrMetallicRoughness":{"baseColorFactor":[1,0,0,0.5],
             "metallicFactor":0.25,"baseColorTexture":{"index":0}}}],
          "textures":[{"source":0,"sampler":0}],"images":[{"bufferView":3,"mimeType":"image/png"}],"samplers":[{"wrapS":33071}],
          "animations":[{"channels":[{"sampler":0,"target":{"node":0,"path":"translation"}}],
             "samplers":[{"input":3,"output":4,"interpolation":"STEP"}]}],
          "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"},
             {"bufferView":1,"componentType":5123,"count":3,"type":"SCALAR"},
             {"bufferView":2,"componentType":5121,"count":3,"type":"VEC2","normalized":true},
             {"bufferView":4,"componentType":5126,"count":2,"type":"SCALAR"},
             {"bufferView":4,"byteOffset":8,"componentType":5126,"count":2,"type":"VEC3"}],
          "bufferViews":[{"buffer":0,"byteOffset":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":6},
             {"buffer":0,"byteOffset":44,"byteLength":12,"byteStride":4},{"buffer":0,"byteOffset":56,"byteLength":4},
             {"buffer":0,"byteOffset":60,"byteLength":32}],
          "buffers":[{"byteLength":92)" +
               uri + "}]}";
    }
    Gltf() {
        for (const float number : {0.f, 0.f, 0.f, 1.f, 0.f, 0.f, 0.f, 1.f, 0.f}) put(buffer, number);
        for (const std::uint16_t index : {2, 1, 0}) put(buffer, index);
        buffer.resize(44, '\0');
        for (const int byte : {0, 0, 9, 9, 255, 0, 9, 9, 0, 255, 9, 9}) put(buffer, static_cast<std::uint8_t>(byte));
        buffer += "\x89PNG";
        for (const float number : {0.f, 2.f, 1.f, 2.f, 3.f, 4.f, 5.f, 6.f}) put(buffer, number);
    }
    std::string glb() const {
        std::string text = json(""), bytes = "glTF";
        text.resize((text.size() + 3) / 4 * 4, ' ');
        put(bytes, std::uint32_t{2});
        put(bytes, static_cast<std::uint32_t>(12 + 8 + text.size() + 8 + buffer.size()));
        put(bytes, static_cast<std::uint32_t>(text.size()));
        bytes += "JSON" + text;
        put(bytes, static_cast<std::uint32_t>(buffer.size()));
        return bytes + std::string("BIN\0", 4) + buffer;
    }
};

TEST(ImportGltf, JsonAndGlbGiveTheSameSceneByHand) {
    const Gltf file;
    const Imported binary(file.glb());
    const Imported text(file.json(",\"uri\":\"data:application/octet-stream;base64," +
                                  base64(std::as_bytes(std::span(file.buffer))) + "\""));
    EXPECT_EQ(binary.problems, "");
    EXPECT_EQ(text.problems, "");
    EXPECT_EQ(binary.commands, text.commands);
    const std::string& c = binary.commands;
    EXPECT_THAT(c,
                HasSubstr("begin Transform DEF root\nset rotation SFRotation 0 0 1 1.5707964\n"
                          "set translation SFVec3f 1 2 3\nbegin Group DEF mesh0 in children\nbegin Shape in children"));
    EXPECT_THAT(
        c, HasSubstr("set alphaMode SFString \"MASK\"\nset alphaCutoff SFFloat 0.25\nbegin PhysicalMaterial in "
                     "material\nset baseColor SFColor 1 0 0\nset transparency SFFloat 0.5\nset metallic SFFloat 0.25\n"
                     "set roughness SFFloat 1\n"));
    EXPECT_THAT(c, HasSubstr("begin ImageTexture DEF texture0 in baseTexture\nset url MFString "
                             "[\"data:image/png;base64,iVBORw==\"]\nset repeatS SFBool FALSE"));
    EXPECT_THAT(c, HasSubstr("set solid SFBool FALSE\nset normalPerVertex SFBool FALSE\nset index MFInt32 [2, 1, 0]"));
    EXPECT_THAT(c, HasSubstr("set point MFVec3f [0 0 0, 1 0 0, 0 1 0]"));
    EXPECT_THAT(c, HasSubstr("set point MFVec2f [0 1, 1 1, 0 0]")) << "v counts from the other side";
    // A quarter turn about y, twice as large; of the narrower side's angle.
    EXPECT_THAT(
        c, HasSubstr("begin Transform in children\nset rotation SFRotation 0 1 0 1.5707964\nset scale SFVec3f 2 2 2\n"
                     "set translation SFVec3f 5 6 7\nbegin Viewpoint in children"));
    const float angle = static_cast<float>(2 * std::atan(std::tan(.5) * .5));
    EXPECT_THAT(c, HasSubstr("set fieldOfView SFFloat " + printFieldText(Value(angle))));
    EXPECT_THAT(c, HasSubstr("begin SpotLight in children\nset color SFColor 1 0.5 0\nset intensity SFFloat 7"));
    EXPECT_THAT(c, HasSubstr("use mesh0 in children"));
    EXPECT_THAT(c, HasSubstr("begin TimeSensor DEF animation0\nset cycleInterval SFTime 2\nset loop SFBool TRUE\nset "
                             "startTime SFTime -1"));
    EXPECT_THAT(c, HasSubstr("set key MFFloat [0, 1, 1]\nset keyValue MFVec3f [1 2 3, 1 2 3, 4 5 6]"));
    EXPECT_THAT(c, HasSubstr("route animation0.fraction_changed animation0_0.set_fraction"));
}

TEST(ImportGltf, WhatDoesNotFitIsNamedAndNothingIsReadBeyondIt) {
    const Gltf file;
    const std::string good = file.json(",\"uri\":\"data:application/octet-stream;base64," +
                                       base64(std::as_bytes(std::span(file.buffer))) + "\"");
    const auto spoiled = [&](const char* from, const char* to) {
        std::string text = good;
        const std::size_t at = text.find(from);
        EXPECT_NE(at, text.npos) << from;
        return Imported(text.replace(at, std::strlen(from), to));
    };
    EXPECT_THAT(spoiled("\"count\":3,\"type\":\"VEC3\"", "\"count\":4000000000,\"type\":\"VEC3\"").problems,
                HasSubstr("reaches beyond its buffer view"));
    EXPECT_THAT(spoiled("\"byteLength\":36", "\"byteLength\":3600").problems, HasSubstr("reaches beyond its buffer"));
    EXPECT_THAT(spoiled("\"children\":[1,2]", "\"children\":[1,0]").problems,
                HasSubstr("node 0 of the glTF file is there twice"));
    EXPECT_THAT(spoiled("\"version\":\"2.0\"", "\"version\":\"1.0\"").problems, HasSubstr("glTF 1.0 is not read"));
    EXPECT_THAT(spoiled("{\"asset\"", "{\"extensionsRequired\":[\"EXT_mesh_of_tomorrow\"],\"asset\"").problems,
                HasSubstr("requires EXT_mesh_of_tomorrow, which is not read"));
    EXPECT_THAT(spoiled("\"indices\":1", "\"indices\":3").problems, Not(testing::IsEmpty()));
    EXPECT_THAT(spoiled("base64,", "base64,***").problems, HasSubstr("is no base64 text"));
    EXPECT_THAT(spoiled("data:application/octet-stream;base64,", "elsewhere.bin?").problems,
                HasSubstr("no other file may be opened"));
    EXPECT_THAT(spoiled("\"mesh\":0}", "\"mesh\":7}").problems, HasSubstr("names number 7 of its meshes"));
    EXPECT_THAT(spoiled("\"cameras\":[", "\n \"cameras\":,[").problems,
                HasSubstr("test:6:12: error: the glTF file's JSON is not well-formed, at its byte"));
    EXPECT_THAT(spoiled("\"intensity\":7", "\"intensity\":1e999").problems, HasSubstr("number in the glTF file"));
    EXPECT_THAT(
        spoiled("{\"asset\"", "{\"extensionsUsed\":[\"KHR_lights_punctual\",\"EXT_a\",\"EXT_b\"],\"asset\"").problems,
        HasSubstr("the glTF file uses EXT_a, EXT_b, which is not read"));
    // A picture in KTX2 is taken where there is no other: whoever shows it says whether it is read.
    const char* basis = "{\"extensionsRequired\":[\"KHR_texture_basisu\"],\"asset\"";
    const char* image = "\"image/png\"";
    std::string alone = good;
    alone.replace(alone.find("{\"asset\""), 8, basis).replace(alone.find(image), 11, "\"image/ktx2\"");
    const std::string source = "\"textures\":[{\"source\":0";
    alone.replace(alone.find(source), source.size(),
                  "\"textures\":[{\"extensions\":{\"KHR_texture_basisu\":{\"source\":0}}");
    EXPECT_EQ(Imported(alone).problems, "");
    EXPECT_THAT(Imported(alone).commands, HasSubstr("set url MFString [\"data:image/ktx2;base64,iVBORw==\"]"));
    Gltf holed;
    const float nan = std::numeric_limits<float>::quiet_NaN();
    std::memcpy(holed.buffer.data() + 4, &nan, sizeof(nan));
    EXPECT_THAT(Imported(holed.glb()).problems, HasSubstr("numbers of the glTF file are not finite"));
    EXPECT_THAT(Imported(holed.glb()).commands, HasSubstr("set point MFVec3f [0 0 0, 1 0 0, 0 1 0]"));
    const Imported far = spoiled("[1,2,3]", "[1e300,-2,0]");
    EXPECT_THAT(far.problems, HasSubstr("1 numbers of the glTF file are not finite; 0 is taken instead"));
    EXPECT_THAT(far.commands, HasSubstr("set translation SFVec3f 0 -2 0"));
    const std::string glb = file.glb();
    for (std::size_t size = 4; size < glb.size(); size += 7) {
        const Imported cut(std::string_view(glb).substr(0, size));
        EXPECT_NE(cut.problems, "") << size;
    }
}

TEST(ImportGltf, TargetsMoveThePointsAndTheirWeightsMayBeAnimated) {
    GltfParts parts;
    const int points = parts.floats("VEC3", 3, {0, 0, 0, 1, 0, 0, 0, 1, 0});
    const int first = parts.floats("VEC3", 3, {0, 0, 1, 0, 0, 0, 0, 0, 0});
    const int second = parts.floats("VEC3", 3, {0, 0, 0, 0, 2, 0, 0, 0, 0});
    const int times = parts.floats("SCALAR", 1, {0, 2});
    const int weights = parts.floats("SCALAR", 1, {1, 0, 0, .5f});
    const std::string rest = fmt::format(
        "\"meshes\":[{{\"weights\":[0.5,1],\"primitives\":[{{\"attributes\":{{\"POSITION\":{}}},\"targets\":[{{"
        "\"POSITION\":"
        "{}}},{{\"POSITION\":{}}}]}}]}}],\"nodes\":[{{\"mesh\":0}},{{\"mesh\":0}},{{\"mesh\":0,\"weights\":[0,0]}}],"
        "\"scenes\":[{{\"nodes\":[0,1,2]}}],\"animations\":[{{\"channels\":[{{\"sampler\":0,\"target\":{{\"node\":1,"
        "\"path\":"
        "\"weights\"}}}}],\"samplers\":[{{\"input\":{},\"output\":{}}}]}}]",
        points, first, second, times, weights);
    const Imported file(parts.text(rest));
    EXPECT_EQ(file.problems, "");
    const std::string& c = file.commands;
    EXPECT_THAT(c, HasSubstr("begin Coordinate in coord\nset point MFVec3f [0 0 0.5, 1 2 0, 0 1 0]"));
    EXPECT_THAT(c, HasSubstr("begin Coordinate DEF node1_points0 in coord\nset point MFVec3f [0 0 0.5, 1 2 0, 0 1 0]"));
    EXPECT_THAT(c, HasSubstr("begin Coordinate in coord\nset point MFVec3f [0 0 0, 1 0 0, 0 1 0]"))
        << "weights of a node";
    EXPECT_THAT(c,
                HasSubstr("begin CoordinateInterpolator DEF animation0_0_part0\nset key MFFloat [0, 1]\nset keyValue "
                          "MFVec3f [0 0 1, 1 0 0, 0 1 0, 0 0 0, 1 1 0, 0 1 0]"));
    EXPECT_THAT(c, HasSubstr("route animation0_0_part0.value_changed node1_points0.point"));
}

// Clips that move the same node play one at a time; others go on beside it.
TEST(ImportGltf, AClipThatStartsStopsThoseThatMoveTheSame) {
    GltfParts parts;
    const int times = parts.floats("SCALAR", 1, {0, 10});
    const int values = parts.floats("VEC3", 3, {0, 0, 0, 1, 0, 0});
    const auto clip = [&](const char* name, int node) {
        return fmt::format(
            "{{\"name\":\"{}\",\"channels\":[{{\"sampler\":0,\"target\":{{\"node\":{},\"path\":\"translation\"}}}}],"
            "\"samplers\":[{{\"input\":{},\"output\":{}}}]}}",
            name, node, times, values);
    };
    Scene scene;
    Diagnostics problems("test");
    ASSERT_TRUE(loadText(scene,
                         parts.text(fmt::format("\"nodes\":[{{}},{{}}],\"animations\":[{},{},{}]", clip("walk", 0),
                                                clip("run", 0), clip("blink", 1))),
                         problems));
    EXPECT_EQ(test::allText(problems), "");
    const auto start = [&](const char* name, double time) {
        const NodeId clock = scene.findName(name);
        EXPECT_TRUE(scene.sendEvent(clock, scene.node(clock).type().findExact("startTime"), Value(Time{time})));
        scene.newFrame(time);
    };
    const auto playing = [&] {
        std::string result;
        for (const char* name : {"walk", "run", "blink"})
            if (scene.node(scene.findName(name)).get(x3d::TimeSensor::isActive)) result += std::string(name) + " ";
        return result;
    };
    scene.newFrame(1);
    start("walk", 2);
    start("blink", 3);
    EXPECT_EQ(playing(), "walk blink ");
    start("run", 4);
    EXPECT_EQ(playing(), "run blink ");
    start("walk", 5);
    scene.newFrame(6);
    EXPECT_EQ(playing(), "walk blink ");
}

// Its zeros count once against what a file may hold, however often they are read; and no route leads to points of what
// was left out.
TEST(ImportGltf, AnimatedTargetsMayBeSparseAndMayBeMissing) {
    GltfParts parts;
    const std::size_t count = 300, keys = 200;
    const int points = parts.floats("VEC3", 3, std::vector<float>(3 * count, 1));
    std::vector<float> seconds, weights;
    for (std::size_t i = 0; i < keys; ++i) seconds.push_back(static_cast<float>(i)), weights.push_back(.5f);
    const int times = parts.floats("SCALAR", 1, seconds), values = parts.floats("SCALAR", 1, weights);
    const int where = parts.accessor(5123, "SCALAR", 1, std::vector<std::uint16_t>{7});
    const int what = parts.floats("VEC3", 3, {2, 0, 0});
    const int target =
        parts.view("", "",
                   fmt::format("\"componentType\":5126,\"type\":\"VEC3\",\"count\":{},\"sparse\":{{\"count\":1,"
                               "\"indices\":{{\"bufferView\":{},\"componentType\":5123}},\"values\":{{"
                               "\"bufferView\":{}}}}}",
                               count, where, what));
    const auto file = [&](int indices) {
        return Imported(
            parts.text(fmt::format("\"meshes\":[{{\"primitives\":[{{\"attributes\":{{\"POSITION\":{}}},\"indices\":{},"
                                   "\"targets\":[{{\"POSITION\":{}}}"
                                   "]}}]}}],\"nodes\":[{{\"mesh\":0}}],\"animations\":[{{\"channels\":[{{\"sampler\":0,"
                                   "\"target\":{{\"node\":0,"
                                   "\"path\":\"weights\"}}}}],\"samplers\":[{{\"input\":{},\"output\":{}}}]}}]",
                                   points, indices, target, times, values)));
    };
    const int good = parts.accessor(5123, "SCALAR", 1, std::vector<std::uint16_t>{0, 1, 7});
    const int bad = parts.accessor(5123, "SCALAR", 1, std::vector<std::uint16_t>{0, 1, 400});
    EXPECT_EQ(file(good).problems, "");
    EXPECT_THAT(file(good).commands, HasSubstr("value_changed node0_points0.point"));
    EXPECT_THAT(file(bad).problems, HasSubstr("indices beyond its points"));
    EXPECT_THAT(file(bad).commands, Not(HasSubstr("node0_points0.point")));
}

TEST(ImportGltf, InstancesStandWhereTheirAttributesSay) {
    GltfParts parts;
    const int points = parts.floats("VEC3", 3, {0, 0, 0, 1, 0, 0, 0, 1, 0});
    const int positions = parts.floats("VEC3", 3, {1, 2, 3, 4, 5, 6});
    const int scales = parts.floats("VEC3", 3, {1, 1, 1, 2, 2, 2});
    const auto file = [&](const std::string& attributes) {
        return Imported(parts.text(fmt::format(
            "\"extensionsRequired\":[\"EXT_mesh_gpu_instancing\"],\"meshes\":[{{\"primitives\":[{{\"attributes\":{{"
            "\"POSITION\":{}}}}}]}}],\"nodes\":[{{\"mesh\":0,\"extensions\":{{\"EXT_mesh_gpu_instancing\":{{"
            "\"attributes\":{{{}}}}}}}}}]",
            points, attributes)));
    };
    const Imported two = file(fmt::format("\"TRANSLATION\":{},\"SCALE\":{}", positions, scales));
    EXPECT_EQ(two.problems, "");
    EXPECT_THAT(two.commands, HasSubstr("begin Transform in children\nset scale SFVec3f 2 2 2\n"
                                        "set translation SFVec3f 4 5 6\nuse mesh0 in children\nend"));
    const Imported odd = file(fmt::format("\"TRANSLATION\":{},\"SCALE\":{}", positions, points));
    EXPECT_THAT(odd.problems,
                HasSubstr("error: instances at node 0 of the glTF file have places of different numbers"));
    EXPECT_THAT(odd.commands, HasSubstr("begin Group DEF mesh0"));
}

// 3.7.2.1: they serve normal textures alone, and only beside normals; targets move them.
TEST(ImportGltf, TangentsAreTakenWhereNormalTexturesAre) {
    GltfParts parts;
    const int points = parts.floats("VEC3", 3, {0, 0, 0, 1, 0, 0, 0, 1, 0});
    const int normals = parts.floats("VEC3", 3, {0, 0, 1, 0, 0, 1, 0, 0, 1});
    const int tangents = parts.floats("VEC4", 4, {1, 0, 0, 1, 0, 1, 0, -1, -1, 0, 0, 1});
    const int moves = parts.floats("VEC3", 3, {0, 2, 0, 0, 0, 0, 1, 0, 0});
    const auto commands = [&](const std::string& attributes, const char* material, const char* version = "4.0") {
        const Imported file(parts.text(fmt::format(
                                "\"images\":[{{\"uri\":\"n.png\"}}],\"textures\":[{{\"source\":0}}],\"materials\":[{{"
                                "\"normalTexture\":{{"
                                "\"index\":0}}}},{{}}],\"meshes\":[{{\"weights\":[0.5],\"primitives\":[{{\"material\":{"
                                "},\"attributes\":{{"
                                "\"POSITION\":{}{}}},\"targets\":[{{\"TANGENT\":{}}}]}}]}}],\"nodes\":[{{\"mesh\":0}}]",
                                material, points, attributes, moves)),
                            version);
        EXPECT_EQ(file.problems, "");
        return file.commands;
    };
    const std::string normal = fmt::format(",\"NORMAL\":{}", normals),
                      tangent = fmt::format(",\"TANGENT\":{}", tangents);
    const std::string both = commands(normal + tangent, "0", "4.1");
    EXPECT_THAT(both, HasSubstr("begin Tangent in tangent\nset vector MFVec4f [1 1 0 1, 0 1 0 -1, -0.5 0 0 1]"));
    for (const std::string& other : {commands(normal + tangent, "1"), commands(tangent, "0"), commands(normal, "0")})
        EXPECT_THAT(other, Not(HasSubstr("Tangent")));
}

/// 18.4.10: Tc' = S R T Tc about the origin, and rows of a matrix as they stand; in double precision.
Vec2d lookedUp(const Node& node, Vec2d tc) {
    if (node.is(x3d::TextureTransformMatrix3D::type)) {
        const Matrix4f& m = node.get(x3d::TextureTransformMatrix3D::matrix);
        const auto at = [&](std::size_t row, std::size_t column) { return double{m.elements[4 * row + column]}; };
        return {tc.x * at(0, 0) + tc.y * at(1, 0) + at(3, 0), tc.x * at(0, 1) + tc.y * at(1, 1) + at(3, 1)};
    }
    using T = x3d::TextureTransform;
    EXPECT_EQ(node.get(T::center), Vec2f(0));
    tc += Vec2d(node.get(T::translation));
    const double c = std::cos(double{node.get(T::rotation)}), n = std::sin(double{node.get(T::rotation)});
    return Vec2d(node.get(T::scale)) * Vec2d(c * tc.x - n * tc.y, n * tc.x + c * tc.y);
}

// KHR_texture_transform, with v downwards: u' = offset + scale, then a turn from v to u. Two textures with ways of
// their own, and one that takes the coordinates as they are.
TEST(ImportGltf, TexturesAreLookedUpInTheirSetsAndMovedAsTheFileSays) {
    struct Variant {
        double rotation, x, y, scaleX, scaleY;
    };
    const Variant variants[] = {{0, .25, -.5, 2, 3},  {.7, .1, .2, 1, 1}, {-2, .5, .25, -1.5, -1.5},
                                {1.2, .3, .4, 2, .5}, {.5, 1, 0, 0, 2},   {0, .125, .25, 1, 1},
                                {3, 0, 0, 1, 1},      {0, 0, 0, 1, -1}};
    for (const Variant& a : variants)
        for (const Variant& b : {variants[3], variants[1]}) {
            if (&a == &variants[3] || &a == &variants[1]) continue;
            GltfParts parts;
            const int points = parts.floats("VEC3", 3, {0, 0, 0, 1, 0, 0, 0, 1, 0});
            const int first = parts.floats("VEC2", 2, {.1f, .2f, .3f, .4f, .5f, .6f});
            const int second = parts.floats("VEC2", 2, {.7f, .8f, .9f, .15f, .25f, .35f});
            const auto moved = [](const Variant& w, const char* set) {
                return fmt::format(
                    "\"extensions\":{{\"KHR_texture_transform\":{{\"rotation\":{},\"offset\":[{},{}],\"scale\":[{},{}]"
                    "{}}}}}",
                    w.rotation, w.x, w.y, w.scaleX, w.scaleY, set);
            };
            const std::string text = parts.text(fmt::format(
                "\"extensionsRequired\":[\"KHR_texture_transform\"],\"images\":[{{\"uri\":\"n.png\"}}],\"textures\":[{{"
                "\"source\":0}}],\"materials\":[{{\"pbrMetallicRoughness\":{{\"baseColorTexture\":{{\"index\":0,"
                "\"texCoord\":1,{}}},\"metallicRoughnessTexture\":{{\"index\":0}}}},\"emissiveTexture\":{{\"index\":0,{"
                "}}},"
                "\"normalTexture\":{{\"index\":0,\"texCoord\":1}}}}],\"meshes\":[{{\"primitives\":[{{\"material\":0,"
                "\"attributes\":{{\"POSITION\":{},\"TEXCOORD_0\":{},\"TEXCOORD_1\":{}}}}}]}}],\"nodes\":[{{\"mesh\":0}}"
                "]",
                moved(a, ""), moved(b, ",\"texCoord\":0"), points, first, second));
            Scene scene;
            Diagnostics problems("test");
            ASSERT_TRUE(loadText(scene, text, problems));
            EXPECT_EQ(test::allText(problems), "");
            std::map<std::string, const Node*> coordinates, transforms;
            const Node* material = nullptr;
            scene.forEachNode([&](const Node& node) {
                if (node.is(x3d::TextureCoordinate::type))
                    coordinates[node.get(x3d::TextureCoordinate::mapping).str()] = &node;
                if (node.is(x3d::TextureTransform::type))
                    transforms[node.get(x3d::TextureTransform::mapping).str()] = &node;
                if (node.is(x3d::TextureTransformMatrix3D::type))
                    transforms[node.get(x3d::TextureTransformMatrix3D::mapping).str()] = &node;
                if (node.is(x3d::PhysicalMaterial::type)) material = &node;
            });
            ASSERT_TRUE(material);
            EXPECT_EQ(coordinates.size(), 4u);
            using P = x3d::PhysicalMaterial;
            const auto expectLookup = [&](const String& mapping, Vec2d uv, const Variant& w) {
                const Node* const coordinate = coordinates[mapping.str()];
                const Node* const transform = transforms[mapping.str()];
                ASSERT_TRUE(coordinate && transform) << mapping.str();
                const Vec2d found = lookedUp(*transform, Vec2d(coordinate->get(x3d::TextureCoordinate::point)[1]));
                const double c = std::cos(w.rotation), n = std::sin(w.rotation);
                EXPECT_NEAR(found.x, w.x + c * w.scaleX * uv.x + n * w.scaleY * uv.y, 2e-6) << w.rotation;
                EXPECT_NEAR(1 - found.y, w.y - n * w.scaleX * uv.x + c * w.scaleY * uv.y, 2e-6) << w.rotation;
            };
            const Variant still{0, 0, 0, 1, 1};
            expectLookup(material->get(P::baseTextureMapping), {.9, .15}, a);
            expectLookup(material->get(P::emissiveTextureMapping), {.3, .4}, b);
            expectLookup(material->get(P::metallicRoughnessTextureMapping), {.3, .4}, still);
            expectLookup(material->get(P::normalTextureMapping), {.9, .15}, still);
            EXPECT_EQ(material->get(P::occlusionTextureMapping), String());
        }
}

TEST(ImportGltf, WhatHasNoSuchCoordinatesSaysSoAndTakesTheFirst) {
    GltfParts parts;
    const int points = parts.floats("VEC3", 3, {0, 0, 0, 1, 0, 0, 0, 1, 0});
    const int first = parts.floats("VEC2", 2, {0, 0, 1, 0, 0, 1});
    const auto file = [&](const std::string& attributes) {
        return Imported(parts.text(fmt::format(
            "\"images\":[{{\"uri\":\"n.png\"}}],\"textures\":[{{\"source\":0}}],\"materials\":[{{"
            "\"pbrMetallicRoughness\":{{\"baseColorTexture\":{{\"index\":0,\"texCoord\":3}}}}}}],\"meshes\":[{{"
            "\"primitives\":[{{\"material\":0,\"attributes\":{{\"POSITION\":{}{}}}}}]}}],\"nodes\":[{{\"mesh\":0}}]",
            points, attributes)));
    };
    const Imported one = file(fmt::format(",\"TEXCOORD_0\":{}", first));
    EXPECT_THAT(one.problems, HasSubstr("has no TEXCOORD_3, which its material asks for; the first set is taken"));
    EXPECT_THAT(one.commands, HasSubstr("set baseTextureMapping SFString \"TEXCOORD_3\""));
    EXPECT_THAT(one.commands, HasSubstr("begin TextureCoordinate in texCoord\nset mapping SFString \"TEXCOORD_3\"\n"
                                        "set point MFVec2f [0 1, 1 1, 0 0]"));
    EXPECT_THAT(one.commands, Not(HasSubstr("Transform in textureTransform")));
    const Imported none = file("");
    EXPECT_THAT(none.problems, HasSubstr("has no TEXCOORD_3"));
    EXPECT_THAT(none.commands, Not(HasSubstr("TextureCoordinate")));
}

/// One triangle, which `nodes` nodes show, and animations: each its JSON, in which %t and %v are the accessors of
/// `keys` and `values` (VEC3, or as `type` says).
struct Animated {
    std::string text;
    Animated(const std::string& animations, const std::vector<float>& keys, const std::vector<float>& values,
             const char* type = "VEC3", std::size_t components = 3, const std::string& more = {}) {
        GltfParts parts;
        const int points = parts.floats("VEC3", 3, {0, 0, 0, 1, 0, 0, 0, 1, 0});
        const int times = parts.floats("SCALAR", 1, keys);
        const int numbers = parts.floats(type, components, values);
        std::string list = animations;
        for (const auto& [from, to] : {std::pair("%t", times), {"%v", numbers}})
            for (auto at = list.find(from); at != list.npos; at = list.find(from))
                list.replace(at, 2, std::to_string(to));
        text = parts.text(fmt::format(
            "\"meshes\":[{{\"name\":\"Leaf\",\"primitives\":[{{\"attributes\":{{\"POSITION\":{}}},\"material\":0}}]}}],"
            "\"materials\":[{{\"name\":\"Oak\"}}],\"nodes\":[{{\"name\":\"Door\",\"mesh\":0}}]{},\"animations\":[{}]",
            points, more, list));
    }
};
std::string clip(const char* name, const char* path = "translation", const char* how = "LINEAR") {
    return fmt::format(
        "{{\"name\":\"{}\",\"channels\":[{{\"sampler\":0,\"target\":{{\"node\":0,\"path\":\"{}\"}}}}],\"samplers\":[{{"
        "\"input\":%t,\"output\":%v,\"interpolation\":\"{}\"}}]}}",
        name, path, how);
}

/// Runs what a file became, and gives the Door's place at some seconds after the scene's start.
class Played {
  public:
    explicit Played(const std::string& text, const std::string& chosen = {}) {
        LoadOptions options;
        options.clip = chosen;
        EXPECT_TRUE(loadText(scene, text, diagnostics_, {}, options));
        scene.newFrame(kStart);
    }
    Vec3f doorAt(double t) {
        if (t > 0) scene.newFrame(kStart + t);
        return scene.node(scene.findName("Door")).get(x3d::Transform::translation);
    }
    std::string problems() const { return test::allText(diagnostics_); }

    static constexpr double kStart = 946684800.25;  // in no clip's beginning
    Scene scene;

  private:
    Diagnostics diagnostics_{"test"};
};

TEST(ImportGltf, OneClipPlaysFromTheStartAndTheOthersWait) {
    const Animated file(clip("Open") + "," + clip("Close", "scale"), {0, 2}, {2, 3, 4, 4, 3, 4});
    Played first(file.text);
    EXPECT_EQ(first.problems(), "");
    EXPECT_EQ(first.doorAt(0), Vec3f(2, 3, 4)) << "the first key";
    EXPECT_EQ(first.doorAt(1), Vec3f(3, 3, 4));
    const Node& door = first.scene.node(first.scene.findName("Door"));
    EXPECT_EQ(door.get(x3d::Transform::scale), Vec3f(1));
    // The other one is started, as this one is stopped.
    const NodeId close = first.scene.findName("Close"), open = first.scene.findName("Open");
    ASSERT_TRUE(close && open);
    const double now = Played::kStart + 1.5;
    ASSERT_TRUE(first.scene.sendEvent(open, x3d::TimeSensor::stopTime.index, Value(Time{now})));
    ASSERT_TRUE(first.scene.sendEvent(close, x3d::TimeSensor::startTime.index, Value(Time{now})));
    EXPECT_EQ(first.doorAt(1.5), Vec3f(3.5f, 3, 4));
    EXPECT_EQ(first.doorAt(2), Vec3f(3.5f, 3, 4));
    EXPECT_EQ(door.get(x3d::Transform::scale), Vec3f(2.5f, 3, 4));

    Played second(file.text, "Close");
    EXPECT_EQ(second.problems(), "");
    EXPECT_EQ(second.doorAt(1), Vec3f(0));
    EXPECT_EQ(second.scene.node(second.scene.findName("Door")).get(x3d::Transform::scale), Vec3f(3, 3, 4));

    Played none(file.text, "Shut");
    EXPECT_THAT(none.problems(), HasSubstr("error: the glTF file has no clip Shut; its clips are Open, Close"));
    EXPECT_EQ(none.doorAt(1), Vec3f(0));
}

TEST(ImportGltf, ClipsAreOfGltfAlone) {
    Scene scene;
    Diagnostics problems("test");
    LoadOptions options;
    options.clip = "Open";
    EXPECT_TRUE(loadText(scene, "#X3D V4.0 utf8\nPROFILE Full\nGroup { }\n", problems, {}, options));
    EXPECT_THAT(test::allText(problems), HasSubstr("error: it has no clip Open: only glTF files have clips"));
    Scene other;
    Diagnostics more("test");
    EXPECT_TRUE(loadText(other, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", more, {}, options));
    EXPECT_THAT(test::allText(more), HasSubstr("it has no clip Open"));
}

TEST(ImportGltf, ASingleKeyHolds) {
    for (const float key : {0.f, 2.f}) {
        Played pose(Animated(clip("Pose"), {key}, {5, -6, 7}).text);
        EXPECT_EQ(pose.problems(), "");
        EXPECT_EQ(pose.doorAt(0), Vec3f(5, -6, 7));
        EXPECT_EQ(pose.doorAt(3.5), Vec3f(5, -6, 7));
    }
}

TEST(ImportGltf, StepsBeginAtTheFirstKey) {
    Played steps(Animated(clip("Steps", "translation", "STEP"), {0, .5f, 1}, {1, 0, 0, 2, 0, 0, 3, 0, 0}).text);
    EXPECT_EQ(steps.doorAt(0).x, 1);
    EXPECT_EQ(steps.doorAt(.25).x, 1);
    EXPECT_EQ(steps.doorAt(.5).x, 2);
    EXPECT_EQ(steps.doorAt(.75).x, 2);
}

/// glTF 2.0 appendix C.5, in double precision.
double hermite(double t, double span, double from, double leaving, double arriving, double to) {
    const double t2 = t * t, t3 = t2 * t;
    return (2 * t3 - 3 * t2 + 1) * from + span * (t3 - 2 * t2 + t) * leaving + (3 * t2 - 2 * t3) * to +
           span * (t3 - t2) * arriving;
}

TEST(ImportGltf, SplinesAreHermiteSplines) {
    // Tangents that differ on the sides of a key, and spans of unequal lengths; x alone moves.
    const std::vector<float> keys{0, 1, 4};
    const float in[] = {9, -3, 2}, at[] = {0, 1, 5}, out[] = {4, 6, 7};
    std::vector<float> values;
    for (int k = 0; k < 3; ++k)
        for (const float x : {in[k], at[k], out[k]}) values.insert(values.end(), {x, 0, 0});
    Played spline(Animated(clip("Curve", "translation", "CUBICSPLINE"), keys, values).text);
    EXPECT_EQ(spline.problems(), "");
    for (const double t : {0., .25, .5, .77, 1., 1.3, 2.5, 3.9}) {
        const double expected = t < 1 ? hermite(t, 1, 0, 4, -3, 1) : hermite((t - 1) / 3, 3, 1, 6, 2, 5);
        EXPECT_NEAR(spline.doorAt(t).x, expected, 2e-3) << t;
    }
    // The memory for a file is in proportion to its size: many targets get few lines.
    std::vector<float> many(6 * 400'000, 0.f);
    for (std::size_t i = 0; i < many.size(); i += 7) many[i] = static_cast<float>(i % 11);
    GltfParts parts;
    const int times = parts.floats("SCALAR", 1, {0, 1}), weights = parts.floats("SCALAR", 1, many);
    Diagnostics reported("test");
    const std::string bytes = parts.text("\"nodes\":[]");
    const detail::ImportInput input{bytes, {}};
    detail::GltfFile file(input, reported);
    ASSERT_TRUE(file.open());
    const auto sampler = nlohmann::json{{"input", times}, {"output", weights}, {"interpolation", "CUBICSPLINE"}};
    const auto curve = detail::readCurve(file, sampler, {0, 1}, 0, 1e-3);
    ASSERT_TRUE(curve);
    EXPECT_EQ(curve->size, 400'000u);
    EXPECT_LE(curve->numbers.size(), std::size_t{1} << 23);
    // For rotations the quaternions are splines, whose values are then normalised.
    const float half = std::sqrt(.5f);
    Played rotation(Animated(clip("Turn", "rotation", "CUBICSPLINE"), {0, 1},
                             {0, 0, 0, 0, 0, 0, 0, 1, 2, 0, 0, 0, 0, 0, 0, 0, half, 0, 0, half, 0, 0, 0, 0}, "VEC4", 4)
                        .text);
    EXPECT_EQ(rotation.problems(), "");
    for (const double t : {.2, .5, .85}) {
        (void)rotation.doorAt(t);
        const Rotation r = rotation.scene.node(rotation.scene.findName("Door")).get(x3d::Transform::rotation);
        const double x = hermite(t, 1, 0, 2, 0, std::sqrt(.5)), w = hermite(t, 1, 1, 0, 0, std::sqrt(.5));
        EXPECT_NEAR(double{r.angle} * r.x, 2 * std::atan2(x, w), 1e-3) << t;
    }
}

TEST(ImportGltf, WhatAnimationsOfOtherThingsChangeStaysAndIsNamed) {
    Played other(Animated(clip("Glow", "pointer"), {0, 1}, {0, 0, 0, 1, 1, 1}).text);
    EXPECT_THAT(other.problems(), HasSubstr("animations of the glTF file change 'pointer', which stays as it is"));
}

TEST(ImportGltf, AuthorsNamesSurviveAndEachIsGivenOnce) {
    GltfParts parts;
    const int points = parts.floats("VEC3", 3, {0, 0, 0, 1, 0, 0, 0, 1, 0});
    const Imported file(parts.text(fmt::format(
        "\"meshes\":[{{\"name\":\"Cube\",\"primitives\":[{{\"attributes\":{{\"POSITION\":{0}}},\"material\":0}},{{"
        "\"attributes\":{{\"POSITION\":{0}}},\"material\":0}}]}},{{\"primitives\":[{{\"attributes\":{{\"POSITION\":"
        "{0}}}}}]}}],\"materials\":[{{\"name\":\"Red.001\"}}],\"cameras\":[{{\"name\":\"Eye\",\"type\":\"perspective\","
        "\"perspective\":{{\"yfov\":1,\"znear\":1}}}}],\"extensions\":{{\"KHR_lights_punctual\":{{\"lights\":[{{"
        "\"name\":\"Lamp\",\"type\":\"point\"}}]}}}},\"nodes\":[{{\"name\":\"Cube\",\"mesh\":0}},{{\"name\":\"Cube\","
        "\"mesh\":0}},{{\"name\":\"mesh1\",\"mesh\":1}},{{\"camera\":0}},{{\"camera\":0,\"extensions\":{{"
        "\"KHR_lights_punctual\":{{\"light\":0}}}}}},{{\"mesh\":1}}]",
        points)));
    EXPECT_EQ(file.problems, "");
    const std::string& c = file.commands;
    EXPECT_THAT(c, HasSubstr("begin Transform DEF Cube\nbegin Group DEF Cube_mesh in children\n"));
    EXPECT_THAT(c, HasSubstr("begin PhysicalMaterial DEF Red.001 in material"));
    EXPECT_THAT(c, HasSubstr("use Red.001 in material"));
    EXPECT_THAT(c, HasSubstr("begin Transform DEF Cube_2\nuse Cube_mesh in children\n"));
    EXPECT_THAT(c, HasSubstr("begin Transform DEF mesh1\nbegin Group DEF mesh1_2 in children\n"));
    EXPECT_THAT(c, HasSubstr("begin Transform\nuse mesh1_2 in children\n"));
    EXPECT_THAT(c, HasSubstr("begin Viewpoint DEF Eye in children"));
    EXPECT_THAT(c, HasSubstr("begin Viewpoint in children"));
    EXPECT_THAT(c, HasSubstr("begin PointLight DEF Lamp in children"));
}

// 3.9.6: without normals they are not lit, and have the sum of base colour and emission; colours of points are
// multiplied by the base colour. That is light, which an UnlitMaterial shows as a screen has it: .5 is .735.
TEST(ImportGltf, LinesAndPointsWithoutNormalsAreUnlit) {
    for (const int mode : {0, 1, 2, 3}) {
        GltfParts parts;
        const int points = parts.floats("VEC3", 3, {0, 0, 0, 1, 0, 0});
        const int normals = parts.floats("VEC3", 3, {0, 0, 1, 0, 0, 1});
        const int colors = parts.floats("VEC3", 3, {1, 1, 1, .5f, .5f, .5f});
        const auto commands = [&](const std::string& attributes) {
            const Imported file(parts.text(fmt::format(
                "\"meshes\":[{{\"primitives\":[{{\"mode\":{},\"attributes\":{{\"POSITION\":{}{}}},\"material\":0}}]}}],"
                "\"nodes\":[{{\"mesh\":0}}],\"materials\":[{{\"emissiveFactor\":[0.25,0.5,0],\"pbrMetallicRoughness\":"
                "{{\"baseColorFactor\":[0.5,0,1,0.25]}}}}]",
                mode, points, attributes)));
            EXPECT_EQ(file.problems, "");
            return file.commands;
        };
        const std::string plain = commands("");
        EXPECT_THAT(plain,
                    HasSubstr("begin UnlitMaterial in material\nset emissiveColor SFColor 0.88082504 0.735357 1\n"
                              "set transparency SFFloat 0.75\nend"));
        EXPECT_THAT(commands(fmt::format(",\"COLOR_0\":{}", colors)),
                    HasSubstr("set color MFColorRGBA [0.88082504 0.735357 1 0.25, 0.735357 0.735357 0.735357 0.25]"));
        const std::string lit = commands(fmt::format(",\"NORMAL\":{}", normals));
        EXPECT_THAT(lit, HasSubstr("begin PhysicalMaterial in material\nset baseColor SFColor 0.5 0 1"));
        EXPECT_THAT(lit, HasSubstr("begin Normal in normal\nset vector MFVec3f [0 0 1, 0 0 1]"));
    }
}

TEST(ImportGltf, IsKnownWhateverKeyComesFirst) {
    for (const char* first : {"\"lights\":[{}]", "\"$schema\":\"x\"", "\"my \\\"X3D\\\" key\":{\"X3D\":1}"})
        EXPECT_EQ(
            Imported(fmt::format("{{{},\"nodes\":[{{\"name\":\"n\"}}],\"asset\":{{\"version\":\"2.0\"}}}}", first))
                .problems,
            "");
    const std::string large =
        fmt::format("{{\"my\":\"{}\",\"nodes\":[{{}}],\"asset\":{{\"version\":\"2.0\"}}}}", std::string(10000, '.'));
    EXPECT_EQ(Imported(large).problems, "") << "the keys are behind what is looked at first";
}

TEST(ImportGltf, RequiredExtensionsOfLooksLeaveTheScene) {
    const auto file = [](const char* required) {
        return Imported(
            fmt::format("{{\"asset\":{{\"version\":\"2.0\"}},\"nodes\":[{{\"name\":\"n\"}}],"
                        "\"extensionsRequired\":[{0}],\"extensionsUsed\":[{0}]}}",
                        required));
    };
    const Imported looks = file("\"KHR_materials_of_tomorrow\",\"MSFT_texture_dds\"");
    EXPECT_TRUE(looks.good);
    EXPECT_EQ(
        looks.problems,
        "test: warning: the glTF file requires KHR_materials_of_tomorrow, MSFT_texture_dds, which is not read; it "
        "looks otherwise than it should [parse]\n");
    EXPECT_THAT(looks.commands, HasSubstr("begin Transform DEF n"));
    EXPECT_FALSE(file("\"EXT_mesh_of_tomorrow\"").good);
    EXPECT_EQ(file("\"EXT_texture_webp\"").problems, "");
    EXPECT_TRUE(file("\"KHR_techniques_webgl\"").good);
}

/// Where a skin's point is, by the formula of glTF, in double precision and with matrices throughout.
glm::dvec3 skinned(const std::vector<glm::dmat4>& joints, const std::vector<glm::dmat4>& inverse, const glm::dvec3& p,
                   const std::array<double, 2>& weights) {
    glm::dvec3 result(0);
    for (std::size_t i = 0; i < 2; ++i) result += weights[i] * glm::dvec3(joints[i] * inverse[i] * glm::dvec4(p, 1));
    return result;
}

glm::dmat4 matrixOf(const Node& node) {
    const auto get = [&]<class T>(const char* field, T) {
        return *static_cast<const T*>(node.storage(node.type().findExact(field)));
    };
    const auto rotation = [](const Rotation& r) {
        return glm::rotate(glm::dmat4(1), double(r.angle), glm::dvec3(r.x, r.y, r.z));
    };
    const glm::dvec3 center(get("center", Vec3f()));
    const glm::dmat4 oriented = rotation(get("scaleOrientation", Rotation{}));
    return glm::translate(glm::dmat4(1), glm::dvec3(get("translation", Vec3f())) + center) *
           rotation(get("rotation", Rotation{})) * oriented *
           glm::scale(glm::dmat4(1), glm::dvec3(get("scale", Vec3f()))) * glm::inverse(oriented) *
           glm::translate(glm::dmat4(1), -center);
}

TEST(ImportGltf, SkinsMoveAsTheirJointsDo) {
    // Two joints below a node that is none, bound in another pose than the one the file has them in.
    const auto transform = [](double angle, const glm::dvec3& t, double scale) {
        return glm::translate(glm::dmat4(1), t) *
               glm::rotate(glm::dmat4(1), angle, glm::normalize(glm::dvec3(1, 2, 3))) *
               glm::scale(glm::dmat4(1), glm::dvec3(scale));
    };
    const std::vector<glm::dmat4> inverse{glm::inverse(transform(.3, {1, 0, 0}, 1)),
                                          glm::inverse(transform(-.7, {1, 2, 0}, 2))};
    std::vector<float> matrices;
    for (const glm::dmat4& m : inverse)
        for (int c = 0; c < 4; ++c)
            for (int r = 0; r < 4; ++r) matrices.push_back(static_cast<float>(m[c][r]));
    const std::vector<float> at{0, 0, 0, 1, 0, 0, 0, 1, 0};
    GltfParts parts;
    const int points = parts.floats("VEC3", 3, at);
    const int joints = parts.accessor<std::uint8_t>(5121, "VEC4", 4, {0, 1, 0, 0, 0, 1, 0, 0, 1, 0, 0, 0});
    const int weights = parts.floats("VEC4", 4, {.5f, .5f, 0, 0, 1, 0, 0, 0, .75f, .25f, 0, 0});
    const int bind = parts.floats("MAT4", 16, matrices);
    const int times = parts.floats("SCALAR", 1, {0, 2});
    const double half = std::sqrt(.5);
    const int rounds = parts.floats("VEC4", 4, {0, 0, 0, 1, 0, 0, float(half), float(half)});
    const int moves = parts.floats("VEC3", 3, {0, 1, 0, 3, 1, 2});
    const std::string text = parts.text(fmt::format(
        "\"meshes\":[{{\"primitives\":[{{\"attributes\":{{\"POSITION\":{},\"JOINTS_0\":{},\"WEIGHTS_0\":{}}}}}]}}],"
        "\"skins\":[{{\"joints\":[2,3],\"inverseBindMatrices\":{}}}],"
        "\"nodes\":[{{\"mesh\":0,\"skin\":0,\"translation\":[9,9,9]}},{{\"children\":[2],\"translation\":[0,0,1],"
        "\"scale\":"
        "[2,2,2]}},{{\"children\":[3],\"translation\":[1,0,0]}},{{\"translation\":[0,1,0],\"scale\":[1,2,1]}}],"
        "\"scenes\":[{{\"nodes\":[0,1]}}],\"animations\":[{{\"channels\":[{{\"sampler\":0,\"target\":{{\"node\":2,"
        "\"path\":"
        "\"rotation\"}}}},{{\"sampler\":1,\"target\":{{\"node\":3,\"path\":\"translation\"}}}}],\"samplers\":[{{"
        "\"input\":{},"
        "\"output\":{}}},{{\"input\":{},\"output\":{}}}]}}]",
        points, joints, weights, bind, times, rounds, times, moves));
    Scene scene;
    Diagnostics problems("test");
    ASSERT_TRUE(loadText(scene, text, problems));
    EXPECT_EQ(test::allText(problems), "");
    const double start = 100;
    scene.newFrame(start);
    for (const double t : {0.0, .5, 1.0, 1.75}) {
        scene.newFrame(start + t);
        const glm::dmat4 above =
            glm::translate(glm::dmat4(1), glm::dvec3(0, 0, 1)) * glm::scale(glm::dmat4(1), glm::dvec3(2));
        const Node& clock = scene.node(scene.findName("animation0"));
        const double phase = clock.get(x3d::TimeSensor::fraction_changed);
        const glm::dmat4 first = above * glm::translate(glm::dmat4(1), glm::dvec3(1, 0, 0)) *
                                 glm::rotate(glm::dmat4(1), phase * std::numbers::pi / 2, glm::dvec3(0, 0, 1));
        const glm::dmat4 second = first * glm::translate(glm::dmat4(1), glm::dvec3(3 * phase, 1, 2 * phase)) *
                                  glm::scale(glm::dmat4(1), glm::dvec3(1, 2, 1));
        const Node& a = scene.node(scene.findName("node0_figure0_joint0"));
        const Node& b = scene.node(scene.findName("node0_figure0_joint1"));
        const std::vector<glm::dmat4> ours{matrixOf(a), matrixOf(a) * matrixOf(b)};
        const std::vector<glm::dmat4> none{glm::dmat4(1), glm::dmat4(1)};
        for (std::size_t i = 0; i < 3; ++i) {
            const glm::dvec3 p(at[3 * i], at[3 * i + 1], at[3 * i + 2]);
            const std::array<double, 2> w = i == 0   ? std::array{.5, .5}
                                            : i == 1 ? std::array{1.0, 0.0}
                                                     : std::array{.25, .75};
            const glm::dvec3 expected = skinned({first, second}, inverse, p, w);
            EXPECT_NEAR(glm::distance(skinned(ours, none, p, w), expected), 0, 2e-5) << t << " point " << i;
        }
    }
    const Node& joint = scene.node(scene.findName("node0_figure0_joint0"));
    EXPECT_EQ(Value(joint.get(x3d::HAnimJoint::skinCoordIndex)), Value(Array<std::int32_t>{0, 1, 2}));
    EXPECT_EQ(Value(joint.get(x3d::HAnimJoint::skinCoordWeight)), Value(Array<float>{.5f, 1, .25f}));
}

TEST(ImportGltf, IsFoundByItsContentInsideAnInline) {
    const std::filesystem::path folder =
        std::filesystem::path(testing::TempDir()) / ("import_inline_" + std::to_string(::getpid()));
    std::filesystem::create_directories(folder);
    std::ofstream(folder / "a.glb", std::ios::binary) << Gltf().glb();
    std::ofstream(folder / "b.stl", std::ios::binary) << binaryStl({{0, 0, 0, 1, 0, 0, 1, 1, 0}});
    std::ofstream(folder / "scene.x3dv")
        << "#X3D V4.0 utf8\nDEF A Inline { url \"a.glb\" }\nInline { url \"b.stl\" }\n";
    Scene scene;
    Diagnostics problems("scene");
    EXPECT_TRUE(loadFile(scene, folder / "scene.x3dv", problems));
    EXPECT_EQ(test::allText(problems), "");
    EXPECT_GT(scene.nodeCount(), 20u);
    std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace rtsg
