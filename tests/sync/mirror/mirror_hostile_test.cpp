// What strangers may do to a mirror: garbage of every kind, too many of them, wrong keys.
#include <csignal>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <rtsg/core/x3d.h>
#include <rtsg/sync/record.h>

#include "mirror_support.h"
#include "support/stranger.h"
#include "support/temp_folder.h"

namespace rtsg {
namespace {

using namespace std::chrono_literals;
using test::eventually;
using test::pollUntil;
using test::pollUntilAt;
using test::Stranger;

struct Served {
    Scene scene, replica;
    NodeId node;
    int frame = 0;
    std::unique_ptr<MirrorServer> server;
    std::unique_ptr<MirrorClient> client;

    explicit Served(MirrorServerOptions options = {}) {
        server = *MirrorServer::start(scene, test::kAnyPort, std::move(options));
        client = *MirrorClient::connect(replica, server->endpoint());
        node = scene.createNode(x3d::Transform::type);
        step();
    }
    void step() {
        ++frame;
        EXPECT_TRUE(scene.set(node, x3d::Transform::translation, Vec3f(float(frame))));
        scene.newFrame(frame);
        ASSERT_TRUE(pollUntilAt(*client, scene));
        EXPECT_EQ(replica.hash(), scene.hash());
    }
};

TEST(MirrorHostile, GarbageIsCountedReportedAndHarmless) {
    Served served;
    const std::uint64_t seed = 7;
    std::mt19937_64 random(seed);
    Stranger stranger(served.server->endpoint());
    for (int i = 0; i < 400; ++i) {
        std::string text(random() % 120, ' ');
        for (char& c : text) c = static_cast<char>(random());
        if (i % 2 && text.size() >= 8) {  // a right prologue, then nonsense
            text.replace(0, 8, std::string("RTSG\x01", 5) + static_cast<char>(random() % 24) + std::string(2, '\0'));
            if (text[5] == 3 || text[5] == 4 || text[5] == 5) text[5] = 18;
        }
        stranger.say(text, i % 7 == 0);
        if (i % 7 == 0) stranger.say("more", true), stranger.say("");
        if (i % 40 == 0) served.step();
    }
    EXPECT_TRUE(eventually([&] { return served.server->statistics().garbage >= 150; }));
    served.step();
    const auto diagnostics = served.server->takeDiagnostics();
    EXPECT_FALSE(diagnostics.empty());
    EXPECT_LE(diagnostics.size(), 32u) << "who tries again for hours fills nobody's terminal";
    EXPECT_THAT(diagnostics.back().text, testing::HasSubstr("by now"));
    EXPECT_EQ(served.client->statistics().gaps, 0u);
    EXPECT_EQ(served.client->statistics().snapshots, 1u);
}

/// What the origin once had it has had, whatever a later ping says.
TEST(MirrorHostile, APingThatNamesAnOlderStateTakesNothingBack) {
    Scene scene, replica;
    MirrorServerOptions options;
    options.heartbeat = std::chrono::milliseconds(20);
    const auto server = *MirrorServer::start(scene, test::kAnyPort, options);
    std::atomic<bool> dropsFrames{false}, lies{false};
    std::atomic<int> pings{0};
    test::Middleman between(server->endpoint(), [&](bool toClient, test::Middleman::Parts& parts) {
        constexpr std::size_t kState = 8 + 8;  // in a ping, behind its token
        if (!toClient || parts[0].size() < 8) return true;
        if (parts[0][5] == 17) return !dropsFrames;
        if (parts[0][5] != 3 || parts[0].size() < kState + 8) return true;
        ++pings;
        if (lies) parts[0].replace(kState, 8, std::string("\x01\0\0\0\0\0\0\0", 8));
        return true;
    });
    const auto client = *MirrorClient::connect(replica, between.endpoint);
    scene.newFrame(0);
    ASSERT_TRUE(pollUntilAt(*client, scene));
    dropsFrames = true;
    for (int i = 1; i < 6; ++i) scene.newFrame(i);
    ASSERT_TRUE(pollUntil(*client, [&] { return client->statistics().originSequence == scene.sequence(); }));
    lies = true;
    const int before = pings;
    ASSERT_TRUE(pollUntil(*client, [&] { return pings > before + 3; }));
    EXPECT_EQ(client->statistics().originSequence, scene.sequence());
    EXPECT_LT(client->statistics().sequence, scene.sequence());
    EXPECT_FALSE(client->inStep());
}

TEST(MirrorHostile, BytesThatAreNoZeroMqAreCountedAndHarmless) {
    Served served;
    for (int i = 0; i < 5; ++i) {
        const test::RawConnection raw(test::portOf(served.server->endpoint()));
        ASSERT_TRUE(raw.connected);
        const std::string text = i % 2 ? "GET / HTTP/1.1\r\nHost: localhost\r\n\r\n" : std::string(3000, '\xFF');
        EXPECT_TRUE(raw.send(text));
        served.step();
    }
    EXPECT_TRUE(eventually([&] { return served.server->statistics().garbage > 0; }));
    served.step();
}

TEST(MirrorHostile, HellosWithoutEndAreNotAnsweredWithoutEnd) {
    Served served;
    const std::size_t headSize = 1000;  // or what the server counts for an answer, at least
    std::string hello("RTSG\x01\x01\0\0", 8);
    hello += std::string(40, '\x7F') + std::string(1, '\0');
    Stranger stranger(served.server->endpoint());
    const std::uint64_t enough = (std::uint64_t{128} << 20) / headSize;
    std::uint64_t said = 0;
    while (served.server->statistics().garbage == 0 && said < enough) {
        for (int i = 0; i < 100; ++i, ++said) stranger.say(hello);
        served.step();
    }
    // What was said may still be on its way.
    EXPECT_TRUE(eventually([&] {
        served.step();
        return served.server->statistics().garbage > 0;
    })) << said;
}

TEST(MirrorHostile, WhoAsksAgainWhereThereIsNoRoomIsToldOfSeldom) {
    MirrorServerOptions options;
    options.maximumPeers = 1;
    Served served(std::move(options));
    std::string hello("RTSG\x01\x01\0\0", 8);
    hello += std::string(40, '\x7F') + std::string(1, '\0');
    Stranger stranger(served.server->endpoint());
    for (int i = 0; i < 100; ++i) stranger.say(hello);
    EXPECT_TRUE(eventually([&] { return served.server->statistics().refused >= 100; }));
    const auto reported = served.server->takeDiagnostics();
    ASSERT_EQ(reported.size(), 8u + 3u);
    EXPECT_EQ(reported.front().text, "refused a peer: 1 are here already");
    EXPECT_EQ(reported.back().text, "refused a peer: 1 are here already; 64 such things by now");
    served.step();
}

TEST(MirrorHostile, AnOversizedMessageEndsOnlyItsOwnConnection) {
    Served served;
    Stranger stranger(served.server->endpoint());
    stranger.say(std::string(1 << 20, 'x'));
    served.step();
    served.step();
    EXPECT_EQ(served.client->statistics().gaps, 0u);
}

TEST(MirrorHostile, MorePeersThanAllowedAreRefusedWithAReason) {
    MirrorServerOptions options;
    options.maximumPeers = 1;
    Served served(options);
    Scene other;
    auto second = *MirrorClient::connect(other, served.server->endpoint());
    ASSERT_TRUE(pollUntil(*second, [&] { return !second->refusal().empty(); }));
    EXPECT_NE(second->refusal().find("as many peers"), std::string::npos);
    EXPECT_TRUE(second->turnedAway());
    served.step();
    // When the first leaves there is room.
    served.client.reset();
    ASSERT_TRUE(pollUntilAt(*second, served.scene));
    EXPECT_EQ(second->refusal(), "");
    EXPECT_FALSE(second->turnedAway());
    EXPECT_EQ(other.hash(), served.scene.hash());
}

TEST(MirrorHostile, AnotherMachineIsRefusedWithoutKeysUnlessAskedFor) {
    Scene scene;
    const auto open = MirrorServer::start(scene, "tcp://0.0.0.0:*");
    ASSERT_FALSE(open);
    EXPECT_NE(open.error().text.find("give keys"), std::string::npos);
    EXPECT_FALSE(MirrorServer::start(scene, "tcp://*:*"));
    MirrorServerOptions options;
    options.insecure = true;
    EXPECT_TRUE(MirrorServer::start(scene, "tcp://0.0.0.0:*", options));
    for (const char* bad : {"", "tcp://", "tcp://localhost", "carrier-pigeon://x:1", "tcp://:5"}) {
        EXPECT_FALSE(MirrorServer::start(scene, bad)) << bad;
    }
    EXPECT_TRUE(*isLocalEndpoint("tcp://127.3.2.1:99"));
    EXPECT_FALSE(*isLocalEndpoint("tcp://127.evil.example:99"));
    EXPECT_FALSE(*isLocalEndpoint("tcp://10.0.0.1:99"));
}

/// Another run of a server may well have been in a state of the same number.
TEST(MirrorHostile, AStateOfAnotherEpochIsNotResumed) {
    Served served;
    const auto hello = [&](std::uint64_t session, std::uint64_t epoch) {
        std::string text("RTSG\x01\x01\0\0", 8);
        for (const std::uint64_t n :
             {session, std::uint64_t{0}, epoch, served.scene.sequence(), std::uint64_t{1} << 20})
            text.append(reinterpret_cast<const char*>(&n), 8);
        return text + std::string(1, '\0');
    };
    Stranger other(served.server->endpoint()), own(served.server->endpoint());
    other.say(hello(1, served.server->epoch() + 1));
    ASSERT_TRUE(eventually([&] { return served.server->statistics().snapshots == 2; })) << "it gets a keyframe";
    EXPECT_EQ(served.server->statistics().resumed, 0u);
    own.say(hello(2, served.server->epoch()));
    ASSERT_TRUE(eventually([&] { return served.server->statistics().resumed == 1; }));
    EXPECT_EQ(served.server->statistics().snapshots, 2u);
}

/// Its hashes are others: every state would look wrong.
TEST(MirrorHostile, AServerOfAnEarlierFormatIsRefusedSayingSo) {
    Served served;
    test::Middleman middle(served.server->endpoint(), [](bool toClient, std::vector<std::string>& parts) {
        constexpr char kWelcome = 16;
        if (!toClient || parts.size() < 2 || parts[0][5] != kWelcome) return true;
        const auto bytes = std::as_bytes(std::span(parts[1].data(), parts[1].size()));
        ByteBuffer head;
        head.append(bytes);
        head.data()[kRecordHeaderSize] = head.data()[kRecordHeaderSize + 2] = std::byte{2};
        sealRecord(head, *parseRecordHeader(bytes));
        parts[1].assign(reinterpret_cast<const char*>(head.data()), head.size());
        return true;
    });
    Scene replica;
    auto client = *MirrorClient::connect(replica, middle.endpoint);
    ASSERT_TRUE(pollUntil(*client, [&] { return !client->refusal().empty(); }));
    EXPECT_NE(client->refusal().find("those of format 2, ours of 3"), std::string::npos) << client->refusal();
    EXPECT_EQ(replica.nodeCount(), 1u);
}

TEST(MirrorHostile, ARecordLongerThanAllowedIsRefusedWithBothNumbers) {
    Scene scene, replica;
    for (int i = 0; i < 1000; ++i) ASSERT_TRUE(scene.setName(scene.createNode(x3d::Group::type), std::to_string(i)));
    scene.newFrame(1);
    auto server = *MirrorServer::start(scene, test::kAnyPort);
    MirrorClientOptions options;
    options.maxRecord = 1000;
    auto client = *MirrorClient::connect(replica, server->endpoint(), options);
    ASSERT_TRUE(pollUntil(*client, [&] { return !client->refusal().empty(); }));
    EXPECT_NE(client->refusal().find("1000 are the most"), std::string::npos) << client->refusal();
    EXPECT_EQ(replica.nodeCount(), 1u);
    options.maxRecord = 1000000;
    auto second = *MirrorClient::connect(replica, server->endpoint(), options);
    ASSERT_TRUE(pollUntilAt(*second, scene));
}

class MirrorKeysTest : public testing::Test {
  protected:
    MirrorKeys fresh(const char* name) {
        EXPECT_TRUE(MirrorKeys::generate(folder / name));
        return *MirrorKeys::load(folder / name);
    }
    const test::TempFolder own;
    const std::filesystem::path folder = own.path();
};

TEST_F(MirrorKeysTest, OnlyThoseOnTheListGetIn) {
    const MirrorKeys keys = fresh("a"), others = fresh("b");
    EXPECT_FALSE(MirrorKeys::generate(folder / "a")) << "never overwrites";
    Scene scene;
    MirrorServerOptions serverOptions;
    serverOptions.keys = keys;
    auto server = *MirrorServer::start(scene, test::kAnyPort, serverOptions);
    scene.createNode(x3d::Transform::type);
    scene.newFrame(1);

    Scene good, plain, uninvited;
    MirrorClientOptions options;
    options.keys = keys;
    auto client = *MirrorClient::connect(good, server->endpoint(), options);
    ASSERT_TRUE(pollUntilAt(*client, scene));
    EXPECT_EQ(good.hash(), scene.hash());

    auto without = *MirrorClient::connect(plain, server->endpoint());
    MirrorKeys mixed = others;
    mixed.serverPublic = keys.serverPublic;
    options.keys = mixed;
    auto stranger = *MirrorClient::connect(uninvited, server->endpoint(), options);
    ASSERT_TRUE(eventually([&] {
        without->poll();
        stranger->poll();
        return server->statistics().refused > 0 && server->statistics().garbage > 0;
    }));
    EXPECT_EQ(without->statistics().frames, 0u);
    EXPECT_EQ(stranger->statistics().frames, 0u);
    EXPECT_EQ(server->statistics().peers, 1u);
}

/// A list that changes while mirrors follow: who comes onto it gets in, who is no longer on it goes, and a file that
/// makes no sense changes nothing.
TEST_F(MirrorKeysTest, AListThatChangesCountsAtOnce) {
    const MirrorKeys keys = fresh("server");
    const auto content = [&](const std::filesystem::path& file) {
        std::ifstream in(file, std::ios::binary);
        return std::string(std::istreambuf_iterator<char>(in), {});
    };
    const auto write = [&](const std::string& text) { std::ofstream(folder / "server", std::ios::binary) << text; };
    const std::string first = content(folder / "server");
    Scene scene;
    MirrorServerOptions serverOptions;
    serverOptions.keys = keys;
    serverOptions.keyFile = folder / "server";
    auto server = *MirrorServer::start(scene, test::kAnyPort, serverOptions);
    scene.newFrame(1);
    Scene one, other, later;
    MirrorClientOptions options;
    options.keys = keys;
    const auto client = *MirrorClient::connect(one, server->endpoint(), options);
    ASSERT_TRUE(pollUntilAt(*client, scene));

    ASSERT_TRUE(MirrorKeys::addClient(folder / "server", folder / "other", "edits", "kim"));
    options.keys = *MirrorKeys::load(folder / "other");
    const auto added = *MirrorClient::connect(other, server->endpoint(), options);
    ASSERT_TRUE(pollUntilAt(*added, scene));
    EXPECT_EQ(server->statistics().peers, 2u);

    write("client-public half a key\n");
    scene.newFrame(2);
    ASSERT_TRUE(pollUntilAt(*added, scene));
    ASSERT_TRUE(pollUntilAt(*client, scene));

    write(first);  // in place
    ASSERT_TRUE(pollUntil(*added, [&] { return !added->refusal().empty(); }));
    EXPECT_EQ(added->refusal(), "its key is no longer on the list");
    EXPECT_FALSE(added->turnedAway());
    scene.newFrame(3);
    ASSERT_TRUE(pollUntilAt(*client, scene));
    EXPECT_EQ(client->refusal(), "");

    // By another file in its place, as editors do.
    const std::string both = first + "client-public " + options.keys->clientPublic.front() + "\n";
    std::ofstream(folder / "new", std::ios::binary) << both;
    std::filesystem::rename(folder / "new", folder / "server");
    const auto again = *MirrorClient::connect(later, server->endpoint(), options);
    ASSERT_TRUE(pollUntilAt(*again, scene));
    std::string said;
    for (const Diagnostic& d : server->takeDiagnostics()) said += d.format() + '\n';
    EXPECT_NE(said.find("the list of keys stays as it was"), std::string::npos) << said;
}

TEST_F(MirrorKeysTest, FilesAreTheOwnersAloneAndNeverHalf) {
    fresh("a");
    EXPECT_EQ(std::filesystem::status(folder / "a").permissions(),
              std::filesystem::perms::owner_read | std::filesystem::perms::owner_write);
    // A disk on which there is room for some bytes only.
    rlimit before{};
    ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &before), 0);
    const auto handler = std::signal(SIGXFSZ, SIG_IGN);
    rlimit few = before;
    few.rlim_cur = 50;
    ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &few), 0);
    const auto created = MirrorKeys::generate(folder / "b");
    ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &before), 0);
    std::signal(SIGXFSZ, handler);
    EXPECT_FALSE(created);
    EXPECT_FALSE(std::filesystem::exists(folder / "b"));
}

TEST_F(MirrorKeysTest, MalformedKeyFilesAreRefusedWithTheLine) {
    const auto path = folder / "keys";
    const auto write = [&](std::string_view text) {
        FILE* file = std::fopen(path.c_str(), "w");
        std::fwrite(text.data(), 1, text.size(), file);
        std::fclose(file);
    };
    EXPECT_FALSE(MirrorKeys::load(path));
    write("# comment\n\nserver-public tooshort\n");
    const auto bad = MirrorKeys::load(path);
    ASSERT_FALSE(bad);
    EXPECT_EQ(bad.error().where.line, 3u);
    write("door-key rq:rM>}U?@Lns47E1%kR.o@n%FcmmsL/@{H8]yf7\n");
    EXPECT_FALSE(MirrorKeys::load(path));
    write("server-public rq:rM>}U?@Lns47E1%kR.o@n%FcmmsL/@{H8]yf7\n");
    const auto half = MirrorKeys::load(path);
    ASSERT_TRUE(half) << half.error().text;
    EXPECT_FALSE(half->checkForServer());
    EXPECT_FALSE(half->checkForClient());
}

}  // namespace
}  // namespace rtsg
