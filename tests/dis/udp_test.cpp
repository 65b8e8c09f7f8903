// Datagrams over loopback, at ports that the system chooses; and nodes of two scenes that meet there.
#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>
#include <rtsg/dis/dis_network.h>
#include <rtsg/documents/loader.h>

namespace rtsg {

namespace {

/// A port of loopback that was free a moment ago.
std::uint16_t freePort() {
    const int one = socket(AF_INET, SOCK_DGRAM, 0);
    sockaddr_in at{};
    at.sin_family = AF_INET;
    at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    EXPECT_EQ(bind(one, reinterpret_cast<sockaddr*>(&at), sizeof(at)), 0);
    socklen_t size = sizeof(at);
    getsockname(one, reinterpret_cast<sockaddr*>(&at), &size);
    close(one);
    return ntohs(at.sin_port);
}

std::vector<std::vector<std::uint8_t>> received(DisTransport& transport, const DisAddress& at, std::size_t count) {
    std::vector<std::vector<std::uint8_t>> all;
    for (int tries = 0; tries < 2000 && all.size() < count; ++tries) {
        transport.receive(at, 100,
                          [&](std::span<const std::uint8_t> one) { all.emplace_back(one.begin(), one.end()); });
        if (all.size() < count) usleep(1000);
    }
    return all;
}

}  // namespace

TEST(UdpTransport, UnicastAndItsEnd) {
    const auto reader = udpTransport(), writer = udpTransport();
    const DisAddress at{"localhost", freePort()};
    const std::vector<std::uint8_t> bytes{1, 2, 3};
    EXPECT_TRUE(writer->send(at, {}, bytes));  // nobody listens: lost
    ASSERT_TRUE(reader->listen(at, {}));
    ASSERT_TRUE(reader->listen(at, {}));  // is so already
    const DisAddress byNumber{"127.0.0.1", at.port};
    EXPECT_TRUE(writer->send(at, {}, bytes));
    EXPECT_TRUE(writer->send(byNumber, {}, std::vector<std::uint8_t>{4}));
    const auto all = received(*reader, at, 2);
    ASSERT_EQ(all.size(), 2u);
    EXPECT_EQ(all[0], bytes);
    // Somebody else has the port.
    const auto second = udpTransport();
    const auto refused = second->listen(at, {});
    ASSERT_FALSE(refused);
    EXPECT_NE(refused.error().text.find("cannot listen at localhost:"), std::string::npos) << refused.error().text;
    reader->stopListening(at);
    EXPECT_EQ(reader->receive(at, 1, [](auto) {}), 0u);
    EXPECT_TRUE(second->listen(at, {}));
}

TEST(UdpTransport, NamesThatAreNone) {
    const auto transport = udpTransport();
    EXPECT_FALSE(transport->listen({"300.1.2.3.4", 3000}, {}));
    EXPECT_FALSE(transport->send({"", 0}, {}, std::vector<std::uint8_t>{1}).has_value() &&
                 transport->listen({"no such host", 1}, {}).has_value());
}

TEST(UdpTransport, GroupsAreSharedOnThisMachine) {
    const DisAddress at{"239.255.77.88", freePort()};
    const auto first = udpTransport(), second = udpTransport(), writer = udpTransport();
    if (!first->listen(at, {})) GTEST_SKIP() << "this machine has no multicast";
    ASSERT_TRUE(second->listen(at, {}));
    if (!writer->send(at, {}, std::vector<std::uint8_t>{7})) GTEST_SKIP() << "this machine has no way to groups";
    const auto one = received(*first, at, 1);
    if (one.empty()) GTEST_SKIP() << "this machine does not loop multicast";
    EXPECT_EQ(received(*second, at, 1).size(), 1u);
    EXPECT_EQ(one[0], std::vector<std::uint8_t>{7});
}

TEST(DisNetwork, OverLoopback) {
    const std::string port = std::to_string(freePort());
    const auto text = [&](const std::string& mode, const std::string& rest) {
        return "#X3D V4.0 utf8\nPROFILE Full\nDEF E EspduTransform { networkMode \"" + mode +
               "\" address \"localhost\" port " + port + " entityID 7 " + rest + " }";
    };
    Scene from, to;
    Diagnostics diagnostics;
    ASSERT_TRUE(loadText(from, text("networkWriter", "translation 1 2 3 writeInterval .01"), diagnostics));
    ASSERT_TRUE(loadText(to, text("networkReader", ""), diagnostics));
    DisNetwork writes(from, {.allowed = {"localhost"}}), reads(to, {.allowed = {"localhost"}});
    const NodeId e = to.findName("E");
    for (int k = 0; k < 2000 && !to.node(e).get(x3d::EspduTransform::isActive); ++k) {
        const double t = k / 50.;
        reads.receive(t);
        (void)to.newFrame(t);
        (void)from.newFrame(t);
        writes.send();
        usleep(1000);
    }
    EXPECT_TRUE(to.node(e).get(x3d::EspduTransform::isActive));
    EXPECT_EQ(to.node(e).get(x3d::EspduTransform::translation), Vec3f(1, 2, 3));
    EXPECT_GT(reads.counts().heard, 0u);
    EXPECT_EQ(to.diagnostics().warnings() + from.diagnostics().warnings(), 0u);
}

}  // namespace rtsg
