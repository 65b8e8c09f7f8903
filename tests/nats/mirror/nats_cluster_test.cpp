// Three NATS servers in a cluster, of which one is killed after the other; and as many subscribers as a scene may have.
#include <algorithm>
#include <cstring>

#include <poll.h>
#include <sys/resource.h>

#include <rtsg/nats/nats_log.h>
#include <rtsg/sync/log.h>

#include "mirror/packet.h"
#include "nats/nats_support.h"
#include "support/long_form.h"

namespace rtsg {
namespace {

using namespace std::chrono_literals;
using test::NatsFollower;
using test::NatsServer;
using test::PublishedScene;

class NatsCluster : public test::WithNats {
  protected:
    void SetUp() override {
        WithNats::SetUp();
        if (IsSkipped()) return;
        int ports[3];
        std::string routes;
        for (int& port : ports) {
            port = NatsServer::freePort();
            routes += std::string(routes.empty() ? "" : ", ") + "\"nats://127.0.0.1:" + std::to_string(port) + "\"";
        }
        for (int i = 0; i < 3; ++i)
            servers.push_back(std::make_unique<NatsServer>(
                "server_name: n" + std::to_string(i) + "\ncluster { name: three, listen: \"127.0.0.1:" +
                std::to_string(ports[i]) + "\", routes: [" + routes + "] }"));
    }
    /// The server with this number first, and then the others.
    std::string address(std::size_t first, const std::string& name) const {
        std::string hosts;
        for (std::size_t i = 0; i < 3; ++i)
            hosts += (i ? ",127.0.0.1:" : "127.0.0.1:") + std::to_string(servers[(first + i) % 3]->port());
        return "nats://" + hosts + "/" + name;
    }
    std::vector<std::unique_ptr<NatsServer>> servers;
};

TEST_F(NatsCluster, MirrorsAndStoreOutliveEachServerInTurn) {
    PublishedScene from(address(0, "hall"));
    std::vector<std::unique_ptr<NatsFollower>> followers;
    for (std::size_t i = 0; i < 3; ++i) followers.push_back(std::make_unique<NatsFollower>(address(i, "hall")));
    for (const auto& follower : followers) ASSERT_TRUE(follower->settle(from));
    test::TempFolder folder;
    const std::string file = folder / "a.rlog", copy = folder / "copy.rlog";
    // The cluster's own election takes a while.
    Result<std::unique_ptr<NatsLog>> log = fail("not yet");
    ASSERT_TRUE(test::eventually([&] {
        log = NatsLog::start(address(0, "log"), file, NatsLog::Begin::fresh);
        return log.has_value();
    })) << log.error().format();
    auto writer = *LogWriter::create(file, builtinTypes());
    {
        const Attachment attachment = from.scene.bus().attach(*writer);
        for (const auto& server : servers) {
            for (int i = 0; i < 20; ++i) from.poll();
            server->stop(SIGKILL);
            for (int i = 0; i < 20; ++i) from.poll();
            const std::uint64_t stored = (*log)->storedMessages();
            for (const auto& follower : followers) {
                ASSERT_TRUE(test::pollUntil(*follower->client, [&] {
                    from.poll();
                    return follower->client->statistics().sequence + 20 > from.scene.sequence();
                }));
            }
            // Two of three go on storing.
            EXPECT_TRUE(test::eventually([&] {
                from.poll();
                return (*log)->storedMessages() > stored;
            })) << (*log)->failure();
            server->start();
            std::this_thread::sleep_for(1500ms);  // it must be in step before the next one goes
        }
    }
    for (const auto& follower : followers) {
        ASSERT_TRUE(follower->settle(from));
        EXPECT_EQ(follower->client->statistics().snapshots, 1u);
        EXPECT_EQ(follower->client->statistics().divergences, 0u);
    }
    ASSERT_TRUE(writer->close());
    const auto finished = (*log)->finish(60s);
    ASSERT_TRUE(finished) << finished.error().format();
    ASSERT_TRUE(test::eventually([&] {
        std::filesystem::remove(copy);
        return NatsLog::fetch(address(1, "log"), copy).has_value();
    }));
    std::ifstream ours(file, std::ios::binary), theirs(copy, std::ios::binary);
    EXPECT_EQ(std::string(std::istreambuf_iterator<char>(ours), {}),
              std::string(std::istreambuf_iterator<char>(theirs), {}));
}

/// A subscriber that speaks the protocol of NATS itself and keeps only what it has seen: cheap enough for thousands.
class BareSubscriber {
  public:
    BareSubscriber(int port, const std::string& subject) : descriptor_(NatsServer::connected(port, false)) {
        const std::string hello = "CONNECT {\"verbose\":false}\r\nSUB " + subject + " 1\r\nPING\r\n";
        EXPECT_EQ(::send(descriptor_, hello.data(), hello.size(), MSG_NOSIGNAL), static_cast<ssize_t>(hello.size()));
    }
    ~BareSubscriber() { ::close(descriptor_); }
    BareSubscriber(const BareSubscriber&) = delete;
    BareSubscriber& operator=(const BareSubscriber&) = delete;

    int descriptor() const { return descriptor_; }
    void read() {
        char buffer[65536];
        const ssize_t count = ::recv(descriptor_, buffer, sizeof(buffer), MSG_DONTWAIT);
        if (count > 0) text_.append(buffer, static_cast<std::size_t>(count));
        while (takeOne()) continue;
    }
    bool subscribed() const { return subscribed_; }
    std::uint64_t state() const { return state_; }
    std::uint64_t records() const { return records_; }
    /// Over all records, one after the other.
    std::uint64_t checksum() const { return checksum_; }
    bool whole() const { return whole_; }

  private:
    bool takeOne() {
        const std::size_t end = text_.find("\r\n");
        if (end == std::string::npos) return false;
        const std::string line = text_.substr(0, end);
        std::size_t taken = end + 2;
        if (line.starts_with("MSG ")) {
            const std::size_t size = std::stoul(line.substr(line.rfind(' ') + 1));
            if (text_.size() < taken + size + 2) return false;
            message(std::string_view(text_).substr(taken, size));
            taken += size + 2;
        } else if (line == "PONG") {
            subscribed_ = true;
        } else if (line == "PING") {
            (void)::send(descriptor_, "PONG\r\n", 6, MSG_NOSIGNAL);
        }
        text_.erase(0, taken);
        return true;
    }
    void message(std::string_view bytes) {
        const auto packet = nats::unpack(bytes);
        if (!packet || packet->type != mirror::Message::data) return;
        const auto header = checkRecord(packet->second);
        whole_ = whole_ && header && (state_ == 0 || header->from == state_);
        if (!header) return;
        state_ = header->to;
        ++records_;
        const std::uint64_t both[] = {checksum_, header->checksum};
        checksum_ = checksumOf(std::as_bytes(std::span(both)));
    }

    const int descriptor_;
    std::string text_;
    bool subscribed_ = false, whole_ = true;
    std::uint64_t state_ = 0, records_ = 0, checksum_ = 0;
};

class NatsCrowd : public test::WithNats {};

TEST_F(NatsCrowd, EachOfManyGetsEachRecordOnceAndWhole) {
    // Its own end of each connection, and the server's, which has these limits from here.
    rlimit files{};
    ::getrlimit(RLIMIT_NOFILE, &files);
    files.rlim_cur = files.rlim_max;
    ::setrlimit(RLIMIT_NOFILE, &files);
    NatsServer nats;
    const auto count = test::fewOrMany<std::size_t>(50, 1000);
    std::vector<std::unique_ptr<BareSubscriber>> all;
    std::vector<pollfd> items;
    for (std::size_t i = 0; i < count; ++i) {
        all.push_back(std::make_unique<BareSubscriber>(nats.port(), "rtsg.hall.live"));
        items.push_back({all.back()->descriptor(), POLLIN, 0});
    }
    const auto readUntil = [&](auto&& done) {
        const auto end = std::chrono::steady_clock::now() + test::kPatience;
        while (!std::ranges::all_of(all, [&](const auto& one) { return done(*one); })) {
            if (std::chrono::steady_clock::now() > end) return false;
            (void)::poll(items.data(), items.size(), 100);
            for (std::size_t i = 0; i < items.size(); ++i)
                if (items[i].revents) all[i]->read();
        }
        return true;
    };
    ASSERT_TRUE(readUntil([](const BareSubscriber& one) { return one.subscribed(); }));
    PublishedScene from(nats.address(), MirrorUpstream::none, 1000);
    NatsFollower follower(nats.address());
    ASSERT_TRUE(follower.settle(from));
    for (int i = 0; i < 40; ++i) {
        from.fill(1000);
        from.poll();
        ASSERT_TRUE(readUntil([&](const BareSubscriber& one) { return one.state() == from.scene.sequence(); }));
    }
    ASSERT_TRUE(follower.settle(from));
    for (const auto& one : all) {
        EXPECT_TRUE(one->whole());
        EXPECT_EQ(one->records(), 40u);
        EXPECT_EQ(one->checksum(), all.front()->checksum());
    }
    EXPECT_EQ(from.publisher->statistics().records, 40u);
    EXPECT_LT(from.publisher->statistics().messages, 60u) << "a record goes out once, however many there are";
}

}  // namespace
}  // namespace rtsg
