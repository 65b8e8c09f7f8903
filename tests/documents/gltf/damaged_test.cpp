// glTF files that contradict themselves: each fault is an error that says where it is, and none makes a scene larger
// than it may be.
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "gltf_parts.h"

namespace rtsg {
namespace {

using nlohmann::json;
using test::GltfParts;
using test::Imported;
using test::put;
using testing::HasSubstr;

/// A file in which all is right: a square with all attributes, a figure, two channels of an animation.
json whole() {
    GltfParts parts;
    parts.floats("VEC3", 3, {-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0});                // 0
    parts.floats("VEC3", 3, {0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1});                    // 1
    parts.floats("VEC2", 2, {0, 1, 1, 1, 1, 0, 0, 0});                                // 2
    parts.floats("VEC4", 4, std::vector<float>(16, 1));                               // 3
    parts.accessor(5123, "SCALAR", 1, std::vector<std::uint16_t>{0, 1, 2, 0, 2, 3});  // 4
    parts.floats("SCALAR", 1, {0, 1, 2});                                             // 5
    parts.floats("VEC3", 3, {0, 0, 0, 1, 0, 0, 0, 1, 0});                             // 6
    parts.accessor(5121, "VEC4", 4, std::vector<std::uint8_t>(16, 0));                // 7
    parts.floats("VEC4", 4, {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0});        // 8
    parts.floats("MAT4", 16, {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1});       // 9
    parts.accessor(5123, "SCALAR", 1, std::vector<std::uint16_t>{9});                 // 10
    parts.accessor(5121, "VEC4", 4, std::vector<std::uint8_t>(16, 5));                // 11
    return json::parse(parts.text(
        R"("scene":0,"scenes":[{"nodes":[0,2]}],
        "nodes":[{"name":"a","mesh":0,"children":[1]},{"camera":0,"extensions":{"KHR_lights_punctual":{"light":0}}},
                 {"mesh":0,"skin":0,"children":[3]},{}],
        "meshes":[{"primitives":[{"attributes":{"POSITION":0,"NORMAL":1,"TEXCOORD_0":2,"COLOR_0":3,"JOINTS_0":7,
                   "WEIGHTS_0":8},"indices":4,"material":0,"targets":[{"POSITION":1}]}],"weights":[0]}],
        "materials":[{"pbrMetallicRoughness":{"baseColorTexture":{"index":0}}}],
        "textures":[{"source":0,"sampler":0}],"samplers":[{}],"images":[{"bufferView":5,"mimeType":"image/png"}],
        "cameras":[{"type":"perspective","perspective":{"yfov":1,"znear":0.1}}],
        "skins":[{"joints":[3],"inverseBindMatrices":9}],
        "extensionsUsed":["KHR_lights_punctual"],"extensions":{"KHR_lights_punctual":{"lights":[{"type":"point"}]}},
        "animations":[{"channels":[{"sampler":0,"target":{"node":0,"path":"translation"}}],
                       "samplers":[{"input":5,"output":6}]}])"));
}

struct Spoilt {
    const char* at;  // JSON pointer
    const char* value;
    const char* said;
};

/// What the file says that cannot be: an error each, with its place.
constexpr Spoilt kSpoilt[] = {
    {"/nodes/0/mesh", "\"0\"", "/nodes/0/mesh: expected the number of one of its meshes"},
    {"/nodes/0/mesh", "-1", "/nodes/0/mesh: expected the number of one of its meshes"},
    {"/nodes/0/mesh", "0.5", "/nodes/0/mesh: expected the number of one of its meshes"},
    {"/nodes/0/mesh", "1", "/nodes/0/mesh: it names number 1 of its meshes, which is not there"},
    {"/nodes/0/children", "3", "/nodes/0/children: expected a list"},
    {"/nodes/0/children", "[4]", "/nodes/0/children/0: it names number 4 of its nodes"},
    {"/nodes/0/children", "[0]", "node 0 of the glTF file is there twice"},
    {"/nodes/0/children", "[1,3]", "node 3 of the glTF file is there twice"},
    {"/nodes/1", "5", "/nodes/1: expected an object"},
    {"/nodes/1/name", "5", "/nodes/1/name: expected a text"},
    {"/nodes/1/extensions/KHR_lights_punctual/light", "1", "light: it names number 1 of its lights"},
    {"/nodes/0/scale", "[\"1\",1,1]", "/nodes/0/scale: expected 3 numbers"},
    {"/nodes/0/rotation", "[0,0,1]", "/nodes/0/rotation: expected 4 numbers"},
    {"/nodes/0/matrix", "[1,0,0,0,1,1,0,0,0,0,1,0,0,0,0,1]", "node 0 of the glTF file has a matrix that is no"},
    {"/nodes/0/matrix", "[1,0,0,0.5,0,1,0,0,0,0,1,0,0,0,0,1]", "node 0 of the glTF file has a matrix that is no"},
    {"/nodes/0/matrix", "[1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,2]", "node 0 of the glTF file has a matrix that is no"},
    {"/nodes/2/skin", "1", "/nodes/2/skin: it names number 1 of its skins"},
    {"/nodes", "{}", "/nodes: expected a list"},
    {"/scene", "1", "/scene: it names number 1 of its scenes"},
    {"/scenes/0/nodes", "[0,2,-1]", "/scenes/0/nodes/2: expected the number of one of its nodes"},
    {"/meshes/0/primitives", "0", "/meshes/0/primitives: expected a list"},
    {"/meshes/0/primitives/0/mode", "7", "/meshes/0/primitives/0/mode: expected one of 0 1 2 3 4 5 6"},
    {"/meshes/0/primitives/0/material", "1", "material: it names number 1 of its materials"},
    {"/meshes/0/primitives/0/indices", "-1", "indices: expected the number of one of its accessors"},
    {"/meshes/0/primitives/0/indices", "0", "accessor 0 of the glTF file is no plain list of indices"},
    {"/meshes/0/primitives/0/attributes/NORMAL", "99", "attributes/NORMAL: it names number 99 of its accessors"},
    {"/meshes/0/primitives/0/attributes/NORMAL", "5", "accessor 5 of the glTF file, for NORMAL, has elements of 1"},
    {"/meshes/0/primitives/0/attributes/POSITION", "2", "accessor 2 of the glTF file, for POSITION, has elements of 2"},
    {"/meshes/0/primitives/0/attributes/NORMAL", "6", "for NORMAL, has 3 elements where there are 4 points"},
    {"/meshes/0/primitives/0/attributes/JOINTS_0", "11", "weights of joints that its skin does not have"},
    {"/meshes/0/weights", "[0,1]", "more weights than targets"},
    {"/accessors/0/count", "5", "accessor 0 of the glTF file reaches beyond its buffer view"},
    {"/accessors/0/count", "18446744073709551615", "accessor 0 of the glTF file reaches beyond its buffer view"},
    {"/accessors/0/count", "-3", "/accessors/0/count: expected a whole number from 1 on"},
    {"/accessors/0/byteOffset", "-4", "/accessors/0/byteOffset: expected a whole number from 0 on"},
    {"/accessors/0/byteOffset", "4.5", "/accessors/0/byteOffset: expected a whole number from 0 on"},
    {"/accessors/0/componentType", "5124", "/accessors/0/componentType: expected one of 5120"},
    {"/accessors/0/type", "\"VEC5\"", "/accessors/0/type: expected one of SCALAR"},
    {"/accessors/0/type", "\"VEC2 VEC3\"", "/accessors/0/type: expected one of SCALAR"},
    {"/accessors/2/count", "3", "for TEXCOORD_0, has 3 elements where there are 4 points"},
    {"/accessors/3/count", "3", "for COLOR_0, has 3 elements where there are 4 points"},
    {"/accessors/4/sparse",
     R"({"count":1,"indices":{"bufferView":10,"componentType":5123},"values":{"bufferView":10}})",
     "accessor 4 of the glTF file is no plain list of indices"},
    {"/accessors/0/sparse", R"({"count":1,"indices":{"bufferView":10,"componentType":5123},"values":{"bufferView":0}})",
     "accessor 0 of the glTF file is sparse, with indices beyond its elements"},
    {"/accessors/0/sparse", R"({"count":1,"indices":{"bufferView":5,"componentType":5126},"values":{"bufferView":0}})",
     "/accessors/0/sparse/indices/componentType: expected one of 5121"},
    {"/accessors/0/sparse", "5", "/accessors/0/sparse: expected an object"},
    {"/bufferViews/0/byteStride", "4", "accessor 0 of the glTF file has elements that lie in each other"},
    {"/bufferViews/0/byteStride", "-12", "/bufferViews/0/byteStride: expected a whole number from 1 on"},
    {"/bufferViews/0/byteOffset", "-4", "/bufferViews/0/byteOffset: expected a whole number from 0 on"},
    {"/bufferViews/0/byteLength", "2147483648", "buffer view 0 of the glTF file reaches beyond its buffer"},
    {"/bufferViews/0/buffer", "1", "/bufferViews/0/buffer: it names number 1 of its buffers"},
    {"/buffers/0/byteLength", "4294967296", "buffer 0 of the glTF file has "},
    {"/buffers/0/uri", "\"\"", "buffer 0 of the glTF file has 0 bytes"},
    {"/buffers/0/uri", "\"data:;base64,@@@@\"", "buffer 0 of the glTF file is no base64 text"},
    {"/textures/0/source", "9", "/textures/0/source: it names number 9 of its images"},
    {"/images/0", "{}", "image 0 of the glTF file has neither uri nor bufferView"},
    {"/samplers/0/wrapS", "1", "/samplers/0/wrapS: expected one of 10497"},
    {"/materials/0/alphaMode", "\"GLASS\"", "/materials/0/alphaMode: expected one of OPAQUE MASK BLEND"},
    {"/materials/0/pbrMetallicRoughness/metallicFactor", "7", "metallicFactor: expected a number from 0 to 1"},
    {"/materials/0/pbrMetallicRoughness/roughnessFactor", "-1", "roughnessFactor: expected a number from 0 to 1"},
    {"/materials/0/doubleSided", "1", "/materials/0/doubleSided: expected true or false"},
    {"/materials/0/pbrMetallicRoughness/baseColorTexture/extensions", R"({"KHR_texture_transform":{"offset":[1]}})",
     "KHR_texture_transform/offset: expected 2 numbers"},
    {"/cameras/0/type", "\"fisheye\"", "/cameras/0/type: expected one of perspective orthographic"},
    {"/cameras/0/perspective/yfov", "9", "camera 0 of the glTF file sees no angle below half a turn"},
    {"/cameras/0/perspective/aspectRatio", "0", "aspectRatio: expected a number above 0"},
    {"/extensions/KHR_lights_punctual/lights/0/type", "\"laser\"", "type: expected one of directional point spot"},
    {"/extensions/KHR_lights_punctual/lights/0/color", "[1,2]", "color: expected 3 numbers"},
    {"/skins/0/joints", "[9]", "/skins/0/joints/0: it names number 9 of its nodes"},
    {"/skins/0/joints", "[3,1]", "skin 0 of the glTF file has matrices of another kind or number than joints"},
    {"/skins/0/inverseBindMatrices", "0", "skin 0 of the glTF file has matrices of another kind or number"},
    {"/skins/0", R"({"joints":[3,3]})", "skin 0 of the glTF file names a joint twice, or joints that are below each"},
    {"/animations/0/samplers/0/interpolation", "\"BEZIER\"", "interpolation: expected one of LINEAR STEP CUBICSPLINE"},
    {"/animations/0/samplers/0/interpolation", "\"CUBICSPLINE\"", "another number of values than keys"},
    {"/animations/0/samplers/0/input", "99", "samplers/0/input: it names number 99 of its accessors"},
    {"/animations/0/samplers/0/input", "6", "animation 0 of the glTF file has keys that do not ascend"},
    {"/animations/0/channels/0/sampler", "1", "sampler: it names number 1 of its samplers of the animation"},
    {"/animations/0/channels/0/target/node", "9", "target/node: it names number 9 of its nodes"},
    {"/animations/0/channels/0/target", R"({"node":1,"path":"weights"})",
     "weights of node 1 of the glTF file are animated, and it has no mesh"},
    {"/cameras/0", R"({"type":"orthographic","orthographic":{"xmag":0,"ymag":1}})",
     "camera 0 of the glTF file sees nothing"},
    {"/nodes/0", R"({"mesh":0,"matrix":[1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1],"scale":[2,2,2]})",
     "node 0 of the glTF file has a matrix, and more that says where it is"},
    {"/meshes/0/primitives/0/attributes", R"({"POSITION":0})", "has joints without weights"},
    {"/animations/0/channels/1", R"({"sampler":0,"target":{"node":0,"path":"translation"}})",
     "animation0 of the glTF file moves node 0 twice; the first counts"},
    {"/cameras/0", R"({"type":"perspective"})", "camera 0 of the glTF file has no lens of its type"},
    {"/cameras/0/perspective/zfar", "0.05", "camera 0 of the glTF file has its zfar before its znear"},
    {"/extensions/KHR_lights_punctual/lights/0", R"({"type":"spot","spot":{"innerConeAngle":2,"outerConeAngle":1}})",
     "light 0 of the glTF file has an inner cone"},
    {"/extensions/KHR_lights_punctual/lights/0/intensity", "-1", "intensity: expected a number from 0 on"},
    {"/extensionsRequired", "\"KHR_x\"", "/extensionsRequired: expected a list of texts"},
    {"/extensionsUsed", "[5]", "/extensionsUsed: expected a list of texts"},
    {"/accessors/4/count", "5", "another number of indices than its triangles or lines need"},
    {"/nodes/0/rotation", "[0,0,0,0]", "node 0 of the glTF file has a rotation of length 0"},
    {"/skins/0/joints", "[]", "skin 0 of the glTF file has no joints"},
    {"/meshes/0/primitives/0/attributes", R"({"POSITION":0,"JOINTS_0":7})", "has joints without weights"},
    {"/asset/minVersion", "\"2.1\"", "needs a reader of glTF 2.1"},
};

TEST(DamagedGltf, EachFaultIsAnErrorWithItsPlace) {
    ASSERT_EQ(Imported(whole().dump()).problems, "");
    for (const Spoilt& spoilt : kSpoilt) {
        json file = whole();
        file[json::json_pointer(spoilt.at)] = json::parse(spoilt.value);
        const Imported read(file.dump());
        EXPECT_THAT(read.problems, HasSubstr(": error: ")) << spoilt.at << " " << spoilt.value;
        EXPECT_THAT(read.problems, HasSubstr(spoilt.said)) << spoilt.at << " " << spoilt.value;
    }
    for (const char* at : {"/accessors/0/count", "/bufferViews/0/buffer", "/animations/0/samplers/0/output",
                           "/meshes/0/primitives", "/skins/0/joints", "/cameras/0/perspective/yfov"}) {
        json file = whole();
        const json::json_pointer pointer(at);
        file[pointer.parent_pointer()].erase(pointer.back());
        EXPECT_THAT(Imported(file.dump()).problems,
                    HasSubstr(std::string("error: the glTF file's ") + at + ": it is missing"));
    }
}

// What streams into text has a node's values before its nodes.
TEST(DamagedGltf, TexturesThatMirrorAndShowSquaresHaveProperties) {
    json file = whole();
    const auto commands = [&](const char* sampler) {
        file["samplers"][0] = json::parse(sampler);
        const Imported read(file.dump());
        EXPECT_EQ(read.problems, "");
        return read.commands.substr(read.commands.find("begin ImageTexture"));
    };
    EXPECT_THAT(commands(R"({"wrapS":33648,"wrapT":33071,"magFilter":9728,"minFilter":9984})"),
                testing::ContainsRegex("set url [^\n]*\nset repeatT SFBool FALSE\nbegin TextureProperties in "
                                       "textureProperties\nset boundaryModeS SFString \"MIRRORED_REPEAT\"\nset "
                                       "boundaryModeT SFString \"CLAMP_TO_EDGE\"\nset magnificationFilter SFString "
                                       "\"NEAREST_PIXEL\"\nset minificationFilter SFString "
                                       "\"NEAREST_PIXEL_NEAREST_MIPMAP\"\nset generateMipMaps SFBool TRUE\nend"));
    EXPECT_THAT(commands(R"({"minFilter":9728})"), HasSubstr("set minificationFilter SFString \"NEAREST_PIXEL\"\nset "
                                                             "generateMipMaps SFBool FALSE\nend"));
    EXPECT_THAT(commands(R"({"minFilter":9987,"magFilter":9729,"wrapS":10497})"),
                testing::Not(HasSubstr("TextureProperties")));
}

TEST(DamagedGltf, NodesBelowThemselvesAreTold) {
    json file = whole();
    file.erase("scene");
    file.erase("scenes");
    file["nodes"][3]["children"] = {2};
    EXPECT_THAT(Imported(file.dump()).problems, HasSubstr("error: the glTF file's nodes are no tree"));
    // A skeleton of such nodes is left out, and nothing names its joints.
    file["scenes"] = json::parse(R"([{"nodes":[0,2]}])");
    file["skins"][0] = json::parse(R"({"joints":[3,2]})");
    EXPECT_THAT(Imported(file.dump()).problems, HasSubstr("joints that are below each other"));
    EXPECT_THAT(Imported(file.dump()).commands, testing::Not(HasSubstr("in joints")));
    file["skins"][0] = json::parse(R"({"joints":[3]})");
    EXPECT_THAT(Imported(file.dump()).commands, testing::Not(HasSubstr("in joints")));
}

TEST(DamagedGltf, AJointThatIsNotThereLeavesTheSkeletonOut) {
    json file = whole();
    file["skins"][0] = json::parse(R"({"joints":[3,9]})");
    const Imported read(file.dump());
    EXPECT_THAT(read.problems, HasSubstr("/skins/0/joints/1: it names number 9 of its nodes"));
    EXPECT_THAT(read.commands, testing::Not(HasSubstr("in joints")));
    EXPECT_THAT(read.commands, testing::Not(HasSubstr("HAnimJoint")));
}

TEST(DamagedGltf, AnAccessorWithoutBytesIsZeros) {
    json file = whole();
    file["accessors"][3].erase("bufferView");
    const Imported read(file.dump());
    EXPECT_EQ(read.problems, "");
    EXPECT_THAT(read.commands, HasSubstr("set color MFColorRGBA [0 0 0 0, 0 0 0 0, 0 0 0 0, 0 0 0 0]"));
    file["accessors"][3]["count"] = 1'000'000'000'000;
    EXPECT_THAT(Imported(file.dump()).problems, HasSubstr("more than there can be without bytes of their own"));
}

TEST(DamagedGltf, AnimationsOfKeysThatGoBackAreLeftOut) {
    for (const bool good : {true, false}) {
        GltfParts parts;
        parts.floats("SCALAR", 1, {0, 1, good ? 1.f : .5f});
        parts.floats("VEC3", 3, {0, 0, 0, 1, 0, 0, 0, 1, 0});
        const Imported read(parts.text(
            R"("nodes":[{}],"animations":[{"channels":[{"sampler":0,"target":{"node":0,"path":"scale"}}],
               "samplers":[{"input":0,"output":1}]}])"));
        EXPECT_EQ(read.problems.empty(), good) << "two keys at one time are a step";
        EXPECT_EQ(read.commands.contains("PositionInterpolator"), good);
    }
}

TEST(DamagedGltf, AnimatedWeightsAreAsManyAsTargets) {
    GltfParts parts;
    parts.floats("VEC3", 3, {0, 0, 0, 1, 0, 0, 0, 1, 0});
    parts.floats("SCALAR", 1, {0, 1});
    parts.floats("SCALAR", 1, {0, 1, 0, 1});
    const Imported read(parts.text(
        R"("nodes":[{"mesh":0}],"meshes":[{"primitives":[{"attributes":{"POSITION":0},"targets":[{"POSITION":0}]}]}],
           "animations":[{"channels":[{"sampler":0,"target":{"node":0,"path":"weights"}}],
           "samplers":[{"input":1,"output":2}]}])"));
    EXPECT_THAT(read.problems,
                HasSubstr("error: animation0_0: an animation of the glTF file has another number of weights"));
}

/// A GLB of `json` whose head counts `more` bytes than there are.
std::string glbOf(std::string text, int more, std::string_view behind = {}) {
    text.resize((text.size() + 3) / 4 * 4, ' ');
    std::string bytes = "glTF";
    put(bytes, std::uint32_t{2});
    put(bytes, static_cast<std::uint32_t>(static_cast<int>(20 + text.size()) + more));
    put(bytes, static_cast<std::uint32_t>(text.size()));
    return (bytes += "JSON" + text) += behind;
}

TEST(DamagedGltf, TheLengthOfAGlbIsThatOfItsHead) {
    const std::string good = whole().dump();
    EXPECT_EQ(Imported(glbOf(good, 0)).problems, "");
    EXPECT_THAT(Imported(glbOf(good, 4)).problems, HasSubstr("the GLB file is damaged: its head counts "));
    EXPECT_FALSE(Imported(glbOf(good, 4)).good);
    EXPECT_THAT(Imported(glbOf(good, -4)).problems, HasSubstr("the chunk at its byte 12 is longer than the rest"));
    const Imported more(glbOf(good, 0, "junk and so on"));
    EXPECT_THAT(more.problems,
                HasSubstr("warning: bytes behind the end of the GLB file, which its head counts, are left out: 14"));
    EXPECT_TRUE(more.good);
}

/// What is read of a text that may become so many bytes.
struct Bounded {
    Bounded(std::string_view text, std::uint64_t bytes) {
        Diagnostics reports("test");
        readDocument(text, handler, reports, {.maximumBytes = bytes});
        problems = test::allText(reports);
    }
    test::RecordingHandler handler;
    std::string problems;
};

// Whatever a file uses again and again is counted each time.
TEST(DamagedGltf, WhatAFileRepeatsIsBounded) {
    constexpr std::uint64_t maximum = 1 << 20;
    const char* said =
        "what the glTF file describes takes more than 1048576 bytes, as it uses its data again and again";
    GltfParts parts;
    const int points = parts.floats("VEC3", 3, std::vector<float>(2997, 1));
    std::vector<float> seconds;
    for (int i = 0; i < 999; ++i) seconds.push_back(static_cast<float>(i));
    const int times = parts.floats("SCALAR", 1, seconds);
    const int picture =
        parts.view(std::string(20000, 'x'), "", R"("componentType":5121,"count":1,"type":"SCALAR","bufferView":2)");
    const auto read = [&](const std::string& rest) { return Bounded(parts.text(rest), maximum); };
    const auto many = [](int count, const auto& one) {
        std::string all;
        for (int i = 0; i < count; ++i) all += (i ? "," : "") + one(i);
        return "[" + all + "]";
    };
    const std::string primitive = fmt::format("{{\"attributes\":{{\"POSITION\":{}}}}}", points);
    const auto same = [](const std::string& text) { return [text](int) { return text; }; };
    EXPECT_EQ(read("\"nodes\":[{\"mesh\":0}],\"meshes\":[{\"primitives\":" + many(50, same(primitive)) + "}]").problems,
              "");
    EXPECT_THAT(
        read("\"nodes\":[{\"mesh\":0}],\"meshes\":[{\"primitives\":" + many(200, same(primitive)) + "}]").problems,
        HasSubstr(said));
    EXPECT_THAT(read("\"nodes\":" + many(600, same("{\"mesh\":0,\"weights\":[1]}")) +
                     ",\"meshes\":[{\"primitives\":" + many(600, same("{}")) + "}]")
                    .problems,
                HasSubstr(said));
    EXPECT_THAT(
        read("\"extensionsUsed\":[\"EXT_mesh_gpu_instancing\"],\"nodes\":" +
             many(10, same(fmt::format("{{\"mesh\":0,\"extensions\":{{\"EXT_mesh_gpu_instancing\":{{\"attributes\":"
                                       "{{\"TRANSLATION\":{}}}}}}}}}",
                                       points))) +
             ",\"meshes\":[{\"primitives\":[" + primitive + "]}]")
            .problems,
        HasSubstr(said));
    EXPECT_THAT(read("\"nodes\":" + many(300, same("{}")) + ",\"animations\":[{\"channels\":" +
                     many(300,
                          [](int i) {
                              return fmt::format("{{\"sampler\":0,\"target\":{{\"node\":{},\"path\":\"scale\"}}}}", i);
                          }) +
                     fmt::format(",\"samplers\":[{{\"input\":{},\"output\":{}}}]}}]", times, points))
                    .problems,
                HasSubstr(said));
    EXPECT_THAT(read(fmt::format("\"images\":[{{\"bufferView\":{}}}],\"textures\":", picture) +
                     many(100, same("{\"source\":0}")) + ",\"materials\":" +
                     many(100,
                          [](int i) {
                              return fmt::format(
                                  "{{\"pbrMetallicRoughness\":{{\"baseColorTexture\":{{\"index\":{}}}}}}}", i);
                          }) +
                     ",\"nodes\":[{\"mesh\":0}],\"meshes\":[{\"primitives\":" +
                     many(100,
                          [&](int i) {
                              return fmt::format("{{\"attributes\":{{\"POSITION\":{}}},\"material\":{}}}", points, i);
                          }) +
                     "}]")
                    .problems,
                HasSubstr(said));
    EXPECT_THAT(read("\"scenes\":[{\"nodes\":[0]}],\"nodes\":" + many(200, same("{\"mesh\":0,\"skin\":0}")) +
                     ",\"skins\":[{\"joints\":" + many(200, [](int i) { return std::to_string(i); }) +
                     "}],\"meshes\":[{\"primitives\":" + many(50, same(primitive)) + "}]")
                    .problems,
                HasSubstr(said));
}

// Joints at the end of a long chain pass its nodes once, not once each: that would take minutes.
TEST(DamagedGltf, ManyJointsBelowALongChainAreReadAtOnce) {
    constexpr int length = 20000;
    json file = json::parse(R"({"asset":{"version":"2.0"},"scenes":[{"nodes":[0]}]})");
    json& nodes = file["nodes"];
    for (int i = 0; i < length; ++i) nodes.push_back({{"children", {i + 1}}, {"translation", {1, 0, 0}}});
    nodes[length - 1]["children"] = json::array();
    json joints = json::array();
    for (int i = 0; i < length; ++i) {
        joints.push_back(length + i);
        nodes[length - 1]["children"].push_back(length + i);
        nodes.push_back(json::object());
    }
    file["skins"] = {{{"joints", joints}}};
    GltfParts parts;
    parts.floats("VEC3", 3, {0, 0, 0, 1, 0, 0, 0, 1, 0});
    parts.accessor(5121, "VEC4", 4, std::vector<std::uint8_t>(12, 0));
    parts.floats("VEC4", 4, {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0});
    const json with = json::parse(
        parts.text(R"("meshes":[{"primitives":[{"attributes":{"POSITION":0,"JOINTS_0":1,"WEIGHTS_0":2}}]}])"));
    file.update(with);
    nodes[0]["mesh"] = 0, nodes[0]["skin"] = 0;
    const Imported read(file.dump());
    EXPECT_EQ(read.problems, "");
    EXPECT_THAT(read.commands, HasSubstr("set translation SFVec3f 20000 0 0"));
}

}  // namespace
}  // namespace rtsg
