// Structure under load: replicas that join a large scene while its nodes are renamed, moved to other parents, destroyed
// and made anew in every frame. Outcome: every replica ends with the origin's hash, by one snapshot and without a gap.
// RTSG_LONG=1 takes ten million nodes (some 8 GB) instead of 100,000.
#include <random>

#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>

#include "support/long_form.h"
#include "sync/mirror/mirror_support.h"

namespace rtsg {
namespace {

using namespace std::chrono_literals;

/// Groups of a thousand Transforms below the root.
struct Large {
    Scene scene;
    std::vector<NodeId> groups;
    std::mt19937 random;
    int names = 0;

    Large(std::size_t nodes, unsigned seed) : random(seed) {
        constexpr std::size_t kBelow = 1000;
        for (std::size_t created = 0; created < nodes; created += kBelow + 1) {
            const NodeId group = scene.createNode(x3d::Group::type);
            for (std::size_t i = 0; i < kBelow; ++i) add(group);
            EXPECT_TRUE(scene.insertChild(scene.root(), x3d::RtsgScene::children, group));
            groups.push_back(group);
        }
        scene.newFrame(0);
    }
    void add(NodeId group) {
        const NodeId node = scene.createNode(x3d::Transform::type);
        EXPECT_TRUE(scene.set(node, x3d::Transform::translation, Vec3f(float(node.value), 0, 0)));
        EXPECT_TRUE(scene.insertChild(group, x3d::Group::children, node));
    }
    NodeId any() { return groups[random() % groups.size()]; }
    const Array<NodeId>& below(NodeId group) const { return scene.node(group).get(x3d::Group::children); }

    void frame(double t) {
        for (int i = 0; i < 20; ++i) {
            const NodeId from = any(), to = any();
            if (below(from).size() < 2) continue;
            const std::size_t index = random() % below(from).size();
            const NodeId node = below(from)[index];
            switch (random() % 4) {
                case 0:
                    EXPECT_TRUE(scene.setName(node, "N" + std::to_string(++names)));
                    break;
                case 1:
                    EXPECT_TRUE(scene.removeChild(from, x3d::Group::children.index, index));
                    EXPECT_TRUE(scene.insertChild(to, x3d::Group::children, node, random() % 5));
                    break;
                case 2:
                    EXPECT_TRUE(scene.destroyNode(node));
                    break;
                default:
                    add(to);
            }
        }
        scene.newFrame(t);
    }
};

TEST(LargeScene, ReplicasJoinWhileItsStructureChanges) {
    const bool full = test::isLongForm();
    const std::size_t nodes = full ? 10'000'000 : 100'000;
    const unsigned seed = std::random_device{}();
    SCOPED_TRACE(seed);
    Large origin(nodes, seed);
    MirrorServerOptions options;
    options.peerTimeout = 120s;
    auto server = *MirrorServer::start(origin.scene, "tcp://127.0.0.1:*", options);
    const int joiners = full ? 1 : 4;
    std::vector<std::unique_ptr<Scene>> replicas;
    std::vector<std::unique_ptr<MirrorClient>> clients;
    double t = 0;
    const auto end = std::chrono::steady_clock::now() + 200s;
    const auto step = [&] {
        server->service();
        origin.frame(t += 0.01);
        for (const auto& client : clients) client->poll(1ms);
    };
    for (int i = 0; i < joiners; ++i) {
        replicas.push_back(std::make_unique<Scene>());
        clients.push_back(*MirrorClient::connect(*replicas.back(), server->endpoint()));
        while (clients.back()->statistics().snapshots == 0 && std::chrono::steady_clock::now() < end) step();
        for (int more = 0; more < 20; ++more) step();
    }
    for (std::size_t i = 0; i < clients.size(); ++i) {
        ASSERT_TRUE(test::pollUntilAt(*clients[i], origin.scene));
        EXPECT_EQ(replicas[i]->hash(), origin.scene.hash());
        EXPECT_EQ(replicas[i]->nodeCount(), origin.scene.nodeCount());
        EXPECT_EQ(clients[i]->statistics().snapshots, 1u);
        EXPECT_EQ(clients[i]->statistics().gaps, 0u);
        EXPECT_EQ(clients[i]->statistics().divergences, 0u);
    }
}

}  // namespace
}  // namespace rtsg
