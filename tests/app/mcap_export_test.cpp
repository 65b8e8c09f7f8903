// rtsg replay --export: what an independent reader of MCAP, in Python, finds in it.
#include "program.h"
#include "test_paths.h"

#include <sstream>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

namespace rtsg::test {
namespace {

using nlohmann::json;

class McapExport : public CommandLine {
  protected:
    struct Exported {
        std::vector<json> frames, scenes, changes;
        json summary;
    };
    Exported exported(const std::string& text, const std::string& duration) {
        Exported result;
        writeFile(file, text);
        const std::string log = folder / "a.rlog", mcap = folder / "a.mcap", lines = folder / "lines";
        const Outcome recorded = rtsg({"record", file, "-o", log, "--for", duration, "--fps", "10"});
        EXPECT_EQ(recorded.status, 0) << recorded.err;
        const Outcome made = rtsg({"replay", "--json", log, "--export", mcap, "--export-plain"});
        EXPECT_EQ(made.status, 0) << made.err;
        const std::string command =
            "python3 " RTSG_SOURCE_DIR "/tests/app/mcap_reader.py " + mcap + " > " + lines + " 2>&1";
        EXPECT_EQ(std::system(command.c_str()), 0) << readFile(lines);
        std::istringstream in(readFile(lines));
        for (std::string line; std::getline(in, line);) {
            json value = json::parse(line, nullptr, false);
            if (!value.contains("topic"))
                result.summary = value;
            else if (value["topic"] == "/tf")
                result.frames.push_back(value);
            else if (value["topic"] == "/scene")
                result.scenes.push_back(value);
            else
                result.changes.push_back(value);
        }
        return result;
    }
    void SetUp() override {
        if (std::system("python3 -c '' 2>/dev/null") != 0) GTEST_SKIP() << "python3 is not installed";
    }
    static json named(const json& list, const char* key, const std::string& part) {
        for (const json& entry : list)
            if (entry[key].get<std::string>().find(part) != std::string::npos) return entry;
        ADD_FAILURE() << "nothing named " << part << " in " << list;
        return {};
    }
    static void expectVector(const json& found, double x, double y, double z) {
        EXPECT_NEAR(found["x"], x, 1e-6);
        EXPECT_NEAR(found["y"], y, 1e-6);
        EXPECT_NEAR(found["z"], z, 1e-6);
    }
};

TEST_F(McapExport, AMovingBoxMovesItsFrameAndNothingElse) {
    const Exported found = exported(scene(), "1s");
    EXPECT_EQ(found.summary["topics"]["/tf"]["schema"], "foxglove.FrameTransforms");
    EXPECT_EQ(found.summary["topics"]["/scene"]["schema"], "foxglove.SceneUpdate");
    // The loaded scene, then eleven frames.
    ASSERT_EQ(found.changes.size(), 12u);
    EXPECT_EQ(found.scenes.size(), 1u);
    ASSERT_GE(found.frames.size(), 10u);
    for (const json& message : found.frames) {
        const double t = message["time"].get<double>() * 1e-9;
        // BOX goes from 0 to 2 in two seconds; its sound goes along.
        const json box = named(message["message"]["transforms"], "child_frame_id", "BOX/");
        EXPECT_EQ(box["parent_frame_id"], "world");
        expectVector(box["translation"], t, 0, 0);
    }
    const json changes = found.changes.back()["message"];
    EXPECT_EQ(changes["t"], 1.0);
    EXPECT_EQ(changes["hash"].get<std::string>().size(), 32u);
    const json move = named(changes["changes"], "field", "translation");
    EXPECT_EQ(move["node"], "BOX");
    EXPECT_EQ(move["value"], json::array({1.0, 0.0, 0.0}));
    EXPECT_EQ(move["external"], false);
}

TEST_F(McapExport, ShapesComeInTheirFramesWithWhatFramesCannotSay) {
    const Exported found = exported(R"(#X3D V4.0 utf8
PROFILE Immersive
Transform { translation 1 2 3 rotation 0 0 1 1.5707963 scale 2 3 4 children [
  DEF CUBE Shape { appearance Appearance { material Material { diffuseColor 1 0.5 0.25 transparency 0.25 } } geometry Box { size 1 1 1 } }
  DEF BALL Shape { geometry Sphere { radius 0.5 } }
] }
DEF POST Shape { geometry Cylinder { radius 0.5 height 3 } }
DEF HAT Shape { geometry Cone { bottomRadius 2 height 5 } }
Transform { scale 2 1 1 children Transform { rotation 0 0 1 0.7853982 children
  DEF SHEARED Shape { geometry Box { size 2 2 2 } } } }
DEF TRIANGLE Shape { geometry IndexedTriangleSet { index [ 0 1 2 ] coord Coordinate { point [ 0 0 0, 1 0 0, 0 1 0 ] } } }
)",
                                    "0s");
    ASSERT_FALSE(found.scenes.empty());
    ASSERT_FALSE(found.frames.empty());
    const json entities = found.scenes[0]["message"]["entities"], frames = found.frames[0]["message"]["transforms"];
    EXPECT_EQ(entities.size(), 6u);
    EXPECT_EQ(found.scenes[0]["message"]["deletions"][0]["type"], 1);

    const json cube = named(entities, "id", "CUBE"), frame = named(frames, "child_frame_id", "CUBE");
    EXPECT_EQ(cube["frame_id"], frame["child_frame_id"]);
    EXPECT_EQ(cube["frame_locked"], true);
    expectVector(frame["translation"], 1, 2, 3);
    EXPECT_NEAR(frame["rotation"]["z"], std::sqrt(.5), 1e-6);
    EXPECT_NEAR(frame["rotation"]["w"], std::sqrt(.5), 1e-6);
    expectVector(cube["cubes"][0]["size"], 2, 3, 4);
    EXPECT_EQ(cube["cubes"][0]["color"], json({{"r", 1.0}, {"g", .5}, {"b", .25}, {"a", .75}}));
    expectVector(named(entities, "id", "BALL")["spheres"][0]["size"], 2, 3, 4);

    // Upright: the viewer's cylinders stand along z, X3D's along y.
    const json post = named(entities, "id", "POST")["cylinders"][0], hat = named(entities, "id", "HAT")["cylinders"][0];
    expectVector(post["size"], 1, 1, 3);
    EXPECT_NEAR(post["pose"]["orientation"]["x"], -std::sqrt(.5), 1e-6);
    EXPECT_NEAR(post["pose"]["orientation"]["w"], std::sqrt(.5), 1e-6);
    EXPECT_EQ(post["top_scale"], 1);
    expectVector(hat["size"], 4, 4, 5);
    EXPECT_EQ(hat["top_scale"], 0);

    // Its corners in the world: the square turned by 45 degrees has its tip at sqrt 2, and the outer scale doubles x.
    const json sheared = named(entities, "id", "SHEARED"), turned = named(frames, "child_frame_id", "SHEARED");
    const double z = turned["rotation"]["z"], w = turned["rotation"]["w"];
    double widest = 0, highest = 0;
    for (const json& p : sheared["triangles"][0]["points"]) {
        const double x = p["x"], y = p["y"], c = w * w - z * z, s = 2 * w * z;
        widest = std::max(widest, c * x - s * y);
        highest = std::max(highest, s * x + c * y);
    }
    EXPECT_NEAR(widest, 2 * std::sqrt(2.), 1e-5);
    EXPECT_NEAR(highest, std::sqrt(2.), 1e-5);

    const json triangle = named(entities, "id", "TRIANGLE")["triangles"][0];
    EXPECT_EQ(triangle["indices"], json::array({0, 1, 2}));
    ASSERT_EQ(triangle["points"].size(), 3u);
    expectVector(triangle["points"][1], 1, 0, 0);
}

TEST_F(McapExport, AFileThatCannotBeWrittenIsAnError) {
    writeFile(file, scene());
    const std::string log = folder / "a.rlog";
    ASSERT_EQ(rtsg({"record", file, "-o", log, "--for", "0.1s"}).status, 0);
    EXPECT_EQ(rtsg({"replay", "--json", log, "--export", folder / "no/such/a.mcap"}).status, 1);
    const Outcome full = rtsg({"replay", "--json", log, "--export", "/dev/full"});
    EXPECT_EQ(full.status, 1);
    EXPECT_THAT(full.err, testing::HasSubstr("No space left"));
}

}  // namespace
}  // namespace rtsg::test
