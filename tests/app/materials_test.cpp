// Portable materials through the program: what their pictures are beside those of metadata, and after conversion.
#include "program.h"

#include <array>

#include <gmock/gmock.h>

namespace rtsg::test {
namespace {

using testing::HasSubstr;

class PortableMaterials : public CommandLine {
  protected:
    /// Four balls above a floor, with a material each.
    static std::string balls(const std::string& before, const std::array<std::string, 4>& materials) {
        std::string text = "#X3D V4.0 utf8\nPROFILE Full\n" + before +
                           "Background { skyColor .3 .5 .8 groundColor [ .3 .3 .3, .4 .4 .4 ] groundAngle 1.57 }\n"
                           "Viewpoint { position 0 1 8 } PointLight { location 1 6 5 radius 100 }\n"
                           "Transform { translation 0 -1.4 0 children Shape { geometry Box { size 12 1 6 } appearance "
                           "Appearance { material Material { diffuseColor .7 .6 .4 } } } }\n";
        for (std::size_t i = 0; i < materials.size(); ++i)
            text += "Transform { translation " + std::to_string(2.0 * static_cast<double>(i) - 3) +
                    " 0 0 children Shape { geometry Sphere { radius .9 } appearance Appearance { material " +
                    materials[i] + " } } }\n";
        return text;
    }
    static std::string withMetadata() {
        const std::string_view set = "metadata MetadataSet { name \"RTSG\" value [ MetadataFloat { name ";
        const auto material = [&](std::string_view fields, std::string_view entries) {
            return "Material { " + std::string(fields) + " " + std::string(set) + std::string(entries) + " } ] } }";
        };
        return balls(
            "", {material("diffuseColor 0 0 0 transparency 1",
                          "\"refractiveIndex\" value 1.4 } MetadataFloat { name \"absorption\" value [ .5 .1 .2 ]"),
                 material("diffuseColor 0 0 0", "\"reflectivity\" value [ .9 .8 .7 ]"),
                 material("diffuseColor .6 .1 .1", "\"reflectivity\" value .2"),
                 "PhysicalMaterial { metallic 1 baseColor 1 .8 .3 roughness .3 }"});
    }
    static std::string portable(const std::string& urn) {
        const auto declared = [&](const std::string& name, const std::string& fields) {
            return "EXTERNPROTO " + name + " [ " + fields + " ] [ \"" + urn + name + "\" \"materials.x3dv#" + name +
                   "\" ]\n";
        };
        return balls(
            declared("Glass", "inputOutput MFFloat refractiveIndex inputOutput MFFloat absorption") +
                declared("Mirror", "inputOutput MFFloat reflectivity") +
                declared("Polished", "inputOutput SFColor diffuseColor inputOutput MFFloat reflectivity") +
                declared("Metal", "inputOutput SFColor baseColor inputOutput SFFloat roughness"),
            {"Glass { refractiveIndex 1.4 absorption [ .5 .1 .2 ] }", "Mirror { reflectivity [ .9 .8 .7 ] }",
             "Polished { diffuseColor .6 .1 .1 reflectivity .2 }", "Metal { baseColor 1 .8 .3 roughness .3 }"});
    }
    std::string rendered(const std::string& scene, const std::string& integrator) {
        const std::string out = folder / "out.pfm";
        const Outcome outcome =
            rtsg({"render", scene, "-o", out, "--size", "64x24", "--spp", "4", "--integrator", integrator});
        EXPECT_EQ(outcome.status, 0) << outcome.err;
        EXPECT_EQ(outcome.err.find("warning"), std::string::npos) << outcome.err;
        return readFile(out);
    }
    std::string written(const std::string& name, const std::string& text) {
        writeFile(folder / name, text);
        return folder / name;
    }
    std::string converted(const std::string& from, const std::string& name, std::vector<std::string> more = {}) {
        std::vector<std::string> arguments{"convert", from, folder / name};
        arguments.insert(arguments.end(), more.begin(), more.end());
        const Outcome outcome = rtsg(arguments);
        EXPECT_EQ(outcome.status, 0) << outcome.err;
        return folder / name;
    }
};

// There is no materials.x3dv: the urn is enough.
TEST_F(PortableMaterials, APictureIsThatOfMetadataBitForBit) {
    const std::string metadata = written("metadata.x3dv", withMetadata());
    const std::string externProtos = written("portable.x3dv", portable("urn:rtsg:material:"));
    const std::string xml = converted(externProtos, "portable.x3d"), json = converted(xml, "portable.json");
    const std::string back = converted(json, "back.x3dv");
    for (const char* integrator : {"whitted", "path"}) {
        const std::string expected = rendered(metadata, integrator);
        EXPECT_GT(expected.size(), 64u * 24 * 12);
        for (const std::string& scene : {externProtos, xml, json, back})
            EXPECT_TRUE(rendered(scene, integrator) == expected) << scene << ", " << integrator;
    }
}

TEST_F(PortableMaterials, TheFilterAndBackAgainShowTheSame) {
    const std::string metadata = written("metadata.x3dv", withMetadata());
    const std::string there = converted(metadata, "there.x3dv", {"--filter", "portable"});
    const std::string back = converted(there, "back.x3dv", {"--filter", "flatten-protos"});
    const std::string again = converted(back, "again.x3dv", {"--filter", "portable"});
    EXPECT_THAT(readFile(there), HasSubstr("urn:rtsg:material:Glass"));
    EXPECT_EQ(readFile(there).find("Metadata"), std::string::npos);
    EXPECT_EQ(readFile(back).find("urn:"), std::string::npos);
    EXPECT_THAT(readFile(again), HasSubstr("urn:rtsg:material:Glass"));
    const std::string expected = rendered(metadata, "whitted");
    for (const std::string& scene : {there, back, again})
        EXPECT_TRUE(rendered(scene, "whitted") == expected) << readFile(scene);
}

// A program that does not know the urn takes the file.
TEST_F(PortableMaterials, TheFileBehindThemShowsOtherMaterials) {
    writeFile(folder / "materials.x3dv", readFile(RTSG_SOURCE_DIR "/examples/materials/materials.x3dv"));
    const std::string known = written("portable.x3dv", portable("urn:rtsg:material:"));
    const std::string unknown = written("unknown.x3dv", portable("urn:another:material:"));
    const std::string shown = rendered(unknown, "whitted");
    EXPECT_GT(shown.size(), 64u * 24 * 12);
    EXPECT_FALSE(shown == rendered(known, "whitted"));
}

}  // namespace
}  // namespace rtsg::test
