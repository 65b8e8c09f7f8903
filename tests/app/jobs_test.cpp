// Pictures of a log, and tiles of them, by several jobs: numbers and bits as those of one run; what is missing is
// named.
#include <algorithm>
#include <cmath>
#include <random>

#include "mirror_session.h"

namespace rtsg::test {

class Jobs : public CommandLine {
  protected:
    Jobs() { beginsAtZero = true; }
    void SetUp() override {
        CommandLine::SetUp();
        ASSERT_EQ(rtsg({"record", file, "-o", log, "--for", "1s", "--fps", "24"}).status, 0);
    }
    /// Makes pictures of the log below `name`, and returns the program's status.
    Outcome pictures(const std::string& name, std::vector<std::string> more) {
        std::vector<std::string> arguments{"replay", log,     "--render", folder / (name + "%03d.png"),
                                           "--size", "48x27", "--fps",    "10"};
        arguments.insert(arguments.end(), more.begin(), more.end());
        return rtsg(arguments);
    }
    std::string picture(const std::string& name, int number) { return readFile(folder / fmtNumber(name, number)); }
    static std::string fmtNumber(const std::string& name, int number) {
        const std::string digits = std::to_string(number);
        return name + std::string(3 - digits.size(), '0') + digits + ".png";
    }
    void expectAsOneRun(const std::vector<std::string>& how) {
        ASSERT_EQ(pictures("one", how).status, 0);
        for (const char* range : {"7-10", "0-2", "3-6", "5-5"}) {
            std::vector<std::string> more = how;
            more.insert(more.end(), {"--frames", range});
            const Outcome job = pictures("job", more);
            ASSERT_EQ(job.status, 0) << range << job.err;
        }
        for (int number = 0; number <= 10; ++number) {
            EXPECT_NE(picture("one", number), "") << number;
            EXPECT_TRUE(picture("one", number) == picture("job", number)) << number;
        }
        EXPECT_EQ(picture("job", 11), "");
    }

    const std::string log = folder / "a.rlog";
};

TEST_F(Jobs, PicturesHaveTheNumbersAndBitsOfOneRun) {
    expectAsOneRun({"--spp", "2"});
}

TEST_F(Jobs, SoHaveThoseWithAnOpenShutter) {
    expectAsOneRun({"--spp", "4", "--shutter", "0.5"});
}

TEST_F(Jobs, OnlyThePicturesThatAreAskedForAreMade) {
    ASSERT_EQ(pictures("job", {"--frames", "4-5", "--shutter", "0.5", "--spp", "2", "--json"}).status, 0);
    for (int number = 0; number <= 10; ++number)
        EXPECT_EQ(picture("job", number).empty(), number != 4 && number != 5) << number;
}

TEST_F(Jobs, WhatLiesBehindTheEndIsNamed) {
    const Outcome job = pictures("job", {"--frames", "9-13"});
    EXPECT_EQ(job.status, 1);
    EXPECT_NE(job.err.find("missing: 3 of 5 pictures: 11-13"), std::string::npos) << job.err;
    EXPECT_NE(picture("job", 10), "");
    const Outcome last = pictures("job", {"--frames", "10-11"});
    EXPECT_NE(last.err.find("missing: 1 of 2 pictures: 11 "), std::string::npos) << last.err;
    const Outcome behind = pictures("job", {"--frames", "20-30"});
    EXPECT_EQ(behind.status, 1);
    EXPECT_NE(behind.err.find("--frames 20-30: the log ends at 1 s"), std::string::npos) << behind.err;
}

TEST_F(Jobs, OptionsThatMakeNoSenseAreRefused) {
    for (const char* range : {"", "3", "5-4", "a-b", "1-2-3", "-1-2", "0-99999999999"})
        EXPECT_EQ(pictures("job", {"--frames", range}).status, 2) << range;
    EXPECT_EQ(pictures("job", {"--frames", "0-1", "--seek", "0.5s"}).status, 2);
    EXPECT_EQ(pictures("job", {"--frames", "0-1", "--for", "0.5s"}).status, 2);
    EXPECT_EQ(rtsg({"replay", log, "--frames", "0-1"}).status, 2);
    EXPECT_EQ(rtsg({"replay", log, "--frames", "0-1", "--render", folder / "a.png"}).status, 2);
    EXPECT_EQ(rtsg({"replay", log, "--frames", "0-1", "--render", folder / "a.gif"}).status, 2);
}

/// A room in which something sounds, and moves if it is to.
class Stretches : public CommandLine {
  protected:
    Stretches() { beginsAtZero = true; }
    void record(bool moves) {
        std::string text =
            "#X3D V4.0 utf8\nPROFILE Full\nViewpoint { position 0 1 3 }\n"
            "Shape { geometry Box { size 9 4 8 solid FALSE } }\n"
            "DEF SOURCE Transform { children Sound { maxFront 50 maxBack 50 source OscillatorSource { "
            "frequency 330 } } }\n";
        if (moves)
            text +=
                "DEF CLOCK TimeSensor { cycleInterval 2 loop TRUE }\nDEF PATH PositionInterpolator { key [ 0 .5 1 ] "
                "keyValue [ -2 0 0, 2 1 -1, -2 0 0 ] }\nROUTE CLOCK.fraction_changed TO PATH.set_fraction\n"
                "ROUTE PATH.value_changed TO SOURCE.set_translation\n";
        else
            text += "DEF CLOCK TimeSensor { loop TRUE }\n";
        writeFile(folder / "room.x3dv", text);
        ASSERT_EQ(rtsg({"record", folder / "room.x3dv", "-o", log, "--for", "4s", "--fps", "30"}).status, 0);
    }
    Outcome sound(const std::string& name, std::vector<std::string> more) {
        std::vector<std::string> arguments{"replay", log,   "--listen", folder / name,
                                           "--rays", "100", "--length", "0.3"};
        arguments.insert(arguments.end(), more.begin(), more.end());
        return rtsg(arguments);
    }
    void makeStretches(const std::vector<std::string>& how) {
        for (const char* range : {"24-39", "0-0", "7-23", "1-6"}) {
            std::vector<std::string> more = how;
            more.insert(more.end(), {"--fps", "10", "--frames", range});
            const Outcome job = sound("job%03d.wav", more);
            ASSERT_EQ(job.status, 0) << range << job.err;
        }
    }
    Outcome join(const std::string& name, const std::string& range = "0-39") {
        return rtsg({"assemble", folder / "job%03d.wav", "--frames", range, "--fps", "10", "-o", folder / name});
    }
    /// The samples of a WAV file with 24 bits a sample, all channels.
    std::vector<double> samplesOf(const std::string& name) {
        const std::string all = readFile(folder / name);
        const std::size_t first = all.find("data") + 8;
        const auto byte = [&](std::size_t at) { return std::uint32_t{static_cast<unsigned char>(all[at])}; };
        std::vector<double> samples;
        for (std::size_t i = first; i + 2 < all.size(); i += 3)
            samples.push_back(static_cast<std::int32_t>(byte(i) << 8 | byte(i + 1) << 16 | byte(i + 2) << 24) /
                              2147483648.);
        return samples;
    }
    bool isAsOneRun() { return readFile(folder / "one.wav") == readFile(folder / "joined.wav"); }

    const std::string log = folder / "sound.rlog";
};

TEST_F(Stretches, WithARunUpFromTheStartHaveTheBitsOfOneRun) {
    record(true);
    ASSERT_EQ(sound("one.wav", {"--binaural"}).status, 0);
    makeStretches({"--binaural"});
    const Outcome joined = join("joined.wav");
    ASSERT_EQ(joined.status, 0) << joined.err;
    EXPECT_TRUE(isAsOneRun());
}

/// Earlier sound is heard, and the traces do not depend on the time of the first one.
TEST_F(Stretches, OfWhatRestsHaveTheBitsOfOneRunAfterAShortRunUp) {
    record(false);
    ASSERT_EQ(sound("one.wav", {}).status, 0);
    makeStretches({"--run-up", "1s"});
    ASSERT_EQ(join("joined.wav").status, 0);
    EXPECT_TRUE(isAsOneRun());
}

TEST_F(Stretches, JoinToTheSampleAndDifferLittleOtherwise) {
    record(true);
    ASSERT_EQ(sound("one.wav", {}).status, 0);
    makeStretches({"--run-up", "1s"});
    ASSERT_EQ(join("joined.wav").status, 0);
    const std::vector<double> one = samplesOf("one.wav"), joined = samplesOf("joined.wav");
    ASSERT_EQ(one.size(), joined.size());
    double sum = 0, difference = 0;
    for (std::size_t i = 0; i < one.size(); ++i)
        sum += one[i] * one[i], difference += (one[i] - joined[i]) * (one[i] - joined[i]);
    EXPECT_LT(10 * std::log10(difference / sum), -3) << "a hundred rays of others";
}

TEST_F(Stretches, ThatAreMissingOrOverlapAreNamed) {
    record(false);
    makeStretches({"--run-up", "0s"});
    std::filesystem::remove(folder / "job007.wav");
    const Outcome lacks = join("joined.wav");
    EXPECT_EQ(lacks.status, 1);
    EXPECT_NE(lacks.err.find("missing: the sound of 17 of 40 pictures: 7-23"), std::string::npos) << lacks.err;
    EXPECT_FALSE(std::filesystem::exists(folder / "joined.wav"));
    ASSERT_EQ(sound("job%03d.wav", {"--fps", "10", "--frames", "7-30", "--run-up", "0s"}).status, 0);
    const Outcome overlaps = join("joined.wav");
    EXPECT_EQ(overlaps.status, 1);
    EXPECT_NE(overlaps.err.find("it overlaps with"), std::string::npos) << overlaps.err;
    EXPECT_EQ(join("joined.wav", "0-20").status, 0) << "what is not asked for does not count";
    ASSERT_EQ(sound("job%03d.wav", {"--fps", "10", "--frames", "7-23", "--run-up", "0s"}).status, 0);
    EXPECT_EQ(rtsg({"assemble", folder / "job%03d.wav", "--frames", "0-39", "--fps", "7"}).status, 1);
    writeFile(folder / "job024.wav", "no sound");
    EXPECT_EQ(join("joined.wav").status, 1);
    const Outcome behind = sound("job%03d.wav", {"--fps", "10", "--frames", "30-60"});
    EXPECT_EQ(behind.status, 1);
    EXPECT_NE(behind.err.find("missing: 2 of 6 s of sound"), std::string::npos) << behind.err;
}

TEST_F(Stretches, GoIntoTheFilm) {
    record(true);
    const std::vector<std::string> looks{"--fps", "10", "--size", "32x16", "--run-up", "9s"};
    for (const char* range : {"0-9", "10-19"}) {
        std::vector<std::string> more = looks;
        more.insert(more.end(), {"--frames", range, "--render", folder / "job%03d.png"});
        ASSERT_EQ(sound("job%03d.wav", more).status, 0);
    }
    const Outcome joined = rtsg({"assemble", folder / "job%03d.png", "--sound", folder / "job%03d.wav", "--frames",
                                 "0-19", "--fps", "10", "-o", folder / "film.mp4"});
    EXPECT_EQ(joined.status, 0) << joined.err;
    EXPECT_GT(readFile(folder / "film.mp4").size(), 1000u);
    std::filesystem::remove(folder / "job010.wav");
    EXPECT_EQ(rtsg({"assemble", folder / "job%03d.png", "--sound", folder / "job%03d.wav", "--frames", "0-19", "--fps",
                    "10", "-o", folder / "film.mp4"})
                  .status,
              1);
}

TEST_F(Stretches, OptionsThatMakeNoSenseAreRefused) {
    record(false);
    EXPECT_EQ(sound("a.wav", {"--frames", "0-1"}).status, 2);
    EXPECT_EQ(sound("a%d.wav", {"--run-up", "1s"}).status, 2);
    EXPECT_EQ(rtsg({"replay", log, "--listen", "device", "--frames", "0-1"}).status, 2);
    EXPECT_EQ(rtsg({"assemble", folder / "a.wav", "--frames", "0-1"}).status, 2);
    EXPECT_EQ(rtsg({"assemble", folder / "a%d.wav", "--frames", "0-1", "-o", folder / "a.mp4"}).status, 2);
    EXPECT_EQ(rtsg({"assemble", folder / "a%d.wav", "--frames", "0-1", "--tiles", "1,1"}).status, 2);
    EXPECT_EQ(rtsg({"assemble", folder / "a%d.png", "--frames", "0-1", "--sound", "a.wav", "-o", "a.mp4"}).status, 2);
    EXPECT_EQ(rtsg({"assemble", folder / "a%d.png", "--frames", "0-1", "--sound", "a%d.wav", "-o", "a.gif"}).status, 2);
}

class Tiles : public Jobs {
  protected:
    static std::string tileName(const std::string& name, int number, int x, int y, int columns, int rows) {
        std::string file = fmtNumber(name, number);
        return file.insert(file.size() - 4, ".tile-" + std::to_string(x) + "-" + std::to_string(y) + "-of-" +
                                                std::to_string(columns) + "-" + std::to_string(rows));
    }
};

TEST_F(Tiles, JoinedArePicturesOfOneRun) {
    const std::vector<std::string> how{"--spp", "4", "--shutter", "0.5", "--integrator", "path", "--frames", "2-4"};
    ASSERT_EQ(pictures("one", how).status, 0);
    std::vector<std::string> tiles{"0,0/3,2", "1,0/3,2", "2,0/3,2", "0,1/3,2", "1,1/3,2", "2,1/3,2"};
    std::ranges::shuffle(tiles, std::mt19937(5));
    const std::vector<std::string> join{"assemble", folder / "job%03d.png", "--frames", "2-4", "--tiles", "3,2"};
    for (const std::string& tile : tiles) {
        const Outcome lacks = rtsg(join);
        EXPECT_EQ(lacks.status, 1) << tile;
        EXPECT_NE(lacks.err.find("missing: "), std::string::npos) << lacks.err;
        std::vector<std::string> more = how;
        more.insert(more.end(), {"--tile", tile});
        const Outcome job = pictures("job", more);
        ASSERT_EQ(job.status, 0) << job.err;
    }
    for (int again = 0; again < 2; ++again) {
        const Outcome joined = rtsg(join);
        ASSERT_EQ(joined.status, 0) << joined.err;
        for (int number = 2; number <= 4; ++number)
            EXPECT_TRUE(picture("one", number) == picture("job", number)) << number;
    }
    // Tiles are needed no longer.
    std::filesystem::remove(folder / tileName("job", 3, 1, 1, 3, 2));
    EXPECT_EQ(rtsg(join).status, 0);
    std::filesystem::remove(folder / fmtNumber("job", 3));
    const Outcome lacks = rtsg({"assemble", folder / "job%03d.png", "--frames", "2-4", "--tiles", "3,2", "--json"});
    EXPECT_EQ(lacks.status, 1);
    EXPECT_NE(lacks.err.find("missing: 1 of 18 tiles: 3: 1,1"), std::string::npos) << lacks.err;
    EXPECT_EQ(nlohmann::json::parse(lacks.out).at("missing_tiles"), 1);
}

TEST_F(Tiles, OfOtherDivisionsAreNamed) {
    ASSERT_EQ(pictures("job", {"--frames", "2-2", "--tile", "0,0/1,1"}).status, 0);
    const Outcome lacks = rtsg({"assemble", folder / "job%03d.png", "--frames", "2-2", "--tiles", "3,1"});
    EXPECT_EQ(lacks.status, 1);
    EXPECT_NE(lacks.err.find("missing: 3 of 3 tiles: 2: 0,0 1,0 2,0"), std::string::npos) << lacks.err;
    EXPECT_NE(lacks.err.find(tileName("job", 2, 0, 0, 1, 1) + " is of another division"), std::string::npos)
        << lacks.err;
    EXPECT_EQ(rtsg({"assemble", folder / "job%03d.png", "--frames", "2-2", "--tiles", "1,1"}).status, 0);
    EXPECT_NE(picture("job", 2), "");
}

/// One state of a picture, with all data of an .exr; by render and by replay.
TEST_F(Tiles, OfOnePictureHaveItsBits) {
    for (const std::vector<std::string>& created :
         {std::vector<std::string>{"render", file, "--time", "0.5s", "--layers", "all", "--spp", "4", "-o"},
          std::vector<std::string>{"replay", log, "--seek", "0.5s", "--spp", "2", "--render"}}) {
        const auto make = [&](const std::string& name, const std::vector<std::string>& more) {
            std::vector<std::string> arguments = created;
            arguments.insert(arguments.end(), {folder / name, "--size", "50x40"});
            arguments.insert(arguments.end(), more.begin(), more.end());
            const Outcome outcome = rtsg(arguments);
            EXPECT_EQ(outcome.status, 0) << outcome.err;
        };
        make("whole.exr", {});
        for (const char* tile : {"0,0/2,2", "1,0/2,2", "0,1/2,2", "1,1/2,2"}) make("joined.exr", {"--tile", tile});
        const Outcome joined = rtsg({"assemble", folder / "joined.exr", "--tiles", "2,2"});
        EXPECT_EQ(joined.status, 0) << joined.err;
        EXPECT_TRUE(readFile(folder / "whole.exr") == readFile(folder / "joined.exr")) << created[0];
    }
}

TEST_F(Tiles, OfTwoSessionsOrWithOtherOptionsAreAMixture) {
    const std::string other = folder / "other.rlog";
    ASSERT_EQ(rtsg({"record", file, "-o", other, "--for", "1.5s", "--fps", "24"}).status, 0);
    const auto tile = [&](const std::string& from, const std::vector<std::string>& more) {
        std::vector<std::string> arguments{"replay", from,    "--render", folder / "job%03d.png",
                                           "--size", "48x27", "--frames", "0-0"};
        arguments.insert(arguments.end(), more.begin(), more.end());
        const Outcome outcome = rtsg(arguments);
        ASSERT_EQ(outcome.status, 0) << outcome.err;
    };
    const auto joins = [&](const std::string& said) {
        const Outcome joined = rtsg({"assemble", folder / "job%03d.png", "--frames", "0-0", "--tiles", "1,2"});
        EXPECT_EQ(joined.status, said.empty() ? 0 : 1) << joined.err;
        EXPECT_NE(joined.err.find(said), std::string::npos) << joined.err;
        EXPECT_EQ(std::filesystem::exists(folder / fmtNumber("job", 0)), said.empty());
    };
    tile(log, {"--tile", "0,0/1,2", "--fps", "10"});
    tile(other, {"--tile", "0,1/1,2", "--fps", "10"});
    joins("a mixture: session ");
    tile(log, {"--tile", "0,1/1,2", "--fps", "5"});
    joins("a mixture: options fps=5, not fps=10 as in ");
    tile(log, {"--tile", "0,1/1,2", "--fps", "10", "--spp", "2", "--integrator", "path"});
    joins("a mixture: options integrator=path spp=2, not integrator=whitted spp=4 as in ");
    ASSERT_EQ(rtsg({"render", file, "-o", folder / "plain.png", "--size", "48x27"}).status, 0);
    std::filesystem::copy_file(folder / "plain.png", folder / tileName("job", 0, 0, 1, 1, 2),
                               std::filesystem::copy_options::overwrite_existing);
    joins("a mixture: it does not say of which session it is");
    tile(log, {"--tile", "0,1/1,2", "--fps", "10"});
    joins("");
}

/// Tiles of `render` tell the state: that of another time is another picture.
TEST_F(Tiles, OfTwoStatesAreAMixture) {
    const auto tile = [&](const char* which, const char* time) {
        ASSERT_EQ(
            rtsg({"render", file, "--time", time, "-o", folder / "a.png", "--size", "48x32", "--tile", which}).status,
            0);
    };
    tile("0,0/1,2", "0.5s");
    tile("0,1/1,2", "0.6s");
    const std::vector<std::string> join{"assemble", folder / "a.png", "--tiles", "1,2"};
    const Outcome mixture = rtsg(join);
    EXPECT_EQ(mixture.status, 1);
    EXPECT_NE(mixture.err.find("a mixture: state "), std::string::npos) << mixture.err;
    tile("0,1/1,2", "0.5s");
    EXPECT_EQ(rtsg(join).status, 0);
}

TEST_F(Jobs, PicturesAndSoundOfTwoSessionsAreAMixture) {
    const std::string other = folder / "other.rlog", names = folder / "job%03d.png", sounds = folder / "job%03d.wav";
    ASSERT_EQ(rtsg({"record", file, "-o", other, "--for", "1.5s", "--fps", "24"}).status, 0);
    const auto make = [&](const std::string& from, const char* range, const std::vector<std::string>& more) {
        std::vector<std::string> arguments{"replay", from, "--fps", "10", "--frames", range, "--rays", "20"};
        arguments.insert(arguments.end(), more.begin(), more.end());
        const Outcome outcome = rtsg(arguments);
        ASSERT_EQ(outcome.status, 0) << outcome.err;
    };
    const auto joins = [&](const std::vector<std::string>& more, const std::string& said) {
        std::vector<std::string> arguments{"assemble", "--frames", "0-3", "--fps", "10"};
        arguments.insert(arguments.end(), more.begin(), more.end());
        const Outcome joined = rtsg(arguments);
        EXPECT_EQ(joined.status, said.empty() ? 0 : 1) << joined.err;
        EXPECT_NE(joined.err.find(said), std::string::npos) << joined.err;
    };
    const std::vector<std::string> pictures{"--render", names, "--size", "32x16"}, listen{"--listen", sounds};
    make(log, "0-1", pictures), make(other, "2-3", pictures);
    joins({names}, "a mixture: session ");
    make(log, "2-3", pictures);
    joins({names}, "");
    make(log, "0-1", listen), make(other, "2-3", listen);
    joins({sounds, "-o", folder / "a.wav"}, "a mixture: session ");
    EXPECT_FALSE(std::filesystem::exists(folder / "a.wav"));
    make(other, "0-1", listen);
    joins({sounds, "-o", folder / "a.wav"}, "");
    joins({names, "--sound", sounds, "-o", folder / "a.mp4"}, "a mixture: session ");
    EXPECT_FALSE(std::filesystem::exists(folder / "a.mp4"));
    make(other, "0-3", pictures);
    joins({names, "--sound", sounds, "-o", folder / "a.mp4"}, "");
    make(other, "2-3", {"--listen", sounds, "--quality", "0.5"});
    joins({sounds}, "a mixture: options quality=0.5, not quality=0 as in ");
}

TEST_F(Tiles, ThatCannotBeAreRefused) {
    for (const char* tile :
         {"", "1", "0,0", "2,0/2,2", "0,2/2,2", "-1,0/2,2", "0,0/0,1", "0,0/2,2/3", "0,0/4,1", "a,b/c,d"})
        EXPECT_EQ(pictures("job", {"--frames", "1-1", "--tile", tile}).status, 2) << tile;
    EXPECT_EQ(rtsg({"replay", log, "--tile", "0,0/2,1"}).status, 2);
    EXPECT_EQ(rtsg({"replay", log, "--tile", "0,0/2,1", "--render", folder / "a.gif"}).status, 2);
    EXPECT_EQ(rtsg({"render", file, "--tile", "0,0/2,1", "-o", folder / "a.jpg"}).status, 2);
    EXPECT_EQ(rtsg({"render", file, "--tile", "0,0/2,1", "-o", folder / "a.png", "--stereo", "beside"}).status, 2);
    EXPECT_EQ(rtsg({"render", file, "--tile", "0,0/2,1", "-o", folder / "a.png", "--integrator", "raster"}).status, 2);
    EXPECT_EQ(rtsg({"assemble", folder / "a.png", "--tiles", "0,1"}).status, 2);
    EXPECT_EQ(rtsg({"assemble", folder / "a.jpg", "--tiles", "2,1"}).status, 2);
    EXPECT_EQ(rtsg({"assemble", folder / "a.png", "--tiles", "2,1", "--frames", "0-1"}).status, 2);
    EXPECT_EQ(rtsg({"assemble", folder / "%03d.png", "--tiles", "2,1"}).status, 2);
    EXPECT_EQ(rtsg({"assemble", folder / "a.png", "--tiles", "2,1", "-o", folder / "a.gif"}).status, 2);
}

TEST_F(Jobs, TheyAreJoinedAndWhatIsMissingIsNamed) {
    ASSERT_EQ(pictures("job", {}).status, 0);
    ASSERT_EQ(rtsg({"replay", log, "--render", folder / "whole.gif", "--size", "48x27", "--fps", "10"}).status, 0);
    const std::string names = folder / "job%03d.png";
    EXPECT_EQ(rtsg({"assemble", names, "--frames", "0-10"}).status, 0);
    const Outcome joined = rtsg({"assemble", names, "--frames", "0-10", "--fps", "10", "-o", folder / "joined.gif"});
    EXPECT_EQ(joined.status, 0) << joined.err;
    EXPECT_TRUE(readFile(folder / "joined.gif") == readFile(folder / "whole.gif"));
    for (const int number : {3, 7, 8, 9}) std::filesystem::remove(folder / fmtNumber("job", number));
    const Outcome lacks = rtsg({"assemble", names, "--frames", "0-10", "-o", folder / "lacks.gif", "--json"});
    EXPECT_EQ(lacks.status, 1);
    EXPECT_NE(lacks.err.find("missing: 4 of 11 pictures: 3,7-9"), std::string::npos) << lacks.err;
    EXPECT_EQ(nlohmann::json::parse(lacks.out).at("missing_numbers"), "3,7-9");
    EXPECT_FALSE(std::filesystem::exists(folder / "lacks.gif"));
    writeFile(folder / fmtNumber("job", 1), "no picture");
    EXPECT_EQ(rtsg({"assemble", names, "--frames", "0-2"}).status, 1);
    EXPECT_EQ(rtsg({"assemble", names, "--frames", "0-2", "-o", folder / "a.png"}).status, 2);
    EXPECT_EQ(rtsg({"assemble", folder / "job.png", "--frames", "0-2"}).status, 2);
}

}  // namespace rtsg::test
