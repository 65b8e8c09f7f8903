// Lines that go to files: all of them are there at the end, or it is said how many are not.
#include "sockets/line_sink.h"

#include <algorithm>
#include <fstream>
#include <sstream>

#include <gtest/gtest.h>

#include "support/temp_folder.h"

namespace rtsg::feeds {

namespace {

std::unique_ptr<LineSink> sinkAt(const std::filesystem::path& name, bool waits = false) {
    auto place = Place::parse(name.string());
    EXPECT_TRUE(place);
    auto sink = LineSink::open(*place, false, waits);
    EXPECT_TRUE(sink);
    return std::move(*sink);
}

std::size_t linesOf(const std::filesystem::path& file) {
    std::ostringstream text;
    text << std::ifstream(file).rdbuf();
    return static_cast<std::size_t>(std::ranges::count(text.view(), '\n'));
}

}  // namespace

/// Whatever the sink's thread is doing when the end is asked for.
TEST(LineSink, AtTheEndAllLinesAreThere) {
    test::TempFolder folder;
    for (int round = 0; round < 400; ++round) {
        const std::filesystem::path file = folder.path() / std::to_string(round);
        const auto sink = sinkAt(file);
        for (int i = 0; i < 20; ++i) sink->write("line");
        sink->close();
        ASSERT_EQ(linesOf(file), 20u) << "round " << round;
        ASSERT_EQ(sink->counts().missed, 0u);
    }
}

TEST(LineSink, AfterTheEndLinesAreMissed) {
    test::TempFolder folder;
    const std::filesystem::path file = folder.path() / "lines";
    const auto sink = sinkAt(file);
    sink->write("one");
    sink->close();
    sink->write("two");
    sink->close();
    EXPECT_EQ(linesOf(file), 1u);
    EXPECT_EQ(sink->counts().missed, 1u);
}

/// More than may wait at once.
TEST(LineSink, WhoMayWaitForRoomLosesNothing) {
    test::TempFolder folder;
    const std::filesystem::path file = folder.path() / "lines";
    const auto sink = sinkAt(file, true);
    const std::string line(1000, 'x');
    for (int i = 0; i < 20'000; ++i) sink->write(line);
    sink->close();
    EXPECT_EQ(sink->counts().missed, 0u);
    EXPECT_EQ(linesOf(file), 20'000u);
}

TEST(LineSink, AFullDiskIsSaidAndItsLinesAreCounted) {
    const auto sink = sinkAt("/dev/full");
    for (int i = 0; i < 5; ++i) sink->write("line");
    sink->close();
    EXPECT_NE(sink->failure(), "");
    EXPECT_EQ(sink->counts().missed, 5u);
}

}  // namespace rtsg::feeds
