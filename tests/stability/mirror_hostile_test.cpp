// Peers that mean harm, in numbers: the server neither crashes nor stalls nor grows, and who follows honestly notices
// nothing. What single malformed messages do is in tests/sync/mirror_hostile_test.cpp.
#include <cstring>
#include <fstream>
#include <random>

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <rtsg/core/x3d.h>

#include "support/own_heap.h"
#include "sync/mirror/mirror_support.h"

namespace rtsg {
namespace {

using namespace std::chrono_literals;
using test::pollUntilAt;

/// What a flood may not add. AddressSanitizer keeps 256 MiB of what was freed.
constexpr std::size_t kMuch = std::size_t{RTSG_HEAP_IS_OURS ? 128 : 640} << 20;

std::size_t residentBytes() {
    std::ifstream statm("/proc/self/statm");
    std::size_t pages = 0;
    statm >> pages >> pages;
    return pages * static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
}

/// A scene, its server and an honest replica, which has to get every frame in good time.
struct Served {
    Scene scene, replica;
    NodeId node;
    int frame = 0;
    std::unique_ptr<MirrorServer> server;
    std::unique_ptr<MirrorClient> client;

    explicit Served(MirrorServerOptions options = {}) {
        options.upstream = MirrorUpstream::edits;
        options.maximumPeers = 16;
        server = *MirrorServer::start(scene, "tcp://127.0.0.1:*", std::move(options));
        client = *MirrorClient::connect(replica, server->endpoint());
        node = scene.createNode(x3d::Transform::type);
        step();
    }
    void step() {
        ++frame;
        server->service();
        EXPECT_TRUE(scene.set(node, x3d::Transform::scale, Vec3f(float(frame))));
        scene.newFrame(frame);
        ASSERT_TRUE(pollUntilAt(*client, scene)) << "frame " << frame;
        EXPECT_EQ(replica.hash(), scene.hash());
        EXPECT_EQ(client->statistics().gaps, 0u);
        EXPECT_EQ(client->statistics().snapshots, 1u);
    }
    int port() const { return std::stoi(server->endpoint().substr(server->endpoint().rfind(':') + 1)); }
};

class Raw {
  public:
    explicit Raw(int port) : descriptor_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
        sockaddr_in address{};
        address.sin_family = AF_INET;
        address.sin_port = htons(static_cast<std::uint16_t>(port));
        address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
        connected = ::connect(descriptor_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0;
    }
    ~Raw() { ::close(descriptor_); }
    Raw(const Raw&) = delete;
    Raw& operator=(const Raw&) = delete;
    void send(std::string_view bytes) const {
        (void)!::send(descriptor_, bytes.data(), bytes.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
    }
    bool connected = false;

  private:
    int descriptor_;
};

/// ZMTP 3.0 (RFC 23): greeting with the NULL mechanism, then READY as a DEALER.
std::string greeting() {
    std::string text("\xFF\0\0\0\0\0\0\0\x01\x7F\x03\0NULL", 16);
    text.resize(64, '\0');
    return text;
}
std::string ready() {
    const std::string body = std::string("\x05READY\x0BSocket-Type\0\0\0\x06", 22) + "DEALER";
    return std::string("\x04", 1) + static_cast<char>(body.size()) + body;
}

/// A ZeroMQ peer that says what it likes.
class Stranger {
  public:
    explicit Stranger(const std::string& endpoint)
        : context_(zmq_ctx_new()), socket_(zmq_socket(context_, ZMQ_DEALER)) {
        const int linger = 0, timeout = 1000;
        zmq_setsockopt(socket_, ZMQ_LINGER, &linger, sizeof(linger));
        zmq_setsockopt(socket_, ZMQ_SNDTIMEO, &timeout, sizeof(timeout));
        zmq_connect(socket_, endpoint.c_str());
    }
    ~Stranger() {
        zmq_close(socket_);
        zmq_ctx_term(context_);
    }
    void say(std::string_view text, bool more = false) {
        zmq_send(socket_, text.data(), text.size(), more ? ZMQ_SNDMORE : 0);
    }

  private:
    void *context_, *socket_;
};

std::string message(int type, std::initializer_list<std::uint64_t> numbers, std::string_view rest = {}) {
    std::string text = std::string("RTSG\x01", 5) + static_cast<char>(type) + std::string(2, '\0');
    for (const std::uint64_t n : numbers) text.append(reinterpret_cast<const char*>(&n), 8);
    return text + std::string(rest);
}

std::string hello(std::uint64_t session, std::uint64_t window = 1 << 20) {
    return message(1, {session, 0, 0, 0, window},
                   std::string("\x04"
                               "evil",
                               5));
}

TEST(MirrorHostileStability, AThousandConnectionsThatSayLittleOrNothing) {
    rlimit limit{};
    ::getrlimit(RLIMIT_NOFILE, &limit);
    limit.rlim_cur = std::min<rlim_t>(limit.rlim_max, 8192);
    ::setrlimit(RLIMIT_NOFILE, &limit);
    if (limit.rlim_cur < 3000) GTEST_SKIP() << "only " << limit.rlim_cur << " files may be open";
    Served served;
    const std::size_t before = residentBytes();
    std::vector<std::unique_ptr<Raw>> all;
    for (int i = 0; i < 1000; ++i) {
        all.push_back(std::make_unique<Raw>(served.port()));
        ASSERT_TRUE(all.back()->connected) << i;
        if (i % 4 == 1) all.back()->send(greeting().substr(0, static_cast<std::size_t>(i) % 64));
        if (i % 4 == 2) all.back()->send(greeting());
        if (i % 4 == 3) all.back()->send(greeting() + ready());
        if (i % 100 == 0) served.step();
    }
    served.step();
    EXPECT_LT(residentBytes(), before + kMuch);
    all.clear();
    for (int i = 0; i < 5; ++i) served.step();
}

TEST(MirrorHostileStability, LengthsThatNobodyHasBytesFor) {
    Served served;
    const std::size_t before = residentBytes();
    std::vector<std::unique_ptr<Raw>> all;
    for (const std::string& length :
         {std::string("\x7F\xFF\xFF\xFF\xFF\xFF\xFF\xFF", 8), std::string("\0\0\0\x10\0\0\0\0", 8),
          std::string("\0\0\0\0\x7F\xFF\xFF\xFF", 8), std::string(8, '\xFF')})
        for (int i = 0; i < 20; ++i) {
            all.push_back(std::make_unique<Raw>(served.port()));
            all.back()->send(greeting() + ready() + std::string("\x02", 1) + length + "x");
        }
    for (int i = 0; i < 10; ++i) served.step();
    EXPECT_LT(residentBytes(), before + (std::size_t{64} << 20));
}

TEST(MirrorHostileStability, MessagesOfEveryTypeWithNumbersOfEveryKind) {
    const std::uint64_t seed = 20;
    std::mt19937_64 random(seed);
    Served served;
    const std::size_t before = residentBytes();
    Stranger stranger(served.server->endpoint());
    const auto number = [&]() -> std::uint64_t {
        constexpr std::uint64_t odd[] = {
            0, 1, 2, 255, 256, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, UINT64_MAX, UINT64_MAX - 1, std::uint64_t{1} << 63};
        return random() % 3 ? odd[random() % std::size(odd)] : random();
    };
    for (int i = 0; i < 20000; ++i) {
        const std::uint64_t session = random() % 3 ? 5 : number();
        const int type = static_cast<int>(random() % 24);
        std::string rest(random() % 60, '\0');
        for (char& c : rest) c = static_cast<char>(random() % 4 ? random() % 4 : random());
        if (type == 5 && random() % 10) continue;  // goodbyes would end the game too soon
        if (i % 50 == 0)
            stranger.say(hello(5, number()));
        else if (type == 2)
            stranger.say(message(2, {session, number(), number()}));
        else if (type == 9)
            stranger.say(
                message(9, {session, number(), random() % 2 ? rest.size() : number(), random() % 2 ? 0 : number()}),
                true),
                stranger.say(rest);
        else
            stranger.say(message(type, {session}, rest));
        if (i % 1000 == 0) served.step();
    }
    served.step();
    EXPECT_LT(residentBytes(), before + (std::size_t{64} << 20)) << "seed " << seed;
    EXPECT_LE(served.server->takeDiagnostics().size(), 100u);
    EXPECT_EQ(served.scene.node(served.node).get(x3d::Transform::translation), Vec3f(0, 0, 0));
}

TEST(MirrorHostileStability, FloodsOfCreditsQuestionsAndRequests) {
    Served served;
    // Enough nodes for a question to be work.
    for (int i = 0; i < 20000; ++i) served.scene.createNode(x3d::Transform::type);
    served.step();
    const std::size_t before = residentBytes();
    Stranger stranger(served.server->endpoint());
    stranger.say(hello(5));
    for (int round = 0; round < 20; ++round) {
        for (int i = 0; i < 500; ++i) {
            stranger.say(message(2, {5, 0, 0}));
            stranger.say(message(6, {5}, std::string(1, '\0')));                               // the whole scene
            stranger.say(message(8, {5}, std::string("\x01\x01\x82\x80\x04", 5)));             // the root, whole
            stranger.say(message(9, {5, std::uint64_t(round * 500 + i + 1), 8000, 0}), true);  // and nothing after it
            stranger.say(std::string(4000, 'x'));
            stranger.say(message(9, {5, std::uint64_t(round * 500 + i + 1), 100, 0}), true);
            stranger.say(std::string(100, 'x'));
        }
        served.step();
    }
    EXPECT_LT(residentBytes(), before + kMuch);
    EXPECT_LE(served.server->statistics().questions, 200u);
    EXPECT_GT(served.server->statistics().garbage, 0u);
}

TEST(MirrorHostileStability, MorePeersThanFitComeAndGo) {
    Served served;
    const std::size_t before = residentBytes();
    for (int round = 0; round < 10; ++round) {
        std::vector<std::unique_ptr<Stranger>> all;
        for (int i = 0; i < 40; ++i) {
            all.push_back(std::make_unique<Stranger>(served.server->endpoint()));
            all.back()->say(hello(static_cast<std::uint64_t>(i) + 1, UINT64_MAX));
        }
        served.step();
        EXPECT_LE(served.server->statistics().peers, 16u);
    }
    EXPECT_LT(residentBytes(), before + (std::size_t{64} << 20));
    served.step();
}

}  // namespace
}  // namespace rtsg
