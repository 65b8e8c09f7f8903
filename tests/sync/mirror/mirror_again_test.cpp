// Replicas of scenes in motion that nobody follows, and then somebody: the same states by whichever way frames come.
#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>

#include "mirror_support.h"

namespace rtsg {
namespace {

using namespace std::chrono_literals;
using test::pollUntilAt;

/// Applies what it gets to a scene of its own.
struct FollowsAReplica : Subscriber {
    Scene scene;
    int sets = 0, snapshots = 0;
    FollowsAReplica() { scene.setBehavioursEnabled(false); }
    Result<> apply(const Scene&, const ChangeSet& changes) override {
        ++sets;
        if (changes.isSnapshot()) ++snapshots;
        return scene.apply(std::make_shared<const ChangeSet>(changes));
    }
};

TEST(MirrorAgain, WhoComesToAReplicaInMotionSeesAllOfItAndWhoGoesLeavesItWhole) {
    Scene origin, replica;
    std::vector<NodeId> nodes;
    for (int i = 0; i < 50; ++i) nodes.push_back(origin.createNode(x3d::Transform::type));
    origin.newFrame(0);
    auto server = MirrorServer::start(origin, test::kAnyPort);
    ASSERT_TRUE(server);
    MirrorClientOptions options;
    options.whenSlow = MirrorWhenSlow::block;  // frame by frame
    auto client = MirrorClient::connect(replica, (*server)->endpoint(), options);
    ASSERT_TRUE(client && pollUntilAt(**client, origin));
    int frame = 0;
    const auto show = [&](int frames) {
        for (int i = 0; i < frames; ++i) {
            ++frame;
            for (std::size_t n = 0; n < nodes.size(); ++n) {
                ASSERT_TRUE(origin.set(nodes[n], x3d::Transform::translation, Vec3f(float(frame), float(n), 0)));
                ASSERT_TRUE(origin.set(nodes[n], x3d::Transform::rotation, Rotation{0, 1, 0, float(frame + int(n))}));
            }
            // Now and then something else as well.
            if (frame % 9 == 0) {
                ASSERT_TRUE(origin.setName(nodes[0], "N" + std::to_string(frame)));
            }
            origin.newFrame(frame / 60.);
            ASSERT_TRUE(pollUntilAt(**client, origin));
            ASSERT_EQ(replica.hash(), origin.hash()) << frame;
        }
    };
    for (int round = 0; round < 4; ++round) {
        show(6);
        FollowsAReplica follower;
        const Attachment attachment = replica.bus().attach(follower);
        show(6);
        EXPECT_TRUE(attachment.attached()) << attachment.failure();
        EXPECT_EQ(follower.sets, 7);
        EXPECT_EQ(follower.snapshots, 1);
        EXPECT_EQ(follower.scene.dump(), origin.dump());
    }
    show(3);
    EXPECT_EQ(replica.dump(), origin.dump());
    const MirrorStatistics& statistics = (*client)->statistics();
    EXPECT_EQ(statistics.frames, static_cast<std::uint64_t>(frame) + 1);
    EXPECT_EQ(statistics.snapshots, 1u);
    EXPECT_EQ(statistics.divergences, 0u);
}

}  // namespace
}  // namespace rtsg
