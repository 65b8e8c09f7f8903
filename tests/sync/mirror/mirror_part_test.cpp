// Replicas of a part of a scene: what is in them, that their hash is what the server says, and that they stay in step.
#include <gtest/gtest.h>

#include <rtsg/core/hash_terms.h>
#include <rtsg/core/x3d.h>
#include <rtsg/sync/log.h>
#include <rtsg/sync/session.h>

#include "mirror_support.h"
#include "parts/part.h"
#include "support/log_support.h"
#include "support/random_edits.h"

namespace rtsg {
namespace {

using namespace std::chrono_literals;
using test::pollUntil;
using test::pollUntilAt;

/// Two arms, each a chain of transforms with a shape; a clock that drives the left one.
struct Robot {
    Scene scene;
    NodeId left, right, hand, shape, material, clock;
    std::unique_ptr<MirrorServer> server;
    int frame = 0;

    explicit Robot(MirrorServerOptions options = {}) {
        const auto child = [&](NodeId parent, TypeIndex type, FieldIndex field) {
            const NodeId id = scene.createNode(type);
            EXPECT_TRUE(scene.insertChild(parent, field, id));
            return id;
        };
        const FieldIndex top = x3d::RtsgScene::children.index, children = x3d::Transform::children.index;
        const NodeId body = child(scene.root(), x3d::Transform::type, top);
        left = child(body, x3d::Transform::type, children);
        right = child(body, x3d::Transform::type, children);
        hand = child(left, x3d::Transform::type, children);
        shape = child(hand, x3d::Shape::type, children);
        const NodeId appearance = scene.createNode(x3d::Appearance::type);
        material = scene.createNode(x3d::Material::type);
        EXPECT_TRUE(scene.set(shape, x3d::Shape::appearance, appearance));
        EXPECT_TRUE(scene.set(appearance, x3d::Appearance::material, material));
        clock = child(scene.root(), x3d::TimeSensor::type, top);
        EXPECT_TRUE(scene.setName(left, "LEFT"));
        EXPECT_TRUE(scene.setName(right, "RIGHT"));
        EXPECT_TRUE(scene.set(body, x3d::Transform::translation, Vec3f(0, 1, 0)));
        scene.newFrame(0);
        server = *MirrorServer::start(scene, test::kAnyPort, std::move(options));
    }
    void step() { scene.newFrame(++frame); }
};

struct PartFollower {
    Scene scene;
    std::unique_ptr<MirrorClient> client;
    PartFollower(const std::string& endpoint, std::vector<std::string> parts, std::vector<Aspect> aspects = {}) {
        MirrorClientOptions options;
        options.parts = std::move(parts);
        options.aspects = std::move(aspects);
        client = *MirrorClient::connect(scene, endpoint, options);
    }
    bool settle(const Scene& origin) {
        return pollUntilAt(*client, origin) && client->statistics().equal && client->statistics().divergences == 0;
    }
};

TEST(MirrorPart, HoldsTheSubtreeAndTheWayToIt) {
    Robot robot;
    PartFollower follower(robot.server->endpoint(), {"LEFT"});
    ASSERT_TRUE(follower.settle(robot.scene));
    for (const NodeId id : {robot.left, robot.hand, robot.shape, robot.material}) EXPECT_TRUE(follower.scene.find(id));
    EXPECT_FALSE(follower.scene.find(robot.right));
    EXPECT_FALSE(follower.scene.find(robot.clock));
    EXPECT_EQ(follower.scene.findName("LEFT"), robot.left);
    // The way to it has its values, so that it stands where it should.
    const NodeId body = follower.scene.parents(robot.left).at(0).node;
    EXPECT_EQ(follower.scene.node(body).get(x3d::Transform::translation), Vec3f(0, 1, 0));
    EXPECT_EQ(follower.scene.node(body).get(x3d::Transform::children).size(), 1u);
    // Others' changes cost a header; the part's arrive.
    ASSERT_TRUE(robot.scene.set(robot.right, x3d::Transform::translation, Vec3f(5, 5, 5)));
    ASSERT_TRUE(robot.scene.set(robot.hand, x3d::Transform::translation, Vec3f(1, 2, 3)));
    robot.step();
    ASSERT_TRUE(follower.settle(robot.scene));
    EXPECT_EQ(follower.scene.node(robot.hand).get(x3d::Transform::translation), Vec3f(1, 2, 3));
    EXPECT_NE(follower.scene.hash(), robot.scene.hash());
}

TEST(MirrorPart, AspectsLeaveTheRestAtItsDefault) {
    Robot robot;
    PartFollower follower(robot.server->endpoint(), {}, {Aspect::transform});
    ASSERT_TRUE(robot.scene.set(robot.material, x3d::Material::transparency, .5f));
    ASSERT_TRUE(robot.scene.set(robot.right, x3d::Transform::translation, Vec3f(7, 0, 0)));
    robot.step();
    ASSERT_TRUE(follower.settle(robot.scene));
    EXPECT_EQ(follower.scene.node(robot.right).get(x3d::Transform::translation), Vec3f(7, 0, 0));
    if (const Node* material = follower.scene.find(robot.material)) {
        EXPECT_EQ(material->get(x3d::Material::transparency), 0.f);
    }
}

TEST(MirrorPart, NodesMoveInAndOut) {
    Robot robot;
    PartFollower follower(robot.server->endpoint(), {"LEFT"});
    ASSERT_TRUE(follower.settle(robot.scene));
    const FieldIndex children = x3d::Transform::children.index;
    ASSERT_TRUE(robot.scene.removeChild(robot.left, children, 0));
    ASSERT_TRUE(robot.scene.insertChild(robot.right, children, robot.hand));
    robot.step();
    ASSERT_TRUE(follower.settle(robot.scene));
    EXPECT_FALSE(follower.scene.find(robot.hand));
    EXPECT_FALSE(follower.scene.find(robot.material));
    ASSERT_TRUE(robot.scene.removeChild(robot.right, children, 0));
    ASSERT_TRUE(robot.scene.insertChild(robot.left, children, robot.hand));
    ASSERT_TRUE(robot.scene.set(robot.hand, x3d::Transform::scale, Vec3f(2, 2, 2)));
    robot.step();
    ASSERT_TRUE(follower.settle(robot.scene));
    EXPECT_EQ(follower.scene.node(robot.hand).get(x3d::Transform::scale), Vec3f(2, 2, 2));
    EXPECT_TRUE(follower.scene.find(robot.material));
    // The name goes to another: so does the part.
    ASSERT_TRUE(robot.scene.setName(robot.left, ""));
    ASSERT_TRUE(robot.scene.setName(robot.right, "LEFT"));
    robot.step();
    ASSERT_TRUE(follower.settle(robot.scene));
    EXPECT_TRUE(follower.scene.find(robot.right));
    EXPECT_FALSE(follower.scene.find(robot.hand));
    EXPECT_EQ(follower.client->statistics().snapshots, 1u);
}

TEST(MirrorPart, ManyPartsBesideTheWholeAndNoMoreThanAllowed) {
    MirrorServerOptions options;
    options.maximumParts = 2;
    Robot robot(options);
    PartFollower whole(robot.server->endpoint(), {}), left(robot.server->endpoint(), {"LEFT"}),
        right(robot.server->endpoint(), {"RIGHT"});
    for (PartFollower* f : {&whole, &left, &right}) ASSERT_TRUE(f->settle(robot.scene));
    PartFollower same(robot.server->endpoint(), {"RIGHT"}),
        third(robot.server->endpoint(), {"#" + std::to_string(robot.hand.value)});
    ASSERT_TRUE(same.settle(robot.scene));
    ASSERT_TRUE(pollUntil(*third.client, [&] { return !third.client->refusal().empty(); }));
    EXPECT_NE(third.client->refusal().find("parts"), std::string::npos);
    for (int i = 1; i < 10; ++i) {
        ASSERT_TRUE(robot.scene.set(robot.right, x3d::Transform::translation, Vec3f(float(i))));
        robot.step();
        for (PartFollower* f : {&whole, &left, &right, &same}) ASSERT_TRUE(f->settle(robot.scene));
    }
    EXPECT_EQ(right.scene.dump(), same.scene.dump());
    EXPECT_EQ(whole.scene.dump(), robot.scene.dump());
}

TEST(MirrorPart, AHelloNamesManyOrIsRefusedBeforeItIsSent) {
    Robot robot;
    std::vector<std::string> parts{"LEFT"};
    for (int i = 1; i < 1024; ++i) parts.push_back("NONE" + std::to_string(i));
    PartFollower maximum(robot.server->endpoint(), parts);
    EXPECT_TRUE(pollUntilAt(*maximum.client, robot.scene));
    EXPECT_TRUE(maximum.scene.findName("LEFT"));
    EXPECT_FALSE(maximum.scene.findName("RIGHT"));
    MirrorClientOptions options;
    options.parts = parts;
    options.parts.push_back("RIGHT");
    Scene scene;
    const auto more = MirrorClient::connect(scene, robot.server->endpoint(), options);
    ASSERT_FALSE(more);
    EXPECT_EQ(more.error().text, "1025 parts: a hello names 1024 at most");
}

TEST(MirrorPart, ADifferenceInsideIsRepairedFromThePart) {
    Robot robot;
    PartFollower follower(robot.server->endpoint(), {"LEFT"});
    ASSERT_TRUE(follower.settle(robot.scene));
    const Vec3f wrong(9, 9, 9);
    std::memcpy(const_cast<void*>(follower.scene.node(robot.hand).storage(x3d::Transform::center.index)), &wrong,
                sizeof(wrong));
    ASSERT_TRUE(robot.scene.set(robot.hand, x3d::Transform::center, Vec3f(1, 1, 1)));
    robot.step();
    ASSERT_TRUE(pollUntil(*follower.client, [&] {
        return follower.client->inStep() && follower.client->statistics().equal &&
               follower.client->statistics().sequence == robot.scene.sequence();
    }));
    EXPECT_EQ(follower.client->statistics().repairs, 1u);
    EXPECT_EQ(follower.client->statistics().snapshots, 1u);
}

/// Law: a part followed through random edits is the part made from scratch.
TEST(MirrorPart, FollowedThroughRandomEditsEqualsOneMadeFromScratch) {
    for (std::uint64_t seed = 1; seed <= 8; ++seed) {
        Scene whole;
        test::RandomEdits edits(whole, seed);
        for (int i = 0; i < 60; ++i) edits.step();
        whole.newFrame(0);
        mirror::Wishes wishes;
        if (seed % 2) {
            std::size_t named = 0;
            for (const NodeId id : edits.nodes())
                if (whole.find(id) && named++ % 5 == 0 && wishes.parts.size() < 4)
                    wishes.parts.push_back("#" + std::to_string(id.value));
        }
        if (seed % 3 == 0) wishes.aspects = 1u << static_cast<unsigned>(Aspect::transform);
        struct Last : Subscriber {
            ChangeSet set;
            Result<> apply(const Scene&, const ChangeSet& changes) override {
                set = changes;
                return {};
            }
        } last;
        Attachment attachment = whole.bus().attach(last);
        MirrorPart part(wishes);
        ASSERT_TRUE(part.follow(whole, nullptr));
        Scene replica;
        replica.setBehavioursEnabled(false);
        ASSERT_TRUE(replica.apply(std::make_shared<ChangeSet>(part.scene().snapshot())));
        for (int frame = 1; frame <= 60; ++frame) {
            for (int i = 0; i < 5; ++i) edits.step();
            whole.newFrame(frame);
            const auto step = part.follow(whole, &last.set);
            ASSERT_TRUE(step) << "seed " << seed << " frame " << frame << ": " << step.error().text;
            const auto applied = replica.apply(std::make_shared<ChangeSet>(**step));
            ASSERT_TRUE(applied) << "seed " << seed << ": " << applied.error().text;
            ASSERT_EQ(replica.hash(), (*step)->hash) << "seed " << seed << " frame " << frame;
            MirrorPart scratch(wishes);
            ASSERT_TRUE(scratch.follow(whole, nullptr));
            ASSERT_EQ(scratch.scene().hash(), part.scene().hash()) << "seed " << seed << " frame " << frame << '\n'
                                                                   << part.scene().dump() << scratch.scene().dump();
        }
    }
}

/// A server that is killed, and one that goes on from its log and is frames ahead when its peers come back.
class PartLog : public test::LogFolder {
  protected:
    void SetUp() override {
        test::LogFolder::SetUp();
        auto log = LogWriter::create(file(), builtinTypes(), {});
        ASSERT_TRUE(log);
        MirrorServerOptions options;
        options.epoch = (*log)->epoch();
        robot_ = std::make_unique<Robot>(options);
        endpoint_ = robot_->server->endpoint();
        Attachment attachment = robot_->scene.bus().attach(**log);
        arm_ = std::make_unique<PartFollower>(endpoint_, std::vector<std::string>{"LEFT"});
        positions_ = std::make_unique<PartFollower>(endpoint_, std::vector<std::string>{},
                                                    std::vector<Aspect>{Aspect::transform});
        for (int i = 0; i < 20; ++i) edit(robot_->scene, i);
        attachment.detach();
        (*log)->abandon();
    }
    void edit(Scene& scene, int i) const {
        const auto x = static_cast<float>(i);
        ASSERT_TRUE(scene.set(robot_->hand, x3d::Transform::translation, Vec3f(x, 2, 3)));
        ASSERT_TRUE(scene.set(robot_->right, x3d::Transform::translation, Vec3f(x, x, 5)));
        ASSERT_TRUE(scene.set(robot_->material, x3d::Material::shininess, x / 100));
        const NodeId group = scene.createNode(x3d::Group::type);
        ASSERT_TRUE(scene.insertChild(i % 2 ? robot_->hand : robot_->right, x3d::Transform::children, group));
        scene.newFrame(scene.now() + 1);
    }
    void killServer() { robot_->server.reset(); }
    std::unique_ptr<MirrorServer> goOn(Scene& scene, int frames) {
        const auto session = resumeSession(file(), scene);
        EXPECT_TRUE(session);
        MirrorServerOptions options;
        options.epoch = session->epoch, options.before = session->before;
        auto server = *MirrorServer::start(scene, endpoint_, options);
        for (int i = 0; i < frames; ++i) edit(scene, 50 + i);
        return server;
    }

    std::unique_ptr<Robot> robot_;
    std::string endpoint_;
    std::unique_ptr<PartFollower> arm_, positions_;
};

TEST_F(PartLog, PeersOfPartsGoOnWithFramesAlone) {
    for (PartFollower* follower : {arm_.get(), positions_.get()}) ASSERT_TRUE(follower->settle(robot_->scene));
    killServer();
    for (const int ahead : {0, 7}) {
        Scene scene;
        const auto server = goOn(scene, ahead);
        std::uint64_t back = 0;
        for (PartFollower* follower : {arm_.get(), positions_.get()}) {
            ++back;
            ASSERT_TRUE(pollUntil(*follower->client, [&] { return server->statistics().resumed == back; })) << ahead;
            ASSERT_TRUE(follower->settle(scene)) << ahead;
            EXPECT_EQ(follower->client->statistics().snapshots, 1u) << ahead;
            EXPECT_EQ(follower->client->statistics().repairs, 0u) << ahead;
        }
    }
}

TEST_F(PartLog, PeersOfPartsThatTheLogHasLostSomethingOfTakeSnapshots) {
    edit(robot_->scene, 30);
    for (PartFollower* follower : {arm_.get(), positions_.get()}) ASSERT_TRUE(follower->settle(robot_->scene));
    killServer();
    Scene scene;
    const auto server = goOn(scene, 4);
    for (PartFollower* follower : {arm_.get(), positions_.get()}) {
        ASSERT_TRUE(follower->settle(scene));
        EXPECT_EQ(follower->client->statistics().snapshots, 2u);
    }
    EXPECT_EQ(server->statistics().resumed, 0u);
}

}  // namespace
}  // namespace rtsg
