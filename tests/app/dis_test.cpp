// Distributed simulation from the command line: nothing without --dis; with it PDUs come and go, and a log of what came
// needs no network.
#include "program.h"

#include <arpa/inet.h>
#include <sys/socket.h>

#include <array>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

namespace rtsg::test {
namespace {

using testing::HasSubstr;
using testing::Not;

/// A socket of loopback at a port that the system chooses.
class Loopback {
  public:
    Loopback() : number_(::socket(AF_INET, SOCK_DGRAM, 0)) {
        at_.sin_family = AF_INET;
        at_.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
        EXPECT_EQ(::bind(number_, reinterpret_cast<const sockaddr*>(&at_), sizeof(at_)), 0);
        socklen_t size = sizeof(at_);
        ::getsockname(number_, reinterpret_cast<sockaddr*>(&at_), &size);
    }
    ~Loopback() { ::close(number_); }
    Loopback(const Loopback&) = delete;
    Loopback& operator=(const Loopback&) = delete;
    int port() const { return ntohs(at_.sin_port); }
    std::string address() const { return "localhost:" + std::to_string(port()); }
    /// Empty: nothing has come.
    std::string receive() const {
        std::array<char, 2048> bytes{};
        const ssize_t size = ::recv(number_, bytes.data(), bytes.size(), MSG_DONTWAIT);
        return size > 0 ? std::string(bytes.data(), static_cast<std::size_t>(size)) : std::string();
    }
    void sendTo(int port, const std::string& bytes) const {
        sockaddr_in to = at_;
        to.sin_port = htons(static_cast<std::uint16_t>(port));
        ::sendto(number_, bytes.data(), bytes.size(), 0, reinterpret_cast<const sockaddr*>(&to), sizeof(to));
    }

  private:
    int number_;
    sockaddr_in at_{};
};

class Dis : public CommandLine {
  protected:
    void writeScene(const std::string& mode, int port, const std::string& rest = {}) {
        writeFile(file, "#X3D V4.0 utf8\nPROFILE Full\nDEF E EspduTransform { networkMode \"" + mode +
                            "\" address \"localhost\" port " + std::to_string(port) +
                            " siteID 1 applicationID 2 entityID 3 " + rest + " }\n");
    }
};

TEST_F(Dis, OpensNothingUnlessTheUserSaysSo) {
    const Loopback socket;
    writeScene("networkWriter", socket.port());
    const Outcome none = rtsg({"run", file, "--for", ".2s"});
    EXPECT_EQ(none.status, 0);
    EXPECT_THAT(none.err, HasSubstr("EspduTransform E: no network is used for " + socket.address() + ": --dis " +
                                    socket.address() + " allows it [dis]"));
    const Outcome other = rtsg({"run", file, "--for", ".2s", "--dis", "localhost:1"});
    EXPECT_THAT(other.err, HasSubstr("allows it"));
    EXPECT_EQ(socket.receive(), "");
    // The option that the message names helps.
    const Outcome allowed = rtsg({"run", file, "--for", ".2s", "--dis", socket.address()});
    EXPECT_EQ(allowed.err, "");
    const std::string pdu = socket.receive();
    ASSERT_EQ(pdu.size(), 144u);
    EXPECT_EQ(pdu.substr(0, 4), std::string("\x07\x01\x01\x01", 4));
    EXPECT_EQ(pdu.substr(12, 6), std::string("\0\1\0\2\0\3", 6));
}

TEST_F(Dis, WhatWasHeardIsReplayedWithoutANetwork) {
    const int port = [] { return Loopback().port(); }();  // free a moment ago
    writeScene("networkReader", port);
    std::string pdu("\x07\x01\x01\x01\0\0\0\0\0\x90\0\0\0\1\0\2\0\3", 18);
    pdu.resize(144);
    pdu[48] = '\x40', pdu[49] = '\x1c';  // x of its location: 7 m
    const std::string log = folder / "heard.rlog";
    Program program({"record", file, "-o", log, "--for", "1.5s", "--realtime", "--inputs", "--dis", "localhost"},
                    folder / "record");
    const Loopback from;
    for (int k = 0; k < 150; ++k) {
        from.sendTo(port, pdu);
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    const Outcome recorded = program.wait();
    ASSERT_EQ(recorded.status, 0) << recorded.err;
    EXPECT_EQ(recorded.err, "");
    const Outcome verified = rtsg({"replay", log, "--verify", "--json"});
    EXPECT_EQ(verified.status, 0) << verified.err << verified.out;
    const std::string saved = folder / "saved.x3dv";
    const Outcome replayed = rtsg({"replay", log, "--save", saved});
    EXPECT_EQ(replayed.status, 0) << replayed.err;
    EXPECT_THAT(readFile(saved), HasSubstr("translation 7 0 0"));
    EXPECT_THAT(replayed.err, Not(HasSubstr("network")));
}

}  // namespace
}  // namespace rtsg::test
