// Lines that go to files: all of them are there at the end, or it is said how many are not.
#include "sockets/line_sink.h"

#include <algorithm>
#include <chrono>
#include <csignal>
#include <fstream>
#include <functional>
#include <optional>
#include <sstream>
#include <thread>

#include <gtest/gtest.h>
#include <sys/resource.h>

#include "support/temp_folder.h"

namespace rtsg::feeds {

namespace {

std::unique_ptr<LineSink> sinkAt(const std::filesystem::path& name, bool waits = false) {
    auto endpoint = Endpoint::parse(name.string());
    EXPECT_TRUE(endpoint);
    auto sink = LineSink::open(*endpoint, false, waits);
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

/// A file that cannot grow acts like a full disk.
TEST(LineSink, AFileThatMayNotGrowHasWholeLines) {
    test::TempFolder folder;
    const std::filesystem::path file = folder.path() / "lines";
    rlimit before{};
    ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &before), 0);
    const rlimit limit{10'000, before.rlim_max};
    const auto handler = std::signal(SIGXFSZ, SIG_IGN);
    ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &limit), 0);
    const auto sink = sinkAt(file);
    for (int i = 0; i < 20; ++i) sink->write(std::string(999, 'x') + std::to_string(i % 10) + "yyyyy");
    sink->close();
    ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &before), 0);
    (void)std::signal(SIGXFSZ, handler);
    const std::size_t lines = linesOf(file);
    EXPECT_EQ(lines, 9u);
    EXPECT_EQ(std::filesystem::file_size(file), lines * 1006);
    EXPECT_EQ(sink->counts().missed, 20 - lines);
}

namespace {

constexpr std::uint64_t kManyLines = 10'000;  // of a kilobyte: more than waits for one subscriber

/// A client that connects to a sink and reads nothing.
struct Deaf {
    std::unique_ptr<LineSink> sink;
    std::optional<Descriptor> socket;

    Deaf() {
        auto endpoint = Endpoint::parse("tcp://127.0.0.1:0");
        auto opened = LineSink::open(*endpoint, false);
        EXPECT_TRUE(opened);
        sink = std::move(*opened);
        socket.emplace(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
        const int small = 4096;
        EXPECT_EQ(::setsockopt(socket->get(), SOL_SOCKET, SO_RCVBUF, &small, sizeof(small)), 0);
        const auto at = findAddress(*endpoint);
        EXPECT_EQ(::connect(socket->get(), at->get(), at->length), 0);
        EXPECT_TRUE(until([&] { return sink->counts().subscribers == 1; }));
        for (std::uint64_t i = 0; i < kManyLines; ++i) sink->write(std::string(1000, 'x'));
    }
    static bool until(const std::function<bool()>& enough) {
        const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
        while (!enough() && std::chrono::steady_clock::now() < end)
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
        return enough();
    }
};

}  // namespace

TEST(LineSink, LinesThatWaitForSomebodyWhoLeavesAreCounted) {
    Deaf one;
    ASSERT_TRUE(Deaf::until([&] { return one.sink->counts().missed > 0; }));
    const std::uint64_t before = one.sink->counts().missed;
    one.socket.reset();
    ASSERT_TRUE(Deaf::until([&] { return one.sink->counts().subscribers == 0; }));
    EXPECT_GT(one.sink->counts().missed, before);
}

TEST(LineSink, LinesThatWaitForSomebodyAtTheEndAreCounted) {
    Deaf one;
    one.sink->close();
    const std::uint64_t missed = one.sink->counts().missed;
    one.sink.reset();  // which ends the connection
    std::string heard;
    char bytes[65536];
    for (ssize_t size = 0; (size = ::recv(one.socket->get(), bytes, sizeof(bytes), 0)) > 0;)
        heard.append(bytes, static_cast<std::size_t>(size));
    const auto whole = static_cast<std::uint64_t>(std::ranges::count(heard, '\n'));
    EXPECT_LT(whole, kManyLines);
    EXPECT_EQ(whole + missed, kManyLines);
}

}  // namespace rtsg::feeds
