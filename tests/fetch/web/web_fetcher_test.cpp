// The files that are fetched, from which servers, how much and for how long: rtsg/fetch/web_fetcher.h. The servers are
// on loopback, and misbehave.
#include <rtsg/fetch/web_fetcher.h>

#include <chrono>
#include <cstdlib>
#include <fstream>
#include <thread>

#include <fcntl.h>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <sys/wait.h>
#include <unistd.h>
#include <zlib.h>

#include <rtsg/core/machine.h>
#include <rtsg/core/resource.h>

#include "lying_server.h"
#include "support/temp_folder.h"
#include "web/held_file.h"

namespace rtsg {
namespace {

using test::LyingServer;
using testing::AllOf;
using testing::HasSubstr;
using Asked = LyingServer::Asked;

constexpr std::uint64_t kMax = 1'000'000;

class WebFetcherTest : public testing::Test {
  protected:
    FetchSettings settings() const {
        FetchSettings result;
        result.rules.allowed = {*WebAddress::parse(server.address("/open/"))};
        result.stallSeconds = 1;
        result.totalSeconds = 20;
        return result;
    }
    /// The text at an address, or why there is none.
    static std::string read(WebFetcher& fetcher, const std::string& address, std::uint64_t maximum = kMax) {
        auto content = fetcher.fetch(address, maximum);
        if (!content) return "refused: " + content.error().text;
        std::string text;
        char block[4096];
        for (ssize_t got = 0; (got = ::read(content->descriptor, block, sizeof block)) > 0;)
            text.append(block, static_cast<std::size_t>(got));
        ::close(content->descriptor);
        return text;
    }
    std::string read(const std::string& path, std::uint64_t maximum = kMax) const {
        WebFetcher fetcher(settings());
        return read(fetcher, server.address(path), maximum);
    }

    LyingServer server;
    const test::TempFolder own;
};

TEST(HeldFile, ItsBytesCountAsMemoryOfTheProcess) {
    constexpr std::uint64_t kMiB = 1 << 20;
    const std::uint64_t before = heldMemory();
    {
        fetch::HeldFile file;
        const std::string block(kMiB, 'x');
        for (int i = 0; i < 64; ++i) ASSERT_TRUE(file.append(block));
        EXPECT_GT(heldMemory(), before + 60 * kMiB);
        const fetch::HeldFile moved = std::move(file);
        EXPECT_GT(heldMemory(), before + 60 * kMiB);
    }
    EXPECT_LT(heldMemory(), before + 32 * kMiB);
}

TEST_F(WebFetcherTest, WhatIsAllowedComesOnceAndStays) {
    server.file("/open/a.x3d", "<X3D/>", "Content-Type: model/x3d+xml; charset=utf-8\r\n");
    WebFetcher fetcher(settings());
    const std::string address = server.address("/open/a.x3d");
    const auto content = fetcher.fetch(address, kMax);
    ASSERT_TRUE(content) << content.error().text;
    EXPECT_EQ(content->address, address);
    EXPECT_EQ(content->mediaType, "model/x3d+xml");
    const int writing = ::open(fmt::format("/proc/self/fd/{}", content->descriptor).c_str(), O_RDWR | O_CLOEXEC);
    EXPECT_LT(::write(writing, "x", 1), 0) << "nobody changes what others read";
    ::close(writing);
    ::close(content->descriptor);
    server.file("/open/a.x3d", "another");
    EXPECT_EQ(read(fetcher, address), "<X3D/>");
    EXPECT_EQ(server.asked(), 1);
    EXPECT_THAT(read(fetcher, address, 3), HasSubstr("more than 3 bytes; --limit bytes=N"));
}

TEST_F(WebFetcherTest, WhatIsNotAllowedIsNotAskedFor) {
    EXPECT_THAT(read("/other/a.png"), HasSubstr("--allow " + server.address("/other/") + " lets it"));
    EXPECT_THAT(read("/open/%2e%2e/other/a.png"), HasSubstr("below no address that may be fetched"));
    EXPECT_EQ(server.asked(), 0);
    EXPECT_THAT(read("/open/none.png"), HasSubstr("the server answers 404"));
}

TEST_F(WebFetcherTest, NamesLeadToPrivateAddressesOnlyIfTheUserNamesThese) {
    // The name is allowed, and a name server says that it is here.
    server.file("/a", "inner");
    FetchSettings open = settings();
    const std::string address = server.address("/a", "evil.localhost");
    open.rules.allowed = {*WebAddress::parse(address)};
    WebFetcher refusing(open);
    EXPECT_THAT(read(refusing, address), HasSubstr("--allow-network"));
    EXPECT_EQ(server.asked(), 0);
    open.rules.networks = {*IpNetwork::parse("127.0.0.0/8")};
    WebFetcher letting(open);
    EXPECT_EQ(read(letting, address), "inner");
    open.rules = {{*WebAddress::parse(server.address("/", "localhost"))}, {}};
    WebFetcher named(open);
    EXPECT_EQ(read(named, server.address("/a", "localhost")), "inner");
}

TEST_F(WebFetcherTest, RedirectsAreCheckedLikeAddresses) {
    server.file("/open/b/c.x3d", "there");
    server.file("/secret", "secret");
    server.redirect("/open/near", "b/c.x3d");
    server.redirect("/open/out", "/secret");
    server.redirect("/open/file", "file:///etc/passwd");
    server.redirect("/open/inside", "http://169.254.169.254/latest/");
    server.redirect("/open/round", "/open/round");
    server.redirect("/open/user", "http://a:b@127.0.0.1/");
    server.at("/open/nowhere", [](const Asked& asked) { asked.send(LyingServer::whole("301 Moved", "")); });
    WebFetcher fetcher(settings());
    auto content = fetcher.fetch(server.address("/open/near"), kMax);
    ASSERT_TRUE(content) << content.error().text;
    EXPECT_EQ(content->address, server.address("/open/b/c.x3d")) << "its own urls start there";
    ::close(content->descriptor);
    EXPECT_THAT(read("/open/out"), AllOf(HasSubstr("it leads to"), HasSubstr("--allow")));
    EXPECT_THAT(read("/open/file"), HasSubstr("'file:' is neither http: nor https:"));
    EXPECT_THAT(read("/open/inside"), HasSubstr("'http://169.254.169.254/latest/': it is below no address"));
    EXPECT_THAT(read("/open/round"), HasSubstr("more than 5 times"));
    EXPECT_THAT(read("/open/user"), HasSubstr("a name or password in an address is not sent"));
    EXPECT_THAT(read("/open/nowhere"), HasSubstr("it is elsewhere, and not where"));
}

TEST_F(WebFetcherTest, ARedirectToAnAllowedNameOfAPrivateAddressIsRefused) {
    server.file("/a", "inner");
    server.redirect("/open/a", server.address("/a", "evil.localhost"));
    FetchSettings both = settings();
    both.rules.allowed.push_back(*WebAddress::parse(server.address("/", "evil.localhost")));
    WebFetcher fetcher(both);
    EXPECT_THAT(read(fetcher, server.address("/open/a")), HasSubstr("--allow-network"));
    EXPECT_EQ(server.asked(), 1);
}

TEST_F(WebFetcherTest, ServersThatStallEndInTime) {
    server.at("/open/silent", [](const Asked& asked) { asked.stall(); });
    server.at("/open/half", [](const Asked& asked) {
        asked.send("HTTP/1.1 200 OK\r\nContent-Length: 100\r\n\r\nhalf of it");
        asked.stall();
    });
    server.at("/open/slow", [](const Asked& asked) {
        asked.send("HTTP/1.1 200 OK\r\nContent-Length: 1000000\r\n\r\n");
        while (!asked.over->load() && asked.send("x")) std::this_thread::sleep_for(std::chrono::milliseconds(20));
    });
    for (const char* path : {"/open/silent", "/open/half"})
        EXPECT_THAT(read(path), HasSubstr("the server took too long")) << path;
    FetchSettings short_ = settings();
    short_.totalSeconds = 1.5;
    WebFetcher fetcher(short_);
    EXPECT_THAT(read(fetcher, server.address("/open/slow")), HasSubstr("the server took too long"));
}

TEST_F(WebFetcherTest, ServersThatNeverEndAreEnded) {
    server.at("/open/headers", [](const Asked& asked) {
        asked.send("HTTP/1.1 200 OK\r\n");
        while (!asked.over->load() && asked.send("X-Padding: " + std::string(500, 'x') + "\r\n")) {
        }
    });
    server.at("/open/continue", [](const Asked& asked) {
        while (!asked.over->load() && asked.send("HTTP/1.1 100 Continue\r\n\r\n")) {
        }
    });
    server.at("/open/body", [](const Asked& asked) {
        asked.send("HTTP/1.1 200 OK\r\n\r\n");
        while (!asked.over->load() && asked.send(std::string(10'000, 'x'))) {
        }
    });
    EXPECT_THAT(read("/open/headers"), HasSubstr("refused: "));
    EXPECT_THAT(read("/open/continue"), HasSubstr("refused: "));
    EXPECT_THAT(read("/open/body"), HasSubstr("more than 1000000 bytes; --limit bytes=N raises this"));
}

TEST_F(WebFetcherTest, LengthsThatAreWrong) {
    server.at("/open/less", [](const Asked& asked) {
        asked.send("HTTP/1.1 200 OK\r\nContent-Length: 100\r\nConnection: close\r\n\r\nten bytes.");
    });
    server.at("/open/more", [](const Asked& asked) {
        asked.send("HTTP/1.1 200 OK\r\nContent-Length: 3\r\nConnection: close\r\n\r\nten bytes.");
    });
    server.at("/open/huge", [](const Asked& asked) {
        asked.send("HTTP/1.1 200 OK\r\nContent-Length: 99999999999\r\nConnection: close\r\n\r\nten bytes.");
    });
    server.at("/open/none", [](const Asked& asked) { asked.send("no HTTP at all"); });
    server.at("/open/part", [](const Asked& asked) { asked.send(LyingServer::whole("206 Partial Content", "a")); });
    EXPECT_THAT(read("/open/less"), HasSubstr("it ended before all of it was there"));
    EXPECT_EQ(read("/open/more"), "ten");
    EXPECT_THAT(read("/open/huge"), HasSubstr("more than 1000000 bytes"));
    EXPECT_THAT(read("/open/none"), HasSubstr("refused: "));
    EXPECT_THAT(read("/open/part"), HasSubstr("the server answers 206"));
}

std::string gzipped(const std::string& text) {
    z_stream stream{};
    constexpr int kGzip = 15 + 16;
    EXPECT_EQ(deflateInit2(&stream, 9, Z_DEFLATED, kGzip, 9, Z_DEFAULT_STRATEGY), Z_OK);
    std::string result(deflateBound(&stream, text.size()), '\0');
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(text.data()));
    stream.avail_in = static_cast<uInt>(text.size());
    stream.next_out = reinterpret_cast<Bytef*>(result.data());
    stream.avail_out = static_cast<uInt>(result.size());
    EXPECT_EQ(deflate(&stream, Z_FINISH), Z_STREAM_END);
    result.resize(stream.total_out);
    deflateEnd(&stream);
    return result;
}

TEST_F(WebFetcherTest, BytesCountUnpacked) {
    server.file("/open/packed", gzipped("a scene"), "Content-Encoding: gzip\r\n");
    const std::string bomb = gzipped(std::string(50'000'000, '\0'));
    ASSERT_LT(bomb.size(), 100'000U);
    server.file("/open/bomb", bomb, "Content-Encoding: gzip\r\n");
    server.file("/open/broken", "no gzip", "Content-Encoding: gzip\r\n");
    server.file("/open/strange", "a scene", "Content-Encoding: zebra\r\n");
    EXPECT_EQ(read("/open/packed"), "a scene");
    EXPECT_THAT(read("/open/bomb"), HasSubstr("more than 1000000 bytes"));
    EXPECT_THAT(read("/open/broken"), HasSubstr("refused: "));
    EXPECT_THAT(read("/open/strange"), HasSubstr("refused: "));
}

TEST_F(WebFetcherTest, AllFilesTogetherAreBounded) {
    FetchSettings few = settings();
    few.totalBytes = 15;
    few.totalFiles = 3;
    WebFetcher fetcher(few);
    for (const char* name : {"/open/a", "/open/b"}) server.file(name, "ten bytes.");
    EXPECT_EQ(read(fetcher, server.address("/open/a")), "ten bytes.");
    EXPECT_THAT(read(fetcher, server.address("/open/b")), HasSubstr("together have more than 15 bytes"));
    (void)read(fetcher, server.address("/open/c"));
    EXPECT_THAT(read(fetcher, server.address("/open/d")), HasSubstr("no more than 3 files"));
}

TEST_F(WebFetcherTest, ProxiesOfTheEnvironmentAreNotUsed) {
    server.file("/open/a", "straight");
    for (const char* name : {"http_proxy", "ALL_PROXY"}) ::setenv(name, "http://127.0.0.1:1/", 1);
    EXPECT_EQ(read("/open/a"), "straight");
    for (const char* name : {"http_proxy", "ALL_PROXY"}) ::unsetenv(name);
}

// ---- kept on disk ---------------------------------------------------------------------------------------------------

class FetchCacheTest : public WebFetcherTest {
  protected:
    FetchSettings settings() const {
        FetchSettings result = WebFetcherTest::settings();
        result.cache = folder;
        return result;
    }
    std::string readAnew(const std::string& path) const {
        WebFetcher fetcher(settings());
        return read(fetcher, server.address(path));
    }
    /// A file that has not changed, with an ETag.
    void unchanging(const std::string& path, const std::string& body) {
        server.at(path, [=, this](const Asked& asked) {
            if (!asked.has("If-None-Match: \"v1\"")) return (void)asked.send(LyingServer::whole("200 OK", body, kTag));
            ++unchanged;
            asked.send("HTTP/1.1 304 Not Modified\r\nConnection: close\r\n\r\n");
        });
    }
    std::vector<std::filesystem::path> files() const {
        std::vector<std::filesystem::path> result;
        for (const auto& one : std::filesystem::directory_iterator(folder / "files")) result.push_back(one.path());
        return result;
    }

    const std::string kTag = "ETag: \"v1\"\r\nContent-Type: text/plain\r\n";
    const std::filesystem::path folder = own.path() / "cache";
    std::atomic<int> unchanged = 0;
};

TEST_F(FetchCacheTest, TheServerIsAskedWhetherItHasChanged) {
    unchanging("/open/a", "a scene");
    EXPECT_EQ(readAnew("/open/a"), "a scene");
    EXPECT_EQ(readAnew("/open/a"), "a scene");
    EXPECT_EQ(unchanged, 1);
    server.file("/open/a", "another", "ETag: \"v2\"\r\n");
    EXPECT_EQ(readAnew("/open/a"), "another");
}

TEST_F(FetchCacheTest, AnUnaskedNotModifiedIsRefused) {
    server.at("/open/a", [](const Asked& asked) { asked.send("HTTP/1.1 304 Not Modified\r\n\r\n"); });
    EXPECT_THAT(readAnew("/open/a"), HasSubstr("it has not changed, and nobody has asked"));
}

TEST_F(FetchCacheTest, WhatIsDamagedOrMissingIsFetchedAgain) {
    unchanging("/open/a", "a scene");
    EXPECT_EQ(readAnew("/open/a"), "a scene");
    ASSERT_EQ(files().size(), 1U);
    std::ofstream(files()[0], std::ios::binary) << "forged.";
    EXPECT_EQ(readAnew("/open/a"), "a scene");
    EXPECT_EQ(unchanged, 0);
    std::filesystem::remove(files()[0]);
    EXPECT_EQ(readAnew("/open/a"), "a scene");
    std::ofstream(folder / "entries" / files()[0].filename()) << "no entry\n";
    EXPECT_EQ(readAnew("/open/a"), "a scene");
    EXPECT_EQ(unchanged, 1);
}

TEST_F(FetchCacheTest, OfflineFilesComeFromTheFolderAndAreNamed) {
    server.file("/open/a", "a scene", "Content-Type: model/x3d+xml\r\n");
    EXPECT_EQ(readAnew("/open/a"), "a scene");
    const int asked = server.asked();
    FetchSettings offline = settings();
    offline.offline = true;
    std::vector<std::string> named;
    offline.fromCache = [&](const std::string& address) { named.push_back(address); };
    WebFetcher fetcher(offline);
    const std::string address = server.address("/open/a");
    EXPECT_EQ(read(fetcher, address), "a scene");
    EXPECT_EQ(read(fetcher, address), "a scene");
    EXPECT_EQ(fetcher.fetch(address, kMax)->mediaType, "model/x3d+xml");
    EXPECT_EQ(named, std::vector{address});
    EXPECT_THAT(read(fetcher, server.address("/open/b")), HasSubstr("the cache does not have it"));
    EXPECT_THAT(read(fetcher, server.address("/other/a")), HasSubstr("--allow")) << "the rules stay";
    EXPECT_EQ(server.asked(), asked);
}

TEST_F(FetchCacheTest, AServerThatIsGoneIsNamedWithTheWayToTheEarlierCopy) {
    server.file("/open/a", "a scene");
    EXPECT_EQ(readAnew("/open/a"), "a scene");
    server.at("/open/a", [](const Asked& asked) { asked.send(""); });
    EXPECT_THAT(readAnew("/open/a"), HasSubstr("--offline takes"));
}

TEST_F(FetchCacheTest, WhatMustNotBeStoredIsNot) {
    server.file("/open/a", "secret", "ETag: \"v1\"\r\nCache-Control: private, no-store\r\n");
    EXPECT_EQ(readAnew("/open/a"), "secret");
    EXPECT_TRUE(files().empty());
}

TEST_F(FetchCacheTest, ItStaysWithinItsLimitAndKeepsWhatWasUsedLast) {
    for (int i = 0; i < 10; ++i)
        server.file(fmt::format("/open/{}", i), std::string(1000, static_cast<char>('a' + i)), "ETag: \"v1\"\r\n");
    FetchSettings small = settings();
    small.cacheBytes = 4000;
    for (int i = 0; i < 10; ++i) {
        WebFetcher fetcher(small);
        EXPECT_EQ(read(fetcher, server.address(fmt::format("/open/{}", i))).size(), 1000U);
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    std::uintmax_t sum = 0;
    for (const auto& one : std::filesystem::recursive_directory_iterator(folder))
        if (one.is_regular_file()) sum += one.file_size();
    EXPECT_LE(sum, 4000U);
    EXPECT_GE(files().size(), 2U);
}

TEST_F(FetchCacheTest, AFolderThatOthersMayWriteIsNotUsed) {
    std::filesystem::create_directories(folder);
    std::filesystem::permissions(folder, std::filesystem::perms::all);
    unchanging("/open/a", "a scene");
    EXPECT_EQ(readAnew("/open/a"), "a scene");
    EXPECT_EQ(readAnew("/open/a"), "a scene");
    EXPECT_EQ(unchanged, 0);
}

TEST_F(FetchCacheTest, ProcessesShareIt) {
    for (int i = 0; i < 8; ++i) unchanging(fmt::format("/open/{}", i), std::string(2000, static_cast<char>('a' + i)));
    std::vector<pid_t> children;
    for (int child = 0; child < 4; ++child) {
        children.push_back(::fork());
        if (children.back() != 0) continue;
        bool good = true;
        FetchSettings small = settings();
        small.cacheBytes = 9000;  // so that they delete each other's
        for (int round = 0; round < 5; ++round)
            for (int i = 0; i < 8; ++i) {
                WebFetcher fetcher(small);
                const std::string text = read(fetcher, server.address(fmt::format("/open/{}", (i + child) % 8)));
                good = good && text == std::string(2000, static_cast<char>('a' + (i + child) % 8));
            }
        ::_exit(good ? 0 : 1);
    }
    for (const pid_t child : children) {
        int status = 0;
        ::waitpid(child, &status, 0);
        EXPECT_EQ(status, 0);
    }
    for (const auto& one : std::filesystem::directory_iterator(folder))
        EXPECT_TRUE(one.is_directory()) << one.path() << " was left";
}

// ---- what others bring ----------------------------------------------------------------------------------------------

TEST_F(WebFetcherTest, WhatALogHasNeedsNoNetworkAndNoPermission) {
    WebFetcher fetcher(FetchSettings{});
    const std::string address = "http://example.org/a.x3d";
    ASSERT_TRUE(fetcher.keep({address, "http://example.org/real/a.x3d", "model/x3d+xml", "hash", "<X3D/>", true}));
    const auto content = fetcher.fetch(address, kMax);
    ASSERT_TRUE(content) << content.error().text;
    EXPECT_EQ(content->address, "http://example.org/real/a.x3d");
    ::close(content->descriptor);
    EXPECT_EQ(read(fetcher, address), "<X3D/>");
    // The first one stays.
    ASSERT_TRUE(fetcher.keep({address, address, {}, "other", "other", true}));
    EXPECT_EQ(read(fetcher, address), "<X3D/>");
    EXPECT_FALSE(fetcher.keep({"file:///etc/passwd", address, {}, {}, "x", true}));
    EXPECT_FALSE(fetcher.keep({address, "../x", {}, {}, "x", true}));
}

TEST_F(WebFetcherTest, AHashRefusesAnotherContentAndGivesNoPermission) {
    server.file("/open/a", "a scene");
    WebFetcher first(settings());
    const std::string address = server.address("/open/a");
    EXPECT_EQ(read(first, address), "a scene");
    std::vector<FetchedFile> fetched;
    EXPECT_EQ(first.forEachFetched(0, false, [&](FetchedFile file) { fetched.push_back(std::move(file)); }), 1U);
    ASSERT_EQ(fetched.size(), 1U);
    EXPECT_EQ(fetched[0].address, address);
    EXPECT_EQ(fetched[0].hash, "d6b00d693f813db59886beb214cc6e1939fe3d29fc1b4349616adf2d36ebdc6a");
    EXPECT_FALSE(fetched[0].hasBytes);
    WebFetcher same(settings());
    ASSERT_TRUE(same.keep(fetched[0]));
    EXPECT_EQ(read(same, address), "a scene");
    server.file("/open/a", "another");
    WebFetcher other(settings());
    ASSERT_TRUE(other.keep(fetched[0]));
    EXPECT_THAT(read(other, address), HasSubstr("it is not what the session had, whose SHA-256 is " + fetched[0].hash));
    const int before = server.asked();
    WebFetcher refusing(FetchSettings{});
    ASSERT_TRUE(refusing.keep(fetched[0]));
    EXPECT_THAT(read(refusing, address), HasSubstr("--allow"));
    EXPECT_EQ(server.asked(), before);
}

TEST_F(FetchCacheTest, AContentWithItsHashIsTakenFromTheFolder) {
    server.file("/open/a", "a scene", "ETag: \"v1\"\r\n");
    WebFetcher first(settings());
    (void)read(first, server.address("/open/a"));
    FetchedFile fetched;
    first.forEachFetched(0, false, [&](FetchedFile file) { fetched = std::move(file); });
    server.file("/open/a", "another");
    WebFetcher again(settings());
    ASSERT_TRUE(again.keep(fetched));
    EXPECT_EQ(read(again, server.address("/open/a")), "a scene");
    EXPECT_EQ(server.asked(), 1);
}

// ---- in the background ----------------------------------------------------------------------------------------------

TEST_F(WebFetcherTest, NobodyNeedWait) {
    std::atomic<bool> go = false;
    server.at("/open/a", [&](const Asked& asked) {
        while (!go && !asked.over->load()) std::this_thread::sleep_for(std::chrono::milliseconds(5));
        asked.send(LyingServer::whole("200 OK", "a scene"));
    });
    FetchSettings background = settings();
    background.inBackground = true;
    background.stallSeconds = 20;
    WebFetcher fetcher(background);
    const std::string address = server.address("/open/a");
    for (int i = 0; i < 5; ++i) EXPECT_TRUE(fetcher.awaits(address, kMax));
    EXPECT_TRUE(fetcher.awaits(server.address("/open/none"), kMax));
    go = true;
    for (int i = 0; i < 2000 && fetcher.awaits(address, kMax); ++i)
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
    EXPECT_FALSE(fetcher.awaits(address, kMax));
    EXPECT_EQ(read(fetcher, address), "a scene");
    EXPECT_THAT(read(fetcher, server.address("/open/none")), HasSubstr("404"));
    EXPECT_EQ(server.asked(), 2);
    WebFetcher waiting(settings());
    EXPECT_FALSE(waiting.awaits(address, kMax)) << "it fetches while one waits";
}

TEST_F(WebFetcherTest, ManyThreadsFetchOnce) {
    server.at("/open/a", [](const Asked& asked) {
        std::this_thread::sleep_for(std::chrono::milliseconds(100));
        asked.send(LyingServer::whole("200 OK", "a scene"));
    });
    WebFetcher fetcher(settings());
    std::atomic<int> good = 0;
    std::vector<std::thread> threads;
    for (int i = 0; i < 8; ++i)
        threads.emplace_back([&] { good += read(fetcher, server.address("/open/a")) == "a scene" ? 1 : 0; });
    for (std::thread& one : threads) one.join();
    EXPECT_EQ(good, 8);
    EXPECT_EQ(server.asked(), 1);
}

TEST_F(WebFetcherTest, ItEndsWhileATransferStalls) {
    server.at("/open/silent", [](const Asked& asked) { asked.stall(); });
    FetchSettings background = settings();
    background.inBackground = true;
    background.stallSeconds = 100;
    const auto begin = std::chrono::steady_clock::now();
    {
        WebFetcher fetcher(background);
        EXPECT_TRUE(fetcher.awaits(server.address("/open/silent"), kMax));
        std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
    EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(15));
}

}  // namespace
}  // namespace rtsg
