// What extensions add to glTF's materials: glass, panes and coats as metadata that the tracer knows, and what of them
// is left out, which is said once.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

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

TEST(GltfLooks, APaneMirrorsAndBendsNothing) {
    const Imported file = withMaterials({glass("")});
    EXPECT_EQ(file.problems, "");
    EXPECT_THAT(file.commands, HasSubstr("\"reflectivity\"\nset value MFFloat [0.04]"));
    EXPECT_THAT(file.commands, Not(HasSubstr("refractiveIndex")));
    const Imported metal = withMaterials({glass("", "\"metallicFactor\":1,\"roughnessFactor\":0")});
    EXPECT_THAT(metal.commands, Not(HasSubstr("MetadataSet"))) << "metals let nothing through";
    EXPECT_THAT(metal.commands, HasSubstr("\"OPAQUE\""));
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

}  // namespace
}  // namespace rtsg
