// rtsg touch: the same ticks each time, contact in the log, drivers at a socket, and what cannot be is named.
#include <fstream>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include "program.h"

namespace rtsg::test {
namespace {

using nlohmann::json;
using testing::HasSubstr;

class Touch : public CommandLine {
  protected:
    json touch(std::vector<std::string> arguments, int status = 0) {
        arguments.insert(arguments.begin(), {"touch", std::string(RTSG_SOURCE_DIR) + "/examples/touch.x3dv"});
        arguments.emplace_back("--json");
        const Outcome outcome = rtsg(arguments);
        EXPECT_EQ(outcome.status, status) << outcome.err;
        said = outcome.err;
        return outcome.out.empty() ? json() : json::parse(outcome.out);
    }
    const std::string knock = std::string("sim:") + RTSG_SOURCE_DIR + "/examples/knock.csv";
    std::string said;
};

TEST_F(Touch, APathIsFeltTheSameEachTimeAndTheLogHasIt) {
    const json first = touch({"--device", knock, "-o", folder / "a.csv", "--record", folder / "a.rlog"}),
               second = touch({"--device", knock, "-o", folder / "b.csv"});
    EXPECT_EQ(first.at("hash"), second.at("hash"));
    EXPECT_EQ(readFile(folder / "a.csv"), readFile(folder / "b.csv"));
    EXPECT_EQ(first.at("contacts"), 4) << first;
    EXPECT_EQ(first.at("missed"), 0) << first;
    const Outcome verified = rtsg({"replay", folder / "a.rlog", "--verify"});
    EXPECT_EQ(verified.status, 0) << verified.err;
    EXPECT_THAT(verified.out, HasSubstr(first.at("hash").get<std::string>()));
    const Outcome blamed = rtsg({"replay", folder / "a.rlog", "--blame", "LAMP.on"});
    EXPECT_THAT(blamed.out, HasSubstr("DRUM.isActive > LAMP.on (4 changes)")) << "two knocks at the drum";
    touch({"--device", knock, "-o", folder / "a.csv"}, 1);  // it is kept
    touch({"--device", knock, "-o", folder / "a.svg"});
    EXPECT_THAT(readFile(folder / "a.svg"), HasSubstr("<polyline"));
}

TEST_F(Touch, ADriverAtASocketIsAnsweredByForces) {
    const std::string prefix = streams();
    Program program(
        {"touch", std::string(RTSG_SOURCE_DIR) + "/examples/touch.x3dv", "--device", "udp:0", "--for", "20s"}, prefix);
    std::string port;
    for (int i = 0; i < 1000 && port.empty(); ++i) {
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
        const std::string said = readFile(prefix + ".err");
        if (const auto at = said.find("127.0.0.1:"), end = said.find('\n', at);
            end != std::string::npos && at != std::string::npos)
            port = said.substr(at + 10, end - at - 10);
    }
    ASSERT_FALSE(port.empty());
    const int driver = ::socket(AF_INET, SOCK_DGRAM, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<std::uint16_t>(std::stoi(port)));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    timeval patience{5, 0};
    ::setsockopt(driver, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof(patience));
    double force = 0;
    for (int i = 0; i < 2000 && force < 1; ++i) {  // down into the cushion
        const double position[3] = {0, .12 - .0001 * i, 0};
        ::sendto(driver, position, sizeof(position), 0, reinterpret_cast<const sockaddr*>(&address), sizeof(address));
        double answer[3] = {0, 0, 0};
        ASSERT_EQ(::recv(driver, answer, sizeof(answer), 0), 24);
        force = answer[1];
    }
    ::close(driver);
    EXPECT_GE(force, 1);
    program.signal(SIGINT);
    EXPECT_EQ(program.wait().status, 1) << "interrupted";
}

TEST_F(Touch, WhatCannotBeIsNamed) {
    std::ofstream(folder / "bad.csv") << "0,0,0,0\n1,0,0\n";
    touch({"--device", "sim:" + std::string(folder / "bad.csv")}, 1);
    EXPECT_THAT(said, HasSubstr("bad.csv:2: "));
    touch({"--device", "sim:/nowhere.csv"}, 1);
    touch({"--device", "udp:99999"}, 2);
    touch({"--device", "hand"}, 2);
    EXPECT_THAT(said, HasSubstr("sim:FILE.csv, udp:PORT or spnav"));
    touch({"--device", "spnav:" + std::string(folder / "none.sock")}, 1);
    EXPECT_THAT(said, HasSubstr("spacenavd"));
    touch({"--device", knock, "-o", folder / "a.txt"}, 2);
    touch({"--device", "udp:0", "--for", ".3s"}, 1);
    EXPECT_THAT(said, HasSubstr("never said where the hand is"));
}

}  // namespace
}  // namespace rtsg::test
