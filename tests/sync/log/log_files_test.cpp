// A log in several files, read as one: a folder of its pieces, or the files by commas.
#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <rtsg/sync/log_check.h>
#include <rtsg/sync/log_player.h>
#include <rtsg/sync/log_summary.h>

#include "log/log_files.h"
#include "support/log_support.h"

namespace rtsg {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;

class LogFilesOfOne : public test::LogFolder {
  protected:
    /// 60 frames in pieces of a second.
    Recorded pieces() {
        LogOptions options;
        options.rotateSeconds = 1;
        return record(file(), 60, 7, options);
    }
    static std::vector<std::string> names(const fs::path& name) {
        std::vector<std::string> all;
        const auto files = filesOfLog(name);
        EXPECT_TRUE(files) << files.error().format();
        if (files)
            for (const fs::path& one : *files) all.push_back(one.filename());
        return all;
    }
    /// Plays it to its end: the states reached, each of which must be the recorded one.
    static std::uint64_t play(const fs::path& name, const Recorded& recorded) {
        auto opened = Replayer::open(name);
        EXPECT_TRUE(opened) << opened.error().format();
        if (!opened) return 0;
        Replayer& replayer = **opened;
        std::uint64_t states = 0;
        for (Result<bool> more = true; more && *more;) {
            more = replayer.step();
            EXPECT_TRUE(more) << more.error().format();
            const std::uint64_t state = replayer.scene().sequence();
            if (!more || !*more || state == 0) continue;
            ++states;
            EXPECT_EQ(replayer.scene().dump(), recorded.dumps.at(state));
        }
        EXPECT_EQ(replayer.verified(), replayer.frames());
        return states;
    }
};

TEST_F(LogFilesOfOne, AFolderIsPlayedAsOneSession) {
    const Recorded recorded = pieces();
    const auto all = names(folder);
    ASSERT_GE(all.size(), 5u);
    EXPECT_EQ(all.front(), "a.0001.rlog");
    EXPECT_EQ(all.back(), "a.rlog");
    EXPECT_EQ(play(folder, recorded), recorded.dumps.size());
    auto replayer = Replayer::open(folder);
    LogCheck check(**replayer);
    for (Result<bool> more = true; more && *more;) more = check.step();
    check.expectClosed();
    EXPECT_FALSE(check.first()) << check.first()->format();
    EXPECT_TRUE((*replayer)->keyframes().size() >= all.size());
    EXPECT_TRUE(gapsBetweenFiles(folder).empty());
    const auto summary = summariseLog(folder);
    ASSERT_TRUE(summary);
    EXPECT_EQ(summary->sessions, 1u);
    EXPECT_EQ(summary->gaps, 0u);
    EXPECT_TRUE(summary->closed);
    EXPECT_EQ(summary->lastState, recorded.last);
    // By the index of each piece, any time is near.
    for (const auto& [state, time] : recorded.times) {
        ASSERT_TRUE((*replayer)->seek(time));
        EXPECT_EQ((*replayer)->scene().sequence(), state) << time;
        EXPECT_EQ((*replayer)->scene().dump(), recorded.dumps.at(state)) << time;
    }
    auto player = LogPlayer::open(folder);
    ASSERT_TRUE(player);
    EXPECT_NEAR((*player)->length(), 5.9, 1e-6);
}

TEST_F(LogFilesOfOne, FilesByCommasAreReadInTheirOrder) {
    const Recorded recorded = pieces();
    std::string list;
    for (const std::string& name : names(folder)) list += (list.empty() ? "" : ",") + file(name).string();
    EXPECT_EQ(play(list, recorded), recorded.dumps.size());
    const std::string two = file("a.0002.rlog").string() + "," + file("a.0003.rlog").string();
    auto later = Replayer::open(two);
    ASSERT_TRUE(later);
    const auto piece = (*later)->laterPiece();
    ASSERT_TRUE(piece);
    EXPECT_GT(piece->begins, .5);
    // A file of that very name counts as one.
    const fs::path comma = file("b,c.rlog");
    fs::copy_file(file("a.0001.rlog"), comma);
    EXPECT_THAT(names(comma), ElementsAre("b,c.rlog"));
    EXPECT_FALSE(LogReader::open(two + "," + file("none.rlog").string()));
}

TEST_F(LogFilesOfOne, WhatIsMissingBetweenFilesIsNamed) {
    const Recorded recorded = pieces();
    fs::remove(file("a.0003.rlog"));
    const auto gaps = gapsBetweenFiles(folder);
    ASSERT_EQ(gaps.size(), 1u);
    EXPECT_THAT(gaps.front(), HasSubstr("between a.0002.rlog and a.0004.rlog frames "));
    auto replayer = Replayer::open(folder);
    LogCheck check(**replayer);
    for (Result<bool> more = true; more && *more;) more = check.step();
    ASSERT_TRUE(check.first());
    // Both say the same.
    const std::string text = check.first()->text;
    EXPECT_THAT(gaps.front(), HasSubstr(text.substr(0, text.find(" are missing")))) << text;
    EXPECT_EQ((*replayer)->gaps(), 1u);
    EXPECT_EQ((*replayer)->scene().dump(), recorded.dumps.at(recorded.last));
    EXPECT_EQ(summariseLog(folder)->gaps, 1u);
    // The first ones, and the newest.
    fs::remove(file("a.0001.rlog"));
    fs::remove(file("a.rlog"));
    auto middle = Replayer::open(folder);
    ASSERT_TRUE(middle);
    EXPECT_TRUE((*middle)->laterPiece());
    for (Result<bool> more = true; more && *more;) more = (*middle)->step();
    EXPECT_TRUE((*middle)->log().goesOn());
    EXPECT_FALSE((*middle)->log().closed());
}

TEST_F(LogFilesOfOne, ADamagedPieceCostsItsOwnFramesAndIsNamed) {
    const Recorded recorded = pieces();
    std::string bytes = test::readAll(file("a.0002.rlog"));
    for (std::size_t i = bytes.size() / 2; i < bytes.size(); ++i) bytes[i] = 'x';
    test::writeAll(file("a.0002.rlog"), bytes);
    auto replayer = Replayer::open(folder);
    ASSERT_TRUE(replayer);
    for (Result<bool> more = true; !more || *more;) more = (*replayer)->step();
    EXPECT_EQ((*replayer)->scene().dump(), recorded.dumps.at(recorded.last));
    EXPECT_EQ((*replayer)->verified(), (*replayer)->frames());
    ASSERT_FALSE((*replayer)->log().damage().empty());
    EXPECT_THAT((*replayer)->log().damageText(), HasSubstr(" of a.0002.rlog)"));
    // Its keyframes are found without its index.
    ASSERT_TRUE((*replayer)->seek(recorded.times.at(recorded.last)));
    EXPECT_EQ((*replayer)->scene().sequence(), recorded.last);
}

TEST_F(LogFilesOfOne, AFileThatHasBecomeAnotherIsNotRead) {
    pieces();
    auto files = LogFiles::open(folder);
    ASSERT_TRUE(files);
    const auto ends = (*files)->ends();
    const auto bytesFrom = [&](std::uint64_t offset, std::size_t length) {
        ByteBuffer bytes;
        (*files)->read(offset, length, bytes);
        return std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    };
    EXPECT_EQ(bytesFrom(ends[0] - 20, 40), test::readAll(file("a.0001.rlog")).substr(ends[0] - 20) +
                                               test::readAll(file("a.0002.rlog")).substr(0, 20));
    const fs::path third = file("a.0003.rlog");
    test::writeAll(file("other"), std::string(fs::file_size(third), 'x'));
    fs::rename(file("other"), third);
    // The bytes behind it stay where they are.
    EXPECT_EQ(bytesFrom(ends[2] - 8, 16), std::string(8, '\0') + test::readAll(file("a.0004.rlog")).substr(0, 8));
    EXPECT_EQ((*files)->locationAt(ends[1] + 5), " (byte 5 of a.0003.rlog)");
    EXPECT_EQ(bytesFrom(ends.back() - 3, 10).size(), 3u);
}

TEST_F(LogFilesOfOne, AFolderWithoutOneLogIsAnError) {
    EXPECT_THAT(filesOfLog(folder).error().text, HasSubstr("no log"));
    EXPECT_FALSE(LogReader::open(folder));
    record(file("a.rlog"), 3, 1);
    record(file("b.rlog"), 3, 1);
    EXPECT_THAT(filesOfLog(folder).error().text, HasSubstr("several logs in this folder, such as a and b"));
    fs::remove(file("b.rlog"));
    // A date is no number of a piece.
    record(file("a.20261130.rlog"), 3, 1);
    EXPECT_FALSE(filesOfLog(folder));
    fs::remove(file("a.20261130.rlog"));
    EXPECT_THAT(names(folder), ElementsAre("a.rlog"));
    EXPECT_THAT(names(file("none.rlog")), ElementsAre("none.rlog"));
}

}  // namespace
}  // namespace rtsg
