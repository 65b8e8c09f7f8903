// Support for tests of mirrors over NATS: a published scene and its followers.
#pragma once

#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>
#include <rtsg/nats/nats_publisher.h>
#include <rtsg/nats/nats_subscriber.h>

#include "support/nats_server.h"
#include "sync/mirror/mirror_support.h"

namespace rtsg::test {

struct PublishedScene {
    Scene scene;
    NodeId box, cloud;
    std::unique_ptr<MirrorServer> server;
    std::unique_ptr<NatsPublisher> publisher;
    int frame = 0;

    explicit PublishedScene(const std::string& address, MirrorUpstream upstream = MirrorUpstream::none,
                            std::size_t points = 4) {
        box = scene.createNode(x3d::Transform::type);
        cloud = scene.createNode(x3d::Coordinate::type);
        EXPECT_TRUE(scene.setName(box, "BOX"));
        const NodeId set = scene.createNode(x3d::PointSet::type), shape = scene.createNode(x3d::Shape::type);
        EXPECT_TRUE(scene.set(set, x3d::PointSet::coord, cloud));
        EXPECT_TRUE(scene.set(shape, x3d::Shape::geometry, set));
        EXPECT_TRUE(scene.setField(scene.root(), x3d::RtsgScene::children.index, Array<NodeId>{box, shape}));
        fill(points);
        scene.newFrame(0);
        MirrorServerOptions options;
        options.upstream = upstream;
        server = *MirrorServer::start(scene, kAnyPort, options);
        NatsPublisherOptions to;
        to.address = address;
        auto started = NatsPublisher::start(*server, to);
        EXPECT_TRUE(started) << started.error().format();
        if (started) publisher = std::move(*started);
    }
    ~PublishedScene() { server.reset(); }

    void fill(std::size_t points) {
        std::vector<Vec3f> all(points);
        for (std::size_t i = 0; i < points; ++i) all[i] = Vec3f(float(i), float(frame), 0);
        EXPECT_TRUE(scene.set(cloud, x3d::Coordinate::point, Array<Vec3f>(all)));
    }
    void poll() {
        server->service();
        EXPECT_TRUE(scene.set(box, x3d::Transform::translation, Vec3f(float(++frame), 0, 0)));
        scene.newFrame(frame * .02);
    }
};

struct NatsFollower {
    Scene scene;
    std::unique_ptr<NatsSubscriber> nats;
    std::unique_ptr<MirrorClient> client;
    std::vector<std::uint64_t> records;  // checksums of what came

    explicit NatsFollower(const std::string& address, MirrorClientOptions options = {}) {
        options.scrub = std::chrono::milliseconds(0);
        auto started = NatsSubscriber::start(address);
        EXPECT_TRUE(started) << started.error().format();
        if (!started) return;
        nats = std::move(*started);
        options.transport = nats->transport();
        client = *MirrorClient::connect(scene, nats->address(), options);
        client->onStep(
            [this](const RecordStep& step) { records.push_back(step.record ? step.record->header.checksum : 0); });
    }
    ~NatsFollower() { client.reset(); }
    /// Until it is in the scene's newest state, with its hash.
    bool settle(PublishedScene& from) {
        return pollUntil(*client, [&] {
            from.server->service();
            return client->inStep() && client->statistics().equal &&
                   client->statistics().sequence == from.scene.sequence() && scene.hash() == from.scene.hash();
        });
    }
};

/// A test that needs a nats-server, and is skipped with the reason without one.
class WithNats : public testing::Test {
  protected:
    void SetUp() override {
        if (NatsServer::program().empty()) GTEST_SKIP() << NatsServer::kMissing;
    }
};

}  // namespace rtsg::test
