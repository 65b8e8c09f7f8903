// Feeds and publishers at a scene: what comes in takes effect, what makes no sense is counted, what is sent goes out.
#include <fcntl.h>
#include <sys/socket.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <fstream>
#include <thread>

#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/feeds/feed.h>
#include <rtsg/feeds/publisher.h>

#include "sockets/endpoint.h"
#include "support/temp_folder.h"

namespace rtsg {

namespace {

constexpr auto kPatience = std::chrono::seconds(60);

/// A connection of this process to a place that listens there.
class Visitor {
  public:
    explicit Visitor(const std::string& endpoint) {
        const auto where = feeds::Endpoint::parse(endpoint);
        const auto address = feeds::findAddress(*where);
        const bool datagrams = where->kind == feeds::Endpoint::Kind::udp;
        socket_ = Descriptor(::socket(AF_INET, datagrams ? SOCK_DGRAM : SOCK_STREAM, 0));
        EXPECT_EQ(::connect(socket_.get(), address->get(), address->length), 0) << endpoint;
        const timeval patience = {60, 0};
        (void)::setsockopt(socket_.get(), SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof(patience));
    }
    void say(std::string_view text) const {
        EXPECT_EQ(::send(socket_.get(), text.data(), text.size(), 0), static_cast<ssize_t>(text.size()));
    }
    std::string line() {
        while (rest_.find('\n') == std::string::npos) {
            char bytes[4096];
            const ssize_t size = ::recv(socket_.get(), bytes, sizeof(bytes), 0);
            if (size <= 0) return "the end";
            rest_.append(bytes, static_cast<std::size_t>(size));
        }
        std::string line = rest_.substr(0, rest_.find('\n'));
        rest_.erase(0, line.size() + 1);
        return line;
    }

  private:
    Descriptor socket_;
    std::string rest_;
};

class FedScene : public testing::Test {
  protected:
    FedScene() {
        Diagnostics diagnostics;
        EXPECT_TRUE(loadText(scene, R"(#X3D V4.0 utf8
PROFILE Full
DEF A Transform { }
DEF B Transform { }
DEF FLAG BooleanToggle { }
DEF GATE BooleanFilter { }
DEF SOUND AudioClip { }
DEF CODE Script { inputOnly SFBool go }
DEF PASS BooleanTrigger { }
DEF PICTURE ImageTexture { }
ROUTE GATE.inputTrue TO FLAG.toggle
)",
                             diagnostics));
    }
    void start(FeedOptions options) {
        auto created = Feed::start(scene, std::move(options));
        ASSERT_TRUE(created) << created.error().text;
        feed = std::move(*created);
    }
    void start(const std::string& source) {
        FeedOptions options;
        options.source = source;
        start(std::move(options));
    }
    void frame() {
        feed->deliver(time);
        scene.newFrame(time);
        time += 1;
    }
    /// Runs frames until so many lines have come and been dealt with.
    void framesUntil(std::uint64_t lines) {
        const auto end = std::chrono::steady_clock::now() + kPatience;
        const auto done = [&] {
            const FeedCounts c = feed->counts();
            return c.lines >= lines && feed->nextAt() > 1e30;
        };
        while (!done() && std::chrono::steady_clock::now() < end) {
            frame();
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
        }
        frame();
        EXPECT_EQ(feed->counts().lines, lines);
    }
    Vec3f position(const char* node) const { return scene.node(scene.findName(node)).get(x3d::Transform::translation); }
    std::vector<std::string> news() {
        std::vector<std::string> all;
        for (const Diagnostic& d : feed->takeDiagnostics()) all.push_back(d.format());
        return all;
    }

    Scene scene;
    std::unique_ptr<Feed> feed;
    double time = 0;
    test::TempFolder folder;
};

}  // namespace

TEST_F(FedScene, DatagramsTakeEffectInTheNextFrame) {
    start("udp://127.0.0.1:0");
    Visitor(feed->source()).say(R"({"node":"A","field":"translation","value":[1,2,3],"author":"Ann"})");
    std::string author;
    struct Authors : Subscriber {
        std::string& into;
        explicit Authors(std::string& text) : into(text) {}
        Result<> apply(const Scene&, const ChangeSet& set) override {
            if (set.authors && !set.authors->empty()) into = set.authors->front().author.view();
            return {};
        }
        std::string subscriberName() const override { return "authors"; }
    } subscriber(author);
    const Attachment attachment = scene.bus().attach(subscriber);
    framesUntil(1);
    EXPECT_EQ(position("A"), Vec3f(1, 2, 3));
    EXPECT_EQ(author, "Ann");
}

TEST_F(FedScene, ConnectionsSendLinesInPieces) {
    start("tcp://127.0.0.1:0");
    const Visitor one(feed->source());
    {
        const Visitor other(feed->source());
        one.say("A,translation,");
        other.say("node,value,field\nB,4 5 6,translation\nB,7 8 9");  // the last one is half a line
        one.say("1 2 3\n");
    }
    framesUntil(4);
    EXPECT_EQ(position("A"), Vec3f(1, 2, 3));
    EXPECT_EQ(position("B"), Vec3f(4, 5, 6));
    EXPECT_EQ(feed->counts().faulty, 1u);
    EXPECT_EQ(feed->counts().events, 2u);
    const auto said = news();
    ASSERT_EQ(said.size(), 1u);
    EXPECT_NE(said[0].find("2 cells, and the header has 3"), std::string::npos) << said[0];
}

// A browser sends them for any page, of any site, to any port.
TEST_F(FedScene, RequestsOfHttpAreNoLines) {
    start("tcp://127.0.0.1:0");
    const std::string body = "\r\nA,translation,9 9 9\n{\"node\":\"A\",\"field\":\"translation\",\"value\":[9,9,9]}\n";
    const Visitor whole(feed->source());
    whole.say("POST / HTTP/1.1\r\nHost: 127.0.0.1\r\n" + body);
    const Visitor pieces(feed->source());
    pieces.say("P");
    const Visitor other(feed->source());
    other.say("G");  // as GATE begins, and GET
    pieces.say("UT / HTTP/1.1\r\n" + body);
    other.say("ATE,set_boolean,TRUE\nA,translation,1 2 3\n");
    framesUntil(2);
    std::vector<std::string> said;
    const auto end = std::chrono::steady_clock::now() + kPatience;
    while (said.size() < 2 && std::chrono::steady_clock::now() < end) {
        frame();
        for (std::string& one : news()) said.push_back(std::move(one));
    }
    ASSERT_EQ(said.size(), 2u);
    for (const std::string& one : said) EXPECT_NE(one.find("request of HTTP"), std::string::npos) << one;
    EXPECT_EQ(position("A"), Vec3f(1, 2, 3));
    EXPECT_EQ(feed->counts().events, 2u);
    EXPECT_EQ(feed->counts().faulty, 0u);
}

TEST_F(FedScene, SilenceKeepsNobodyOut) {
    start("tcp://127.0.0.1:0");
    const Visitor first(feed->source());
    first.say("A,translation,1 2 3\n");
    framesUntil(1);
    std::vector<std::unique_ptr<Visitor>> silent;
    for (int i = 0; i < 150; ++i) silent.push_back(std::make_unique<Visitor>(feed->source()));
    const Visitor last(feed->source());
    last.say("B,translation,4 5 6\n");
    framesUntil(2);
    EXPECT_EQ(position("B"), Vec3f(4, 5, 6));
    // The one that has sent a line stays.
    first.say("A,translation,7 8 9\n");
    framesUntil(3);
    EXPECT_EQ(position("A"), Vec3f(7, 8, 9));
    const auto said = news();
    ASSERT_FALSE(said.empty());
    EXPECT_NE(said[0].find("closed a connection that was silent"), std::string::npos) << said[0];
    EXPECT_LT(said.size(), 20u);
}

TEST_F(FedScene, FaultsAreNamedByLineAndCounted) {
    std::ofstream(folder / "feed") << "A,translation,1 2 3\n"
                                   << "AA,translation,1 2 3\n"
                                   << "A,translations,1 2 3\n"
                                   << "A,translation,1 2\n"
                                   << "FLAG,toggle_changed_,TRUE\n"
                                   << "\x7f\x45\x4c\x46\xff\xfe\n"
                                   << "PASS,triggerTrue,TRUE\n";
    start(folder / "feed");
    framesUntil(7);
    EXPECT_EQ(feed->counts().faulty, 6u);
    EXPECT_EQ(position("A"), Vec3f(1, 2, 3));
    const std::string name = folder / "feed";
    std::vector<std::string> said = news();
    std::ranges::sort(said);
    ASSERT_EQ(said.size(), 6u);
    EXPECT_EQ(said[0], name + ":2: warning: AA.translation: no node is named AA [no-such-node]");
    EXPECT_TRUE(said[1].starts_with(name + ":3: warning: A.translations: ")) << said[1];
    EXPECT_TRUE(said[1].ends_with("[no-such-field]")) << said[1];
    EXPECT_TRUE(said[2].starts_with(name + ":4: warning: A.translation: ")) << said[2];
    EXPECT_TRUE(said[4].starts_with(name + ":6:5: warning: a byte that is no UTF-8")) << said[4];
    EXPECT_EQ(said[5], name + ":7: warning: PASS.triggerTrue: it takes no events [access]");
}

TEST_F(FedScene, AFieldWithAValueTakesTheNewestAndEventsComeOneAFrame) {
    std::ofstream file(folder / "feed");
    for (int i = 1; i <= 5; ++i) file << "A,translation," << i << " 0 0\nGATE,set_boolean,TRUE\n";
    file.close();
    int passed = 0;
    scene.setEventListener([&](double, const Node& node, FieldIndex, const Value&) {
        passed += node.id() == scene.findName("GATE") ? 1 : 0;
    });
    start(folder / "feed");
    frame();
    EXPECT_EQ(position("A"), Vec3f(5, 0, 0));
    EXPECT_EQ(feed->counts().merged, 4u);
    for (int i = 0; i < 6; ++i) frame();
    EXPECT_EQ(feed->counts().events, 6u);
    // The filter sends two events for each that it gets.
    EXPECT_EQ(passed, 5 * 3);
}

TEST_F(FedScene, LinesOfAFileWaitForTheirTimes) {
    std::ofstream(folder / "feed")
        << "1.5,A,translation,1 0 0\n2,A,translation,2 0 0\nA,scale,2 2 2\n9,A,scale,3 3 3\n";
    start(folder / "feed");
    frame();  // 0
    frame();  // 1
    EXPECT_EQ(position("A"), Vec3f(0, 0, 0));
    frame();  // 2: a line without a time is at the time of the line before
    EXPECT_EQ(position("A"), Vec3f(2, 0, 0));
    EXPECT_EQ(scene.node(scene.findName("A")).get(x3d::Transform::scale), Vec3f(2, 2, 2));
    EXPECT_EQ(feed->nextAt(), 9);
    EXPECT_TRUE(feed->hasLeft());
}

TEST_F(FedScene, SocketsChangeNeitherUrlsNorScripts) {
    const std::string lines = "SOUND,url,\"\"\"http://x/y\"\"\"\nCODE,go,TRUE\nA,translation,1 1 1\n";
    start("udp://127.0.0.1:0");
    Visitor(feed->source()).say(lines);
    framesUntil(3);
    EXPECT_EQ(feed->counts().faulty, 2u);
    EXPECT_EQ(feed->counts().events, 1u);
    ASSERT_TRUE(scene.addRoute(scene.findName("A"), scene.type(x3d::Transform::type).find("translation"),
                               scene.findName("B"), scene.type(x3d::Transform::type).find("translation")));
    // The user's own file may.
    std::ofstream(folder / "feed") << lines;
    start(folder / "feed");
    framesUntil(3);
    EXPECT_EQ(feed->counts().faulty, 0u);
}

TEST_F(FedScene, AFloodIsBoundedAndNothingElseSuffers) {
    start("udp://127.0.0.1:0");
    const Visitor visitor(feed->source());
    // Nobody runs frames meanwhile: the most that waits is kept.
    for (std::size_t i = 0; i < 2 * Feed::kMaxWaiting; ++i) {
        visitor.say("NOBODY" + std::to_string(i) + ",x,1");
        if (i % 64 == 0) std::this_thread::sleep_for(std::chrono::microseconds(200));
    }
    const auto end = std::chrono::steady_clock::now() + kPatience;
    while (feed->counts().flooded < 1000 && std::chrono::steady_clock::now() < end)
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
    EXPECT_GE(feed->counts().flooded, 1000u);
    while (position("A").x == 0 && std::chrono::steady_clock::now() < end) {
        visitor.say("A,translation,1 2 3");
        frame();
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    EXPECT_EQ(position("A"), Vec3f(1, 2, 3));
    while (feed->nextAt() < 0) frame();
    EXPECT_GT(feed->counts().faulty, Feed::kMaxWaiting / 2);
    EXPECT_LT(news().size(), 40u);
}

TEST_F(FedScene, AConnectionWaitsInPlaceOfLosing) {
    start("tcp://127.0.0.1:0");
    constexpr std::size_t kLines = 3 * Feed::kMaxWaiting;
    std::jthread sender([source = feed->source()] {
        const Visitor visitor(source);
        std::string all;
        for (std::size_t i = 1; i <= kLines; ++i) all += "A,translation," + std::to_string(i) + " 0 0\n";
        visitor.say(all);
    });
    framesUntil(kLines);
    EXPECT_EQ(feed->counts().flooded, 0u);
    EXPECT_EQ(feed->counts().events + feed->counts().merged, kLines);
    EXPECT_EQ(position("A"), Vec3f(kLines, 0, 0));
}

TEST_F(FedScene, ManyEventsOfOneFieldAreLeftOutBeyondABound) {
    start("tcp://127.0.0.1:0");
    const std::size_t lines = Feed::kMaxPutOff + 500;
    std::string all;
    for (std::size_t i = 0; i < lines; ++i) all += "GATE,set_boolean,TRUE\n";
    Visitor(feed->source()).say(all);
    const auto end = std::chrono::steady_clock::now() + kPatience;
    while (feed->counts().flooded == 0 && std::chrono::steady_clock::now() < end) feed->deliver(time);
    EXPECT_GT(feed->counts().flooded, 0u);
}

TEST_F(FedScene, OtherMachinesAreRefusedUnlessAllowed) {
    FeedOptions options;
    options.source = "udp://0.0.0.0:0";
    const auto refused = Feed::start(scene, options);
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().code, DiagnosticCode("keys"));
    options.insecure = true;
    EXPECT_TRUE(Feed::start(scene, options));
    PublishOptions publish;
    publish.target = "tcp://0.0.0.0:0";
    publish.fields = {"A.translation"};
    EXPECT_FALSE(Publisher::start(scene, publish));
}

TEST_F(FedScene, AccountsAreRefusedAndNotRepeated) {
    for (const char* source : {"mqtt://ann:secret@127.0.0.1/a", "mqtts://ann:secret@127.0.0.1/a", "mqtt://secret@h",
                               "udp://secret@127.0.0.1:1", "mqtt://ann:sec/ret@127.0.0.1/a", "http://secret@h"}) {
        FeedOptions options;
        options.source = source;
        const auto refused = Feed::start(scene, options);
        ASSERT_FALSE(refused);
        EXPECT_EQ(refused.error().text.find("sec"), std::string::npos) << refused.error().text;
        EXPECT_NE(refused.error().text.find("***@"), std::string::npos) << refused.error().text;
    }
}

TEST_F(FedScene, DatagramsThatTheSystemLeavesOutAreTold) {
    auto position = feeds::Endpoint::parse("udp://127.0.0.1:0");
    auto socket = feeds::listenAt(*position, false);
    ASSERT_TRUE(socket);
    int small = 4096;
    ASSERT_EQ(::setsockopt(socket->get(), SOL_SOCKET, SO_RCVBUF, &small, sizeof small), 0);
    const Visitor visitor(position->text);
    for (int i = 0; i < 200; ++i) visitor.say(std::string(500, 'x'));
    char bytes[1000], control[100] = {};
    std::uint32_t leftOut = 0, came = 0;
    const auto receive = [&] {
        iovec room = {bytes, sizeof bytes};
        msghdr message{};
        message.msg_iov = &room;
        message.msg_iovlen = 1;
        message.msg_control = control;
        message.msg_controllen = sizeof control;
        if (::recvmsg(socket->get(), &message, MSG_DONTWAIT) < 0) return false;
        ++came;
        const cmsghdr* head = CMSG_FIRSTHDR(&message);
        if (head && head->cmsg_type == SO_RXQ_OVFL) std::memcpy(&leftOut, CMSG_DATA(head), sizeof leftOut);
        return true;
    };
    while (receive()) {
    }
    visitor.say("one more");
    while (!receive()) {
    }
    EXPECT_GT(leftOut, 0u);
    EXPECT_EQ(leftOut + came, 201u);
}

TEST_F(FedScene, PlacesThatMakeNoSenseAreErrors) {
    for (const char* source : {"", "udp://", "udp://127.0.0.1", "udp://127.0.0.1:x", "http://127.0.0.1:1", "mqtt://h",
                               "mqtt://h/", "tcp://:5", "/no/such/file", "tcp://127.0.0.1:70000"}) {
        FeedOptions options;
        options.source = source;
        EXPECT_FALSE(Feed::start(scene, options)) << source;
    }
}

TEST_F(FedScene, AFeedEndsWhileItsSenderWaits) {
    start("tcp://127.0.0.1:0");
    std::string all;
    for (std::size_t i = 0; i < 2 * Feed::kMaxWaiting; ++i) all += "A,translation,1 0 0\n";
    std::jthread sender([source = feed->source(), all] { (void)Visitor(source); });
    const Visitor visitor(feed->source());
    std::jthread other([&] { visitor.say(all); });
    while (feed->counts().lines <= Feed::kMaxWaiting) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    feed.reset();  // must not wait for frames
}

TEST_F(FedScene, EveryEventIsPublishedAndAFeedTakesIt) {
    PublishOptions options;
    options.target = "tcp://127.0.0.1:0";
    options.fields = {"A.translation", "FLAG.*"};
    options.start = 100;
    auto publisher = Publisher::start(scene, options);
    ASSERT_TRUE(publisher) << publisher.error().text;
    Visitor visitor((*publisher)->target());
    const NodeId a = scene.findName("A"), gate = scene.findName("GATE");
    const FieldIndex go = scene.node(gate).type().find("set_boolean");
    ASSERT_TRUE(scene.sendEvent(a, x3d::Transform::translation.index, Vec3f(1, 2.5f, 3)));
    ASSERT_TRUE(scene.sendEvent(gate, go, true));
    scene.newFrame(100.5);
    ASSERT_TRUE(scene.set(a, x3d::Transform::translation, Vec3f(4, 0, 0)));  // an edit is heard, too
    scene.newFrame(101);
    EXPECT_EQ(visitor.line(), R"({"t":0.5,"node":"A","field":"translation","value":[1,2.5,3]})");
    EXPECT_EQ(visitor.line(), R"({"t":0.5,"node":"FLAG","field":"toggle","value":true})");
    EXPECT_EQ(visitor.line(), R"({"t":1,"node":"A","field":"translation","value":[4,0,0]})");
    (*publisher)->expect(4.0 / 3);
    ASSERT_TRUE(scene.sendEvent(a, x3d::Transform::translation.index, Vec3f(5, 0, 0)));
    scene.newFrame(100 + 4.0 / 3);
    EXPECT_EQ(visitor.line(), R"({"t":1.3333333333333333,"node":"A","field":"translation","value":[5,0,0]})");
    EXPECT_EQ((*publisher)->counts().lines, 4u);
}

TEST_F(FedScene, ARateGivesTheNewestValue) {
    PublishOptions options;
    options.target = folder / "out";
    options.fields = {"A.translation"};
    options.rate = 10;
    auto publisher = Publisher::start(scene, options);
    ASSERT_TRUE(publisher);
    const NodeId a = scene.findName("A");
    for (int i = 0; i <= 60; ++i) {
        if (i < 33) (void)scene.sendEvent(a, x3d::Transform::translation.index, Vec3f(static_cast<float>(i), 0, 0));
        scene.newFrame(i / 60.0);
        (*publisher)->frame(i / 60.0);
    }
    EXPECT_GT((*publisher)->nextAt(), 1e30);
    publisher->reset();
    std::ifstream in(folder / "out");
    std::string line, all;
    for (; std::getline(in, line);)
        all += line.substr(line.find('[') + 1, line.find(',', line.find('[')) - line.find('[') - 1) + ' ';
    EXPECT_EQ(all, "0 6 12 18 24 30 32 ");
}

TEST_F(FedScene, ASlowReaderMissesWholeLinesAndIsTold) {
    PublishOptions options;
    options.target = "tcp://127.0.0.1:0";
    options.fields = {"A.translation"};
    auto publisher = Publisher::start(scene, options);
    ASSERT_TRUE(publisher);
    Visitor slow((*publisher)->target());
    const NodeId a = scene.findName("A");
    double t = 0;
    const auto send = [&] {
        (void)scene.sendEvent(a, x3d::Transform::translation.index, Vec3f(static_cast<float>(t), 0, 0));
        scene.newFrame(t += 1);
    };
    const auto end = std::chrono::steady_clock::now() + kPatience;
    while ((*publisher)->counts().missed == 0 && std::chrono::steady_clock::now() < end)
        for (int i = 0; i < 1000; ++i) send();
    ASSERT_GT((*publisher)->counts().missed, 0u);
    std::string line;
    for (int i = 0; !line.starts_with("{\"missed\":") && std::chrono::steady_clock::now() < end; ++i) {
        line = slow.line();
        ASSERT_TRUE(line.starts_with("{\"") && line.ends_with('}')) << line;
        if (i % 1000 == 0) send();
    }
    EXPECT_TRUE(line.starts_with("{\"missed\":")) << line;
}

TEST_F(FedScene, WhatCannotBePublishedIsAnError) {
    const auto why = [&](std::vector<std::string> fields) {
        PublishOptions options;
        options.target = folder / "out";
        options.fields = std::move(fields);
        const auto created = Publisher::start(scene, options);
        return created ? std::string() : created.error().text;
    };
    EXPECT_EQ(why({"A.translation"}), "");
    EXPECT_NE(why({}), "");
    EXPECT_NE(why({"AA.translation"}), "");
    EXPECT_NE(why({"A.nothing"}), "");
    EXPECT_NE(why({"AA.*"}), "");
    EXPECT_NE(why({"GATE.set_boolean"}), "");  // sends nothing
    EXPECT_FALSE(std::filesystem::exists(folder / "nothing"));
}

}  // namespace rtsg
