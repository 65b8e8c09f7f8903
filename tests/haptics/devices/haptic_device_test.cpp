// Devices: a simulated hand against the closed form of its swing, paths from files, and one at the end of a socket.
#include <chrono>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <thread>

#include <gtest/gtest.h>

#include <arpa/inet.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <glm/geometric.hpp>

#include <rtsg/haptics/haptic_device.h>

namespace rtsg {
namespace {

TEST(SimulatedHand, IsOnItsPath) {
    const auto device = simulatedDevice({{{0, {0, 0, 0}}, {1, {2, 0, 0}}, {3, {2, 4, 0}}}, 0, 0, 0});
    EXPECT_EQ(*device->position(-1), Vec3d(0));
    EXPECT_EQ(*device->position(.5), Vec3d(1, 0, 0));
    EXPECT_EQ(*device->position(2), Vec3d(2, 2, 0));
    EXPECT_FALSE(device->hasEnded());
    EXPECT_EQ(*device->position(9), Vec3d(2, 4, 0));
    EXPECT_TRUE(device->hasEnded());
}

TEST(SimulatedHand, SwingsAsAMassOnASpring) {
    // x = 1 - e^(-c t / 2m) (cos w t + c / (2 m w) sin w t) for a step of the path to 1.
    const double m = .1, k = 40, c = .8;
    const auto device = simulatedDevice({{{0, {0, 0, 0}}, {1e-9, {1, 0, 0}}, {2, {1, 0, 0}}}, m, k, c});
    (void)device->position(0);
    const double decay = c / (2 * m), w = std::sqrt(k / m - decay * decay);
    for (int i = 1; i <= 500; ++i) {
        const double t = 1e-3 * i;
        const double x = 1 - std::exp(-decay * t) * (std::cos(w * t) + decay / w * std::sin(w * t));
        EXPECT_NEAR(device->position(t)->x, x, 3e-3) << t;
    }
    // A force moves its rest by force / stiffness.
    device->push({4, 0, 0});
    for (int i = 501; i <= 6000; ++i) (void)device->position(1e-3 * i);
    EXPECT_NEAR(device->position(6.001)->x, 1 + 4 / k, 1e-4);
}

class HandPath : public testing::Test {
  protected:
    void SetUp() override { write(""); }
    void write(const std::string& text) { std::ofstream(file) << text; }
    void TearDown() override { std::filesystem::remove(file); }
    const std::string file =
        std::filesystem::temp_directory_path() / ("hand-path-" + std::to_string(::getpid()) + ".csv");
};

TEST_F(HandPath, IsReadWithCommentsAndAHeading) {
    write("seconds,x,y,z\n# a knock\n0, 0, 0.1, 0\r\n0.5,0,-.01,0 # in\n\n1,0,.1,0\n");
    const auto path = readHandPath(file);
    ASSERT_TRUE(path) << path.error().format();
    ASSERT_EQ(path->size(), 3u);
    EXPECT_EQ((*path)[1].seconds, .5);
    EXPECT_EQ((*path)[1].position, Vec3d(0, -.01, 0));
}

TEST_F(HandPath, FaultsHaveALine) {
    for (const auto& [text, line] : {std::pair{"0,0,0,0\n1,0,0\n", ":2:"},
                                     {"0,0,0,0\n0.5,a,0,0\n", ":2:"},
                                     {"1,0,0,0\n.5,0,0,0\n", ":2:"},
                                     {"0,0,0,nan\n", ":1:"},
                                     {"", "no path"}}) {
        write(text);
        const auto path = readHandPath(file);
        ASSERT_FALSE(path) << text;
        EXPECT_NE(path.error().format().find(line), std::string::npos) << path.error().format();
    }
    EXPECT_FALSE(readHandPath("/nowhere/at/all.csv"));
}

/// A driver at the other end.
class Driver {
  public:
    explicit Driver(std::uint16_t port) : socket_(::socket(AF_INET, SOCK_DGRAM, 0)) {
        address_.sin_family = AF_INET;
        address_.sin_port = htons(port);
        address_.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
        timeval patience{2, 0};
        ::setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof(patience));
    }
    ~Driver() { ::close(socket_); }
    void send(const void* bytes, std::size_t size) {
        (void)::sendto(socket_, bytes, size, 0, reinterpret_cast<const sockaddr*>(&address_), sizeof(address_));
    }
    Vec3d heard() {
        double numbers[3] = {0, 0, 0};
        EXPECT_EQ(::recv(socket_, numbers, sizeof(numbers), 0), 24);
        return {numbers[0], numbers[1], numbers[2]};
    }

  private:
    const int socket_;
    sockaddr_in address_{};
};

TEST(UdpDevice, BelongsToItsFirstSenderUntilThatIsSilent) {
    std::uint16_t port = 0;
    auto device = udpDevice(0, 0.5, &port);
    ASSERT_TRUE(device) << device.error().format();
    Driver first(port), second(port);
    const double positions[2][3] = {{1, 2, 3}, {4, 5, 6}};
    first.send(positions[0], 24);
    EXPECT_EQ(*(*device)->position(0), Vec3d(1, 2, 3));
    EXPECT_EQ((*device)->warning(), "");
    second.send(positions[1], 24);
    EXPECT_EQ(*(*device)->position(0), Vec3d(1, 2, 3));
    (*device)->push({7, 8, 9});
    EXPECT_EQ(first.heard(), Vec3d(7, 8, 9));
    EXPECT_TRUE((*device)->warning().starts_with("1 datagrams were ignored")) << (*device)->warning();
    std::this_thread::sleep_for(std::chrono::milliseconds(700));
    EXPECT_FALSE((*device)->position(0));
    second.send(positions[1], 24);
    EXPECT_EQ(*(*device)->position(0), Vec3d(4, 5, 6));
    (*device)->push({7, 8, 9});
    EXPECT_EQ(second.heard(), Vec3d(7, 8, 9));
}

TEST(UdpDevice, TakesPlacesAndGivesForces) {
    std::uint16_t port = 0;
    auto device = udpDevice(0, 0.1, &port);
    ASSERT_TRUE(device) << device.error().format();
    ASSERT_NE(port, 0);
    EXPECT_FALSE((*device)->position(0)) << "nobody has said anything";
    (*device)->push({1, 2, 3});  // to nobody
    Driver driver(port);
    driver.send("short", 5);
    EXPECT_FALSE((*device)->position(0));
    const double positions[2][3] = {{1, 2, 3}, {4, 5, 6}};
    driver.send(positions[0], 24);
    driver.send(positions[1], 24);
    EXPECT_EQ(*(*device)->position(0), Vec3d(4, 5, 6)) << "the last one";
    (*device)->push({.5, 0, -1});
    EXPECT_EQ(driver.heard(), Vec3d(.5, 0, -1));
    std::this_thread::sleep_for(std::chrono::milliseconds(120));
    EXPECT_FALSE((*device)->position(0)) << "it stalls";
    driver.send(positions[0], 24);
    EXPECT_TRUE((*device)->position(0)) << "and goes on";
    EXPECT_FALSE(udpDevice(port)) << "the port is taken";
}

TEST(SpaceMouse, MovesTheHandAsLongAsItIsPushed) {
    const std::string name = std::filesystem::temp_directory_path() / ("spnav-" + std::to_string(::getpid()) + ".sock");
    EXPECT_FALSE(spaceMouse(name)) << "no daemon";
    const int daemon = ::socket(AF_UNIX, SOCK_STREAM, 0);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::copy(name.begin(), name.end(), address.sun_path);
    ASSERT_EQ(::bind(daemon, reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
    ASSERT_EQ(::listen(daemon, 1), 0);
    auto mouse = spaceMouse(name, .5);
    ASSERT_TRUE(mouse) << mouse.error().format();
    const int peer = ::accept(daemon, nullptr, nullptr);
    EXPECT_EQ(*(*mouse)->position(0), Vec3d(0));
    const std::int32_t pushed[8] = {0, 350, 0, -175, 0, 0, 0, 16}, button[8] = {1, 0, 1}, rest[8] = {0};
    ASSERT_EQ(::send(peer, pushed, 20, 0), 20);  // a packet in two pieces
    EXPECT_EQ(*(*mouse)->position(.01), Vec3d(0));
    ASSERT_EQ(::send(peer, reinterpret_cast<const char*>(pushed) + 20, 12, 0), 12);
    ASSERT_EQ(::send(peer, button, 32, 0), 32);
    EXPECT_LT(glm::length(*(*mouse)->position(.05) - Vec3d(.02, 0, .01)), 1e-12)
        << "half a metre a second to the right";
    EXPECT_LT(glm::length(*(*mouse)->position(9) - Vec3d(.07, 0, .035)), 1e-12)
        << "at most a tenth of a second at once";
    ASSERT_EQ(::send(peer, rest, 32, 0), 32);
    const Vec3d stood = *(*mouse)->position(9.01);
    EXPECT_EQ(*(*mouse)->position(9.02), stood);
    ::close(peer);
    EXPECT_FALSE((*mouse)->position(9.03)) << "the daemon has gone";
    ::close(daemon);
    std::filesystem::remove(name);
}

}  // namespace
}  // namespace rtsg
