// Peers of a region through what happens to connections and servers: cuts, slow links, a server that goes on from its
// log, a scene with more places than are followed.
#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/sync/log.h>
#include <rtsg/sync/session.h>

#include "mirror_support.h"
#include "support/log_support.h"

namespace rtsg {
namespace {

using namespace std::chrono_literals;
using test::eventually;
using test::Middleman;
using test::pollUntil;
using test::pollUntilAt;
using x3d::Transform;

/// Balls along a street, three metres from one to the next, and a viewpoint that walks it; one ball jumps.
struct Street {
    static constexpr int kBalls = 60;
    Scene scene;
    NodeId eye;
    std::vector<NodeId> balls;
    int frame = 0;

    void build() {
        eye = scene.createNode(x3d::Viewpoint::type);
        EXPECT_TRUE(scene.insertChild(scene.root(), x3d::RtsgScene::children, eye));
        EXPECT_TRUE(scene.setName(eye, "EYE"));
        for (int i = 0; i < kBalls; ++i) {
            const NodeId transform = scene.createNode(Transform::type), shape = scene.createNode(x3d::Shape::type);
            EXPECT_TRUE(scene.insertChild(scene.root(), x3d::RtsgScene::children, transform));
            EXPECT_TRUE(scene.insertChild(transform, Transform::children, shape));
            EXPECT_TRUE(scene.set(shape, x3d::Shape::geometry, scene.createNode(x3d::Sphere::type)));
            EXPECT_TRUE(scene.set(transform, Transform::translation, Vec3f(3.f * float(i), 0, 0)));
            EXPECT_TRUE(scene.setName(transform, "BALL" + std::to_string(i)));
        }
        find();
        scene.newFrame(0);
    }
    void find() {
        eye = scene.findName("EYE");
        balls.clear();
        for (int i = 0; i < kBalls; ++i) balls.push_back(scene.findName("BALL" + std::to_string(i)));
    }
    void step(int frames = 1) {
        for (; frames > 0; --frames) {
            ++frame;
            EXPECT_TRUE(scene.set(eye, x3d::Viewpoint::position, Vec3f(eyeAt(), 0, 0)));
            const NodeId jumps = balls[std::size_t(frame) % balls.size()];
            Vec3f at = scene.node(jumps).get(Transform::translation);
            at.y = at.y == 0 ? 2.f : 0.f;
            EXPECT_TRUE(scene.set(jumps, Transform::translation, at));
            scene.newFrame(frame / 60.0);
        }
    }
    /// There and back.
    float eyeAt() const { return std::abs(float(frame % 240) - 120.f) * 1.5f; }
    /// Balls within the radius are there, and those beyond the margin not.
    void expectNear(const Scene& replica, double radius, double margin) const {
        std::size_t here = 0;
        for (const NodeId ball : balls) {
            const Vec3f at = scene.node(ball).get(Transform::translation);
            const Vec3d out = glm::max(glm::abs(Vec3d(at) - Vec3d(eyeAt(), 0, 0)) - 1., Vec3d(0));
            const double distance = glm::length(out);
            const bool isIn = replica.find(ball) != nullptr;
            here += isIn;
            EXPECT_TRUE(distance > radius - 1e-4 || isIn) << distance;
            EXPECT_TRUE(distance <= radius * (1 + margin) + 1e-4 || !isIn) << distance;
        }
        EXPECT_GT(here, 2u);
        EXPECT_LT(here, balls.size());
    }
};

MirrorClientOptions walking(std::string region = "region:EYE,12,.2") {
    MirrorClientOptions options;
    options.parts = {std::move(region)};
    return options;
}

TEST(MirrorRegionSession, FramesLostOnTheWayAreResumedWithoutASnapshot) {
    Street street;
    street.build();
    auto server = *MirrorServer::start(street.scene, test::kAnyPort);
    std::atomic<int> data{0};
    std::atomic<bool> loses{true};
    Middleman middle(server->endpoint(), [&](bool toClient, Middleman::Parts& parts) {
        const bool isData = toClient && parts.size() == 2 && parts[0][5] == 17;
        return !(isData && ++data % 9 == 5 && loses);
    });
    Scene replica;
    const auto client = *MirrorClient::connect(replica, middle.endpoint, walking());
    for (int i = 0; i < 40; ++i) {
        const int before = data;
        street.step();
        ASSERT_TRUE(eventually([&] {
            client->poll(1ms);
            return data > before;
        }));
    }
    loses = false;
    street.step();
    ASSERT_TRUE(pollUntilAt(*client, street.scene));
    street.expectNear(replica, 12, .2);
    EXPECT_GT(client->statistics().gaps, 1u);
    EXPECT_EQ(client->statistics().snapshots, 1u);
    EXPECT_EQ(client->statistics().divergences, 0u);
    EXPECT_GT(server->statistics().resumed, 1u);
}

TEST(MirrorRegionSession, OneThatWasForgottenGoesOnFromTheHistoryOfItsRegion) {
    MirrorServerOptions options;
    options.heartbeat = 20ms;
    options.peerTimeout = 100ms;
    Street street;
    street.build();
    auto server = *MirrorServer::start(street.scene, test::kAnyPort, options);
    Scene replica;
    const auto client = *MirrorClient::connect(replica, server->endpoint(), walking());
    street.step();
    ASSERT_TRUE(pollUntilAt(*client, street.scene));
    ASSERT_TRUE(eventually([&] { return server->statistics().lost == 1; }));
    street.step(50);
    ASSERT_TRUE(pollUntilAt(*client, street.scene));
    street.expectNear(replica, 12, .2);
    EXPECT_EQ(client->statistics().snapshots, 1u);
    EXPECT_EQ(client->statistics().divergences, 0u);
    EXPECT_TRUE(eventually([&] { return server->statistics().resumed == 1; }));
}

/// On a link that carries little, frames of the region come merged: nodes that enter and leave between them never come.
TEST(MirrorRegionSession, ASlowLinkGetsTheRegionMergedAndInTime) {
    Street street;
    street.build();
    auto server = *MirrorServer::start(street.scene, test::kAnyPort);
    MirrorClientOptions slow = walking();
    slow.maxLag = 100ms;
    slow.maxBytesPerSecond = 6000;
    Scene quick, replica;
    const auto fast = *MirrorClient::connect(quick, server->endpoint(), walking());
    const auto client = *MirrorClient::connect(replica, server->endpoint(), slow);
    ASSERT_TRUE(pollUntilAt(*fast, street.scene));
    ASSERT_TRUE(pollUntilAt(*client, street.scene));
    for (int i = 0; i < 200; ++i) {
        street.step();
        fast->poll(2ms);
        client->poll(2ms);
    }
    for (MirrorClient* c : {fast.get(), client.get()}) {
        ASSERT_TRUE(pollUntilAt(*c, street.scene));
        EXPECT_TRUE(c->statistics().equal);
        EXPECT_EQ(c->statistics().divergences, 0u);
        EXPECT_EQ(c->statistics().snapshots, 1u);
    }
    EXPECT_GT(server->statistics().merged, 20u);
    EXPECT_LT(client->statistics().frames, 150u);
    EXPECT_EQ(replica.dump(), quick.dump());
    street.expectNear(replica, 12, .2);
}

class RegionLog : public test::LogFolder {};

/// A server that goes on from its log has the same epoch and states, and finds the region from the state that the log
/// ends with. Snapshots that the peer of the region has got in the end.
std::uint64_t snapshotsAcrossServers(const std::string& file, const std::string& region) {
    auto first = std::make_unique<Street>();
    first->build();
    std::uint64_t epoch = 0;
    std::string endpoint;
    Scene replica, whole;
    std::unique_ptr<MirrorClient> client, all;
    {
        auto log = LogWriter::create(file, builtinTypes(), {});
        EXPECT_TRUE(log);
        Attachment attachment = first->scene.bus().attach(**log);
        MirrorServerOptions options;
        options.epoch = epoch = (*log)->epoch();
        auto server = *MirrorServer::start(first->scene, test::kAnyPort, options);
        endpoint = server->endpoint();
        client = *MirrorClient::connect(replica, endpoint, walking(region));
        all = *MirrorClient::connect(whole, endpoint, {});
        for (int i = 0; i < 31; ++i) {  // from the first on: what has come in stays until it is beyond the margin
            if (i > 0) first->step();
            EXPECT_TRUE(pollUntilAt(*client, first->scene));
        }
        EXPECT_TRUE(pollUntilAt(*all, first->scene));
        attachment.detach();
        (*log)->abandon();
    }
    Street second;
    const auto session = resumeSession(file, second.scene);
    EXPECT_TRUE(session) << session.error().format();
    EXPECT_EQ(second.scene.hash(), first->scene.hash());
    second.find();
    second.frame = first->frame;
    MirrorServerOptions options;
    options.epoch = session->epoch;
    options.before = session->before;
    auto server = *MirrorServer::start(second.scene, endpoint, options);
    for (int i = 0; i < 30; ++i) {
        second.step();
        EXPECT_TRUE(pollUntilAt(*client, second.scene)) << i;
        EXPECT_TRUE(pollUntilAt(*all, second.scene)) << i;
    }
    second.expectNear(replica, 12, region.ends_with(",0") ? 0 : .2);
    EXPECT_EQ(all->statistics().snapshots, 1u);
    EXPECT_EQ(client->statistics().divergences, 0u);
    EXPECT_EQ(client->statistics().repairs, 0u);
    return client->statistics().snapshots;
}

TEST_F(RegionLog, PeersOfARegionGoOnWithFramesAloneFromAServerThatGoesOnFromItsLog) {
    EXPECT_EQ(snapshotsAcrossServers(file(), "region:EYE,12,0"), 1u);
}

/// A ball that the viewer has left behind is still there; the state that the log ends with does not say so.
TEST_F(RegionLog, PeersOfARegionWithSomethingAtItsMarginTakeASnapshot) {
    EXPECT_EQ(snapshotsAcrossServers(file(), "region:EYE,12,.2"), 2u);
}

/// Told once, and refused without another look for a while: peers knock again and again.
TEST(MirrorRegionSession, WhereThereAreTooManyPlacesRegionsAreRefused) {
    MirrorServerOptions options;
    options.maximumIndexed = 2 * Street::kBalls + 10;
    Street street;
    street.build();
    auto server = *MirrorServer::start(street.scene, test::kAnyPort, options);
    Scene near, whole;
    const auto client = *MirrorClient::connect(near, server->endpoint(), walking());
    const auto all = *MirrorClient::connect(whole, server->endpoint(), {});
    street.step();
    ASSERT_TRUE(pollUntilAt(*client, street.scene));
    (void)server->takeDiagnostics();
    // A place for each group, and for each way to the ball in it.
    for (int i = 0; i < 5; ++i) {
        const NodeId group = street.scene.createNode(x3d::Group::type);
        ASSERT_TRUE(street.scene.insertChild(street.scene.root(), x3d::RtsgScene::children, group));
        ASSERT_TRUE(street.scene.insertChild(group, x3d::Group::children, street.balls[0]));
    }
    street.step();
    ASSERT_TRUE(pollUntil(*client, [&] { return !client->refusal().empty(); }));
    EXPECT_NE(client->refusal().find(std::to_string(options.maximumIndexed) + " places"), std::string::npos)
        << client->refusal();
    EXPECT_TRUE(client->turnedAway()) << "there may be fewer some time";
    // Another one is refused as well, the whole scene goes on.
    Scene other;
    const auto late = *MirrorClient::connect(other, server->endpoint(), walking("region:5"));
    ASSERT_TRUE(pollUntil(*late, [&] { return !late->refusal().empty(); }));
    EXPECT_EQ(late->refusal(), client->refusal());
    street.step(5);
    ASSERT_TRUE(pollUntilAt(*all, street.scene));
    EXPECT_EQ(all->statistics().snapshots, 1u);
    std::size_t reported = 0;
    for (const Diagnostic& d : server->takeDiagnostics()) reported += d.text.contains("no parts by region");
    EXPECT_EQ(reported, 1u);
}

}  // namespace
}  // namespace rtsg
