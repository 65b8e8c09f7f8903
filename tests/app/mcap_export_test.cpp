// rtsg replay --export: what an independent reader of MCAP, in Python, finds in it.
#include "program.h"
#include "test_paths.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
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
        const Outcome recorded = rtsg(atZero({"record", file, "-o", log, "--for", duration, "--fps", "10"}));
        EXPECT_EQ(recorded.status, 0) << recorded.err;
        const Outcome created = rtsg({"replay", "--json", log, "--export", mcap, "--export-plain"});
        EXPECT_EQ(created.status, 0) << created.err;
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

struct Vec {
    double x = 0, y = 0, z = 0;
    friend Vec operator-(Vec a, Vec b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
    friend Vec operator+(Vec a, Vec b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
    friend Vec operator*(double s, Vec a) { return {s * a.x, s * a.y, s * a.z}; }
};
double dot(Vec a, Vec b) {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}
Vec cross(Vec a, Vec b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
Vec vec(const json& v) {
    return {v["x"], v["y"], v["z"]};
}

using Triangle = std::array<Vec, 3>;

/// Triangles of an entity in the world, as a viewer of the file has them.
std::vector<Triangle> inWorld(const json& entity, const json& frame) {
    const Vec at = vec(frame["translation"]), q = vec(frame["rotation"]);
    const double w = frame["rotation"]["w"];
    std::vector<Vec> points;
    for (const json& p : entity["triangles"][0]["points"]) {
        const Vec v = vec(p), u = cross(q, v);
        points.push_back(at + v + 2 * w * u + 2 * cross(q, u));
    }
    std::vector<Triangle> triangles;
    const json& indices = entity["triangles"][0]["indices"];
    for (std::size_t i = 0; i + 2 < indices.size(); i += 3)
        triangles.push_back({points[indices[i]], points[indices[i + 1]], points[indices[i + 2]]});
    return triangles;
}

/// How far along the ray the first of them is; infinite if none.
double distance(const std::vector<Triangle>& triangles, Vec from, Vec along) {
    double nearest = INFINITY;
    for (const auto& [a, b, c] : triangles) {
        const Vec normal = cross(b - a, c - a);
        const double s = dot(normal, a - from) / dot(normal, along);
        const Vec p = from + s * along;
        const bool inside = dot(cross(b - a, p - a), normal) >= 0 && dot(cross(c - b, p - b), normal) >= 0 &&
                            dot(cross(a - c, p - c), normal) >= 0;
        if (s > 0 && inside) nearest = std::min(nearest, s);
    }
    return nearest;
}

/// A sheet of 10 x 10 m that lies at z = -9 in the file, and at z = -3, as soon as the clock runs: moved by its
/// Transform, by its coordinates, or as the skin of a humanoid.
std::string sheet(const std::string& kind) {
    const std::string look = "appearance Appearance { material Material { diffuseColor 0 0 0 emissiveColor 1 1 1 } }";
    const std::string points = "-5 -5 -9, 5 -5 -9, 5 5 -9, -5 5 -9";
    const std::string set = look + " geometry IndexedFaceSet { solid FALSE coordIndex [ 0 1 2 3 -1 ] coord ";
    std::string text = R"(#X3D V4.0 utf8
PROFILE Full
NavigationInfo { headlight FALSE }
Viewpoint { position 0 0 4 fieldOfView 1.4 }
Sound { location 1 0 2 maxFront 100 maxBack 100 minFront 100 minBack 100 spatialize TRUE source AudioClip { url "none.wav" loop TRUE } }
DEF CLOCK TimeSensor { cycleInterval 10 loop TRUE }
)";
    if (kind == "transform")
        text += "DEF T Transform { children DEF SHEET Shape { " + set + "Coordinate { point [ " + points + R"( ] } } } }
DEF MOVE PositionInterpolator { key [ 0 1 ] keyValue [ 0.25 0 6, 0.25 0 6 ] }
ROUTE CLOCK.fraction_changed TO MOVE.set_fraction
ROUTE MOVE.value_changed TO T.set_translation
)";
    if (kind == "coordinates")
        text += "DEF SHEET Shape { " + set + "DEF C Coordinate { point [ " + points + R"( ] } } }
DEF MOVE CoordinateInterpolator { key [ 0 1 ] keyValue [ -4.75 -5 -3, 5.25 -5 -3, 5.25 5 -3, -4.75 5 -3, -4.75 -5 -3, 5.25 -5 -3, 5.25 5 -3, -4.75 5 -3 ] }
ROUTE CLOCK.fraction_changed TO MOVE.set_fraction
ROUTE MOVE.value_changed TO C.set_point
)";
    if (kind == "skin")
        text += "HAnimHumanoid { skinCoord DEF C Coordinate { point [ " + points + R"( ] }
  skeleton DEF JOINT HAnimJoint { skinCoordIndex [ 0 1 2 3 ] skinCoordWeight [ 1 1 1 1 ] }
  joints USE JOINT
  skin DEF SHEET Shape { )" +
                set + R"(USE C } } }
DEF MOVE PositionInterpolator { key [ 0 1 ] keyValue [ 0.25 0 6, 0.25 0 6 ] }
ROUTE CLOCK.fraction_changed TO MOVE.set_fraction
ROUTE MOVE.value_changed TO JOINT.set_translation
)";
    return text;
}

class Whereabouts : public McapExport, public testing::WithParamInterface<const char*> {
  protected:
    std::vector<Triangle> triangles;
    void SetUp() override {
        McapExport::SetUp();
        if (IsSkipped()) return;
        const Exported found = exported(sheet(GetParam()), "0s");
        ASSERT_FALSE(found.scenes.empty());
        const json entity = named(found.scenes.back()["message"]["entities"], "id", "SHEET");
        ASSERT_TRUE(entity.contains("triangles")) << entity;
        triangles = inWorld(entity, named(found.frames.back()["message"]["transforms"], "child_frame_id", "SHEET"));
        ASSERT_EQ(triangles.size(), 2u);
    }
};

TEST_P(Whereabouts, AreTheSameInExportAndPick) {
    for (const Vec from : {Vec{0, 0, 4}, Vec{-4.7, 4.9, 4}, Vec{5.2, -4.9, 1}, Vec{-4.9, 0, 4}}) {
        const double expected = distance(triangles, from, {0, 0, -1});
        const auto text = [](double v) { return std::to_string(v); };
        const Outcome picked =
            rtsg({"pick", file, "--json", "--ray", text(from.x), text(from.y), text(from.z), "0", "0", "-1"});
        const json pick = json::parse(picked.out);
        ASSERT_EQ(pick["hit"], std::isfinite(expected)) << picked.out << from.x;
        if (pick["hit"]) {
            EXPECT_NEAR(pick["distance_m"], expected, 1e-5);
        }
    }
    EXPECT_NEAR(distance(triangles, {0, 0, 4}, {0, 0, -1}), 7, 1e-5);  // and not where the file has it
}

TEST_P(Whereabouts, AreTheSameInExportAndPicture) {
    const int n = 64;
    const std::string out = folder / "p.pfm";
    const Outcome created = rtsg({"render", file, "-o", out, "--size", "64x64", "--spp", "1"});
    ASSERT_EQ(created.status, 0) << created.err;
    const std::string bytes = readFile(out);
    const std::size_t size = std::size_t{n} * n * 3 * sizeof(float);
    ASSERT_GT(bytes.size(), size);
    std::vector<float> pixels(std::size_t{n} * n * 3);
    std::memcpy(pixels.data(), bytes.data() + bytes.size() - size, size);  // rows from the bottom up
    int lit = 0, compared = 0;
    for (int y = 0; y < n; ++y)
        for (int x = 0; x < n; ++x) {
            // All four corners of the pixel say the same, or it lies on the edge.
            int hits = 0;
            for (int corner = 0; corner < 4; ++corner) {
                const double step = 2 * std::tan(.7) / n;
                const Vec along{(x + corner % 2 - n / 2) * step, (y + corner / 2 - n / 2) * step, -1};
                hits += std::isfinite(distance(triangles, {0, 0, 4}, along));
            }
            if (hits % 4 != 0) continue;
            ++compared;
            const bool seen = pixels[static_cast<std::size_t>(3 * (y * n + x))] > .5f;
            lit += seen;
            EXPECT_EQ(seen, hits == 4) << "pixel " << x << ", " << y;
        }
    EXPECT_GT(compared, n * n * 9 / 10);
    EXPECT_GT(lit, n * n / 2);  // at its place in the file it would fill a fifth
}

TEST_P(Whereabouts, AreTheSameInExportAndSound) {
    const std::string out = folder / "ir.wav";
    const Outcome heard = rtsg({"listen", file, "--ir", out, "--rays", "1000"});
    ASSERT_EQ(heard.status, 0) << heard.err;
    const std::string bytes = readFile(out);
    const std::size_t data = bytes.find("data") + 8;
    std::vector<float> response((bytes.size() - data) / sizeof(float));
    std::memcpy(response.data(), bytes.data() + data, response.size() * sizeof(float));
    // Directly, and by the mirror image of the source in the sheet, as the export has it.
    const Vec listener{0, 0, 4}, source{1, 0, 2};
    const double z = listener.z - distance(triangles, listener, {0, 0, -1});
    const Vec image{source.x, source.y, 2 * z - source.z};
    const double direct = std::sqrt(dot(source - listener, source - listener)),
                 echo = std::sqrt(dot(image - listener, image - listener));
    const auto peak = [&](std::size_t from, std::size_t to) {
        const auto begin = response.begin() + static_cast<std::ptrdiff_t>(from);
        const auto end = response.begin() + static_cast<std::ptrdiff_t>(std::min(to, response.size()));
        return static_cast<double>(std::ranges::max_element(begin, end, {}, [](float v) { return std::abs(v); }) -
                                   response.begin());
    };
    const double first = peak(0, response.size());
    const double second = peak(static_cast<std::size_t>(first) + 480, response.size());
    // 48 samples are 36 cm of path; at its place in the file the sheet would answer 12 m later.
    EXPECT_NEAR(second - first, first / direct * (echo - direct), 48);
}

INSTANTIATE_TEST_SUITE_P(Sheets, Whereabouts, testing::Values("transform", "coordinates", "skin"),
                         [](const auto& kind) { return std::string(kind.param); });

TEST_F(McapExport, AShapeHasTheColourThatItsMaterialHasNow) {
    // The material changes with every frame; at .5 s BALL gets another appearance, and after that its material's
    // changes.
    const Exported found = exported(R"(#X3D V4.0 utf8
PROFILE Immersive
DEF CUBE Shape { appearance Appearance { material DEF PAINT Material { } } geometry Box { } }
DEF BALL Shape { appearance Appearance { material Material { diffuseColor 0 0 1 } } geometry Sphere { } }
DEF CLOCK TimeSensor { cycleInterval 1000 loop TRUE }
DEF HUE ColorInterpolator { key [ 0 0.001 ] keyValue [ 0 0 0, 1 0 0 ] }
DEF WHEN BooleanSequencer { key [ 0 0.0005 ] keyValue [ FALSE TRUE ] }
DEF SWAP Script { initializeOnly SFNode ball USE BALL initializeOnly SFNode paint USE PAINT inputOnly SFBool now
  initializeOnly SFNode other Appearance { material USE PAINT } directOutput TRUE
  url "ecmascript: function now(yes) { if (yes) ball.appearance = other; }" }
ROUTE CLOCK.fraction_changed TO HUE.set_fraction
ROUTE CLOCK.fraction_changed TO WHEN.set_fraction
ROUTE HUE.value_changed TO PAINT.set_diffuseColor
ROUTE WHEN.value_changed TO SWAP.now
)",
                                    "1s");
    ASSERT_FALSE(found.scenes.empty());
    for (const json& message : found.scenes) {
        const double t = message["time"].get<double>() * 1e-9;
        const json cube = named(message["message"]["entities"], "id", "CUBE"),
                   ball = named(message["message"]["entities"], "id", "BALL");
        if (t == 0) continue;  // loaded, and not run yet
        EXPECT_NEAR(cube["cubes"][0]["color"]["r"], t, 1e-6);
        const json blue{{"r", 0.}, {"g", 0.}, {"b", 1.}, {"a", 1.}};
        EXPECT_EQ(ball["spheres"][0]["color"], t > .49 ? cube["cubes"][0]["color"] : blue) << t;
    }
    EXPECT_GE(found.scenes.size(), 10u);
}

TEST_F(McapExport, AShapeThatIsScaledGrowsInItsFrame) {
    const Exported found = exported(R"(#X3D V4.0 utf8
PROFILE Immersive
DEF T Transform { children DEF CUBE Shape { geometry Box { size 1 1 1 } } }
DEF CLOCK TimeSensor { cycleInterval 1000 loop TRUE }
DEF GROW PositionInterpolator { key [ 0 1 ] keyValue [ 1 1 1, 1001 2001 1 ] }
ROUTE CLOCK.fraction_changed TO GROW.set_fraction
ROUTE GROW.value_changed TO T.set_scale
)",
                                    "1s");
    ASSERT_GE(found.scenes.size(), 10u);
    for (const json& message : found.scenes) {
        const double t = message["time"].get<double>() * 1e-9;
        expectVector(named(message["message"]["entities"], "id", "CUBE")["cubes"][0]["size"], 1 + t, 1 + 2 * t, 1);
    }
}

/// Two sessions in one log, the second of which begins at 0 again: messages go on in time.
TEST_F(McapExport, SessionsThatBeginEarlierFollowEachOther) {
    const std::string log = folder / "both.rlog", one = folder / "one.rlog", two = folder / "two.rlog";
    writeFile(file, scene());
    // Sessions of other options are others, whatever their clock says.
    ASSERT_EQ(rtsg(atZero({"record", file, "-o", one, "--for", "1s", "--fps", "5"})).status, 0);
    ASSERT_EQ(rtsg(atZero({"record", file, "-o", two, "--for", "1s", "--fps", "10"})).status, 0);
    writeFile(log, readFile(one) + readFile(two));
    const std::string mcap = folder / "both.mcap", lines = folder / "both.lines";
    ASSERT_EQ(rtsg({"replay", log, "--export", mcap, "--export-plain"}).status, 0);
    const std::string command =
        "python3 " RTSG_SOURCE_DIR "/tests/app/mcap_reader.py " + mcap + " > " + lines + " 2>&1";
    ASSERT_EQ(std::system(command.c_str()), 0) << readFile(lines);
    EXPECT_THAT(readFile(lines), testing::HasSubstr("\"time\": 2000000000")) << "of the last state";
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
