// What server and client may expect of a transport, of ZeroMQ and within a process.
#include <gtest/gtest.h>
#include <poll.h>

#include "sync/mirror/mirror_support.h"
#include "transport/in_process.h"

namespace rtsg {
namespace {

std::span<const std::byte> wordOf(const std::string& text) {
    return std::as_bytes(std::span(text));
}
std::string wordIn(std::span<const std::byte> bytes) {
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

struct TransportKind {
    const char* name;
    std::shared_ptr<Transport> (*make)();
    const char* endpoint;
};

class Transports : public testing::TestWithParam<TransportKind> {
  protected:
    void SetUp() override {
        listener_ = std::move(*transport_->listen(GetParam().endpoint, {nullptr, 8 << 10, -1}));
        endpoint_ = listener_->endpoint();
        connection_ = std::move(*transport_->connect(endpoint_, {}));
        ASSERT_EQ(nextEvent(), Connection::Event::up);
    }
    Connection::Event nextEvent() {
        Connection::Event event{};
        EXPECT_TRUE(test::eventually([&] { return (event = connection_->nextEvent()) != Connection::Event::none; }));
        return event;
    }
    /// Waits as a server does.
    bool atListener(Received& message) {
        return test::eventually([&] {
            std::array<pollfd, Listener::kDescriptors> items{};
            const auto maximum = listener_->prepare(items, false);
            (void)transport_->clock().wait(items, std::min<Clock::duration>(maximum, std::chrono::seconds(1)));
            if (!listener_->came(items)) return false;
            const bool got = listener_->receive(message);
            (void)listener_->received(!got);
            return got;
        });
    }
    /// Waits as a client does.
    bool atConnection(Received& message) {
        return test::eventually([&] {
            if (connection_->receive(message)) return true;
            pollfd item = {connection_->descriptors()[0], POLLIN, 0};
            (void)transport_->clock().wait({&item, 1}, std::chrono::seconds(1));
            return false;
        });
    }
    std::shared_ptr<Transport> transport_ = GetParam().make();
    std::unique_ptr<Listener> listener_;
    std::string endpoint_;
    std::unique_ptr<Connection> connection_;
};

TEST_P(Transports, MessagesComeWholeAndInOrderBothWays) {
    for (int i = 0; i < 100; ++i)
        ASSERT_TRUE(connection_->send(wordOf("question " + std::to_string(i)), wordOf(std::string(i % 3, 'x'))));
    Received message;
    for (int i = 0; i < 100; ++i) {
        ASSERT_TRUE(atListener(message));
        EXPECT_EQ(message.problem, nullptr);
        EXPECT_EQ(wordIn(message.first), "question " + std::to_string(i));
        EXPECT_EQ(message.second.size(), i % 3);
        ASSERT_TRUE(listener_->send(message.from, wordOf("answer " + std::to_string(i)), message.second));
    }
    for (int i = 0; i < 100; ++i) {
        ASSERT_TRUE(atConnection(message));
        EXPECT_EQ(wordIn(message.first), "answer " + std::to_string(i));
        EXPECT_EQ(message.second.size(), i % 3);
    }
    EXPECT_FALSE(connection_->receive(message));
    EXPECT_TRUE(connection_->foundEmpty());
}

TEST_P(Transports, BytesWithAnOwnerLiveUntilTheyAreRead) {
    ASSERT_TRUE(connection_->send(wordOf("who")));
    Received message;
    ASSERT_TRUE(atListener(message));
    const std::string from = message.from;
    auto owner = std::make_shared<std::string>(100000, 'r');
    const std::weak_ptr<std::string> life = owner;
    ASSERT_TRUE(listener_->send(from, wordOf("record"), wordOf(*owner), owner));
    owner.reset();
    ASSERT_TRUE(atConnection(message));
    EXPECT_EQ(wordIn(message.second), std::string(100000, 'r'));
    // The last record is kept for more peers until there is another.
    const auto next = std::make_shared<std::string>(2000, 's');
    ASSERT_TRUE(listener_->send(from, wordOf("record"), wordOf(*next), next));
    ASSERT_TRUE(atConnection(message));
    EXPECT_EQ(wordIn(message.second), *next);
    EXPECT_TRUE(test::eventually([&] { return life.expired(); }));
}

TEST_P(Transports, AnEndIsToldAndAnotherListenerOfThatNameIsFound) {
    const bool named = endpoint_.starts_with("inproc://");
    ASSERT_TRUE(connection_->send(wordOf("who")));
    Received message;
    ASSERT_TRUE(atListener(message));
    const std::string from = message.from;
    listener_.reset();
    EXPECT_EQ(nextEvent(), Connection::Event::down);
    listener_ = std::move(*transport_->listen(endpoint_, {nullptr, 8 << 10, -1}));
    EXPECT_EQ(nextEvent(), Connection::Event::up);
    if (named) {
        EXPECT_FALSE(listener_->send(from, wordOf("to whom it was before"))) << "that connection has ended";
    }
    ASSERT_TRUE(connection_->send(wordOf("again")));
    ASSERT_TRUE(atListener(message));
    EXPECT_EQ(wordIn(message.first), "again");
}

TEST_P(Transports, WhoHasLeftIsKnownToBeGone) {
    ASSERT_TRUE(connection_->send(wordOf("who")));
    Received message;
    ASSERT_TRUE(atListener(message));
    connection_.reset();
    EXPECT_TRUE(test::eventually([&] { return !listener_->send(message.from, wordOf("there?")); }));
}

TEST_P(Transports, OneNameHasOneListener) {
    EXPECT_FALSE(transport_->listen(endpoint_, {nullptr, 8 << 10, -1}));
    ASSERT_TRUE(connection_->send(wordOf("still there?")));
    Received message;
    EXPECT_TRUE(atListener(message));
    EXPECT_FALSE(transport_->isLocal("nonsense"));
}

constexpr TransportKind kKinds[] = {
    {"ZeroMQ", zmqTransport, "tcp://127.0.0.1:*"},
    {"InProcess", [] { return std::shared_ptr<Transport>(std::make_shared<InProcess>()); }, "inproc://hall"}};
INSTANTIATE_TEST_SUITE_P(All, Transports, testing::ValuesIn(kKinds),
                         [](const auto& kind) { return std::string(kind.param.name); });

TEST(InProcess, ARecordIsNotCopied) {
    InProcess transport;
    const auto listener = std::move(*transport.listen("inproc://hall", {}));
    const auto connection = std::move(*transport.connect("inproc://hall", {}));
    ASSERT_TRUE(connection->send(wordOf("who")));
    Received message;
    ASSERT_TRUE(listener->receive(message));
    const auto owner = std::make_shared<std::string>(10, 'r');
    ASSERT_TRUE(listener->send(message.from, wordOf("record"), wordOf(*owner), owner));
    ASSERT_TRUE(connection->receive(message));
    EXPECT_EQ(message.second.data(), wordOf(*owner).data());
}

}  // namespace
}  // namespace rtsg
