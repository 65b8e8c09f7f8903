// The interface for scripts: exit statuses, diagnostics on standard error, JSON on standard output.
#include "program.h"

#include <cstdlib>
#include <filesystem>
#include <map>
#include <sstream>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

namespace rtsg::test {
namespace {

using nlohmann::json;
using testing::ContainsRegex;
using testing::HasSubstr;

std::vector<json> jsonLines(const std::string& text) {
    std::vector<json> lines;
    std::istringstream in(text);
    for (std::string line; std::getline(in, line);) lines.push_back(json::parse(line));
    return lines;
}

using Usage = CommandLine;

TEST_F(Usage, EveryVerbHasHelpWithAnExample) {
    for (const char* verb : {"info", "validate", "convert", "run", "render", "listen", "serve", "mirror", "record",
                             "replay", "pick", "bench"}) {
        const Outcome help = rtsg({verb, "--help"});
        EXPECT_EQ(help.status, 0) << verb;
        EXPECT_THAT(help.out, HasSubstr("Example: rtsg " + std::string(verb))) << verb;
    }
}

TEST_F(Usage, PickAnswersAsJson) {
    const std::string scene = folder / "ball.x3dv";
    std::ofstream(scene) << "#X3D V4.0 utf8\nPROFILE Interchange\nDEF T Transform { translation 1 0 0 children DEF B "
                            "Shape { geometry Box { } } }\n";
    const json ray = json::parse(rtsg({"pick", scene, "--json", "--ray", "1", "0", "5", "0", "0", "-1"}).out);
    EXPECT_EQ(ray["hit"], true);
    EXPECT_EQ(ray["path"], (json{"T", "B"}));
    EXPECT_NEAR(ray["distance_m"].get<double>(), 4, 1e-6);
    const json sweep =
        json::parse(rtsg({"pick", scene, "--json", "--sweep", "-5", "0", "0", "0.5", "9", "0", "0"}).out);
    EXPECT_NEAR(sweep["distance_m"].get<double>(), 4.5, 1e-9);
    const json nothing = json::parse(rtsg({"pick", scene, "--json", "--ray", "1", "0", "5", "0", "0", "1"}).out);
    EXPECT_EQ(nothing["hit"], false);
    const json seen = json::parse(rtsg({"pick", scene, "--json", "--pixel", "60", "45", "--size", "120x90"}).out);
    EXPECT_EQ(seen["path"], (json{"T", "B"}));
    EXPECT_EQ(json::parse(rtsg({"pick", scene, "--json", "--pixel", "1", "1", "--size", "120x90"}).out)["hit"], false);
    EXPECT_EQ(rtsg({"pick", scene, "--pixel", "1", "1", "--size", "12"}).status, 2);
    for (const auto& [x, y] : {std::pair{"120", "45"}, {"60", "90"}, {"-1", "45"}, {"60", "-0.1"}}) {
        const Outcome outside = rtsg({"pick", scene, "--pixel", x, y, "--size", "120x90"});
        EXPECT_EQ(outside.status, 2) << x << ' ' << y;
        EXPECT_THAT(outside.err, HasSubstr("is outside a picture of 120 x 90"));
    }
    EXPECT_EQ(rtsg({"pick", scene, "--pixel", "119.9", "89.9", "--size", "120x90"}).status, 0);
    EXPECT_EQ(rtsg({"pick", scene}).status, 2);
    EXPECT_EQ(rtsg({"pick", scene, "--ray", "0", "0", "0", "0", "0", "0"}).status, 2);
}

TEST_F(Usage, WrongUsageIsStatusTwo) {
    const std::vector<std::vector<std::string>> wrong = {
        {},
        {"paint"},
        {"info"},
        {"info", file, "--no-such-option"},
        {"run", file, "--for", "soon"},
        {"run", file, "--fps", "0"},
        {"run", file, "--watch", "NOBODY.translation"},
        {"run", file, "--set", "BOX.translation=1"},
        {"render", file},
        {"render", file, "-o", folder / "a.png", "--size", "wide"},
        {"render", file, "-o", folder / "a.png", "--frames", "3"},
        {"run", file, "--for", "1s", "--render", folder / "a.png", "--integrator", "raster"},
        {"render", file, "-o", folder / "a.png", "--integrator", "raster", "--shadows", "all"},
        {"render", file, "-o", folder / "a.png", "--integrator", "raster", "--panorama"},
        {"render", file, "-o", folder / "a.exr", "--integrator", "raster", "--layers", "depth"},
        {"render", file, "-o", folder / "a.png", "--integrator", "hybrid", "--stereo", "beside"},
        {"render", file, "-o", folder / "a.png", "--integrator", "hybrid", "--caps"},
        {"view", file, "--integrator", "hybrid"},
        {"render", file, "-o", folder / "a.png", "--integrator", "magic"},
        {"render", file, "-o", folder / "a.png", "--error", "-1"},
        {"render", file, "-o", folder / "a.png", "--shutter", ".5", "--spp", "1"},
        {"run", file, "--for", "1s", "--render", folder / "a.png", "--shutter", ".5"},
        {"listen", file},
        {"listen", file, "-o", folder / "a.wav", "--ambisonic", "9"},
        {"listen", file, "-o", folder / "a.wav", "--stereo", "--binaural"},
        {"record", file},
        {"mirror", "nonsense"},
        {"help", "paint"},
        {"completion", "tcsh"},
        {"mirror", "ipc://" + folder / "nobody", "--save", folder / "a.stl"},
    };
    for (const auto& arguments : wrong) {
        const Outcome outcome = rtsg(arguments);
        EXPECT_EQ(outcome.status, 2) << testing::PrintToString(arguments);
        EXPECT_NE(outcome.err, "") << testing::PrintToString(arguments);
    }
}

/// A variable of a shell that is not set: as if the option had not been given, which nobody meant.
TEST_F(Usage, EmptyValuesAreRefusedByName) {
    const std::string log = folder / "a.rlog";
    ASSERT_EQ(rtsg({"record", file, "-o", log, "--for", "100ms"}).status, 0);
    for (const char* option : {"--rerun", "--diff", "--blame", "--compact", "--expect-picture", "--expect-sound",
                               "--save", "--seek", "--field"}) {
        const Outcome outcome = rtsg({"replay", log, option, ""});
        EXPECT_EQ(outcome.status, 2) << option;
        EXPECT_THAT(outcome.err, HasSubstr(option));
        EXPECT_THAT(outcome.err, HasSubstr("is empty"));
    }
    EXPECT_EQ(rtsg({"render", file, "-o", ""}).status, 2);
    EXPECT_EQ(rtsg({"info", ""}).status, 2);
}

TEST_F(Usage, SoundBendsRoundAsManyEdgesAsAreAskedFor) {
    const std::string scene = folder / "screen.x3dv";
    std::ofstream(scene) << "#X3D V4.0 utf8\nPROFILE Full\nShape { geometry Box { size 1 4 60 } }\n"
                            "Transform { translation -3 0 0 children SpatialSound { children OscillatorSource { } } }\n"
                            "ListenerPointSource { position 3 0 0 }\n";
    const auto asked = [&](const std::vector<std::string>& more) {
        std::vector<std::string> verb{"listen", scene, "--metrics", "--rays", "20"};
        verb.insert(verb.end(), more.begin(), more.end());
        const Outcome outcome = rtsg(verb);
        EXPECT_EQ(outcome.status, 0) << outcome.err;
        return json::parse(outcome.out)["sources"][0];
    };
    const json usual = asked({}), two = asked({"--diffraction", "2"}), one = asked({"--diffraction", "1"});
    EXPECT_EQ(usual, two);
    EXPECT_GT(two["edge_pairs"]["heard"], 0);
    // Behind what is thick nothing comes round one edge alone.
    EXPECT_EQ(one["edge_pairs"]["heard"], 0);
    EXPECT_GT(two["images"], one["images"]);
    EXPECT_EQ(asked({"--diffraction", "0"})["images"], 0);
}

// Each by name, as somebody who typed five options wants to know which was meant.
TEST_F(Usage, ValuesOutsideAnOptionsRangeAreRefusedByItsName) {
    const std::string png = folder / "a.png", wav = folder / "a.wav", log = folder / "a.rlog";
    const std::vector<std::string> render{"render", file, "-o", png}, listen{"listen", file, "-o", wav},
        run{"run", file}, record{"record", file, "-o", log}, mirror{"mirror", "ipc://" + folder / "nobody"},
        serve{"serve", file, "--bind", "ipc://" + folder / "s", "--for", "10ms"};
    using Values = std::vector<std::string>;
    const std::vector<std::tuple<std::vector<std::string>, std::string, Values>> refused = {
        {render, "--spp", {"0", "1048577", "1.5", "many"}},
        {render, "--error", {"0", "1001", "nan", "inf"}},
        {render, "--shutter", {"0", "1.1", "-1", "nan"}},
        {render, "--depth", {"-1", "251"}},
        {render, "--integrator", {"magic", ""}},
        {render, "--shadows", {"some"}},
        {render, "--color-space", {"cmyk"}},
        {render, "--exposure", {"0", "-1", "nan", "inf"}},
        {render, "--seed", {"-1", "1e99"}},
        {render, "--threads", {"-1"}},
        {render, "--size", {"0x4", "4x0", "65537x1", "4x4x4", "-4x4", "4"}},
        {render, "--frames", {"0", "-1", "1000001"}},
        {render, "--fps", {"0", "nan", "10001"}},
        {listen, "--ambisonic", {"0", "8"}},
        {listen, "--rays", {"0", "-1", "1099511627777"}},
        {listen, "--diffraction", {"-1", "3", "1.5"}},
        {listen, "--temperature", {"-51", "61", "nan"}},
        {listen, "--humidity", {"-1", "101", "nan"}},
        {listen, "--speed-of-sound", {"9", "10001", "nan"}},
        {listen, "--length", {"0", "601", "nan"}},
        {listen, "--error", {"0", "-1", "nan"}},
        {run, "--fps", {"0", "-1", "nan", "inf", "1000001"}},
        {record, "--fps", {"0", "nan"}},
        {record, "--mode", {"guess"}},
        {record, "--coding", {"morse"}},
        {record, "--error", {"0", "nan"}},
        {mirror, "--aspect", {"smell"}},
        {mirror, "--mode", {"lossy"}},
        {mirror, "--most-fps", {"-1", "10001", "nan"}},
        {mirror, "--max-rate", {"fast"}},
        {serve, "--fps", {"0", "10001", "nan"}},
        {serve, "--peers", {"-1", "few"}},
        {serve, "--upstream", {"all"}},
        {serve, "--coding", {"morse"}},
    };
    for (const auto& [verb, option, values] : refused)
        for (const std::string& value : values) {
            std::vector<std::string> arguments = verb;
            arguments.push_back(option + "=" + value);
            const Outcome outcome = rtsg(arguments);
            EXPECT_EQ(outcome.status, 2) << testing::PrintToString(arguments) << outcome.err;
            EXPECT_THAT(outcome.err, HasSubstr(option)) << testing::PrintToString(arguments);
        }
    for (const std::string& created : {png, wav, log}) EXPECT_FALSE(std::filesystem::exists(created)) << created;
}

TEST_F(Usage, WhatExcludesEachOtherIsRefused) {
    for (const std::vector<std::string>& two : std::vector<std::vector<std::string>>{
             {"--stereo", "--binaural"}, {"--stereo", "--ambisonic=1"}, {"--binaural", "--ambisonic=1"}}) {
        const Outcome outcome = rtsg({"listen", file, "-o", folder / "a.wav", two[0], two[1]});
        EXPECT_EQ(outcome.status, 2) << testing::PrintToString(two);
        EXPECT_THAT(outcome.err, HasSubstr("excludes")) << testing::PrintToString(two);
    }
}

TEST_F(Usage, WhatCannotBeDoneSaysSo) {
    EXPECT_THAT(rtsg({"run", file, "--for", "1s", "--render", folder / "a.png", "--integrator", "raster"}).err,
                HasSubstr("raster is for rtsg render and view"));
    EXPECT_THAT(rtsg({"run", file, "--for", "1s", "--render", folder / "a.png", "--integrator", "hybrid"}).err,
                HasSubstr("hybrid is for rtsg render;"));
    EXPECT_THAT(rtsg({"listen", file, "-o", folder / "a.wav", "--ambisonic", "9"}).err, HasSubstr("--ambisonic"));
}

// The rasteriser needs a display, or OGRE is not there at all.
TEST_F(Usage, WithoutADisplayThereIsNoRasteriser) {
    const char* const display = std::getenv("DISPLAY");
    const std::string before = display ? display : "";
    ::setenv("DISPLAY", ":987", 1);
    for (const char* integrator : {"raster", "hybrid"}) {
        const Outcome outcome = rtsg({"render", file, "-o", folder / "a.png", "--integrator", integrator});
        EXPECT_EQ(outcome.status, 1);
        EXPECT_THAT(outcome.err, HasSubstr("rasteriser"));
        EXPECT_FALSE(std::filesystem::exists(folder / "a.png"));
    }
    ::unsetenv("DISPLAY");
    if (display) ::setenv("DISPLAY", before.c_str(), 1);
}

TEST_F(Usage, MissingInputIsStatusOne) {
    const std::string none = folder / "none.x3d";
    for (const std::vector<std::string>& arguments : std::vector<std::vector<std::string>>{
             {"info", none},
             {"validate", none},
             {"convert", none, folder / "a.x3d"},
             {"run", none},
             {"render", none, "-o", folder / "a.png"},
             {"listen", none, "-o", folder / "a.wav"},
             {"record", none, "-o", folder / "a.rlog"},
             {"replay", "--json", folder / "none.rlog"},
             {"serve", none},
         }) {
        const Outcome outcome = rtsg(arguments);
        EXPECT_EQ(outcome.status, 1) << testing::PrintToString(arguments);
        EXPECT_THAT(outcome.err, HasSubstr("none.")) << testing::PrintToString(arguments);
    }
}

TEST_F(Usage, OutputThatCannotBeWrittenIsStatusOne) {
    const std::string nowhere = folder / "no/such/folder/a";
    EXPECT_EQ(rtsg({"render", file, "-o", nowhere + ".png", "--size", "16x16"}).status, 1);
    EXPECT_EQ(rtsg({"listen", file, "-o", nowhere + ".wav", "--for", "0.01", "--rays", "10"}).status, 1);
    EXPECT_EQ(rtsg({"record", file, "-o", nowhere + ".rlog"}).status, 1);
    EXPECT_EQ(rtsg({"convert", file, nowhere + ".x3d"}).status, 1);
}

using Info = CommandLine;

TEST_F(Info, Counts) {
    const Outcome outcome = rtsg({"info", file, "--json"});
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    const json info = json::parse(outcome.out);
    EXPECT_EQ(info.at("nodes"), 13);
    EXPECT_EQ(info.at("routes"), 2);
    EXPECT_EQ(info.at("triangles"), 24);
    EXPECT_EQ(info.at("protos"), 0);
    EXPECT_EQ(info.at("scripts"), 0);
    EXPECT_EQ(info.at("sounds"), 1);
    EXPECT_EQ(info.at("components").at("Geometry3D"), 2);
    EXPECT_EQ(info.at("components").at("Shape"), 4);
    EXPECT_EQ(info.at("errors"), 0);
}

TEST_F(Info, ReadsStandardInput) {
    const Outcome outcome = rtsg({"info", "-", "--json"}, scene());
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    EXPECT_EQ(outcome.out, rtsg({"info", file, "--json"}).out);
}

TEST_F(Info, DiagnosticsHavePositions) {
    const std::string bad = folder / "bad.x3dv";
    writeFile(bad, "#X3D V4.0 utf8\nPROFILE Immersive\nGroup {\n  children Shape { bogus 1 }\n}\nShape { }\n");
    const Outcome validated = rtsg({"validate", bad, file});
    EXPECT_EQ(validated.status, 1);
    EXPECT_THAT(validated.err, ContainsRegex("bad\\.x3dv:4:[0-9]+: error: .*bogus"));
    EXPECT_THAT(validated.out, HasSubstr("scene.x3dv: 0 errors"));
    EXPECT_EQ(rtsg({"validate", file}).status, 0);
    // The valid part is kept.
    const json info = json::parse(rtsg({"info", bad, "--json"}).out);
    EXPECT_EQ(info.at("errors"), 1);
    EXPECT_EQ(info.at("components").at("Shape"), 2);
}

using Convert = CommandLine;

TEST_F(Convert, RoundTripsKeepTheState) {
    const auto hash = [&](const std::string& name) {
        const Outcome outcome = rtsg({"run", name, "--for", "0.5", "--json"});
        EXPECT_EQ(outcome.status, 0) << outcome.err;
        return json::parse(outcome.out).at("hash");
    };
    const std::string xml = folder / "a.x3d", packed = folder / "b.x3dv.gz", back = folder / "c.x3dv";
    ASSERT_EQ(rtsg({"convert", file, xml}).status, 0);
    ASSERT_EQ(rtsg({"convert", xml, packed}).status, 0);
    ASSERT_EQ(rtsg({"convert", packed, back}).status, 0);
    EXPECT_THAT(readFile(xml), HasSubstr("<PositionInterpolator DEF='PATH'"));
    for (const std::string& name : {xml, packed, back}) EXPECT_EQ(hash(name), hash(file)) << name;
}

TEST_F(Convert, StandardOutputHasTheEncodingThatIsAskedFor) {
    for (const std::string encoding : {"x3d", "x3dv", "wrl", "json"}) {
        const std::string name = folder / ("a." + encoding);
        ASSERT_EQ(rtsg({"convert", file, name}).status, 0);
        EXPECT_EQ(rtsg({"convert", file, "-", "--encoding", encoding}).out, readFile(name)) << encoding;
        const Outcome twice = rtsg({"convert", file, name, "--encoding", encoding, "--force"});
        EXPECT_EQ(twice.status, 2);
        EXPECT_THAT(twice.err, HasSubstr("is of -, standard output"));
    }
    EXPECT_EQ(rtsg({"convert", file, "-"}).out, readFile(folder / "a.x3dv"));
}

TEST_F(Convert, BadInputIsStatusOne) {
    const std::string bad = folder / "bad.x3d";
    writeFile(bad, "<X3D><Scene><Shape></Scene></X3D>");
    const Outcome outcome = rtsg({"convert", bad, folder / "a.x3dv"});
    EXPECT_EQ(outcome.status, 1);
    EXPECT_THAT(outcome.err, ContainsRegex("bad\\.x3d:1:[0-9]+: error: "));
}

using Running = CommandLine;

TEST_F(Running, PrintsWatchedEventsAsLines) {
    const Outcome outcome = rtsg(atZero({"run", file, "--for", "1s", "--fps", "10", "--watch", "BOX.translation"}));
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    const auto lines = jsonLines(outcome.out);
    ASSERT_EQ(lines.size(), 11u);
    for (std::size_t i = 0; i < lines.size(); ++i) {
        const double t = static_cast<double>(i) / 10;
        EXPECT_DOUBLE_EQ(lines[i].at("t"), t);
        EXPECT_EQ(lines[i].at("node"), "BOX");
        EXPECT_EQ(lines[i].at("field"), "translation");
        ASSERT_EQ(lines[i].at("value").size(), 3u);
        EXPECT_NEAR(lines[i].at("value")[0], t, 1e-6);  // from 0 to 2 within 2 s
        EXPECT_EQ(lines[i].at("value")[1], 0);
    }
}

// Whatever shows a state runs the frames up to it, and the one at 0 is among them.
TEST_F(Running, TheFirstFrameIsRunEvenForAPictureOfTime0) {
    writeFile(file, R"(#X3D V4.0 utf8
PROFILE Immersive
DEF CLOCK TimeSensor { loop TRUE cycleInterval 2 }
DEF PATH PositionInterpolator { key [ 0 1 ] keyValue [ 5 0 0, 5 0 0 ] }
DEF BOX Transform { children Shape { geometry Box { } } }
ROUTE CLOCK.fraction_changed TO PATH.set_fraction
ROUTE PATH.value_changed TO BOX.translation
)");
    for (const char* time : {"0", "0.5"})
        EXPECT_THAT(rtsg({"pick", file, "--time", time, "--ray", "5", "0", "9", "0", "0", "-1"}).out, HasSubstr("BOX"))
            << time;
}

TEST_F(Running, InjectsEvents) {
    const Outcome outcome = rtsg({"run", file, "--for", "1s", "--fps", "10", "--watch", "FLAG.*", "--set",
                                  "FLAG.set_boolean=TRUE@0.35", "--set", "BOX.children=NULL@1"});
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    for (const char* verb : {"run", "record"}) {
        const Outcome late = rtsg({verb, file, "--for", "1s", "--fps", "10", "--set", "FLAG.set_boolean=TRUE@2",
                                   verb == std::string("run") ? "--hash" : "-o" + (folder / "late.rlog")});
        EXPECT_EQ(late.status, 2) << verb;
        EXPECT_THAT(late.err, HasSubstr("@2: that is after the end, 1 s")) << verb;
    }
    EXPECT_EQ(
        rtsg({"render", file, "-o", folder / "late.png", "--size", "8x8", "--set", "FLAG.set_boolean=TRUE@2"}).status,
        2);
    bool toggled = false;
    for (const json& line : jsonLines(outcome.out)) {
        EXPECT_NEAR(line.at("t"), 0.4, 1e-9) << "the first frame after it";
        toggled = toggled || (line.at("field") == "toggle" && line.at("value") == true);
    }
    EXPECT_TRUE(toggled) << outcome.out;
}

/// The lines that were printed are whole, the program ends by itself, and reports that the result is incomplete.
TEST_F(Running, AnInterruptionCutsNoLine) {
    for (const std::vector<std::string>& arguments : std::vector<std::vector<std::string>>{
             {"run", file, "--for", "1e6s", "--watch", "*"}, {"run", file, "--for", "1e6s", "--hash", "--json"}}) {
        Program program(arguments, streams());
        program.firstLine();
        std::this_thread::sleep_for(std::chrono::milliseconds(50));
        program.signal(SIGINT);
        const Outcome outcome = program.wait();
        EXPECT_EQ(outcome.status, 1) << outcome.err;
        EXPECT_THAT(outcome.err, ContainsRegex("interrupted after [0-9.]+ of 1000000 s"));
        EXPECT_TRUE(outcome.out.ends_with("}\n")) << lastLine(outcome.out);
        EXPECT_GT(jsonLines(outcome.out).size(), 1u);
    }
}

TEST_F(Running, HashesEveryFrame) {
    const auto first = jsonLines(rtsg({"run", file, "--for", "0.5", "--hash"}).out);
    const auto second = jsonLines(rtsg({"run", file, "--for", "0.5", "--hash"}).out);
    ASSERT_EQ(first.size(), 31u);
    EXPECT_EQ(first, second);
    EXPECT_NE(first[0].at("hash"), first[1].at("hash"));
    EXPECT_EQ(first[30].at("frame"), 30);
}

using Render = CommandLine;

TEST_F(Render, WritesPicturesOfTheAskedSize) {
    const std::string png = folder / "a.png";
    const Outcome outcome = rtsg({"render", file, "-o", png, "--size", "48x32", "--time", "0.5s", "--json"});
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    EXPECT_EQ(json::parse(outcome.out).at("width"), 48);
    const std::string bytes = readFile(png);
    ASSERT_GT(bytes.size(), 33u);
    EXPECT_EQ(bytes.substr(1, 3), "PNG");
    EXPECT_EQ(bytes.substr(16, 8), std::string("\0\0\0\x30\0\0\0\x20", 8));  // IHDR: width, height
    EXPECT_EQ(rtsg({"render", file, "-o", folder / "a.exr", "--size", "48x32"}).status, 0);
    EXPECT_EQ(readFile(folder / "a.exr").substr(0, 4), "\x76\x2f\x31\x01");
}

TEST_F(Render, WritesAnimations) {
    ASSERT_EQ(rtsg({"render", file, "-o", folder / "f%02d.png", "--size", "16x16", "--frames", "3"}).status, 0);
    for (const char* name : {"f00.png", "f01.png", "f02.png"}) EXPECT_NE(readFile(folder / name), "") << name;
    EXPECT_NE(readFile(folder / "f00.png"), readFile(folder / "f02.png")) << "the box moves";
    ASSERT_EQ(rtsg({"render", file, "-o", folder / "f.gif", "--size", "16x16", "--frames", "3"}).status, 0);
    EXPECT_EQ(readFile(folder / "f.gif").substr(0, 3), "GIF");
}

/// Each changes the picture, and the same ones make the same bytes again.
TEST_F(Render, EveryOptionReachesThePicture) {
    writeFile(file, R"(#X3D V4.1 utf8
PROFILE Immersive
NavigationInfo { headlight FALSE }
Viewpoint { position 0 2 6 orientation 1 0 0 -.3 }
DEF ABOVE Viewpoint { position 0 6 0 orientation 1 0 0 -1.57 }
DirectionalLight { direction -1 -1 0 intensity .4 shadows TRUE }
DirectionalLight { direction 1 -1 0 intensity .4 }
Transform { translation 0 -1 0 children Shape { appearance Appearance { material DEF M Material { } } geometry Box { size 9 .1 9 } } }
Shape { appearance Appearance { material USE M } geometry Sphere { } }
Transform { translation 1.5 0 1 children Shape { appearance Appearance { material PhysicalMaterial { roughness 0 metallic 1 } } geometry Box { } } }
)");
    const auto picture = [&](const std::vector<std::string>& more) {
        std::vector<std::string> arguments{"render", file, "-o", folder / "a.png", "--size", "32x24"};
        arguments.insert(arguments.end(), more.begin(), more.end());
        const Outcome outcome = rtsg(arguments);
        EXPECT_EQ(outcome.status, 0) << outcome.err;
        return readFile(folder / "a.png");
    };
    std::map<std::string, std::string> created{{picture({}), "none"}};
    for (const std::vector<std::string>& options : std::vector<std::vector<std::string>>{
             {"--integrator", "path"},
             {"--integrator", "path", "--seed", "2"},
             {"--integrator", "path", "--error", "0.5"},
             {"--spp", "1"},
             {"--shadows", "none"},
             {"--shadows", "all"},
             {"--depth", "0"},
             {"--color-space", "linear"},
             {"--color-space", "display"},
             {"--exposure", "0.5"},
             {"--viewpoint", "ABOVE"},
         }) {
        const std::string name = testing::PrintToString(options), bytes = picture(options);
        EXPECT_EQ(bytes, picture(options)) << name;
        const auto [there, isNew] = created.emplace(bytes, name);
        EXPECT_TRUE(isNew) << name << " made the picture of " << there->second;
    }
    EXPECT_EQ(created.at(picture({"--shadows", "authored"})), "none") << "as a light says shadows TRUE";
    EXPECT_EQ(created.at(picture({"--threads", "1"})), "none");
    EXPECT_EQ(created.at(picture({"--integrator", "path", "--seed", "1"})),
              testing::PrintToString(std::vector<std::string>{"--integrator", "path"}));
}

TEST_F(Render, UnknownViewpointIsStatusOne) {
    const Outcome outcome = rtsg({"render", file, "-o", folder / "a.png", "--size", "16x16", "--viewpoint", "NOWHERE"});
    EXPECT_EQ(outcome.status, 1);
    EXPECT_THAT(outcome.err, HasSubstr("NOWHERE"));
}

using Listen = CommandLine;

TEST_F(Listen, ReportsAndWritesSound) {
    // A missing clip is silent.
    std::string text = readFile(file);
    const std::string clip = "AudioClip { url \"none.wav\" loop TRUE }";
    ASSERT_NE(text.find(clip), std::string::npos);
    writeFile(file, text.replace(text.find(clip), clip.size(), "OscillatorSource { }"));
    const std::string wav = folder / "a.wav", ir = folder / "ir.wav";
    const Outcome outcome =
        rtsg({"listen", file, "-o", wav, "--ir", ir, "--for", "0.25s", "--metrics", "--rays", "300"});
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    const json report = json::parse(outcome.out);
    ASSERT_EQ(report.at("sources").size(), 1u);
    const json& source = report.at("sources")[0];
    EXPECT_EQ(source.at("source"), "TONE");
    for (const char* figure : {"bands_hz", "EDT_s", "T20_s", "T30_s", "C50_db", "C80_db", "D50", "Ts_s", "G_db"})
        EXPECT_EQ(source.at(figure).size(), 10u) << figure;
    EXPECT_EQ(source.at("ci95").at("T20_s").size(), 10u);
    EXPECT_GT(report.at("rays"), 0);
    EXPECT_TRUE(report.contains("seconds") && report.contains("escaped"));
    EXPECT_EQ(readFile(ir).substr(0, 4), "RIFF");
    // Stereo, 48 kHz, 24 bits, a quarter of a second.
    const std::string bytes = readFile(wav);
    EXPECT_EQ(bytes.substr(0, 4), "RIFF");
    EXPECT_NEAR(static_cast<double>(bytes.size()), 48000 * 0.25 * 6, 400);
    EXPECT_NE(bytes.find_first_not_of('\0', 200), std::string::npos) << "silent";
    // Ambisonics of order 2: nine channels.
    const Outcome field = rtsg({"listen", file, "-o", wav, "--for", "0.25s", "--ambisonic", "2", "--rays", "300"});
    ASSERT_EQ(field.status, 0) << field.err;
    EXPECT_NEAR(static_cast<double>(readFile(wav).size()), 48000 * 0.25 * 27, 400);
}

TEST_F(Listen, WritesResponsesOfAllPlacesAsSofa) {
    const std::string sofa = folder / "room.sofa", wav = folder / "room.wav";
    const Outcome one = rtsg({"listen", file, "--ir", sofa, "--rays", "300"});
    ASSERT_EQ(one.status, 0) << one.err;
    ASSERT_EQ(rtsg({"listen", file, "--ir", wav, "--rays", "300"}).status, 0);
    const std::string bytes = readFile(sofa);
    EXPECT_THAT(bytes, testing::StartsWith("\x89HDF\r\n"));
    EXPECT_THAT(bytes, HasSubstr("SingleRoomSRIR"));
    // Doubles in place of floats, and some kilobytes of what says where they belong.
    const double samples = (static_cast<double>(readFile(wav).size()) - 44) / 4;
    EXPECT_GT(static_cast<double>(bytes.size()), 8 * samples);
    EXPECT_LT(static_cast<double>(bytes.size()), 8 * samples + 40'000);
    const Outcome two =
        rtsg({"listen", file, "--ir", sofa, "--rays", "300", "--place", "0 1 2", "--place", "1,1,-2.5"});
    ASSERT_EQ(two.status, 0) << two.err;
    EXPECT_GT(readFile(sofa).size(), 1.5 * static_cast<double>(bytes.size()));
    EXPECT_EQ(rtsg({"listen", file, "--ir", wav, "--place", "1 2 3"}).status, 2);
}

TEST_F(Listen, ReportsRoomsOfManyPlaces) {
    const std::string page = folder / "room.html", numbers = folder / "room.json", text = folder / "room.txt";
    const Outcome drawn = rtsg({"listen", file, "--report", page, "--rays", "300"});
    ASSERT_EQ(drawn.status, 0) << drawn.err;
    EXPECT_THAT(readFile(page), testing::StartsWith("<!DOCTYPE html>"));
    EXPECT_THAT(readFile(page), HasSubstr("<h2>TONE heard from"));
    const Outcome reported =
        rtsg({"listen", file, "--report", numbers, "--rays", "300", "--place", "0 1 2", "--place", "1,1,-2.5"});
    ASSERT_EQ(reported.status, 0) << reported.err;
    const json report = json::parse(readFile(numbers));
    ASSERT_EQ(report.at("pairs").size(), 2u);
    EXPECT_EQ(report.at("pairs")[1].at("listener_position"), json({1, 1, -2.5}));
    for (const char* part : {"mean", "deviation", "count"})
        EXPECT_EQ(report.at("average").at(part).at("T20_s").size(), 10u) << part;
    EXPECT_EQ(report.at("average").at("count").at("G_db")[3], 2);
    EXPECT_TRUE(report.at("single").at("G_db").is_number());
    ASSERT_EQ(rtsg({"listen", file, "--report", text, "--rays", "300"}).status, 0);
    EXPECT_THAT(readFile(text), HasSubstr("single numbers (500 and 1000 Hz; LF: 125 to 1000 Hz"));
    for (const std::vector<std::string>& wrong : std::vector<std::vector<std::string>>{
             {"listen", file, "--report", folder / "a.pdf"},
             {"listen", file, "--report", page, "--place", "1 2"},
             {"listen", file, "--report", page, "--place", "1 2 3 4"},
             {"listen", file, "--metrics", "--place", "1 2 3"},
             {"listen", file, "-o", folder / "a.wav", "--sofa", folder / "none.sofa"}})
        EXPECT_EQ(rtsg(wrong).status, 2) << testing::PrintToString(wrong);
    EXPECT_EQ(rtsg({"listen", file, "-o", folder / "a.wav", "--binaural", "--sofa", file}).status, 1) << "bad input";
    const Outcome names = rtsg({"listen", file, "--ir", folder / "a.txt"});
    EXPECT_EQ(names.status, 2);
    EXPECT_THAT(names.err, HasSubstr("a.txt: responses are .wav or .sofa"));
    EXPECT_THAT(rtsg({"listen", file, "-o", folder / "a.wav", "--binaural", "--sofa", folder.path()}).err,
                HasSubstr("it is a folder, not a SOFA file"));
    const Outcome longest = rtsg({"listen", file, "-o", folder / "a.wav", "--for", "1e9s"});
    EXPECT_EQ(longest.status, 2);
    EXPECT_THAT(longest.err, HasSubstr("1e9s: it is 24h at most"));
}

}  // namespace
}  // namespace rtsg::test
