// The client's own ZMTP: beside ZeroMQ's sockets, in pieces, with what no server should send, and while nobody looks.
#include "mirror/zmtp_link.h"

#include <array>
#include <filesystem>
#include <random>
#include <string>

#include <gtest/gtest.h>

#include <arpa/inet.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include "mirror_support.h"

namespace rtsg {
namespace {

using namespace std::chrono_literals;
using namespace std::string_literals;
using test::eventually;

/// What it is asked for, until it has come.
template <class Condition>
bool waitOnLink(MirrorLink& link, const Condition& condition) {
    const auto end = std::chrono::steady_clock::now() + test::kPatience;
    while (!condition()) {
        if (std::chrono::steady_clock::now() > end) return false;
        link.wait(1ms);
    }
    return true;
}

bool eventComes(MirrorLink& link, MirrorLink::Event wanted) {
    return waitOnLink(link, [&] {
        while (const auto event = link.nextEvent())
            if (*event == wanted) return true;
        return false;
    });
}

std::string asText(std::span<const std::byte> bytes) {
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

std::span<const std::byte> asOctets(const std::string& text) {
    return std::as_bytes(std::span(text));
}

/// The next message, its parts one behind the other.
std::optional<std::string> nextText(MirrorLink& link) {
    std::optional<MirrorLink::Message> message;
    if (!waitOnLink(link, [&] { return bool(message = link.receive()); })) return std::nullopt;
    return asText(message->first) + "|" + asText(message->second);
}

std::unique_ptr<MirrorLink> linkTo(const std::string& endpoint) {
    EXPECT_TRUE(ZmtpLink::addressOf(endpoint)) << endpoint;
    auto link = makeLink(endpoint, std::nullopt);
    EXPECT_TRUE(link->start());
    return link;
}

/// A server that sends what a test says, byte for byte, by TCP.
class ByHand {
  public:
    ByHand() : listener_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
        sockaddr_in address{};
        address.sin_family = AF_INET;
        address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
        socklen_t length = sizeof(address);
        auto* const any = reinterpret_cast<sockaddr*>(&address);
        EXPECT_EQ(::bind(listener_, any, length), 0);
        EXPECT_EQ(::listen(listener_, 10), 0);
        EXPECT_EQ(::getsockname(listener_, any, &length), 0);
        endpoint = "tcp://127.0.0.1:" + std::to_string(ntohs(address.sin_port));
    }
    ~ByHand() {
        hangUp();
        ::close(listener_);
    }
    ByHand(const ByHand&) = delete;
    ByHand& operator=(const ByHand&) = delete;

    std::string endpoint;

    /// The next connection; while nobody connects, the link is given time to.
    bool accept(MirrorLink& link) {
        hangUp();
        pollfd item{listener_, POLLIN, 0};
        if (!waitOnLink(link, [&] { return ::poll(&item, 1, 0) == 1; })) return false;
        connection_ = ::accept(listener_, nullptr, nullptr);
        const int on = 1;
        ::setsockopt(connection_, IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));
        return connection_ >= 0;
    }
    void send(const std::string& bytes) const {
        EXPECT_EQ(::send(connection_, bytes.data(), bytes.size(), MSG_NOSIGNAL), std::ssize(bytes));
    }
    /// As much of it as goes now.
    std::size_t trySend(std::string_view bytes) const {
        return static_cast<std::size_t>(
            std::max<ssize_t>(0, ::send(connection_, bytes.data(), bytes.size(), MSG_NOSIGNAL | MSG_DONTWAIT)));
    }
    /// What the link has sent, of so many bytes.
    std::string receive(MirrorLink& link, std::size_t size) const {
        std::string result;
        std::array<char, 4096> buffer{};
        (void)waitOnLink(link, [&] {
            const ssize_t count =
                ::recv(connection_, buffer.data(), std::min(buffer.size(), size - result.size()), MSG_DONTWAIT);
            if (count > 0) result.append(buffer.data(), static_cast<std::size_t>(count));
            return result.size() == size;
        });
        return result;
    }
    /// Having read what came: else the system takes back what is under way.
    void hangUp() {
        std::array<char, 4096> rest{};
        while (::recv(connection_, rest.data(), rest.size(), MSG_DONTWAIT) > 0) continue;
        if (connection_ >= 0) ::close(connection_);
        connection_ = -1;
    }
    /// Up to where messages can come.
    bool shakeHands(MirrorLink& link) {
        if (!accept(link)) return false;
        send(greeting("NULL") + ready());
        return eventComes(link, MirrorLink::Event::up);
    }

    static std::string greeting(std::string mechanism, char version = 3) {
        mechanism.resize(20);
        return "\xFF"s + std::string(8, '\0') + "\x7F" + version + '\0' + mechanism + std::string(32, '\0');
    }
    static std::string ready() { return "\x04\x1C\5READY\x0BSocket-Type\0\0\0\6ROUTER"s; }
    static std::string frame(const std::string& bytes, bool more = false) {
        std::string result(1, static_cast<char>((more ? 1 : 0) | (bytes.size() > 255 ? 2 : 0)));
        for (int shift = bytes.size() > 255 ? 56 : 0; shift >= 0; shift -= 8)
            result += static_cast<char>(bytes.size() >> shift);
        return result + bytes;
    }

  private:
    int listener_ = -1, connection_ = -1;
};

TEST(ZmtpLink, IsForWhatHasAnAddressWithoutKeys) {
    for (const char* own : {"tcp://127.0.0.1:80", "tcp://10.0.0.1:65535", "ipc:///tmp/x", "ipc://@x"})
        EXPECT_TRUE(ZmtpLink::addressOf(own)) << own;
    for (const char* others :
         {"tcp://localhost:80", "tcp://127.0.0.1:*", "tcp://127.0.0.1:0", "tcp://127.0.0.1:65536", "tcp://127.0.0.1:8x",
          "tcp://127.0.0.1:", "tcp://[::1]:80", "tcp://127.0.0.1;127.0.0.1:80", "tcp:80", "inproc://x", "ipc://", "80"})
        EXPECT_FALSE(ZmtpLink::addressOf(others)) << others;
    EXPECT_FALSE(ZmtpLink::addressOf("ipc:///" + std::string(200, 'x')));
}

TEST(ZmtpLink, PassesMessagesToAndFromARouter) {
    const std::string local =
        "ipc://" + (std::filesystem::temp_directory_path() / ("zmtp-" + std::to_string(::getpid()))).string();
    for (const std::string& where : {std::string(test::kAnyPort), local}) {
        void *context = zmq_ctx_new(), *router = zmq_socket(context, ZMQ_ROUTER);
        const int none = 0;
        zmq_setsockopt(router, ZMQ_LINGER, &none, sizeof(none));
        ASSERT_EQ(zmq_bind(router, where.c_str()), 0);
        std::array<char, 256> bound{};
        std::size_t length = bound.size();
        zmq_getsockopt(router, ZMQ_LAST_ENDPOINT, bound.data(), &length);
        {
            const auto link = linkTo(bound.data());
            ASSERT_TRUE(eventComes(*link, MirrorLink::Event::up)) << where;
            for (const std::size_t size : {0, 1, 255, 256, 8192, 13000, 300'000}) {
                const std::string head(40, 'h'), body(size, 'b');
                ASSERT_TRUE(link->send(asOctets(head), asOctets(body)));
                std::vector<std::string> parts;
                ASSERT_TRUE(waitOnLink(*link, [&] { return !(parts = test::receiveParts(router, 0)).empty(); }));
                ASSERT_EQ(parts.size(), size > 0 ? 3u : 2u);  // with the identity
                EXPECT_EQ(parts[1], head);
                if (size > 0) {
                    EXPECT_EQ(parts[2], body);
                }
                test::sendParts(router, {parts[0], body, head});
                EXPECT_EQ(nextText(*link), body + "|" + head) << size;
            }
        }
        zmq_close(router);
        zmq_ctx_term(context);
    }
}

TEST(ZmtpLink, ReadsWhatComesByteByByte) {
    ByHand server;
    const auto link = linkTo(server.endpoint);
    ASSERT_TRUE(server.accept(*link));
    const std::string large(300, 'l');
    const std::string all = ByHand::greeting("NULL") + ByHand::ready() + ByHand::frame("one") +
                            ByHand::frame(large, true) + ByHand::frame("two") + ByHand::frame("", true) +
                            ByHand::frame("b", true) + ByHand::frame("c") + ByHand::frame("end");
    std::size_t ups = 0;
    for (const char byte : all) {
        server.send(std::string(1, byte));
        link->wait(0ms);
        while (const auto event = link->nextEvent()) ups += *event == MirrorLink::Event::up;
    }
    EXPECT_EQ(nextText(*link), "one|");
    EXPECT_EQ(nextText(*link), large + "|two");
    std::optional<MirrorLink::Message> third;
    ASSERT_TRUE(waitOnLink(*link, [&] { return bool(third = link->receive()); }));
    EXPECT_EQ(third->parts, 3u);
    EXPECT_EQ(asText(third->second), "b");
    EXPECT_EQ(nextText(*link), "end|");
    EXPECT_EQ(ups, 1u);
}

TEST(ZmtpLink, GreetsAndAnswersAPingAsTheProtocolSays) {
    ByHand server;
    const auto link = linkTo(server.endpoint);
    ASSERT_TRUE(server.accept(*link));
    EXPECT_EQ(server.receive(*link, 64), ByHand::greeting("NULL"));
    server.send(ByHand::greeting("NULL"));
    const std::string properties = "\5READY\x0BSocket-Type\0\0\0\6DEALER\x08Identity\0\0\0\0"s;
    EXPECT_EQ(server.receive(*link, 2 + properties.size()),
              "\x04"s + static_cast<char>(properties.size()) + properties);
    server.send(ByHand::ready() + "\x04\x0A\4PING\0\1xyz"s);
    EXPECT_EQ(server.receive(*link, 10), "\x04\x08\4PONGxyz"s);
}

TEST(ZmtpLink, WhatCameBeforeACutIsHandedOverAndTheNextConnectionStands) {
    ByHand server;
    const auto link = linkTo(server.endpoint);
    ASSERT_TRUE(server.shakeHands(*link));
    server.send(ByHand::frame("last words") + ByHand::frame("cut short").substr(0, 5));
    server.hangUp();
    EXPECT_EQ(nextText(*link), "last words|");
    EXPECT_TRUE(eventComes(*link, MirrorLink::Event::cut));
    EXPECT_FALSE(link->send(asOctets("x")));
    ASSERT_TRUE(server.shakeHands(*link));
    server.send(ByHand::frame("again"));
    EXPECT_EQ(nextText(*link), "again|");
    link->reconnect(1000ms);
    ASSERT_TRUE(server.shakeHands(*link));
    server.send(ByHand::frame("and again"));
    EXPECT_EQ(nextText(*link), "and again|");
}

TEST(ZmtpLink, WhoIsNoServerIsNoneAndAskedAgain) {
    const std::string good = ByHand::greeting("NULL");
    const std::string bad[] = {"HTTP/1.1 400 Bad Request\r\n\r\n" + std::string(64, ' '),
                               ByHand::greeting("CURVE"),
                               ByHand::greeting("NULL", 1),
                               good + "\x04\x06\5ERROR"s,
                               good + ByHand::frame("a message before the handshake"),
                               good + "\xF0\x01x"s};
    ByHand server;
    const auto link = linkTo(server.endpoint);
    for (const std::string& bytes : bad) {
        ASSERT_TRUE(server.accept(*link)) << bytes;
        server.send(bytes);
    }
    ASSERT_TRUE(server.shakeHands(*link));
    EXPECT_FALSE(link->nextEvent());
}

/// Announced, or by parts without end: the connection ends before the memory does.
TEST(ZmtpLink, MessagesWithoutEndEndTheConnection) {
    ByHand server;
    const auto link = linkTo(server.endpoint);
    ASSERT_TRUE(server.shakeHands(*link));
    server.send("\x02\0\0\0\0\1\0\0\1"s);  // 16 MiB and a byte
    EXPECT_TRUE(eventComes(*link, MirrorLink::Event::cut));
    server.hangUp();
    ASSERT_TRUE(server.shakeHands(*link));
    server.send("\x02\xFF\xFF\xFF\xFF\xFF\xFF\xFF\xFF"s);
    EXPECT_TRUE(eventComes(*link, MirrorLink::Event::cut));
    server.hangUp();
    ASSERT_TRUE(server.shakeHands(*link));
    const std::string part = ByHand::frame(std::string(1 << 16, 'x'), true);
    std::size_t sent = 0;
    EXPECT_TRUE(waitOnLink(*link, [&] {
        sent += server.trySend(std::string_view(part).substr(sent % part.size()));
        return link->nextEvent() == MirrorLink::Event::cut;
    }));
    EXPECT_GT(sent, MirrorLink::kLongestMessage);
    EXPECT_FALSE(link->receive());
}

TEST(ZmtpLink, RandomBytesAreMessagesOrTheEnd) {
    for (unsigned seed = 0; seed < 200; ++seed) {
        ByHand server;
        const auto link = linkTo(server.endpoint);
        std::mt19937 random(seed);
        ASSERT_TRUE(server.accept(*link)) << seed;
        std::string bytes = ByHand::greeting("NULL") + ByHand::ready();
        for (int i = 0; i < 4; ++i) bytes += ByHand::frame(std::string(random() % 600, 'm'), random() % 2 == 0);
        for (unsigned i = 0; i <= seed % 4; ++i) bytes[random() % bytes.size()] = static_cast<char>(random());
        server.send(bytes.substr(0, random() % (bytes.size() + 1)));
        for (int i = 0; i < 3; ++i) {
            link->wait(1ms);
            while (const auto message = link->receive()) ASSERT_LE(message->first.size(), bytes.size()) << seed;
        }
        link->reconnect(1000ms);
        EXPECT_FALSE(link->receive()) << seed;
    }
}

/// The system keeps less of it than this: who is busy elsewhere has it read by another thread.
TEST(ZmtpLink, WhatComesWhileNobodyLooksIsThereAfterwards) {
    ByHand server;
    const auto link = linkTo(server.endpoint);
    ASSERT_TRUE(server.shakeHands(*link));
    server.send(ByHand::frame("handed over"));
    const std::optional<std::string> first = nextText(*link);
    EXPECT_EQ(first, "handed over|");
    constexpr std::size_t kMegabytes = 30;
    const std::string megabyte(std::size_t{1} << 20, 'm');
    std::string all;
    for (std::size_t i = 0; i < kMegabytes; ++i) all += ByHand::frame(megabyte);
    std::size_t sent = 0;
    EXPECT_TRUE(eventually([&] {
        sent += server.trySend(std::string_view(all).substr(sent));
        return sent == all.size();
    }));
    server.hangUp();
    for (std::size_t i = 0; i < kMegabytes; ++i) ASSERT_TRUE(nextText(*link) == megabyte + "|") << i;
    EXPECT_TRUE(eventComes(*link, MirrorLink::Event::cut));
}

}  // namespace
}  // namespace rtsg
