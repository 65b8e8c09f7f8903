// The watch over connections, on connections of its own: which it shuts, and which it leaves alone.
#include "transport/connection_watch.h"

#include <gtest/gtest.h>

#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

namespace rtsg {
namespace {

using namespace std::chrono_literals;

/// Two ends of a TCP connection; what comes to the one is read there, as ZeroMQ does.
struct TcpPair {
    int sender = -1, receiver = -1;

    TcpPair() {
        const int listener = ::socket(AF_INET, SOCK_STREAM, 0);
        sockaddr_in address{};
        address.sin_family = AF_INET;
        address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
        socklen_t length = sizeof(address);
        auto* const any = reinterpret_cast<sockaddr*>(&address);
        EXPECT_EQ(::bind(listener, any, length), 0);
        EXPECT_EQ(::listen(listener, 1), 0);
        EXPECT_EQ(::getsockname(listener, any, &length), 0);
        sender = ::socket(AF_INET, SOCK_STREAM, 0);
        EXPECT_EQ(::connect(sender, any, length), 0);
        receiver = ::accept(listener, nullptr, nullptr);
        ::close(listener);
    }
    ~TcpPair() {
        ::close(sender);
        ::close(receiver);
    }
    TcpPair(const TcpPair&) = delete;
    TcpPair& operator=(const TcpPair&) = delete;
    void bring(std::size_t bytes) const {
        std::vector<char> some(4096);
        for (std::size_t done = 0; done < bytes; done += some.size()) {
            ASSERT_EQ(::send(sender, some.data(), some.size(), MSG_NOSIGNAL), ssize_t(some.size()));
            ASSERT_EQ(::recv(receiver, some.data(), some.size(), MSG_WAITALL), ssize_t(some.size()));
        }
    }
    bool isOpen() const {
        return ::send(sender, "x", 1, MSG_NOSIGNAL) == 1 && ::send(receiver, "x", 1, MSG_NOSIGNAL) == 1;
    }
};

constexpr std::size_t kMuchMore = 2 * ConnectionWatch::kMaxUnfinished;

/// Looks, takes a message from those connections, and says how many were shut.
struct Rounds {
    ConnectionWatch watch;
    ConnectionWatch::Clock::time_point now{};

    std::size_t poll(const std::vector<int>& delivering, bool drained = true) {
        watch.look(now += 10s);
        for (const int descriptor : delivering) watch.delivered(descriptor);
        return watch.shutEndless(drained);
    }
};

TEST(ConnectionWatch, ShutsWhatBringsBytesAndNoMessage) {
    TcpPair pair;
    Rounds rounds;
    rounds.watch.opened(pair.receiver);
    pair.bring(ConnectionWatch::kMaxUnfinished);
    EXPECT_EQ(rounds.poll({}), 0u);
    pair.bring(4096);
    EXPECT_EQ(rounds.poll({}), 1u);
    EXPECT_FALSE(pair.isOpen());
    EXPECT_EQ(rounds.poll({}), 0u) << "once";
}

TEST(ConnectionWatch, LeavesAloneWhatBringsMessages) {
    TcpPair pair;
    Rounds rounds;
    rounds.watch.opened(pair.receiver);
    for (int i = 0; i < 20; ++i) {
        pair.bring(kMuchMore);
        EXPECT_EQ(rounds.poll({pair.receiver}), 0u);
    }
    pair.bring(kMuchMore);
    EXPECT_EQ(rounds.poll({}), 1u) << "and does not any more";
}

/// On a busy machine many messages come and are taken between a look and the end of its turn.
TEST(ConnectionWatch, WhatIsDeliveredAfterALookIsSettled) {
    TcpPair pair;
    ConnectionWatch watch;
    ConnectionWatch::Clock::time_point now{};
    watch.opened(pair.receiver);
    watch.look(now += 10s);
    pair.bring(kMuchMore);
    watch.delivered(pair.receiver);
    EXPECT_EQ(watch.shutEndless(true), 0u);
    watch.look(now += 10s);
    EXPECT_EQ(watch.shutEndless(true), 0u);
    EXPECT_TRUE(pair.isOpen());
}

TEST(ConnectionWatch, AllowsMoreWhileMessagesWait) {
    TcpPair pair;
    Rounds rounds;
    rounds.watch.opened(pair.receiver);
    pair.bring(ConnectionWatch::kMaxWaiting);
    EXPECT_EQ(rounds.poll({}, false), 0u);
    pair.bring(4096);
    EXPECT_EQ(rounds.poll({}, false), 1u);
}

/// The notice that a connection is open comes another way than its messages, and is read once a turn: a machine that is
/// busy may have all messages taken before it is.
TEST(ConnectionWatch, LeavesAloneWhatBroughtItsMessagesBeforeItWasKnownToBeOpen) {
    TcpPair pair;
    Rounds rounds;
    pair.bring(kMuchMore);
    EXPECT_EQ(rounds.poll({pair.receiver}), 0u);
    rounds.watch.opened(pair.receiver);
    EXPECT_EQ(rounds.poll({}), 0u);
    EXPECT_TRUE(pair.isOpen());
    pair.bring(kMuchMore);
    EXPECT_EQ(rounds.poll({}), 1u) << "from then on it is one like all others";
}

/// Another connection may get the same number.
TEST(ConnectionWatch, WhatCameEarlyCountsForTheNextTurnOnly) {
    TcpPair pair;
    Rounds rounds;
    pair.bring(kMuchMore);
    EXPECT_EQ(rounds.poll({pair.receiver}), 0u);
    EXPECT_EQ(rounds.poll({}), 0u);
    rounds.watch.opened(pair.receiver);
    EXPECT_EQ(rounds.poll({}), 1u);
}

TEST(ConnectionWatch, ForgetsWhatIsClosed) {
    TcpPair pair;
    Rounds rounds;
    rounds.watch.opened(pair.receiver);
    EXPECT_TRUE(rounds.watch.any());
    pair.bring(kMuchMore);
    rounds.watch.closed(pair.receiver);
    EXPECT_FALSE(rounds.watch.any());
    EXPECT_EQ(rounds.poll({}), 0u);
}

}  // namespace
}  // namespace rtsg
