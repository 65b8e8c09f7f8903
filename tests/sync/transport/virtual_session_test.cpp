// Whole sessions on one thread, in time that goes on as the test says: no sockets, no sleeps.
#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>
#include <rtsg/sync/mirror_relay.h>

#include "sync/mirror/mirror_support.h"
#include "transport/in_process.h"

namespace rtsg {
namespace {

using namespace std::chrono_literals;

/// Connections that can be cut, or go half open: then nothing is told, and nothing arrives.
class Faults : public InProcess {
  public:
    using InProcess::InProcess;
    bool isDeaf = false;
    /// Ends all connections, with what is under way to clients.
    void cut() {
        Received lost;
        for (Faulty* one : all_) {
            while (one->inner->receive(lost)) continue;
            one->isDown = true;
            one->inner->reconnect(0ms);
        }
    }

    Result<std::unique_ptr<Connection>> connect(const std::string& endpoint, const ConnectSettings& settings) override {
        auto inner = InProcess::connect(endpoint, settings);
        if (!inner) return inner;
        return std::make_unique<Faulty>(*this, std::move(*inner));
    }

  private:
    struct Faulty : Connection {
        Faulty(Faults& of, std::unique_ptr<Connection> within) : faults(of), inner(std::move(within)) {
            faults.all_.push_back(this);
        }
        ~Faulty() override { std::erase(faults.all_, this); }
        bool send(std::span<const std::byte> first, std::span<const std::byte> second) override {
            return faults.isDeaf || inner->send(first, second);
        }
        bool receive(Received& message) override {
            while (inner->receive(message))
                if (!faults.isDeaf) return true;
            return false;
        }
        bool foundEmpty() const override { return inner->foundEmpty(); }
        std::array<int, 2> descriptors() const override { return inner->descriptors(); }
        Event nextEvent() override { return std::exchange(isDown, false) ? Event::down : inner->nextEvent(); }
        void reconnect(std::chrono::milliseconds within) override {
            if (!faults.isDeaf) inner->reconnect(within);
        }
        Faults& faults;
        std::unique_ptr<Connection> inner;
        bool isDown = false;
    };
    std::vector<Faulty*> all_;
};

class VirtualSession : public testing::Test {
  protected:
    VirtualSession() {
        box_ = scene_.createNode(x3d::Transform::type);
        EXPECT_TRUE(scene_.setField(scene_.root(), x3d::RtsgScene::children.index, Array<NodeId>{box_}));
        scene_.newFrame(0);
        server_ = *MirrorServer::start(scene_, kEndpoint, serverOptions());
        client_ = *MirrorClient::connect(replica_, kEndpoint, clientOptions());
    }
    MirrorServerOptions serverOptions() {
        MirrorServerOptions options;
        options.transport = net_;
        return options;
    }
    MirrorClientOptions clientOptions() {
        MirrorClientOptions options;
        options.transport = net_;
        return options;
    }
    /// A frame of 10 ms, which everybody sees.
    void frame() {
        ++frames_;
        EXPECT_TRUE(scene_.set(box_, x3d::Transform::translation, Vec3f(float(frames_), 0, 0)));
        scene_.newFrame(frames_ * .01);
        rest();
    }
    /// 10 ms in which the scene rests.
    void rest() {
        if (server_) server_->service();
        client_->poll();
        if (server_) server_->service();
        clock_.advance(10ms);
    }
    /// The time until then, in steps of 10 ms; a minute at most.
    Clock::duration until(const std::function<bool()>& condition) {
        const Clock::time_point start = clock_.now();
        while (!condition() && clock_.now() - start < 60s) rest();
        return clock_.now() - start;
    }
    bool equal() const { return client_->inStep() && replica_.hash() == scene_.hash(); }

    static constexpr const char* kEndpoint = "inproc://hall";
    VirtualClock clock_;
    std::shared_ptr<Faults> net_ = std::make_shared<Faults>(clock_);
    Scene scene_, replica_;
    NodeId box_;
    int frames_ = 0;
    std::unique_ptr<MirrorServer> server_;
    std::unique_ptr<MirrorClient> client_;
};

TEST_F(VirtualSession, AMirrorJoinsAndFollowsAThousandFrames) {
    EXPECT_LT(until([this] { return equal(); }), 1s);
    const std::uint64_t before = client_->statistics().frames;
    for (int i = 0; i < 1000; ++i) {
        frame();
        ASSERT_GE(client_->statistics().sequence + 2, scene_.sequence()) << "frame " << i;
    }
    EXPECT_LT(until([this] { return equal(); }), 1s);
    EXPECT_EQ(client_->statistics().frames - before, 1000);
    EXPECT_EQ(client_->statistics().snapshots, 1);
    EXPECT_EQ(client_->statistics().gaps, 0);
    EXPECT_EQ(server_->statistics().garbage, 0);
    EXPECT_LE(client_->statistics().maximumLag, .02) << "a frame arrives with the next step";
}

TEST_F(VirtualSession, AConnectionThatWasCutIsMadeAgainAndNeedsNoSnapshot) {
    until([this] { return equal(); });
    for (int i = 0; i < 20; ++i) frame();
    net_->cut();
    for (int i = 0; i < 20; ++i) frame();
    EXPECT_LT(until([this] { return equal(); }), 1s);
    EXPECT_EQ(server_->statistics().resumed, 1);
    EXPECT_EQ(client_->statistics().snapshots, 1);
    EXPECT_EQ(client_->statistics().sequence, scene_.sequence());
}

TEST_F(VirtualSession, SilenceIsNoticedWhenItsTimeIsOver) {
    until([this] { return equal(); });
    net_->isDeaf = true;
    const auto lost = until([this] { return client_->originLost(); });
    EXPECT_GE(lost, 900ms) << "less is no silence";
    EXPECT_LT(lost, 2s) << "a heartbeat and .4 s";
    const auto forgotten = lost + until([this] { return server_->statistics().peers == 0; });
    EXPECT_GE(forgotten, 9900ms);
    EXPECT_LT(forgotten, 12s);
    EXPECT_EQ(server_->statistics().lost, 1);
    frame();
    EXPECT_NE(replica_.hash(), scene_.hash());
    net_->isDeaf = false;
    EXPECT_LT(until([this] { return equal(); }), 20s);
    EXPECT_FALSE(client_->originLost());
    EXPECT_EQ(client_->statistics().snapshots, 1) << "it goes on with the frames that it missed";
}

TEST_F(VirtualSession, AServerThatEndsSaysSoAndItsSuccessorIsFound) {
    until([this] { return equal(); });
    const Clock::time_point before = clock_.now();
    server_.reset();
    EXPECT_LT(clock_.now() - before, 2s) << "it waits for answers, in virtual time";
    rest();
    EXPECT_TRUE(client_->serverLeft());
    server_ = *MirrorServer::start(scene_, kEndpoint, serverOptions());
    EXPECT_LT(until([this] { return equal(); }), 5s);
    EXPECT_EQ(client_->statistics().restarts, 1);
}

TEST_F(VirtualSession, ARelayPassesFramesOnWithoutAThread) {
    Scene between, far;
    auto relay = MirrorRelay::connect(between, kEndpoint, "inproc://relay", clientOptions(), serverOptions());
    ASSERT_TRUE(relay);
    const auto client = *MirrorClient::connect(far, "inproc://relay", clientOptions());
    for (int i = 0; i < 200; ++i) {
        frame();
        ASSERT_TRUE((*relay)->poll(0ms));
        client->poll();
    }
    for (int i = 0; i < 100 && far.hash() != scene_.hash(); ++i) {
        rest();
        ASSERT_TRUE((*relay)->poll(0ms));
        client->poll();
    }
    EXPECT_EQ(far.hash(), scene_.hash());
    EXPECT_EQ(client->statistics().sequence, scene_.sequence());
}

TEST(InProcess, AServerAndAMirrorOfThisProcessWithTheirThreads) {
    const auto net = std::make_shared<InProcess>();
    Scene scene, replica;
    scene.newFrame(0);
    MirrorServerOptions to;
    to.transport = net;
    MirrorClientOptions from;
    from.transport = net;
    const auto server = *MirrorServer::start(scene, "inproc://hall", to);
    const auto client = *MirrorClient::connect(replica, "inproc://hall", from);
    for (int i = 1; i <= 200; ++i) {
        const NodeId created = scene.createNode(x3d::Transform::type);
        EXPECT_TRUE(scene.setField(scene.root(), x3d::RtsgScene::children.index, Array<NodeId>{created}));
        scene.newFrame(i);
        client->poll();
    }
    EXPECT_TRUE(test::pollUntilAt(*client, scene));
    EXPECT_EQ(replica.hash(), scene.hash());
}

}  // namespace
}  // namespace rtsg
