// Rooms measured by the program: maps, speech in noise, materials by name.
#include <algorithm>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "app/program.h"

namespace rtsg::test {
namespace {

using nlohmann::json;
using testing::HasSubstr;
using testing::StartsWith;

class AcousticsOptions : public CommandLine {
  protected:
    /// A room of 6 x 3 x 5 m whose walls have a name, and a voice in it.
    void SetUp() override {
        writeFile(file, R"(#X3D V4.0 utf8
PROFILE Full
Viewpoint { position 2 1.2 1 }
Transform { translation 0 1.5 0 children Shape { geometry Box { size 6 3 5 solid FALSE }
  appearance DEF plaster Appearance { acousticProperties AcousticProperties { absorption .3 diffuse .4 specular .3 } } } }
DEF VOICE Sound { location -2 1.5 -1 source AudioClip { url "none.wav" } }
)");
    }
    json metricsOf(std::vector<std::string> more) {
        more.insert(more.begin(), {"listen", file, "--metrics", "--rays", "500", "--for", "0s"});
        const Outcome outcome = rtsg(more);
        EXPECT_EQ(outcome.status, 0) << outcome.err;
        return json::parse(outcome.out);
    }
};

TEST_F(AcousticsOptions, SpeechIsHeardInNoise) {
    const json quiet = metricsOf({}), noisy = metricsOf({"--noise", "NC50"}),
               loud = metricsOf({"--noise", "NC50", "--speech-level", "80"}), female = metricsOf({"--voice", "female"});
    const auto index = [](const json& report) { return report.at("sources")[0].at("STI").get<double>(); };
    EXPECT_GT(index(quiet), .6);
    EXPECT_LT(index(noisy), index(quiet) - .2);
    EXPECT_GT(index(loud), index(noisy) + .1);
    EXPECT_TRUE(quiet.at("speech").at("noise_db").is_null());
    EXPECT_EQ(noisy.at("speech").at("noise_db")[5], 51);
    EXPECT_EQ(female.at("speech").at("voice"), "female");
    EXPECT_TRUE(female.at("sources")[0].at("MTI")[2].is_null());
    EXPECT_GT(quiet.at("sources")[0].at("STI_ci95"), 0);
    for (const char* figure : {"LF", "IACC_early", "IACC_late"}) {
        EXPECT_GT(quiet.at("sources")[0].at(figure)[5], 0) << figure;
        EXPECT_GT(quiet.at("sources")[0].at("ci95").at(figure)[5], 0) << figure;
    }
    const Outcome wrong = rtsg({"listen", file, "--metrics", "--noise", "loud"});
    EXPECT_EQ(wrong.status, 2);
    EXPECT_THAT(wrong.err, HasSubstr("--noise"));
    EXPECT_EQ(rtsg({"listen", file, "--metrics", "--voice", "robot"}).status, 2);
}

TEST_F(AcousticsOptions, MapsAreTablesAndPictures) {
    const std::string table = folder / "map.csv", picture = folder / "map.png";
    const Outcome outcome = rtsg({"listen", file, "--grid", "1.2,1", "--map", table, "--map", picture, "--figure",
                                  "G@1000", "--rays", "300", "--for", "0s"});
    EXPECT_EQ(outcome.status, 0) << outcome.err;
    const std::string csv = readFile(table);
    EXPECT_THAT(csv, StartsWith("source,x,y,z,EDT_s@31.5,"));
    EXPECT_EQ(std::ranges::count(csv, '\n'), 1 + 6 * 5);
    EXPECT_THAT(readFile(picture), StartsWith("\x89PNG"));
    for (const std::vector<std::string>& wrong :
         std::vector<std::vector<std::string>>{{"--grid", "1.2,1"},
                                               {"--map", table},
                                               {"--grid", "1.2", "--map", table},
                                               {"--grid", "1.2,0", "--map", table},
                                               {"--grid", "1.2,1,1", "--map", table},
                                               {"--grid", "1.2,1", "--map", table, "--figure", "RT"},
                                               {"--grid", "1.2,1", "--map", folder / "map.svg"},
                                               {"--grid", "1.2,1", "--map", table, "--map", table},
                                               {"--grid", "1.2,1", "--map", table, "--live"}}) {
        std::vector<std::string> arguments{"listen", file};
        arguments.insert(arguments.end(), wrong.begin(), wrong.end());
        EXPECT_EQ(rtsg(arguments).status, 2) << wrong.back();
    }
    const Outcome high = rtsg({"listen", file, "--grid", "9,1", "--map", table, "--rays", "300", "--for", "0s"});
    EXPECT_EQ(high.status, 1);
    EXPECT_THAT(high.err, HasSubstr("at a height of 9 m no point of the grid is in the room"));
    EXPECT_EQ(readFile(table), csv);
}

TEST_F(AcousticsOptions, MaterialsComeFromATable) {
    const std::string table = folder / "materials.csv";
    writeFile(table, "name,500\nplaster,.02\nfelt,.9\n");
    const auto time = [](const json& report) { return report.at("sources")[0].at("T20_s")[4].get<double>(); };
    EXPECT_GT(time(metricsOf({"--no-air", "--materials", table})), 5 * time(metricsOf({"--no-air"})));
    const Outcome reported = rtsg({"listen", file, "--metrics", "--rays", "100", "--for", "0s", "--materials", table});
    EXPECT_EQ(reported.status, 0);
    EXPECT_THAT(reported.err, HasSubstr("materials.csv:3:1: warning: nothing in the scene is made of 'felt'"));
    writeFile(table, "name,500\nplaster,2\n");
    const Outcome wrong = rtsg({"listen", file, "--metrics", "--materials", table});
    EXPECT_EQ(wrong.status, 1);
    EXPECT_THAT(wrong.err, HasSubstr("materials.csv:2:9: error: '2' is no share from 0 to 1"));
    EXPECT_EQ(rtsg({"listen", file, "--metrics", "--materials", folder / "none.csv"}).status, 1);
}

TEST_F(AcousticsOptions, ThePageHasTheRoomInIt) {
    const std::string page = folder / "room.html";
    const Outcome outcome = rtsg({"listen", file, "--report", page, "--rays", "500", "--for", "0s", "--noise", "NR30"});
    EXPECT_EQ(outcome.status, 0) << outcome.err;
    const std::string text = readFile(page);
    EXPECT_THAT(text, HasSubstr("plaster"));
    EXPECT_THAT(text, HasSubstr("Schroeder"));
    EXPECT_THAT(text, HasSubstr("background noise of 48.1, 39.9,"));
    EXPECT_THAT(text, HasSubstr("<b>STI "));
}

}  // namespace
}  // namespace rtsg::test
