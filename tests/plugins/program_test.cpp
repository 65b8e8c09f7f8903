// The program with plug-ins, formats and tables of others: every verb has them, and what is missing is no status 0.
#include <cstdlib>

#include <gtest/gtest.h>

#include <rtsg/renderers/picture.h>

#include "app/program.h"
#include "test_plugins.h"

namespace rtsg::test {
namespace {

class WithPlugins : public CommandLine {
  protected:
    void SetUp() override {
        beginsAtZero = true;
        writeFile(folder / "own.x3dv", kOwn);
        writeFile(folder / "cloud.points", "0 0 0\n1 2 3\n\n4 5 six\n7 8 9\n");
        writeFile(folder / "inline.x3dv", "#X3D V4.0 utf8\nInline { url \"cloud.points\" }\n");
    }
    static std::string plugin(const std::string& name) { return std::string(RTSG_TEST_PLUGINS) + "/" + name + ".so"; }

    static constexpr const char* kOwn =
        "#X3D V4.0 utf8\nDEF S Spinner { turnsPerSecond 0.25 }\nDEF T Transform { children Shape { appearance "
        "Appearance { "
        "material Material { } } geometry Pane { } } }\nROUTE S.rotation_changed TO T.rotation\n";
    const std::string workshop = plugin("workshop");
};

TEST_F(WithPlugins, NodesActAndHaveGeometry) {
    const std::string own = folder / "own.x3dv";
    const Outcome run = rtsg({"run", own, "--plugin", workshop, "--for", "1s", "--fps", "1", "--watch", "T.rotation"});
    EXPECT_EQ(run.status, 0) << run.err;
    EXPECT_NE(run.out.find("\"value\":[0,1,0,1.5707"), std::string::npos) << run.out;
    EXPECT_NE(run.err.find("workshop: "), std::string::npos) << "its subscriber follows the scene";
    const Outcome info = rtsg({"info", own, "--plugin", workshop, "--json"});
    EXPECT_EQ(info.status, 0) << info.err;
    EXPECT_NE(info.out.find("\"triangles\":2"), std::string::npos) << info.out;
    EXPECT_EQ(info.err, "");
    const std::string spinner = std::string(RTSG_SOURCE_DIR) + "/examples/plugin/spinner.x3dv";
    const Outcome validate = rtsg({"validate", spinner, "--plugin", workshop});
    EXPECT_EQ(validate.status, 0);
    EXPECT_EQ(validate.err, "") << "its component is known";
    const Outcome render = rtsg({"render", own, "--plugin", workshop, "--size", "16x16", "-o", folder / "out.png"});
    EXPECT_EQ(render.status, 0) << render.err;
    const Outcome without = rtsg({"info", own, "--json"});
    EXPECT_NE(without.err.find("unknown node type Spinner"), std::string::npos);
}

TEST_F(WithPlugins, MeshSourcesAreInMeshFilesToo) {
    const Outcome stl = rtsg({"convert", folder / "own.x3dv", folder / "own.stl", "--plugin", workshop});
    EXPECT_EQ(stl.status, 0) << stl.err;
    EXPECT_EQ(readFile(folder / "own.stl").size(), 84u + 2 * 50) << "two triangles";
}

/// A green Pane in the middle of a picture that mirrors draw in tiles.
TEST_F(WithPlugins, MeshSourcesAreInTilesToo) {
    writeFile(folder / "green.x3dv",
              "#X3D V4.0 utf8\nShape { appearance Appearance { material UnlitMaterial { emissiveColor 0 1 0 } } "
              "geometry Pane { } }\n");
    const auto endpointOf = [](Program& program) {
        const std::string line = program.firstLine();
        const std::size_t from = line.find("tcp://");
        return from == line.npos ? line : line.substr(from, line.find('"', from) - from);
    };
    Program server({"serve", folder / "green.x3dv", "--bind", "tcp://127.0.0.1:*", "--plugin", workshop, "--json"},
                   streams());
    const std::string served = endpointOf(server);
    Program assembler({"assemble", "--live", "tcp://127.0.0.1:0", "--tiles", "2,1", "--json", "--for", "1s", "-o",
                       folder / "live%d.png"},
                      streams());
    Program mirror(
        {"mirror", served, "--tiles", endpointOf(assembler), "--size", "64x32", "--fps", "5", "--plugin", workshop},
        streams());
    const Outcome joined = assembler.wait();
    EXPECT_EQ(joined.status, 0) << joined.err;
    (void)mirror.wait();
    const auto picture = readPicture(folder / "live0.png");
    ASSERT_TRUE(picture) << picture.error().format();
    EXPECT_GT(picture->at(32, 16).g, .9f);
    EXPECT_LT(picture->at(32, 16).r, .1f);
}

TEST_F(WithPlugins, MeshSourcesThatThrowAreNamedAndTheRestIsDrawn) {
    writeFile(folder / "cone.x3dv",
              "#X3D V4.0 utf8\nShape { geometry DEF C Cone { } }\nShape { geometry Cone { } }\n"
              "Shape { appearance Appearance { material UnlitMaterial { emissiveColor 0 1 0 } } geometry Box { } }\n");
    const std::string cone = folder / "cone.x3dv", odd = plugin("odd_reader");
    for (const std::vector<std::string>& how :
         {std::vector<std::string>{"render", cone, "-o", folder / "cone.png"},
          {"run", cone, "--for", "0.1s", "--render", folder / "cone.png", "--force"},
          {"run", cone, "--for", "0.1s", "--live", "--render", folder / "cone.png", "--force"}}) {
        std::vector<std::string> all = how;
        all.insert(all.end(), {"--size", "9x9", "--plugin", odd});
        const Outcome created = rtsg(all);
        EXPECT_EQ(created.status, 1) << how[0] << created.err;
        const std::string reported = "Cone: its mesh source failed, and is asked no more: out of triangles";
        const std::size_t at = created.err.find(reported);
        EXPECT_NE(at, std::string::npos) << created.err;
        EXPECT_EQ(created.err.find(reported, at + 1), std::string::npos) << "once: " << created.err;
        const auto picture = readPicture(folder / "cone.png");
        ASSERT_TRUE(picture) << picture.error().format();
        EXPECT_GT(picture->at(4, 4).g, .9f) << how[0];
    }
    const Outcome stl = rtsg({"convert", cone, folder / "cone.stl", "--plugin", odd});
    EXPECT_EQ(stl.status, 1);
    EXPECT_NE(stl.err.find("Cone: its mesh source failed"), std::string::npos) << stl.err;
}

TEST_F(WithPlugins, ANodeRendererThatChangesThePicturesSizeIsAnError) {
    writeFile(folder / "cylinder.x3dv", "#X3D V4.0 utf8\nShape { geometry Cylinder { } }\n");
    const std::string cylinder = folder / "cylinder.x3dv", odd = plugin("odd_reader");
    for (const std::vector<std::string>& how :
         {std::vector<std::string>{"render", cylinder, "-o", folder / "c.png"},
          {"run", cylinder, "--for", "0.1s", "--live", "--render", folder / "d.png"}}) {
        std::vector<std::string> all = how;
        all.insert(all.end(), {"--size", "9x9", "--plugin", odd});
        const Outcome created = rtsg(all);
        EXPECT_EQ(created.status, 1) << how[0] << created.err;
        EXPECT_NE(created.err.find("a node renderer has changed the size of the picture"), std::string::npos)
            << created.err;
    }
}

// A node renderer draws on the scene's thread, so pictures beside the scene are made there, too.
TEST_F(WithPlugins, NodeRenderersDrawIntoLivePicturesAndTheWindow) {
    writeFile(folder / "ball.x3dv", "#X3D V4.0 utf8\nShape { geometry Sphere { } }\n");
    const std::string ball = folder / "ball.x3dv", drawing = plugin("drawing");
    ::setenv("SDL_VIDEODRIVER", "offscreen", 1);
    const auto isGreen = [&](const char* name) {
        const auto picture = readPicture(folder / name);
        if (!picture) return testing::AssertionFailure() << picture.error().format();
        const Vec4f& corner = picture->pixels[0];
        return corner.g > .9f && corner.r < .1f && corner.b < .1f
                   ? testing::AssertionSuccess()
                   : testing::AssertionFailure() << name << ": " << corner.r << " " << corner.g << " " << corner.b;
    };
    const Outcome still = rtsg({"run", ball, "--plugin", drawing, "--for", "0.2s", "--live", "--render",
                                folder / "still.png", "--size", "16x16"});
    EXPECT_EQ(still.status, 0) << still.err;
    EXPECT_TRUE(isGreen("still.png"));
    const Outcome film = rtsg({"run", ball, "--plugin", drawing, "--for", "0.3s", "--live", "--fps", "10", "--render",
                               folder / "film%d.png", "--size", "16x16"});
    EXPECT_EQ(film.status, 0) << film.err;
    EXPECT_TRUE(isGreen("film0.png"));
    const Outcome view = rtsg({"view", ball, "--plugin", drawing, "--for", "0.5s", "--mute", "--screenshot",
                               folder / "view.png", "--size", "32x32"});
    if (view.err.find("built without a window") == view.err.npos) {
        EXPECT_EQ(view.status, 0) << view.err;
        EXPECT_TRUE(isGreen("view.png"));
    }
}

TEST_F(WithPlugins, TablesAloneMakeTypesKnown) {
    const std::string table = std::string(RTSG_SOURCE_DIR) + "/examples/plugin/workshop.x3dspec",
                      own = folder / "own.x3dv";
    const Outcome run = rtsg({"run", own, "--nodes", table, "--for", "1s", "--hash"});
    EXPECT_EQ(run.status, 0) << run.err;
    EXPECT_EQ(run.err, "");
    const Outcome xml = rtsg({"convert", own, folder / "own.x3d", "--nodes", table});
    EXPECT_EQ(xml.status, 0) << xml.err;
    const Outcome back = rtsg({"convert", folder / "own.x3d", folder / "back.x3dv", "--nodes", table});
    EXPECT_EQ(back.status, 0) << back.err;
    EXPECT_NE(readFile(folder / "back.x3dv").find("DEF S Spinner {\n  turnsPerSecond 0.25\n}"), std::string::npos)
        << readFile(folder / "back.x3dv");
    EXPECT_EQ(rtsg({"convert", own, folder / "own.rtsgb", "--nodes", table}).status, 0);
    const Outcome state = rtsg({"convert", folder / "own.rtsgb", folder / "state.x3dv"});
    EXPECT_EQ(state.status, 0) << "the state has its types with it: " << state.err;
    EXPECT_NE(readFile(folder / "state.x3dv").find("Spinner"), std::string::npos);
}

TEST_F(WithPlugins, LogsHaveTheTypesAndReplayWithoutThePlugin) {
    const std::string log = folder / "own.rlog";
    const Outcome record = rtsg({"record", folder / "own.x3dv", "-o", log, "--for", "1s", "--plugin", workshop});
    EXPECT_EQ(record.status, 0) << record.err;
    const Outcome replay = rtsg({"replay", log, "--verify", "--json"});
    EXPECT_EQ(replay.status, 0) << replay.err;
    EXPECT_NE(replay.out.find("\"first_divergence\":null"), std::string::npos) << replay.out;
}

/// A program that lacks a field type keeps its bits, its hash and its numbers.
TEST_F(WithPlugins, FieldTypesAreRecordedReplayedAndMirroredWithEqualHashes) {
    const std::string crates = folder / "crates.x3dv", log = folder / "crates.rlog";
    writeFile(crates,
              "#X3D V4.0 utf8\nPROTO Pallet [ inputOutput SFQuantity load \"2 kg\" ] { Crate { weight IS load } }\n"
              "DEF A Crate { weight \"3.5 kg\" }\nDEF B Crate { }\nDEF P Pallet { load \"7 m\" }\n"
              "ROUTE A.weight TO B.weight\n");
    const Outcome run = rtsg({"run", crates, "--plugin", workshop, "--for", "1s", "--fps", "2", "--set",
                              "A.weight=\"9 s\"@0.5s", "--watch", "B.weight"});
    EXPECT_EQ(run.status, 0) << run.err;
    EXPECT_NE(run.out.find("\"value\":\"9 s\""), std::string::npos) << run.out;
    const Outcome record = rtsg(
        {"record", crates, "-o", log, "--for", "1s", "--fps", "2", "--plugin", workshop, "--set", "A.weight=9 3@0.5s"});
    EXPECT_EQ(record.status, 0) << record.err;
    const Outcome replay = rtsg({"replay", log, "--verify", "--json"});
    EXPECT_EQ(replay.status, 0) << replay.err;
    EXPECT_NE(replay.out.find("\"first_divergence\":null"), std::string::npos) << replay.out;
    const Outcome saved = rtsg({"replay", log, "--save", folder / "end.x3dv"});
    EXPECT_EQ(saved.status, 0) << saved.err;
    const std::string end = readFile(folder / "end.x3dv");
    EXPECT_NE(end.find("weight 9 3"), std::string::npos) << end;
    EXPECT_NE(end.find("SFQuantity load 2 2"), std::string::npos) << end;
    const Outcome again = rtsg({"info", folder / "end.x3dv", "--plugin", workshop});
    EXPECT_EQ(again.status, 0) << again.err;
    const Outcome binary = rtsg({"convert", crates, folder / "crates.rtsgb", "--plugin", workshop});
    EXPECT_EQ(binary.status, 0) << binary.err;
    const Outcome plain = rtsg({"convert", folder / "crates.rtsgb", folder / "plain.x3dv"});
    EXPECT_EQ(plain.status, 0) << plain.err;
    EXPECT_NE(readFile(folder / "plain.x3dv").find("weight 3.5 2"), std::string::npos)
        << readFile(folder / "plain.x3dv");
    Program server({"serve", crates, "--bind", "tcp://127.0.0.1:*", "--fps", "30", "--plugin", workshop, "--json"},
                   streams());
    const std::string line = server.firstLine();
    const std::size_t from = line.find("tcp://");
    ASSERT_NE(from, std::string::npos) << line;
    const std::string endpoint = line.substr(from, line.find('"', from) - from);
    const Outcome mirror = rtsg({"mirror", endpoint, "--for", "0.5s", "--json", "--save", folder / "mirrored.x3dv"});
    EXPECT_EQ(mirror.status, 0) << mirror.err;
    EXPECT_NE(mirror.out.find("\"equal\":true"), std::string::npos) << mirror.out;
    EXPECT_NE(readFile(folder / "mirrored.x3dv").find("load 7 1"), std::string::npos)
        << readFile(folder / "mirrored.x3dv");
}

/// Results that follow from the inputs alone are computed again, if the plug-in is there; otherwise there is an error.
TEST_F(WithPlugins, LogsOfInputsNeedThePluginOfADeterministicBehaviour) {
    const std::string log = folder / "own.rlog";
    const Outcome record =
        rtsg({"record", folder / "own.x3dv", "-o", log, "--for", "1s", "--mode", "input", "--plugin", workshop});
    EXPECT_EQ(record.status, 0) << record.err;
    const Outcome with = rtsg({"replay", log, "--verify", "--plugin", workshop});
    EXPECT_EQ(with.status, 0) << with.err;
    const Outcome without = rtsg({"replay", log, "--verify"});
    EXPECT_EQ(without.status, 1);
    EXPECT_NE(without.err.find("the behaviour of Spinner is not registered here"), std::string::npos) << without.err;
}

/// A mirror needs no plug-in for the types and what they do; for their triangles it has to be given one.
TEST_F(WithPlugins, MirrorsHaveTheTypesWithEqualHashes) {
    const std::string spinner = std::string(RTSG_SOURCE_DIR) + "/examples/plugin/spinner.x3dv";
    Program server({"serve", spinner, "--bind", "tcp://127.0.0.1:*", "--fps", "30", "--plugin", workshop, "--json"},
                   streams());
    const std::string line = server.firstLine();
    const std::size_t from = line.find("tcp://");
    ASSERT_NE(from, std::string::npos) << line;
    const std::string endpoint = line.substr(from, line.find('"', from) - from);
    for (const bool with : {false, true}) {
        std::vector<std::string> arguments{
            "mirror", endpoint, "--for", "0.5s", "--json", "--save", folder / (with ? "with.x3dv" : "without.x3dv")};
        if (with) arguments.insert(arguments.end(), {"--mode", "input", "--plugin", workshop});
        const Outcome mirror = rtsg(arguments);
        EXPECT_EQ(mirror.status, 0) << mirror.err;
        EXPECT_NE(mirror.out.find("\"equal\":true"), std::string::npos) << mirror.out;
        EXPECT_NE(readFile(arguments[6]).find("DEF SPINNER Spinner {"), std::string::npos) << readFile(arguments[6]);
    }
}

TEST_F(WithPlugins, FormatsAreThereForEveryVerbAndForInlines) {
    const std::string cloud = folder / "cloud.points";
    const Outcome info = rtsg({"info", cloud, "--plugin", workshop, "--json"});
    EXPECT_NE(info.out.find("\"nodes\":3"), std::string::npos) << info.out;
    EXPECT_NE(info.err.find("cloud.points:4:1: error: expected three numbers"), std::string::npos) << info.err;
    const Outcome convert = rtsg({"convert", cloud, folder / "cloud.x3dv", "--plugin", workshop});
    EXPECT_EQ(convert.status, 1) << "one line was left out";
    EXPECT_NE(readFile(folder / "cloud.x3dv").find("point [0 0 0, 1 2 3, 7 8 9]"), std::string::npos)
        << readFile(folder / "cloud.x3dv");
    const Outcome inlined = rtsg({"info", folder / "inline.x3dv", "--plugin", workshop, "--json"});
    EXPECT_NE(inlined.out.find("\"Rendering\":2"), std::string::npos) << inlined.out << inlined.err;
    const Outcome without = rtsg({"info", cloud});
    EXPECT_EQ(without.status, 1);
}

TEST_F(WithPlugins, AWriterHasItsNames) {
    const Outcome convert = rtsg({"convert", folder / "own.x3dv", folder / "own.dot", "--plugin", workshop});
    EXPECT_EQ(convert.status, 0) << convert.err;
    EXPECT_EQ(readFile(folder / "own.dot"),
              "digraph scene {\n  n0 [label=\"S Spinner\"];\n  n1 [label=\"T Transform\"];\n  n2 [label=\"Shape\"];\n"
              "  n1 -> n2 [label=\"children\"];\n  n3 [label=\"Appearance\"];\n  n2 -> n3 [label=\"appearance\"];\n"
              "  n4 [label=\"Material\"];\n  n3 -> n4 [label=\"material\"];\n  n5 [label=\"Pane\"];\n"
              "  n2 -> n5 [label=\"geometry\"];\n}\n");
    const Outcome without = rtsg({"convert", folder / "own.x3dv", folder / "more.dot"});
    EXPECT_EQ(without.status, 2) << without.err;
    const Outcome tired =
        rtsg({"convert", folder / "own.x3dv", folder / "own.tired", "--plugin", plugin("odd_reader")});
    EXPECT_EQ(tired.status, 1);
    EXPECT_NE(tired.err.find("the writer of tired files failed: too many nodes"), std::string::npos) << tired.err;
    EXPECT_FALSE(std::filesystem::exists(folder / "own.tired"));
}

TEST_F(WithPlugins, WhatCannotBeLoadedIsNamedAndTheRestGoesOn) {
    writeFile(folder / "bad.x3dspec", "component Own\nnode A level\n");
    const Outcome info = rtsg({"info", folder / "own.x3dv", "--json", "--plugin", folder / "none.so", "--plugin",
                               plugin("odd_throws"), "--plugin", workshop, "--nodes", folder / "bad.x3dspec"});
    EXPECT_EQ(info.status, 1);
    EXPECT_NE(info.err.find("none.so: error: it cannot be loaded: No such file or directory [plug-in]"),
              std::string::npos)
        << info.err;
    EXPECT_NE(info.err.find("odd_throws.so: error: it failed: no licence [plug-in]"), std::string::npos) << info.err;
    EXPECT_NE(info.err.find("bad.x3dspec:2: error: "), std::string::npos) << info.err;
    EXPECT_NE(info.out.find("\"triangles\":2"), std::string::npos) << "the plug-in that is as it should be";
}

TEST_F(WithPlugins, TheEnvironmentNamesPluginsForScenesOfOnesOwnOnly) {
    ASSERT_EQ(::setenv("RTSG_PLUGINS", (workshop + ":" + (folder / "none.so")).c_str(), 1), 0);
    const Outcome info = rtsg({"info", folder / "own.x3dv", "--json"});
    const std::string log = folder / "own.rlog";
    const Outcome record = rtsg({"record", folder / "own.x3dv", "-o", log, "--for", "0.1s"});
    const Outcome replay = rtsg({"replay", log, "--verify"});
    ::unsetenv("RTSG_PLUGINS");
    EXPECT_EQ(info.status, 1) << "one of them is missing";
    EXPECT_NE(info.out.find("\"triangles\":2"), std::string::npos) << info.out;
    EXPECT_NE(record.err.find("none.so: error: "), std::string::npos);
    EXPECT_EQ(replay.status, 0) << replay.err;
    EXPECT_EQ(replay.err, "") << "a log is of others: nothing was loaded for it";
}

}  // namespace
}  // namespace rtsg::test
