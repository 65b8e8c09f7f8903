// Logs and replays as a script uses them: recorded by one process, verified, compared and saved by another.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <sys/file.h>
#include <unistd.h>
#include <algorithm>
#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>

#include "program.h"

namespace rtsg::test {
namespace {

using nlohmann::json;
using testing::HasSubstr;

class Replay : public CommandLine {
  protected:
    void record(const std::string& name, const std::string& text) {
        const std::string source = folder / "source.x3dv";
        writeFile(source, text);
        const Outcome outcome = rtsg({"record", source, "-o", name, "--for", "1s", "--fps", "20", "--json"});
        ASSERT_EQ(outcome.status, 0) << outcome.err;
        recorded = json::parse(outcome.out);
    }
    json recorded;
    const std::string log = folder / "a.rlog";
};

TEST_F(Replay, VerifiesEveryState) {
    record(log, scene());
    const Outcome outcome = rtsg({"replay", "--json", log, "--verify"});
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    const json report = json::parse(outcome.out);
    EXPECT_GE(report.at("frames"), 21);
    EXPECT_EQ(report.at("frames"), report.at("verified"));
    EXPECT_TRUE(report.at("first_divergence").is_null());
    EXPECT_EQ(report.at("hash"), recorded.at("hash"));
}

/// One log has one number of states, whoever is asked, in whichever mode it was recorded.
TEST_F(Replay, AllVerbsCountTheSameStates) {
    writeFile(folder / "a.x3dv", scene());
    using Words = std::vector<std::string>;
    for (const Words& mode : {Words{},
                              {"--inputs"},
                              {"--mode", "input"},
                              {"--mode", "lossy"},
                              {"--coding", "compact"},
                              {"--set", "PATH.set_fraction=0.3@0.33"}}) {
        SCOPED_TRACE(testing::PrintToString(mode));
        Words words{"record", folder / "a.x3dv", "-o", log, "--for", "1s", "--fps", "20", "--force", "--json"};
        words.insert(words.end(), mode.begin(), mode.end());
        const Outcome created = rtsg(words), reported = rtsg({"info", log, "--json"}),
                      played = rtsg({"replay", log, "--json"});
        ASSERT_EQ(created.status, 0) << created.err;
        ASSERT_EQ(reported.status, 0) << reported.err;
        ASSERT_EQ(played.status, 0) << played.err;
        const auto states = json::parse(created.out).at("states").get<int>();
        EXPECT_GT(states, 20);
        EXPECT_EQ(json::parse(reported.out).at("states"), states);
        EXPECT_EQ(json::parse(played.out).at("frames"), states);
        EXPECT_THAT(rtsg({"info", log}).out, HasSubstr("states     " + std::to_string(states) + ","));
        EXPECT_THAT(rtsg({"replay", log}).out, HasSubstr(std::to_string(states) + " states to "));
    }
}

TEST_F(Replay, FindsAFlippedByteWhereverItIs) {
    record(log, scene());
    const std::string bytes = readFile(log);
    const std::size_t keyframe = bytes.find("RTSGrec1", 8);
    ASSERT_NE(keyframe, std::string::npos);
    const std::size_t body = bytes.find("BOX", keyframe);  // the name of a node
    ASSERT_NE(body, std::string::npos);
    const std::size_t rest = bytes.size() - keyframe;
    for (const std::size_t at : {keyframe / 2, keyframe + 70, body, keyframe + rest / 2, keyframe + rest * 3 / 4}) {
        std::string broken = bytes;
        broken[at] = static_cast<char>(broken[at] ^ 0x10);
        writeFile(folder / "broken.rlog", broken);
        const Outcome outcome = rtsg({"replay", "--json", folder / "broken.rlog", "--verify"});
        EXPECT_EQ(outcome.status, 1) << "byte " << at;
        EXPECT_NE(outcome.err, "") << "byte " << at;
        if (at < keyframe) continue;  // without its head it is no log at all
        const json report = json::parse(outcome.out);
        ASSERT_FALSE(report.at("first_divergence").is_null()) << report;
        EXPECT_GT(report.at("first_divergence").at("frame"), 0);
    }
}

TEST_F(Replay, ATruncatedLogKeepsWhatIsWhole) {
    record(log, scene());
    const std::string bytes = readFile(log);
    std::size_t record = 0;  // the ninth
    for (int i = 0; i < 9; ++i) record = bytes.find("RTSGrec1", record + 1);
    ASSERT_LT(record, bytes.size());
    writeFile(folder / "cut.rlog", bytes.substr(0, record - 5));
    const Outcome outcome = rtsg({"replay", "--json", folder / "cut.rlog", "--verify"});
    EXPECT_EQ(outcome.status, 1);
    const json report = json::parse(outcome.out);
    EXPECT_GT(report.at("frames"), 2);
    EXPECT_EQ(report.at("frames"), report.at("verified"));
    EXPECT_FALSE(report.at("first_divergence").is_null());
    writeFile(folder / "garbage.rlog", std::string(5000, 'x'));
    EXPECT_EQ(rtsg({"replay", "--json", folder / "garbage.rlog", "--verify"}).status, 1);
}

TEST_F(Replay, ALogThatWasNotClosedDoesNotVerify) {
    record(log, scene());
    const std::string bytes = readFile(log);
    std::vector<std::size_t> records;
    for (std::size_t at = bytes.find("RTSGrec1"); at != std::string::npos; at = bytes.find("RTSGrec1", at + 1))
        records.push_back(at);
    // Between whole records: nothing is damaged, and nothing but the missing index tells that there was more.
    for (const std::size_t left : {records.size() - 1, records.size() - 4, std::size_t{8}}) {
        writeFile(folder / "cut.rlog", bytes.substr(0, records[left]));
        const Outcome outcome = rtsg({"replay", "--json", folder / "cut.rlog", "--verify"});
        EXPECT_EQ(outcome.status, 1) << left;
        EXPECT_NE(outcome.err.find("the log was not closed"), std::string::npos) << outcome.err;
        const json report = json::parse(outcome.out);
        EXPECT_EQ(report.at("frames"), report.at("verified"));
        EXPECT_EQ(report.at("damaged"), 0);
        EXPECT_EQ(report.at("closed"), false);
        EXPECT_FALSE(report.at("first_divergence").is_null());
        // Only who asks for all of it misses something; the others are told.
        const std::string said = "; the log was not closed: ";
        const Outcome played = rtsg({"replay", folder / "cut.rlog"});
        EXPECT_EQ(played.status, 0);
        EXPECT_THAT(played.out, HasSubstr(said));
        const Outcome tested = rtsg({"replay", folder / "cut.rlog", "--rerun", file});
        EXPECT_EQ(tested.status, 0) << tested.err;
        EXPECT_THAT(tested.out, HasSubstr(": passed" + said));
        EXPECT_EQ(rtsg({"replay", folder / "cut.rlog", "--rerun", file, "--verify"}).status, 1);
        const Outcome blamed = rtsg({"replay", folder / "cut.rlog", "--blame", "BOX.translation"});
        EXPECT_EQ(blamed.status, 1);
        EXPECT_THAT(blamed.err, HasSubstr("not all of it"));
    }
    for (const char* option : {"--verify", "--live"})
        EXPECT_EQ(rtsg({"replay", log, option}).out.find("not closed"), std::string::npos) << option;
}

/// Its writer is in the middle of a record: that is no damage, and all that is there is verified.
TEST_F(Replay, ALogThatIsBeingWrittenIsVerifiedAsFarAsItGoes) {
    record(log, scene());
    std::filesystem::resize_file(log, std::filesystem::file_size(log) - 5);
    const int writer = ::open(log.c_str(), O_WRONLY | O_APPEND | O_CLOEXEC);
    ASSERT_EQ(::flock(writer, LOCK_EX | LOCK_NB), 0);
    const Outcome outcome = rtsg({"replay", "--json", log, "--verify"});
    EXPECT_EQ(outcome.status, 1) << "not all of it is there";
    EXPECT_THAT(outcome.err, HasSubstr("the log is still being written"));
    const json report = json::parse(outcome.out);
    EXPECT_GT(report.at("frames"), 2);
    EXPECT_EQ(report.at("frames"), report.at("verified"));
    EXPECT_EQ(report.at("damaged"), 0);
    EXPECT_EQ(report.at("being_written"), true);
    EXPECT_EQ(rtsg({"replay", log}).status, 0);
    const Outcome described = rtsg({"info", log});
    EXPECT_EQ(described.status, 0) << described.err;
    EXPECT_THAT(described.out, HasSubstr("it is still being written"));
    // Nobody puts another file in its place, where its writer would go on in the old one, which has no name any more.
    const std::string before = readFile(log), whole = folder / "whole.rlog";
    record(whole, scene());
    for (const std::vector<std::string>& command :
         {std::vector<std::string>{"replay", whole, "--compact", log, "--force"},
          std::vector<std::string>{"replay", log, "--rerun", file, "--update"}}) {
        const Outcome refused = rtsg(command);
        EXPECT_EQ(refused.status, 1) << refused.out;
        EXPECT_THAT(refused.err, HasSubstr("another log writer has the file open"));
        EXPECT_EQ(readFile(log), before);
    }
    const Outcome tested = rtsg({"replay", log, "--rerun", file, "--verify"});
    EXPECT_THAT(tested.err, testing::ContainsRegex("t = 0?.?[0-9]* s.: the log is still being written"));
    ::close(writer);
    EXPECT_THAT(rtsg({"replay", log, "--verify"}).err, HasSubstr("truncated"));
    EXPECT_EQ(rtsg({"info", log}).status, 1);
}

TEST_F(Replay, KeyframesComeAsOftenAsAsked) {
    const std::string source = folder / "source.x3dv";
    writeFile(source, scene());
    std::vector<std::size_t> found;
    for (const char* seconds : {"0", "250ms"}) {
        ASSERT_EQ(rtsg({"record", source, "-o", log, "--for", "2s", "--fps", "20", "--force", "--keyframe-seconds",
                        seconds, "--keyframe-bytes", "1MB"})
                      .status,
                  0);
        const Outcome outcome = rtsg({"info", log, "--json"});
        found.push_back(json::parse(outcome.out).at("keyframes"));
    }
    EXPECT_GE(found[1], found[0] + 6);
    EXPECT_EQ(rtsg({"replay", log, "--verify"}).status, 0);
    EXPECT_EQ(rtsg({"record", source, "-o", log, "--keyframe-seconds", "often", "--force"}).status, 2);
}

TEST_F(Replay, ALogThatHasLostItsBeginningDoesNotVerify) {
    const std::string source = folder / "source.x3dv";
    writeFile(source, scene());
    ASSERT_EQ(rtsg({"record", source, "-o", log, "--for", "2s", "--fps", "20", "--keyframe-seconds", "500ms"}).status,
              0);
    const std::string bytes = readFile(log);
    // Behind the first head and keyframe: frames that lead on from nothing, up to the next head.
    std::size_t record = 0;
    for (int i = 0; i < 5; ++i) record = bytes.find("RTSGrec1", record + 1);
    writeFile(folder / "late.rlog", bytes.substr(record));
    const Outcome late = rtsg({"replay", "--json", folder / "late.rlog", "--verify"});
    EXPECT_EQ(late.status, 1);
    EXPECT_THAT(late.err, HasSubstr("are missing"));
    EXPECT_THAT(rtsg({"replay", folder / "late.rlog"}).out, HasSubstr("1 gap"));
    const Outcome compacted = rtsg({"replay", "--json", folder / "late.rlog", "--compact", folder / "short.rlog"});
    EXPECT_EQ(compacted.status, 1);
    EXPECT_THAT(compacted.err, HasSubstr("are missing"));
    EXPECT_EQ(json::parse(compacted.out).at("gaps"), 1);
    EXPECT_EQ(json::parse(compacted.out).at("complete"), false);
}

/// Cut behind its head it says so, at its start, and compares with nothing.
TEST_F(Replay, ALogWithoutAStateDoesNotVerify) {
    record(log, scene());
    const std::string bytes = readFile(log), bare = folder / "bare.rlog";
    writeFile(bare, bytes.substr(0, bytes.find("RTSGrec1", 1)));
    const Outcome verified = rtsg({"replay", "--json", bare, "--verify"});
    EXPECT_EQ(verified.status, 1);
    EXPECT_THAT(verified.err, HasSubstr("no intact state"));
    const json report = json::parse(verified.out);
    EXPECT_EQ(report.at("frames"), 0);
    EXPECT_EQ(report.at("first_divergence").at("t"), 0);
    const Outcome diff = rtsg({"diff", "--json", bare, log});
    EXPECT_EQ(diff.status, 1);
    EXPECT_EQ(json::parse(diff.out).at("compared"), 0);
    EXPECT_EQ(json::parse(diff.out).at("differences").at(0).at("t"), 0);
}

/// Whatever the first bytes are, its name says that it is one.
TEST_F(Replay, ALogWhoseFirstBytesAreDamagedIsToldAsALog) {
    record(log, scene());
    std::string bytes = readFile(log);
    bytes[1] = 'X';
    writeFile(log, bytes + bytes);
    const Outcome outcome = rtsg({"info", log, "--json"});
    EXPECT_EQ(outcome.status, 1) << outcome.err;
    const json report = json::parse(outcome.out);
    EXPECT_EQ(report.at("damaged"), 2) << report;
    EXPECT_TRUE(report.contains("frames"));
}

/// No state is missing for it: the logs are equal, and the damage is told.
TEST_F(Replay, ComparisonsTellOfDamageThatCostNoState) {
    record(log, scene());
    const std::string damaged = folder / "damaged.rlog";
    std::string bytes = readFile(log);
    bytes[bytes.size() - 1] ^= 1;  // of the index at the end
    writeFile(damaged, bytes);
    for (const std::vector<std::string>& arguments : std::vector<std::vector<std::string>>{
             {"diff", log, damaged},
             {"diff", damaged, log},
             {"diff", log, damaged, "--field", "BOX.translation"},
             {"replay", log, "--diff", damaged},
         }) {
        const Outcome compared = rtsg(arguments);
        EXPECT_EQ(compared.status, 0) << compared.err;
        EXPECT_THAT(compared.err, HasSubstr(damaged + ": warning: 1 damaged place, the first at bytes "));
        EXPECT_THAT(compared.out, HasSubstr("are equal in "));
    }
    const Outcome compared = rtsg({"diff", log, damaged, "--json"});
    EXPECT_EQ(json::parse(compared.out).at("damage").at(0), nullptr);
    EXPECT_THAT(std::string(json::parse(compared.out).at("damage").at(1)), HasSubstr("1 damaged place"));
    EXPECT_EQ(rtsg({"diff", log, log}).err, "");
}

/// A part of a log, or a mirror's that came late.
TEST_F(Replay, ALogThatBeginsLateIsNotRunAgainFromTheScenesStart) {
    record(log, scene());
    const std::string late = folder / "late.rlog";
    ASSERT_EQ(rtsg({"replay", log, "--compact", late, "--seek", "0.5s"}).status, 0);
    const Outcome whole = rtsg({"replay", late, "--rerun", file});
    EXPECT_EQ(whole.status, 1);
    EXPECT_THAT(whole.err, testing::ContainsRegex(
                               "the log begins with state 1[0-9] of its session, the scene with state [12]: only"));
    const Outcome chosen = rtsg({"replay", late, "--rerun", file, "--field", "BOX.translation"});
    EXPECT_EQ(chosen.status, 1);
    EXPECT_THAT(chosen.err, HasSubstr("BOX.translation"));
    EXPECT_THAT(chosen.err, HasSubstr("the log begins with state 1"));
}

/// State numbers begin anew in each.
TEST_F(Replay, DifferencesOfLogsOfSeveralSessionsSayWhichOne) {
    record(log, scene());
    const std::string same = folder / "same.rlog", other = folder / "b.rlog", first = folder / "first.rlog",
                      second = folder / "second.rlog";
    record(same, scene());
    record(other, scene("3"));
    writeFile(first, readFile(log) + readFile(same));
    writeFile(second, readFile(log) + readFile(other));
    EXPECT_THAT(rtsg({"diff", first, second}).out, HasSubstr(", in session 2 of both"));
    EXPECT_THAT(rtsg({"diff", log, second}).out, HasSubstr(", in session 1 of " + log + " and session 2 of " + second));
    EXPECT_THAT(rtsg({"diff", log, other}).out, testing::Not(HasSubstr("session")));
}

TEST_F(Replay, ComparesLogsAndNamesTheField) {
    record(log, scene());
    const std::string same = folder / "same.rlog", other = folder / "other.rlog";
    record(same, scene());
    record(other, scene("3"));
    const Outcome equal = rtsg({"replay", "--json", log, "--diff", same});
    EXPECT_EQ(equal.status, 0) << equal.err;
    EXPECT_EQ(json::parse(equal.out).at("equal"), true);
    const Outcome different = rtsg({"replay", "--json", log, "--diff", other});
    EXPECT_EQ(different.status, 1);
    const json found = json::parse(different.out).at("first_divergence");
    EXPECT_EQ(found.at("node"), "PATH") << found;
    EXPECT_EQ(found.at("field"), "keyValue") << found;
    EXPECT_GT(found.at("frame"), 0);
    EXPECT_THAT(different.err, HasSubstr("PATH.keyValue"));
}

/// Neither of the two is the one that the other is to be like.
TEST_F(Replay, DiffSaysTheSameBothWays) {
    const std::string more = folder / "more.x3dv", longer = folder / "more.rlog";
    writeFile(more, scene() +
                        "DEF LAMP PointLight { }\nDEF BLINK TimeSensor { cycleInterval .3 loop TRUE }\n"
                        "DEF WINK BooleanTrigger { }\nROUTE BLINK.cycleTime TO WINK.set_triggerTime\n"
                        "ROUTE WINK.triggerTrue TO LAMP.set_on\n");
    record(log, scene());
    record(longer, readFile(more));
    const auto swapped = [](std::string text) {
        for (const auto& [from, to] : {std::pair{"first", "#"}, {"second", "first"}, {"#", "second"}})
            for (std::size_t at = 0; (at = text.find(from, at)) != text.npos; at += std::strlen(to))
                text.replace(at, std::strlen(from), to);
        return text;
    };
    const auto compare = [&](const std::string& a, const std::string& b, const std::vector<std::string>& options) {
        std::vector<std::string> arguments{"diff", a, b, "--json"};
        arguments.insert(arguments.end(), options.begin(), options.end());
        return rtsg(arguments);
    };
    for (const auto& [a, b] : {std::pair{file, more}, {log, longer}})
        for (const std::vector<std::string>& options : std::vector<std::vector<std::string>>{
                 {"--field", "LAMP.*"}, {"--field", "LAMP.on", "--field", "BOX.*"}, {"--ignore", "initial"}}) {
            const Outcome there = compare(a, b, options), back = compare(b, a, options);
            EXPECT_EQ(there.status, back.status) << testing::PrintToString(options) << there.err << back.err;
            EXPECT_EQ(there.err, back.err);
            EXPECT_EQ(there.out, swapped(back.out)) << testing::PrintToString(options);
            if (a == file && options.front() == "--ignore") continue;  // nothing has happened in a document
            EXPECT_EQ(there.status, 1) << testing::PrintToString(options);
            EXPECT_THAT(there.out, HasSubstr("LAMP"));
            EXPECT_THAT(there.out, HasSubstr("only in second"));
        }
    EXPECT_THAT(compare(log, longer, {"--field", "NOBODY.*"}).err, HasSubstr("no such field"));
    // A log says what is to be tested: what a scene has besides is no difference of a rerun.
    EXPECT_EQ(rtsg({"replay", log, "--rerun", more, "--field", "BOX.*"}).status, 0);
}

TEST_F(Replay, SeeksAndSaves) {
    record(log, scene());
    const std::string saved = folder / "half.x3dv";
    const Outcome outcome = rtsg({"replay", "--json", log, "--seek", "0.5s", "--save", saved, "--render",
                                  folder / "half.png", "--size", "24x16"});
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    EXPECT_DOUBLE_EQ(json::parse(outcome.out).at("t"), 0.5);
    EXPECT_THAT(readFile(saved), HasSubstr("translation 0.5 0 0"));  // 2 m within 2 s
    EXPECT_EQ(readFile(folder / "half.png").substr(1, 3), "PNG");
    // The same picture as of the scene itself at that time.
    ASSERT_EQ(rtsg({"render", file, "-o", folder / "direct.png", "--time", "0.5", "--size", "24x16"}).status, 0);
    EXPECT_EQ(readFile(folder / "half.png"), readFile(folder / "direct.png"));
}

/// Status 0 means that all that was asked for is there.
TEST_F(Replay, MoreOfALogThanThereIsIsStatusOneAndNamesWhatIsNotWhole) {
    record(log, scene());  // of 1 s
    const std::string saved = folder / "end.x3dv", mcap = folder / "end.mcap", shorter = folder / "end.rlog",
                      wav = folder / "end.wav";
    const std::string lacks = ".5 of 1 s of the log, which ends at t = 1 s";
    using Arguments = std::vector<std::string>;
    for (const auto& [more, files] : std::vector<std::pair<Arguments, std::string>>{
             {{}, ""},
             {{"--verify"}, ""},
             {{"--save", saved}, saved},
             {{"--export", mcap}, mcap},
             {{"--listen", wav, "--rays", "20"}, wav},
             {{"--render", folder / "end%02d.png", "--size", "8x8", "--fps", "4"}, "end%02d.png"},
         }) {
        Arguments arguments{"replay", "--json", log, "--seek", "0.5s", "--for", "1s"};
        arguments.insert(arguments.end(), more.begin(), more.end());
        const Outcome outcome = rtsg(arguments);
        EXPECT_EQ(outcome.status, 1) << testing::PrintToString(more);
        EXPECT_THAT(outcome.err, HasSubstr("missing: 0" + lacks)) << testing::PrintToString(more);
        EXPECT_THAT(outcome.err, HasSubstr(files)) << testing::PrintToString(more);
        EXPECT_THAT(json::parse(outcome.out).at("missing").get<std::string>(), HasSubstr(lacks));
    }
    EXPECT_THAT(readFile(saved), HasSubstr("translation 1 0 0")) << "the last state that there is";
    const Outcome compacted = rtsg({"replay", "--json", log, "--compact", shorter, "--seek", "0.5s", "--for", "1s"});
    EXPECT_EQ(compacted.status, 1);
    EXPECT_THAT(compacted.err, HasSubstr("missing: 0" + lacks + ": " + shorter + " is shorter"));
    EXPECT_EQ(json::parse(compacted.out).at("complete"), false);
    EXPECT_EQ(rtsg({"replay", shorter, "--verify"}).status, 0) << "it is a whole log";
    // All that there is is not more than there is.
    for (const char* asked : {"--save", "--compact"})
        EXPECT_EQ(rtsg({"replay", log, asked, asked == std::string("--save") ? saved : shorter, "--seek", "0.5s",
                        "--for", "0.5s", "--force"})
                      .status,
                  0);
    for (const char* created : {"--save", "--compact", "--export"}) {
        const std::string name = folder / (created == std::string("--save")      ? "none.x3dv"
                                           : created == std::string("--compact") ? "none.rlog"
                                                                                 : "none.mcap");
        const Outcome beyond = rtsg({"replay", log, created, name, "--seek", "2s"});
        EXPECT_EQ(beyond.status, 1);
        EXPECT_THAT(beyond.err, HasSubstr("--seek 2s: the log ends at 1 s"));
        EXPECT_FALSE(std::filesystem::exists(name));
    }
}

/// Options that have no effect with this use are refused, before anything is opened or made.
TEST_F(Replay, OptionsThatGoNotTogetherAreWrongUsage) {
    record(log, scene());
    const std::string created = folder / "made.x3dv", other = folder / "b.rlog";
    const std::vector<std::vector<std::string>> wrong = {
        {"--rerun", file, "--compact", other},
        {"--rerun", file, "--seek", "1s"},
        {"--rerun", file, "--live"},
        {"--compact", other, "--save", created},
        {"--compact", other, "--export", folder / "a.mcap"},
        {"--compact", other, "--verify"},
        {"--compact", other, "--size", "8x8"},
        {"--diff", log, "--save", created},
        {"--diff", log, "--field", "BOX.*"},
        {"--diff", log, "--tolerance", "1"},
        {"--diff", log, "--for", "1s"},
        {"--diff", log, "--blame", "BOX.translation"},
        {"--blame", "BOX.translation", "--render", folder / "a.png"},
        {"--every", "3"},
        {"--interval", "1s", "--verify"},
        {"--export-plain"},
        {"--sound-tolerance", "-20"},
        {"--rerun", file, "--picture-tolerance", ".1"},
        {"--rerun", file, "--name", "one"},
    };
    for (std::vector<std::string> arguments : wrong) {
        arguments.insert(arguments.begin(), {"replay", log});
        const Outcome outcome = rtsg(arguments);
        EXPECT_EQ(outcome.status, 2) << testing::PrintToString(arguments);
        EXPECT_THAT(outcome.err, testing::ContainsRegex("(goes|cannot be combined) with --"));
    }
    for (const std::string& none : {created, other}) EXPECT_FALSE(std::filesystem::exists(none)) << none;
    EXPECT_EQ(rtsg({"replay", log, "--rerun", file, "--verify", "--save", created}).status, 0);
    EXPECT_TRUE(std::filesystem::exists(created));
}

/// A frame in its middle is gone: every use of the log says so, and makes what can be made.
TEST_F(Replay, WhatALogLacksIsSaidByEveryUseOfIt) {
    record(log, scene());
    const std::string gap = folder / "gap.rlog", shorter = folder / "short.rlog";
    std::string bytes = readFile(log);
    std::vector<std::size_t> records;
    for (std::size_t at = bytes.find("RTSGrec1"); at != std::string::npos; at = bytes.find("RTSGrec1", at + 1))
        records.push_back(at);
    bytes.erase(records[12], records[13] - records[12]);
    writeFile(gap, bytes + readFile(log));  // its own keyframes are those of the same states again
    const Outcome compacted = rtsg({"replay", gap, "--compact", shorter, "--json"});
    EXPECT_EQ(compacted.status, 1) << compacted.err;
    EXPECT_THAT(compacted.err, HasSubstr("is not complete"));
    EXPECT_EQ(json::parse(compacted.out).at("complete"), false);
    EXPECT_TRUE(std::filesystem::exists(shorter));
    const std::string hole = folder / "hole.rlog";
    writeFile(hole, bytes);
    const Outcome described = rtsg({"info", hole, "--json"});
    EXPECT_EQ(described.status, 1);
    EXPECT_EQ(json::parse(described.out).at("gaps"), 1);
    EXPECT_GT(json::parse(described.out).at("missing_frames"), 0);
    EXPECT_EQ(json::parse(described.out).at("damaged"), 0);
    EXPECT_THAT(rtsg({"info", hole}).out, testing::ContainsRegex("gaps +1, [0-9]+ frames missing"));
    EXPECT_EQ(rtsg({"info", log}).status, 0);
    const Outcome blamed = rtsg({"replay", gap, "--blame", "BOX.translation", "--json"});
    EXPECT_EQ(blamed.status, 1) << blamed.out;
    EXPECT_EQ(json::parse(blamed.out).at("complete"), false);
    const Outcome compared = rtsg({"diff", log, log, "--json"});
    EXPECT_EQ(compared.status, 0);
    EXPECT_GT(json::parse(compared.out).at("compared"), 10);
    EXPECT_EQ(json::parse(compared.out).at("in_one_alone"), 0);
    const Outcome replayed = rtsg({"replay", log, "--diff", log, "--json"});
    EXPECT_EQ(json::parse(replayed.out).at("compared"), json::parse(compared.out).at("compared"));
}

const char* const kTwo = R"(#X3D V4.0 utf8
PROFILE Immersive
DEF CLOCK TimeSensor { loop TRUE }
DEF WAY PositionInterpolator { key [ 0 1 ] keyValue [ 0 0 0, 1 0 0 ] }
DEF A Transform { }
DEF B Transform { }
ROUTE CLOCK.fraction_changed TO WAY.set_fraction
ROUTE WAY.value_changed TO A.translation
ROUTE WAY.value_changed TO B.translation
)";

/// The second column of a table, as numbers.
std::vector<double> columnOf(const std::string& csv) {
    std::vector<double> numbers;
    std::istringstream lines(csv);
    for (std::string line; std::getline(lines, line);)
        if (line.starts_with("0") || line.starts_with("1"))
            numbers.push_back(std::stod(line.substr(line.find(',') + 1)));
    return numbers;
}

TEST_F(Replay, ALogIsCutToFields) {
    record(log, kTwo);
    const std::string cut = folder / "cut.rlog";
    for (const auto& [option, fields, moves, rests] :
         {std::tuple("--only", "A.translation,CLOCK.*", "A", "B"), std::tuple("--without", "B.*", "A", "B")}) {
        const Outcome outcome = rtsg({"replay", log, option, fields, "-o", cut, "--force", "--json"});
        ASSERT_EQ(outcome.status, 0) << outcome.err;
        EXPECT_TRUE(json::parse(outcome.out).at("complete"));
        EXPECT_EQ(rtsg({"replay", cut, "--verify"}).status, 0);
        const auto of = [&](const std::string& file, const std::string& node) {
            return columnOf(rtsg({"replay", file, "--table", node + ".translation"}).out);
        };
        EXPECT_EQ(of(cut, moves), of(log, moves));
        const std::vector<double> still = of(cut, rests);
        EXPECT_EQ(still.size(), of(log, rests).size());
        EXPECT_TRUE(std::ranges::all_of(still, [&](double x) { return x == still.front(); }));
        EXPECT_LT(std::filesystem::file_size(cut), std::filesystem::file_size(log));
    }
    EXPECT_THAT(rtsg({"replay", log, "--only", "C.*", "-o", folder / "none.rlog"}).err,
                HasSubstr("no state has a field C.*"));
    EXPECT_FALSE(std::filesystem::exists(folder / "none.rlog"));
    for (const std::vector<std::string>& wrong : {std::vector<std::string>{"--only", "A.*"},
                                                  {"--only", "A.*", "-o", cut, "--compact", cut},
                                                  {"--only", "A.*", "-o", folder / "a.csv"},
                                                  {"--only", "A.*", "-o", cut, "--table", "A.*"},
                                                  {"-o", cut}}) {
        std::vector<std::string> words{"replay", log, "--force"};
        words.insert(words.end(), wrong.begin(), wrong.end());
        EXPECT_EQ(rtsg(words).status, 2) << wrong.front();
    }
}

TEST_F(Replay, TwoLogsBecomeOne) {
    record(log, kTwo);
    const std::string other = folder / "b.rlog", both = folder / "both.rlog";
    record(other, scene());
    const Outcome outcome = rtsg({"merge", log, other, "-o", both, "--apart", "3", "--json"});
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    EXPECT_TRUE(json::parse(outcome.out).at("complete"));
    EXPECT_EQ(rtsg({"replay", both, "--verify"}).status, 0);
    EXPECT_EQ(columnOf(rtsg({"replay", both, "--table", "A_A.translation"}).out).back(),
              columnOf(rtsg({"replay", log, "--table", "A.translation"}).out).back());
    EXPECT_THAT(rtsg({"replay", both, "--table", "B.translation"}).out, HasSubstr(",3,0,0"));
    EXPECT_THAT(rtsg({"merge", log, other, "-o", both}).err, HasSubstr("already"));
    EXPECT_EQ(rtsg({"merge", log, other, "-o", log, "--force"}).status, 2);
}

TEST_F(Replay, TimesAreSecondsOrMinutesOrDates) {
    record(log, kTwo);
    const auto rows = [&](const std::vector<std::string>& span) {
        std::vector<std::string> words{"replay", log, "--table", "A.translation"};
        words.insert(words.end(), span.begin(), span.end());
        return rtsg(words);
    };
    const Outcome half = rows({"--seek", "0.5"});
    ASSERT_EQ(half.status, 0) << half.err;
    // Simulated time begins in 2000.
    for (const char* const same : {"0:00.5", "0:00:00.5", "500ms", "2000-01-01T00:00:00.5Z"})
        EXPECT_EQ(rows({"--seek", same}).out, half.out) << same;
    EXPECT_EQ(rows({"--seek", "0", "--for", "0:00.5"}).out, rows({"--seek", "0", "--for", "500ms"}).out);
    for (const char* const wrong : {"1:75", "1:2:3:4", ":5", "5:", "1:-2", "1.5:2", "1999-12-31", "2000-13-01"})
        EXPECT_EQ(rows({"--seek", wrong}).status, 2) << wrong;
    EXPECT_EQ(rows({"--for", "2000-01-01"}).status, 2);  // a date is no duration
    const Outcome set = rtsg({"run", folder / "source.x3dv", "--for", "0:01", "--fps", "10", "--watch", "B.scale",
                              "--set", "B.scale=2 2 2@2000-01-01T00:00:00.5Z"});
    EXPECT_THAT(set.out, HasSubstr("\"t\":0.5")) << set.err;
    EXPECT_THAT(rows({"-o", folder / "a.parquet"}).err, HasSubstr("Apache Arrow"));
}

}  // namespace
}  // namespace rtsg::test
