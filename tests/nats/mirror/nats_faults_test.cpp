// Faults between a scene and its mirrors over NATS, each with its outcome: every hash equal at the end.
#include <random>

#include "link/open_nats.h"
#include "nats/nats_support.h"
#include "sockets/message.h"
#include "support/random_edits.h"

namespace rtsg {
namespace {

using namespace std::chrono_literals;
using test::NatsFollower;
using test::NatsServer;
using test::PublishedScene;

class NatsFaults : public test::WithNats {};

TEST_F(NatsFaults, ANatsServerThatIsKilledAndComesBackCostsFramesThatAreSentAgain) {
    NatsServer nats;
    PublishedScene from(nats.address());
    NatsFollower follower(nats.address());
    ASSERT_TRUE(follower.settle(from));
    for (int kill = 0; kill < 2; ++kill) {
        for (int i = 0; i < 30; ++i) {
            from.poll();
            (void)follower.client->poll(1ms);
        }
        nats.stop(SIGKILL);
        for (int i = 0; i < 30; ++i) {
            from.poll();
            (void)follower.client->poll(1ms);
        }
        nats.start();
        ASSERT_TRUE(test::pollUntil(*follower.client, [&] {
            from.poll();
            return follower.client->statistics().sequence + 5 > from.scene.sequence();
        }));
        ASSERT_TRUE(follower.settle(from));
    }
    EXPECT_EQ(follower.client->statistics().snapshots, 1u) << "what was missed was enough";
    for (const auto& news : {from.publisher->takeDiagnostics(), follower.nats->takeDiagnostics()}) {
        std::string all;
        for (const Diagnostic& d : news) all += d.format() + '\n';
        EXPECT_NE(all.find("the connection to the NATS server is lost"), std::string::npos) << all;
        EXPECT_NE(all.find("there again"), std::string::npos) << all;
    }
    EXPECT_EQ(follower.client->statistics().divergences, 0u);
}

TEST_F(NatsFaults, WhoReadsTooSlowlyGetsWhatIsMissingLater) {
    NatsServer nats;
    PublishedScene from(nats.address());
    NatsFollower slow(nats.address()), quick(nats.address());
    ASSERT_TRUE(slow.settle(from));
    ASSERT_TRUE(quick.settle(from));
    // 24 MB: more than its window of 8 MiB, and less than what is kept.
    for (int i = 0; i < 40; ++i) {
        from.fill(50'000);
        from.poll();
        ASSERT_TRUE(quick.settle(from));
    }
    ASSERT_TRUE(slow.settle(from));
    EXPECT_EQ(slow.client->statistics().snapshots, 1u) << "what was missed was enough";
    EXPECT_EQ(quick.client->statistics().snapshots, 1u) << "nobody waits for the slow one";
    // 96 MB: more than what is kept, so the slow one gets a keyframe.
    for (int i = 0; i < 160; ++i) {
        from.fill(50'000);
        from.poll();
        ASSERT_TRUE(quick.settle(from));
    }
    ASSERT_TRUE(slow.settle(from));
    EXPECT_EQ(slow.client->statistics().snapshots, 2u);
}

TEST_F(NatsFaults, AnotherRunOfTheSceneIsFollowedFromItsState) {
    NatsServer nats;
    auto from = std::make_unique<PublishedScene>(nats.address());
    NatsFollower follower(nats.address());
    ASSERT_TRUE(follower.settle(*from));
    for (int i = 0; i < 20; ++i) from->poll();
    ASSERT_TRUE(follower.settle(*from));
    from.reset();
    PublishedScene again(nats.address(), MirrorUpstream::none, 100);
    for (int i = 0; i < 3; ++i) again.poll();
    ASSERT_TRUE(follower.settle(again));
    EXPECT_EQ(follower.scene.dump(), again.scene.dump());
    EXPECT_EQ(follower.client->statistics().restarts, 1u);
}

/// Messages that anybody may send who may publish: noise, messages cut short, every type with any numbers, records with
/// any header.
std::vector<std::string> rubbish(std::uint64_t seed) {
    std::mt19937_64 random(seed);
    const auto noise = [&](std::size_t length) {
        std::string text(length, '\0');
        for (char& c : text) c = static_cast<char>(random());
        return text;
    };
    std::vector<std::string> messages{""};
    for (int i = 0; i < 100; ++i) messages.push_back(noise(random() % 300));
    for (int type = 0; type < 30; ++type)
        for (int i = 0; i < 4; ++i) {
            std::string first = "RTSG\x01" + std::string(1, static_cast<char>(type)) + std::string(2, '\0');
            for (int k = 0; k < 5; ++k) {
                const std::uint64_t number = random() % 3 ? random() % 200 : random();
                first.append(reinterpret_cast<const char*>(&number), sizeof(number));
            }
            first.resize(first.size() - random() % 20);
            std::string second = random() % 2 ? "RTSGrec1" + noise(100) : noise(random() % 100);
            const auto length = static_cast<std::uint32_t>(first.size());
            messages.push_back(std::string(reinterpret_cast<const char*>(&length), sizeof(length)) + first + second);
        }
    return messages;
}

TEST_F(NatsFaults, RubbishOnEverySubjectIsIgnoredAndCounted) {
    NatsServer nats;
    PublishedScene from(nats.address(), MirrorUpstream::edits);
    NatsFollower follower(nats.address());
    ASSERT_TRUE(follower.settle(from));
    const auto link = openNatsLink(*NatsAddress::parse(nats.address()), "stranger");
    ASSERT_TRUE(link);
    const NatsSubjects subjects("hall");
    for (std::uint64_t seed = 1; seed <= 3; ++seed) {
        for (const std::string& message : rubbish(seed)) {
            const auto bytes = std::as_bytes(std::span(message));
            for (const std::string& subject : {subjects.live, subjects.state}) (*link)->publish(subject, "", bytes);
            (*link)->publish(subjects.ask, "", bytes);
            (*link)->publish(subjects.ask, "_INBOX.somebody", bytes);
        }
        for (int i = 0; i < 20; ++i) {
            from.poll();
            (void)follower.client->poll(1ms);
        }
    }
    EXPECT_EQ((*link)->flush(5s), "");
    ASSERT_TRUE(test::pollUntil(*follower.client, [&] {
        from.poll();
        return follower.client->inStep() && follower.client->statistics().equal;
    }));
    ASSERT_TRUE(follower.settle(from));
    EXPECT_EQ(follower.scene.dump(), from.scene.dump());
    EXPECT_GT(from.publisher->statistics().garbage, 100u);
    EXPECT_GT(follower.nats->statistics().garbage, 100u);
    NatsFollower late(nats.address());
    EXPECT_TRUE(late.settle(from));
}

/// A hello or a refusal of version 2, as a message of NATS.
std::string ofVersion2(mirror::Message type, const std::string& text = {}) {
    std::string first = "RTSG\x02" + std::string(1, static_cast<char>(type)) + std::string(2, '\0');
    if (!text.empty()) first += static_cast<char>(text.size()) + text + '\x01';
    const auto length = static_cast<std::uint32_t>(first.size());
    return std::string(reinterpret_cast<const char*>(&length), sizeof(length)) + first;
}

TEST_F(NatsFaults, AMirrorOfAnotherVersionIsRefusedInItsInboxAlone) {
    NatsServer nats;
    PublishedScene from(nats.address());
    const auto link = openNatsLink(*NatsAddress::parse(nats.address()), "stranger");
    ASSERT_TRUE(link);
    const NatsSubjects subjects("hall");
    for (const std::string& subject : {subjects.state, std::string("_INBOX.rtsg.a")})
        ASSERT_EQ((*link)->subscribe(subject), "");
    ASSERT_EQ((*link)->flush(5s), "");
    const std::string hello = ofVersion2(mirror::Message::hello);
    // Where mirrors believe what comes nobody is answered.
    for (const std::string& reply : {subjects.state, std::string("_INBOX.rtsg.a")})
        ASSERT_EQ((*link)->publish(subjects.ask, reply, std::as_bytes(std::span(hello))), "");
    NatsMessage answer;
    ASSERT_TRUE(test::eventually([&] { return (*link)->take(answer); }));
    EXPECT_EQ(answer.subject, "_INBOX.rtsg.a");
    EXPECT_NE(answer.bytes.find("this server speaks version 1 of the protocol, and this client version 2"),
              std::string::npos);
    EXPECT_EQ(answer.bytes.substr(4, 6), std::string("RTSG\x02") + static_cast<char>(mirror::Message::refused));
    EXPECT_EQ(from.publisher->statistics().garbage, 1u);
}

TEST_F(NatsFaults, AServerOfAnotherVersionIsNamedAndStrangersAreNotBelieved) {
    NatsServer nats;
    const auto link = openNatsLink(*NatsAddress::parse(nats.address()), "server");
    ASSERT_TRUE(link);
    const NatsSubjects subjects("hall");
    ASSERT_EQ((*link)->subscribe(subjects.ask), "");
    ASSERT_EQ((*link)->flush(5s), "");
    NatsFollower follower(nats.address());
    NatsMessage hello;
    ASSERT_TRUE(test::pollUntil(*follower.client, [&] { return (*link)->take(hello); }));
    const std::string strange = ofVersion2(mirror::Message::refused, "go away"),
                      refusal = ofVersion2(mirror::Message::refused, "only version 2");
    ASSERT_EQ((*link)->publish(subjects.state, "", std::as_bytes(std::span(strange))), "");
    ASSERT_EQ((*link)->publish(hello.reply, "", std::as_bytes(std::span(refusal))), "");
    ASSERT_TRUE(test::pollUntil(*follower.client, [&] { return !follower.client->refusal().empty(); }));
    EXPECT_EQ(follower.client->refusal(), "only version 2");
}

TEST_F(NatsFaults, AWrongPasswordIsSaidWithoutIt) {
    NatsServer nats("authorization { user: anna, password: right }");
    const auto wrong = NatsSubscriber::start(nats.address("hall", "anna:wrong@"), 5s);
    ASSERT_FALSE(wrong);
    EXPECT_NE(wrong.error().format().find("uthorization"), std::string::npos) << wrong.error().format();
    EXPECT_EQ(wrong.error().format().find("wrong"), std::string::npos) << wrong.error().format();
    EXPECT_TRUE(NatsSubscriber::start(nats.address("hall", "anna:right@")));
}

}  // namespace
}  // namespace rtsg
