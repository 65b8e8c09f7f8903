// Extensions of glTF's materials: glass, panes and coats as metadata for the tracer, and one warning about the effects
// that are left out.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>

#include "documents/import/imported.h"
#include "gltf_parts.h"

namespace rtsg {
namespace {

using test::GltfParts;
using test::Imported;
using testing::HasSubstr;
using testing::Not;

/// A triangle of each material.
Imported withMaterials(const std::vector<std::string>& materials) {
    GltfParts parts;
    const int points = parts.floats("VEC3", 3, {0, 0, 0, 1, 0, 0, 0, 1, 0});
    std::string list, primitives;
    for (std::size_t i = 0; i < materials.size(); ++i) {
        list += (i ? "," : "") + materials[i];
        primitives += fmt::format("{}{{\"attributes\":{{\"POSITION\":{}}},\"material\":{}}}", i ? "," : "", points, i);
    }
    return Imported(parts.text(fmt::format(
        "\"materials\":[{}],\"meshes\":[{{\"primitives\":[{}]}}],\"nodes\":[{{\"mesh\":0}}]", list, primitives)));
}

std::string glass(const std::string& more, const std::string& metal = "\"metallicFactor\":0,\"roughnessFactor\":0") {
    return "{\"pbrMetallicRoughness\":{" + metal +
           "},\"extensions\":{\"KHR_materials_transmission\":{\"transmissionFactor\":1}" + more + "}}";
}

TEST(GltfLooks, ABodyOfGlassBendsAndAbsorbs) {
    const Imported file = withMaterials({glass(
        ",\"KHR_materials_ior\":{\"ior\":1.33},\"KHR_materials_volume\":{\"thicknessFactor\":2,\"attenuationColor\":"
        "[0.5,1,0.25],\"attenuationDistance\":0.5}")});
    EXPECT_EQ(file.problems, "");
    EXPECT_THAT(file.commands, HasSubstr("set alphaMode SFString \"BLEND\""));
    EXPECT_THAT(file.commands, HasSubstr("set transparency SFFloat 1\n"));
    // exp(-a * .5) is the colour.
    EXPECT_THAT(file.commands,
                HasSubstr("begin MetadataSet in metadata\nset name SFString \"RTSG\"\nbegin MetadataFloat in value\n"
                          "set name SFString \"refractiveIndex\"\nset value MFFloat [1.33]\nend\n"
                          "begin MetadataFloat in value\nset name SFString \"absorption\"\n"
                          "set value MFFloat [1.3862944, 0, 2.7725887]\nend\nend\n"));
    EXPECT_THAT(file.commands, Not(HasSubstr("reflectivity")));
}

TEST(GltfLooks, TheColourOfABodyIsWhatItsThicknessLeaves) {
    const Imported file = withMaterials({glass(",\"KHR_materials_volume\":{\"thicknessFactor\":0.5}",
                                               "\"metallicFactor\":0,\"roughnessFactor\":0,\"baseColorFactor\":"
                                               "[0.5,1,1,1]")});
    EXPECT_EQ(file.problems, "");
    EXPECT_THAT(file.commands, HasSubstr("\"absorption\"\nset value MFFloat [1.3862944, 0, 0]"));
}

TEST(GltfLooks, AThicknessThatIsLessThanTheMeshCountsAsMuchAsThat) {
    GltfParts parts;
    std::string bytes;
    for (const float number : {0.f, 0.f, 0.f, 2.f, 0.f, 0.f, 0.f, 4.f, 6.f}) test::put(bytes, number);
    const int points =
        parts.view(bytes, "",
                   "\"bufferView\":0,\"componentType\":5126,\"count\":3,\"type\":\"VEC3\",\"min\":[0,0,0],"
                   "\"max\":[2,4,6]");
    const Imported file(parts.text(fmt::format(
        "\"materials\":[{}],\"meshes\":[{{\"primitives\":[{{\"attributes\":{{\"POSITION\":{}}},\"material\":0}}]}}],"
        "\"nodes\":[{{\"mesh\":0}}]",
        glass(",\"KHR_materials_volume\":{\"thicknessFactor\":0.5}",
              "\"metallicFactor\":0,\"roughnessFactor\":0,\"baseColorFactor\":[0.25,1,1,1]"),
        points)));
    EXPECT_EQ(file.problems, "");
    EXPECT_THAT(file.commands, HasSubstr("\"absorption\"\nset value MFFloat [0.6931472, 0, 0]"));
}

TEST(GltfLooks, APaneMirrorsAndBendsNothing) {
    const Imported file = withMaterials({glass("")});
    EXPECT_EQ(file.problems, "");
    EXPECT_THAT(file.commands, HasSubstr("\"reflectivity\"\nset value MFFloat [0.04]"));
    EXPECT_THAT(file.commands, Not(HasSubstr("refractiveIndex")));
    const Imported metal = withMaterials({glass("", "\"metallicFactor\":1,\"roughnessFactor\":0")});
    EXPECT_THAT(metal.commands, Not(HasSubstr("MetadataSet"))) << "metals let nothing through";
    EXPECT_THAT(metal.commands, HasSubstr("\"OPAQUE\""));
    const Imported textured = withMaterials({glass("", "\"metallicRoughnessTexture\":{\"index\":0}")});
    EXPECT_THAT(textured.commands, HasSubstr("set transparency SFFloat 1\n")) << "its texture says where it is metal";
}

TEST(GltfLooks, WhatIsLeftOutIsSaidOnceForEachKind) {
    const std::string coat =
        "{\"extensions\":{\"KHR_materials_clearcoat\":{\"clearcoatFactor\":0.5},\"KHR_materials_sheen\":{}}}";
    const Imported file = withMaterials({coat, coat});
    EXPECT_EQ(
        file.problems,
        "test: warning: the glTF file uses KHR_materials_clearcoat: a coat is a sharp mirror of 4 % at every angle "
        "if its roughness is at most .3, else there is none; its textures are left out [parse]\n"
        "test: warning: the glTF file uses KHR_materials_sheen: the shine of cloth is left out [parse]\n");
    EXPECT_THAT(file.commands, HasSubstr("\"reflectivity\"\nset value MFFloat [0.02]"));
    const Imported none = withMaterials(
        {"{\"extensions\":{\"KHR_materials_clearcoat\":{\"clearcoatFactor\":0},\"KHR_materials_ior\":{\"ior\":1.5},"
         "\"KHR_materials_iridescence\":{\"iridescenceFactor\":0}}}"});
    EXPECT_EQ(none.problems, "");
    const Imported rough = withMaterials(
        {"{\"extensions\":{\"KHR_materials_clearcoat\":{\"clearcoatFactor\":1,\"clearcoatRoughnessFactor\":0.5}}}"});
    EXPECT_THAT(rough.commands, Not(HasSubstr("reflectivity")));
    EXPECT_THAT(withMaterials({glass("", "\"metallicFactor\":0")}).problems, HasSubstr("neither blurred"));
}

TEST(GltfLooks, SpecularGlossinessBecomesMetalOrNone) {
    const auto file = [](const std::string& gloss, const std::string& beside = {}) {
        return withMaterials(
            {"{\"extensions\":{\"KHR_materials_pbrSpecularGlossiness\":{" + gloss + "}}" + beside + "}"});
    };
    const Imported plastic =
        file("\"diffuseFactor\":[0.5,0.25,0,0.5],\"specularFactor\":[0.04,0.04,0.04],\"glossinessFactor\":0.75");
    EXPECT_EQ(plastic.problems, "");
    EXPECT_THAT(plastic.commands, HasSubstr("set baseColor SFColor 0.5 0.25 0\nset transparency SFFloat 0.5\n"
                                            "set metallic SFFloat 0\nset roughness SFFloat 0.25"));
    const Imported gold = file("\"diffuseFactor\":[0,0,0,1],\"specularFactor\":[1,0.75,0.25],\"glossinessFactor\":1");
    EXPECT_THAT(gold.commands,
                HasSubstr("set baseColor SFColor 1 0.75 0.25\nset metallic SFFloat 1\nset roughness SFFloat 0"));
    EXPECT_THAT(file("\"diffuseFactor\":[0,1,0,1]", ",\"pbrMetallicRoughness\":{\"roughnessFactor\":0.5}").commands,
                HasSubstr("set baseColor SFColor 1 1 1"));
}

TEST(GltfLooks, APaneIsTintedByItsColour) {
    const Imported file =
        withMaterials({glass("", "\"metallicFactor\":0,\"roughnessFactor\":0,\"baseColorFactor\":[0.5,1,1,1]")});
    EXPECT_THAT(file.commands, HasSubstr("\"absorption\"\nset value MFFloat [0.6931472, 0, 0]"));
}

/// Two primitives, one of which has variants.
std::string variants(const std::string& mappings, const std::string& more = {}) {
    GltfParts parts;
    const int points = parts.floats("VEC3", 3, {0, 0, 0, 1, 0, 0, 0, 1, 0});
    const int times = parts.floats("SCALAR", 1, {0, 1}), weights = parts.floats("SCALAR", 1, {0, 1});
    return parts.text(fmt::format(
        "\"materials\":[{{\"name\":\"red\"}},{{\"name\":\"blue\"}}],\"meshes\":[{{\"primitives\":[{{\"attributes\":{{"
        "\"POSITION\":{0}}},\"material\":0,\"targets\":[{{\"POSITION\":{0}}}],\"extensions\":{{"
        "\"KHR_materials_variants\":{{\"mappings\":[{3}]}}}}}},{{\"attributes\":{{\"POSITION\":{0}}},\"material\":0}}]}"
        "}],"
        "\"nodes\":[{{\"mesh\":0}}],\"extensionsRequired\":[\"KHR_materials_variants\"],\"extensions\":{{"
        "\"KHR_materials_variants\":{{\"variants\":[{{\"name\":\"day\"}},{{\"name\":\"night\"}},{{}}]}}}}{4}",
        points, times, weights, mappings,
        more.empty() ? "" : fmt::format(fmt::runtime(more), fmt::arg("times", times), fmt::arg("weights", weights))));
}

TEST(GltfLooks, VariantsAreChosenByTheirNames) {
    const std::string text = variants("{\"material\":1,\"variants\":[1,7]}");
    const Imported file(text);
    EXPECT_THAT(file.problems, HasSubstr("variants/1: it names number 7 of its variants, which is not there"));
    EXPECT_THAT(file.commands, HasSubstr("begin Switch DEF variants_of_0 in children\nset whichChoice SFInt32 0\n"
                                         "begin Shape DEF variants_of_0_shape0 in children\n"));
    Scene scene;
    Diagnostics problems("test");
    ASSERT_TRUE(loadText(scene, text, problems));
    const auto choice = [&](const char* name) {
        const NodeId trigger = scene.findName(name), one = scene.findName("variants_of_0");
        EXPECT_TRUE(trigger && one) << name;
        EXPECT_TRUE(scene.sendEvent(trigger, scene.node(trigger).type().findExact("set_boolean"), Value(true)));
        scene.newFrame(scene.now() + 1);
        const Node& node = scene.node(one);
        const auto shown = static_cast<std::size_t>(node.get(x3d::Switch::whichChoice));
        return node.get(x3d::Switch::children)[shown];
    };
    const NodeId red = scene.findName("variants_of_0_shape0"), blue = scene.findName("variants_of_0_shape1");
    EXPECT_EQ(choice("night"), blue);
    EXPECT_EQ(choice("day"), red) << "a variant that says nothing of a primitive";
    EXPECT_EQ(choice("variant2"), red);
}

TEST(GltfLooks, WhatMovesKeepsItsMaterial) {
    const Imported file(variants("{\"material\":1,\"variants\":[1]}",
                                 ",\"animations\":[{{\"channels\":[{{\"sampler\":0,\"target\":{{\"node\":0,\"path\":"
                                 "\"weights\"}}}}],\"samplers\":[{{\"input\":{times},\"output\":{weights}}}]}}]"));
    EXPECT_THAT(file.problems, HasSubstr("variants of the glTF file change what moves by joints or weights"));
    EXPECT_THAT(file.commands, Not(HasSubstr("Switch")));
}

TEST(GltfLooks, ManyVariantsOfManyPointsAreRefused) {
    std::string all;
    for (int i = 0; i < 3; ++i) all += fmt::format("{}{{\"material\":{},\"variants\":[{}]}}", i ? "," : "", i % 2, i);
    std::string text = variants(all);
    EXPECT_EQ(Imported(text).problems, "");
    const std::string count = "\"count\":3,\"type\":\"VEC3\"";
    text.replace(text.find(count), count.size(), "\"count\":30000000,\"type\":\"VEC3\"");
    EXPECT_THAT(Imported(text).problems, HasSubstr("variants of the glTF file's materials are too many"));
}

}  // namespace
}  // namespace rtsg
