// Tables of materials: what they say, what is wrong in them, and which surfaces get what.
#include <string>

#include <gtest/gtest.h>

#include <rtsg/audio/material_table.h>

#include "audio/listen/listen_scene.h"
#include "geometry/world_geometry.h"

namespace rtsg {
namespace {

TEST(MaterialTable, HasOctavesAndScattering) {
    const auto table = MaterialTable::parse(
        "\xEF\xBB\xBF# of a catalogue\n\nname, 125, 500, 1k, 4000 Hz, scattering, scattering 4k\r\n"
        "heavy curtain, .1, .3, .5, .7, .2, .6  # drawn\n  brick,0,.02,.03,,, \n",
        "a.csv");
    ASSERT_TRUE(table) << table.error().format();
    ASSERT_EQ(table->rows().size(), 2u);
    const AcousticMaterial* curtain = table->find("heavy curtain");
    ASSERT_TRUE(curtain);
    EXPECT_EQ(curtain->absorption, (Bands{.1, .1, .1, .1, .3, .5, .5, .7, .7, .7}));
    EXPECT_EQ(curtain->scattering, (Bands{.2, .2, .2, .2, .2, .2, .2, .6, .2, .2}));
    const AcousticMaterial* brick = table->find("brick");
    ASSERT_TRUE(brick);
    EXPECT_EQ(brick->absorption, (Bands{0, 0, 0, 0, .02, .03, .03, .03, .03, .03}));
    EXPECT_EQ(brick->scattering, allBands(.1));
    EXPECT_EQ(brick->transmission, allBands(0));
    EXPECT_FALSE(table->find("curtain"));
    EXPECT_TRUE(MaterialTable::parse("500;name\n.5;a, b\n", "")->find("a, b"));
    EXPECT_TRUE(MaterialTable::parse("name\t500\nx\t1", "")->find("x"));
}

TEST(MaterialTable, SaysWhereItIsWrong) {
    const auto wrong = [](const std::string& text) {
        const auto table = MaterialTable::parse(text, "a.csv");
        return table ? "nothing" : table.error().format();
    };
    EXPECT_NE(wrong("name, 125, loudness\n").find("a.csv:1:12: error: 'loudness' is no column"), std::string::npos);
    EXPECT_NE(wrong("name, 126\n").find("a.csv:1:7:"), std::string::npos);
    EXPECT_NE(wrong("125, 500\n").find("a.csv:1:1: error: no column is called name"), std::string::npos);
    EXPECT_NE(wrong("name, scattering\n").find("no column is an octave"), std::string::npos);
    EXPECT_NE(wrong("name,500\na,.5\n\nb,1.5\n").find("a.csv:4:3: error: '1.5' is no share"), std::string::npos);
    EXPECT_NE(wrong("name,500\na,x\n").find("'x' is no share"), std::string::npos);
    EXPECT_NE(wrong("name,500\na,.5,.6\n").find("a.csv:2:1: error: 3 values, and there are 2 columns"),
              std::string::npos);
    EXPECT_NE(wrong("name,500\na,.5\na,.6\n").find("a.csv:3:1: error: 'a' is there already, in line 2"),
              std::string::npos);
    EXPECT_NE(wrong("name,500\n,.5\n").find("without a name"), std::string::npos);
    EXPECT_NE(wrong("name,500\na,\n").find("no absorption"), std::string::npos);
    EXPECT_NE(wrong("name,500\n").find("without materials"), std::string::npos);
    EXPECT_NE(wrong("").find("an empty table"), std::string::npos);
    EXPECT_FALSE(MaterialTable::read("/no/such/table.csv"));
}

using MaterialsOfScene = test::Listen;

/// By the DEF of AcousticProperties, of an Appearance without any, of a Material and of an instance of a prototype, and
/// by metadata, which go first.
TEST_F(MaterialsOfScene, SurfacesAreMadeOfWhatTheyHaveTheNameOf) {
    const auto wall = [](const std::string& appearance, double z) {
        return "Transform { translation 0 0 " + std::to_string(z) + " children Shape { appearance " + appearance +
               " geometry Box { size 4 4 .1 } } }\n";
    };
    Scene scene;
    load(
        scene,
        "PROTO Skin [ ] { Material { } }\n"
        "Sound { maxBack 90 maxFront 90 source AudioClip { url \"impulse.wav\" } }\nViewpoint { position 0 0 1 }\n" +
            wall("Appearance { acousticProperties DEF brick AcousticProperties { absorption .9 } }", 10) +
            wall("DEF curtain Appearance { acousticProperties AcousticProperties { absorption .9 } }", 20) +
            wall("Appearance { material DEF wood Material { } }", 30) +
            wall("Appearance { material DEF skin Skin { } }", 40) +
            wall("DEF brick2 Appearance { metadata MetadataString { name \"acousticMaterial\" value \"wood\" } }", 50) +
            wall("Appearance { metadata MetadataSet { value MetadataString { name \"acousticMaterial\" value \"fur\" } "
                 "} }",
                 60) +
            wall("Appearance { acousticProperties AcousticProperties { absorption .7 } }", 70));
    SharedWorld world(scene);
    ListenOptions asked = options();
    auto table =
        MaterialTable::parse("name,500\nbrick,.01\ncurtain,.02\nwood,.03\nskin,.04\nbrick2,.05\nglass,.06\n", "m.csv");
    ASSERT_TRUE(table);
    asked.render.materials = std::make_shared<const MaterialTable>(std::move(*table));
    SoundRenderer sound(world, asked);
    ASSERT_TRUE(sound.renderFrame());
    const OpenedGeometry room = sound.room({0, 0, 0});
    const auto absorbs = [&](double z) {
        AcousticHit hit;
        EXPECT_TRUE(room.closest({0, 0, z - 1}, {0, 0, 1}, 5, kNoPlane, hit));
        return room.materials()[hit.material].absorption[4];
    };
    EXPECT_EQ(absorbs(10), .01);
    EXPECT_EQ(absorbs(20), .02);
    EXPECT_EQ(absorbs(30), .03);
    EXPECT_EQ(absorbs(40), .04);
    EXPECT_EQ(absorbs(50), .03);
    EXPECT_EQ(absorbs(60), AcousticMaterial().absorption[4]);
    EXPECT_NEAR(absorbs(70), .7, 1e-6);
    // Changes of fields have no effect while the table has the material.
    ASSERT_TRUE(scene.set(scene.findName("brick"), x3d::AcousticProperties::absorption, .5f));
    scene.newFrame(1);
    ASSERT_TRUE(sound.renderFrame());
    EXPECT_EQ(absorbs(10), .01);
    const ListenReport report = sound.finish();
    std::string said;
    for (const Diagnostic& diagnostic : report.diagnostics.all()) said += diagnostic.format() + "\n";
    EXPECT_NE(said.find("the table of materials has no 'fur'"), std::string::npos) << said;
    EXPECT_NE(said.find("m.csv:6:1: warning: nothing in the scene is made of 'brick2'"), std::string::npos) << said;
    EXPECT_NE(said.find("m.csv:7:1: warning: nothing in the scene is made of 'glass'"), std::string::npos) << said;
    EXPECT_EQ(said.find("made of 'wood'"), std::string::npos) << said;
}

}  // namespace
}  // namespace rtsg
