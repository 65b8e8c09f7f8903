// Parts by region: what is near is in them and what is far is not, through random walks, and as peers get them.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>
#include <set>

#include <glm/gtc/matrix_transform.hpp>

#include <rtsg/core/change_composer.h>
#include <rtsg/core/field_text.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/sync/mirror_relay.h>

#include "mirror_support.h"
#include "parts/part.h"
#include "support/random_edits.h"

namespace rtsg {
namespace {

using namespace std::chrono_literals;
using test::pollUntil;
using test::pollUntilAt;
using x3d::Transform;

struct KeepLast : Subscriber {
    ChangeSet set;
    Result<> apply(const Scene&, const ChangeSet& changes) override {
        set = changes;
        return {};
    }
};

/// A part by region beside the scene it is of, and a replica that has its sets only.
struct Walk {
    Scene& whole;
    MirrorPart part;
    SpatialIndex index;
    Scene replica;
    explicit Walk(Scene& scene, const std::string& region) : whole(scene), part(wishes(region)) {
        replica.setBehavioursEnabled(false);
        index.coverRadius(1);
        EXPECT_TRUE(index.follow(whole, nullptr));
        step(nullptr);
    }
    static mirror::Wishes wishes(const std::string& region) {
        mirror::Wishes result;
        result.parts = {region};
        EXPECT_FALSE(MirrorPart::refusalOf(result));
        return result;
    }
    void follow(const ChangeSet& set) {
        ASSERT_TRUE(index.follow(whole, &set));
        step(&set);
    }
    void step(const ChangeSet* set) {
        const auto created = part.follow(whole, set, &index);
        ASSERT_TRUE(created) << created.error().text;
        const auto applied = replica.apply(std::make_shared<ChangeSet>(**created));
        ASSERT_TRUE(applied) << applied.error().text;
        ASSERT_EQ(replica.hash(), (*created)->hash);
        ASSERT_EQ(part.scene().hash(), (*created)->hash);
        changes = (*created)->changes.size();
        last = *created;
    }
    std::size_t changes = 0;
    std::shared_ptr<const ChangeSet> last;
};

/// Everything in a scene but the order in lists of nodes.
std::string unordered(const Scene& scene) {
    std::vector<std::string> lines;
    scene.forEachNode([&](const Node& node) {
        std::string line = std::to_string(node.id().value) + ' ' + node.type().name + ' ' +
                           std::to_string(node.scope().value) + ' ' + std::string(scene.name(node.id()));
        for (FieldIndex f = 0; f < node.type().fields.size(); ++f) {
            if (!node.type().fields[f].readable()) continue;
            line += '|';
            if (node.type().fields[f].type != FieldType::MFNode) {
                line += printFieldText(node.value(f));
                continue;
            }
            const auto& array = node.get(Field<Array<NodeId>>{f});
            std::vector<NodeId> children(array.begin(), array.end());
            std::ranges::sort(children);
            for (const NodeId child : children) line += ' ' + std::to_string(child.value);
        }
        std::multiset<std::string> routes;
        for (const Route& r : scene.routesFrom(node.id()))
            routes.insert(std::to_string(r.fromField) + '>' + std::to_string(r.toNode.value) + '.' +
                          std::to_string(r.toField));
        for (const std::string& route : routes) line += ' ' + route;
        lines.push_back(line);
    });
    std::string all;
    for (const std::string& line : lines) all += line + '\n';
    return all;
}

/// A town: groups in groups, with balls, boxes, meshes, switches of balls, lamps.
struct Town {
    Scene scene;
    std::mt19937_64 random;
    std::vector<NodeId> groups, shapes, switches, lamps, points;
    NodeId eye;
    explicit Town(std::uint64_t seed) : random(seed) {
        groups.push_back(scene.root());
        eye = add(scene.root(), x3d::Viewpoint::type);
        EXPECT_TRUE(scene.setName(eye, "EYE"));
        for (int i = 0; i < 25; ++i) groups.push_back(add(any(groups), Transform::type));
        for (const NodeId id : groups)
            if (id != scene.root()) move(id);
        for (int i = 0; i < 60; ++i) shapes.push_back(shape(any(groups), i % 3));
        for (int i = 0; i < 8; ++i) {
            switches.push_back(add(any(groups), x3d::Switch::type));
            const NodeId inner = add(switches.back(), Transform::type);
            move(inner);
            shape(inner, 0);
            shape(switches.back(), 1);
        }
        for (int i = 0; i < 3; ++i) lamps.push_back(add(any(groups), x3d::PointLight::type));
        for (int i = 0; i < 10; ++i) {
            const NodeId group = any(groups);
            EXPECT_TRUE(scene.insertChild(group, listOf(group), any(shapes)));
        }
        scene.newFrame(0);
    }
    FieldIndex listOf(NodeId id) const { return scene.node(id).type().findExact("children"); }
    double number(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random); }
    NodeId any(const std::vector<NodeId>& from) { return from[random() % from.size()]; }
    NodeId add(NodeId parent, TypeIndex type) {
        const NodeId id = scene.createNode(type);
        EXPECT_TRUE(scene.insertChild(parent, listOf(parent), id));
        return id;
    }
    NodeId shape(NodeId parent, int kind) {
        const NodeId id = add(parent, x3d::Shape::type);
        NodeId geometry;
        if (kind == 0) {
            geometry = scene.createNode(x3d::Sphere::type);
            EXPECT_TRUE(scene.set(geometry, x3d::Sphere::radius, float(number(.1, 3))));
        } else if (kind == 1) {
            geometry = scene.createNode(x3d::Box::type);
            EXPECT_TRUE(scene.set(geometry, x3d::Box::size, Vec3f(number(.1, 9), 1, 2)));
        } else {
            geometry = scene.createNode(x3d::PointSet::type);
            points.push_back(scene.createNode(x3d::Coordinate::type));
            EXPECT_TRUE(scene.set(geometry, x3d::PointSet::coord, points.back()));
            bend(points.back());
        }
        EXPECT_TRUE(scene.set(id, x3d::Shape::geometry, geometry));
        return id;
    }
    void bend(NodeId coordinate) {
        Array<Vec3f> all;
        for (int i = 0; i < 4; ++i) all.push_back(Vec3f(number(-3, 3), number(-3, 3), number(-3, 3)));
        EXPECT_TRUE(scene.set(coordinate, x3d::Coordinate::point, all));
    }
    void move(NodeId id) {
        EXPECT_TRUE(scene.set(id, Transform::translation, Vec3f(number(-15, 15), number(-3, 3), number(-15, 15))));
        EXPECT_TRUE(scene.set(id, Transform::rotation, Rotation{0, 1, 0, float(number(-3, 3))}));
        EXPECT_TRUE(scene.set(id, Transform::scale, Vec3f(number(.7, 1.3), 1, number(.7, 1.3))));
    }
    void walk(int frame) {
        const Vec3f to(20 * std::sin(frame * .1), 1, 20 * std::cos(frame * .07));
        if (frame % 3) {
            EXPECT_TRUE(scene.set(eye, x3d::Viewpoint::position, to));
        }
        for (int i = 0; i < 2; ++i)
            if (const NodeId id = any(groups); id != scene.root()) move(id);
        bend(any(points));
        if (frame % 4 == 0) hangElsewhere();
        if (frame % 5 == 0) shapes.push_back(shape(any(groups), frame % 3));
    }
    void hangElsewhere() {
        const NodeId from = any(groups), to = any(groups);
        const auto& list = scene.node(from).get(Field<Array<NodeId>>{listOf(from)});
        if (list.empty()) return;
        const std::size_t index = random() % list.size();
        const NodeId child = list[index];
        if (child == eye || !scene.removeChild(from, listOf(from), index)) return;
        const bool fits = scene.insertChild(to, listOf(to), child).has_value();
        EXPECT_TRUE(fits || scene.insertChild(from, listOf(from), child));
    }

    /// The boxes in the world of shapes and switches, worked out anew, in another way than the library does.
    using Corners = std::vector<Vec3d>;
    static double distance(const Corners& corners, const Vec3d& to) {
        Vec3d low(1e300), high(-1e300);
        for (const Vec3d& c : corners) {
            low = glm::min(low, c);
            high = glm::max(high, c);
        }
        return corners.empty() ? 1e300 : glm::length(glm::max(glm::max(low - to, to - high), Vec3d(0)));
    }
    Corners local(NodeId id) const {
        const Node& node = scene.node(id);
        Vec3d low(1e300), high(-1e300);
        Corners all;
        if (node.is(x3d::Shape::type)) {
            const Node& g = scene.node(node.get(x3d::Shape::geometry));
            if (g.is(x3d::Sphere::type)) high = Vec3d(g.get(x3d::Sphere::radius)), low = -high;
            if (g.is(x3d::Box::type)) high = Vec3d(g.get(x3d::Box::size)) * .5, low = -high;
            if (g.is(x3d::PointSet::type))
                for (const Vec3f& p : scene.node(g.get(x3d::PointSet::coord)).get(x3d::Coordinate::point))
                    low = glm::min(low, Vec3d(p)), high = glm::max(high, Vec3d(p));
        } else {
            for (const NodeId child : node.get(Field<Array<NodeId>>{listOf(id)}))
                for (const Vec3d& c : local(child)) low = glm::min(low, c), high = glm::max(high, c);
        }
        for (int i = 0; i < 8; ++i)
            all.emplace_back(i & 1 ? low.x : high.x, i & 2 ? low.y : high.y, i & 4 ? low.z : high.z);
        return node.is(Transform::type) ? out(node, all) : all;
    }
    static Corners out(const Node& node, Corners corners) {
        const double angle = node.get(Transform::rotation).angle;
        for (Vec3d& c : corners) {
            c *= Vec3d(node.get(Transform::scale));
            c = Vec3d(std::cos(angle) * c.x + std::sin(angle) * c.z, c.y,
                      std::cos(angle) * c.z - std::sin(angle) * c.x);
            c += Vec3d(node.get(Transform::translation));
        }
        return corners;
    }
    double nearest(NodeId id, const Vec3d& to) const { return nearest(id, local(id), to); }
    double nearest(NodeId id, const Corners& corners, const Vec3d& to) const {
        if (id == scene.root()) return distance(corners, to);
        double best = 1e300;
        for (const ParentRef& parent : scene.parents(id)) {
            const Node& above = scene.node(parent.node);
            best = std::min(best, nearest(parent.node, above.is(Transform::type) ? out(above, corners) : corners, to));
        }
        return best;
    }
    Vec3d eyeAt() const {
        Corners at{Vec3d(scene.node(eye).get(x3d::Viewpoint::position))};
        for (NodeId id = eye; id != scene.root();) {
            id = scene.parents(id).at(0).node;
            if (scene.node(id).is(Transform::type)) at = out(scene.node(id), at);
        }
        return at.front();
    }
};

/// Law: what is within the radius is in; what is beyond the radius and its margin is not; and hashes are equal.
TEST(MirrorRegion, HoldsWhatIsNearThroughARandomWalk) {
    std::size_t entered = 0, left = 0, between = 0;
    for (std::uint64_t seed = 1; seed <= 6; ++seed) {
        Town town(seed);
        KeepLast last;
        const Attachment attachment = town.scene.bus().attach(last);
        Walk walk(town.scene, "region:EYE,12,0.25");
        for (int frame = 1; frame <= 120; ++frame) {
            town.walk(frame);
            std::set<std::uint32_t> before;
            walk.replica.forEachNode([&](const Node& node) { before.insert(node.id().value); });
            town.scene.newFrame(frame);
            walk.follow(last.set);
            if (::testing::Test::HasFatalFailure()) FAIL() << "seed " << seed << " frame " << frame;
            const Vec3d eye = town.eyeAt();
            for (const std::vector<NodeId>* units : {&town.shapes, &town.switches}) {
                for (const NodeId id : *units) {
                    const double distance = town.nearest(id, eye);
                    const bool isIn = walk.replica.find(id) != nullptr;
                    const bool mustBe = distance <= 12 - 1e-4, mustNotBe = distance > 15 + 1e-4;
                    ASSERT_TRUE(isIn ? !mustNotBe : !mustBe)
                        << "seed " << seed << " frame " << frame << " node " << id.value << " at " << distance;
                    between += distance > 12 && distance < 15 && isIn;
                    entered += isIn && !before.contains(id.value);
                    left += !isIn && before.contains(id.value);
                }
            }
            for (const NodeId id : town.lamps)
                ASSERT_TRUE(walk.replica.find(id) || town.nearest(id, Town::Corners{Vec3d(0)}, eye) > 1e200);
        }
    }
    EXPECT_GT(entered, 100u);
    EXPECT_GT(left, 100u);
    EXPECT_GT(between, 100u);
}

/// Law: without a margin, step by step is what is made from scratch, but for the order in lists.
TEST(MirrorRegion, FollowedThroughRandomEditsEqualsOneMadeFromScratch) {
    for (std::uint64_t seed = 1; seed <= 10; ++seed) {
        Town town(seed);
        test::RandomEdits edits(town.scene, seed);
        for (const std::vector<NodeId>* some : {&town.groups, &town.shapes, &town.switches, &town.lamps, &town.points})
            for (const NodeId id : *some)
                if (id != town.scene.root()) edits.adopt(id);
        KeepLast last;
        const Attachment attachment = town.scene.bus().attach(last);
        Walk walk(town.scene, "region:EYE,14,0");
        for (int frame = 1; frame <= 80; ++frame) {
            for (int i = 0; i < 4; ++i) edits.step();
            if (town.scene.find(town.eye))
                (void)town.scene.set(town.eye, x3d::Viewpoint::position,
                                     Vec3f(15 * std::sin(frame * .2), 1, frame % 20));
            town.scene.newFrame(frame);
            walk.follow(last.set);
            if (::testing::Test::HasFatalFailure()) FAIL() << "seed " << seed << " frame " << frame;
            Walk scratch(town.scene, "region:EYE,14,0");
            ASSERT_EQ(unordered(scratch.replica), unordered(walk.replica)) << "seed " << seed << " frame " << frame;
            ASSERT_EQ(scratch.replica.hash(), walk.replica.hash()) << "seed " << seed << " frame " << frame;
        }
    }
}

struct Subset : Subscriber {
    Scene scene;
    std::size_t sets = 0;
    Subset() { scene.setBehavioursEnabled(false); }
    Result<> apply(const Scene&, const ChangeSet& changes) override {
        ++sets;
        return scene.apply(std::make_shared<ChangeSet>(changes));
    }
};

/// Law: steps merged into one lead where they lead one by one. Nodes go and come again in them under the same number,
/// which nodes of a whole scene never do. So for what the server merges for slow peers, and who polls a replica seldom.
TEST(MirrorRegion, StepsMergedAtRandomLeadToTheSameState) {
    std::size_t again = 0;
    for (std::uint64_t seed = 1; seed <= 8; ++seed) {
        Town town(seed);
        Diagnostics diagnostics;
        ASSERT_TRUE(loadText(town.scene, R"(#X3D V4.0 utf8
PROFILE Immersive
PROTO Lump [ inputOutput SFVec3f at 0 0 0 ] { Transform { translation IS at children Shape { geometry Box { } } } }
DEF CART Transform { children DEF LUMP Lump { at 0 1 0 } }
)",
                             diagnostics));
        const NodeId cart = town.scene.findName("CART");
        town.scene.newFrame(0);
        KeepLast last;
        const Attachment attachment = town.scene.bus().attach(last);
        Walk walk(town.scene, "region:EYE,8,0");
        Subset polling;
        Attachment polled = walk.replica.bus().attach(polling, Delivery::polled);
        Scene merged;
        merged.setBehavioursEnabled(false);
        ChangeComposer composer;
        composer.add(*walk.last);
        std::set<std::uint32_t> gone;
        for (int frame = 1; frame <= 150; ++frame) {
            town.walk(frame);
            ASSERT_TRUE(town.scene.set(cart, Transform::translation, Vec3f(frame % 6 < 3 ? 300 : 20, 0, 0)));
            ASSERT_TRUE(town.scene.set(town.eye, x3d::Viewpoint::position, Vec3f(20, 1, frame % 11)));
            town.scene.newFrame(frame);
            walk.follow(last.set);
            if (::testing::Test::HasFatalFailure()) FAIL() << "seed " << seed << " frame " << frame;
            composer.add(*walk.last);
            for (const Change& c : walk.last->changes) {
                if (c.kind == ChangeKind::destroyNode) gone.insert(c.node.value);
                again += c.kind == ChangeKind::createNode && gone.contains(c.node.value);
            }
            if (town.random() % 12 && frame != 150) continue;
            const auto applied = merged.apply(std::make_shared<ChangeSet>(composer.take(&town.scene)));
            ASSERT_TRUE(applied) << "seed " << seed << " frame " << frame << ": " << applied.error().text;
            ASSERT_EQ(merged.dump(), walk.replica.dump()) << "seed " << seed << " frame " << frame;
            ASSERT_EQ(merged.hash(), walk.replica.hash());
            gone.clear();
            polled.poll();
            ASSERT_TRUE(polled.attached()) << polled.failure();
            ASSERT_EQ(polling.scene.hash(), walk.replica.hash());
        }
        EXPECT_LT(polling.sets, 100u);
    }
    EXPECT_GT(again, 100u);
}

/// Distant movements cost a region nothing, and things at its border do not come and go.
TEST(MirrorRegion, StaysQuietWhereNothingNearChanges) {
    Scene scene;
    const auto at = [&](float x) {
        const NodeId transform = scene.createNode(Transform::type), shape = scene.createNode(x3d::Shape::type),
                     ball = scene.createNode(x3d::Sphere::type);
        EXPECT_TRUE(scene.insertChild(scene.root(), x3d::RtsgScene::children, transform));
        EXPECT_TRUE(scene.insertChild(transform, Transform::children, shape));
        EXPECT_TRUE(scene.set(shape, x3d::Shape::geometry, ball));
        EXPECT_TRUE(scene.set(transform, Transform::translation, Vec3f(x, 0, 0)));
        return transform;
    };
    const NodeId near = at(0), border = at(10.5f), far = at(100);
    scene.newFrame(0);
    KeepLast last;
    const Attachment attachment = scene.bus().attach(last);
    Walk walk(scene, "region:0,0,0,10,.1");
    EXPECT_TRUE(walk.replica.find(near) && walk.replica.find(border));
    EXPECT_FALSE(walk.replica.find(far));
    double t = 0;
    const auto move = [&](NodeId id, float x) {
        EXPECT_TRUE(scene.set(id, Transform::translation, Vec3f(x, 0, 0)));
        scene.newFrame(++t);
        walk.follow(last.set);
    };
    move(far, 90);
    EXPECT_EQ(walk.changes, 0u);
    for (const float x : {11.5f, 10.9f, 11.9f, 11.1f}) {
        move(border, x);  // its box ends one nearer
        EXPECT_TRUE(walk.replica.find(border)) << x;
        EXPECT_EQ(walk.changes, 1u) << x;
    }
    move(border, 12.5f);
    EXPECT_FALSE(walk.replica.find(border));
    move(border, 11.5f);  // within the margin, but it is out
    EXPECT_FALSE(walk.replica.find(border));
    EXPECT_EQ(walk.changes, 0u);
    move(border, 10.5f);
    EXPECT_TRUE(walk.replica.find(border));
}

/// A lamp is in wherever it is; once it has gone, a centre that comes back finds it no more.
TEST(MirrorRegion, BeginsAnewWithoutWhatHasGone) {
    Scene scene;
    const NodeId lamp = scene.createNode(x3d::PointLight::type), eye = scene.createNode(x3d::Viewpoint::type);
    for (const NodeId id : {lamp, eye}) ASSERT_TRUE(scene.insertChild(scene.root(), x3d::RtsgScene::children, id));
    ASSERT_TRUE(scene.setName(eye, "EYE"));
    scene.newFrame(0);
    KeepLast last;
    const Attachment attachment = scene.bus().attach(last);
    Walk walk(scene, "region:EYE,10");
    EXPECT_TRUE(walk.replica.find(lamp));
    double t = 0;
    const auto step = [&] {
        scene.newFrame(++t);
        walk.follow(last.set);
    };
    ASSERT_TRUE(scene.destroyNode(lamp));
    step();
    EXPECT_FALSE(walk.replica.find(lamp));
    ASSERT_TRUE(scene.removeFromParents(eye));
    step();
    ASSERT_TRUE(scene.insertChild(scene.root(), x3d::RtsgScene::children, eye));
    step();
    EXPECT_TRUE(walk.replica.find(eye));
    EXPECT_FALSE(walk.replica.find(lamp));
}

/// A region that goes on beside other places of the same scene has to see that their numbers are others.
TEST(MirrorRegion, PlacesTellThatTheyAreNotThoseOfBefore) {
    Scene scene;
    SpatialIndex one(100), other(100);
    ASSERT_TRUE(one.follow(scene, nullptr));
    ASSERT_TRUE(other.follow(scene, nullptr));
    EXPECT_NE(one.beginning(), other.beginning());
}

TEST(MirrorRegion, SpellingsThatAreNoneAreRefusedWithWhatIsRight) {
    for (const char* good :
         {"region:10", "region:10,.2", "region:EYE,10", "region:EYE,10,0", "region:1,2,3,10", "region:-1,2e3,3,10,.5"})
        EXPECT_TRUE(RegionWish::parse(good)) << good;
    EXPECT_EQ(RegionWish::parse("region:1,2,3,10,.5")->point, Vec3d(1, 2, 3));
    EXPECT_EQ(RegionWish::parse("region:EYE,10")->name, "EYE");
    for (const char* bad : {"region:", "region:EYE", "region:EYE,", "region:EYE,0", "region:EYE,-1", "region:EYE,nan",
                            "region:EYE,10,-.1", "region:EYE,10,11", "region:1,2,3", "region:EYE,1,2,3,4",
                            "region:1,2,3,4,5,6", "region:EYE,inf", "region:1,EYE", "region:EYE,10,x"}) {
        const auto wish = RegionWish::parse(bad);
        ASSERT_FALSE(wish) << bad;
        EXPECT_NE(wish.error().text.find("radius"), std::string::npos) << wish.error().text;
    }
}

struct RegionFollower {
    Scene scene;
    std::unique_ptr<MirrorClient> client;
    RegionFollower(const std::string& endpoint, std::vector<std::string> parts, std::vector<Aspect> aspects = {}) {
        MirrorClientOptions options;
        options.parts = std::move(parts);
        options.aspects = std::move(aspects);
        client = *MirrorClient::connect(scene, endpoint, options);
    }
    bool settle(const Scene& origin) {
        return pollUntilAt(*client, origin) && client->statistics().equal && client->statistics().divergences == 0 &&
               client->statistics().repairs == 0;
    }
};

/// Through sockets: several regions, one who comes late, one behind a relay, with aspects, and who is refused.
TEST(MirrorRegion, PeersFollowRegionsInEveryFrame) {
    Town town(77);
    auto server = *MirrorServer::start(town.scene, test::kAnyPort, {});
    RegionFollower eye(server->endpoint(), {"region:EYE,12,.2"}), same(server->endpoint(), {"region:EYE,12,.2"}),
        here(server->endpoint(), {"region:3,0,3,5"}), viewer(server->endpoint(), {"region:20"}),
        form(server->endpoint(), {"region:EYE,12"}, {Aspect::transform});
    Scene middle;
    const auto relay = *MirrorRelay::connect(middle, server->endpoint(), test::kAnyPort);
    ASSERT_TRUE(pollUntil(*eye.client, [&] {
        EXPECT_TRUE(relay->poll());
        return relay->server() != nullptr;
    }));
    RegionFollower behind(relay->server()->endpoint(), {"region:EYE,12,.2"});
    std::unique_ptr<RegionFollower> late;
    for (int frame = 1; frame <= 40; ++frame) {
        town.walk(frame);
        town.scene.newFrame(frame);
        for (RegionFollower* f : {&eye, &same, &here, &viewer, &form})
            ASSERT_TRUE(f->settle(town.scene)) << "frame " << frame;
        if (frame == 20)
            late = std::make_unique<RegionFollower>(server->endpoint(), std::vector<std::string>{"region:EYE,12,.2"});
        ASSERT_TRUE(pollUntil(*behind.client, [&] {
            EXPECT_TRUE(relay->poll());
            return behind.client->statistics().sequence == town.scene.sequence();
        }));
        ASSERT_TRUE(behind.client->statistics().equal);
        if (late) {
            ASSERT_TRUE(late->settle(town.scene));
            ASSERT_EQ(late->scene.dump(), eye.scene.dump());
        }
    }
    EXPECT_EQ(eye.scene.dump(), same.scene.dump());
    EXPECT_LT(eye.scene.nodeCount(), town.scene.nodeCount());
    EXPECT_NE(eye.scene.hash(), here.scene.hash());
    EXPECT_EQ(eye.client->statistics().snapshots, 1u);
    for (const char* wrong : {"region:EYE", "region:EYE,0"}) {
        RegionFollower refused(server->endpoint(), {wrong});
        ASSERT_TRUE(pollUntil(*refused.client, [&] { return !refused.client->refusal().empty(); }));
        EXPECT_NE(refused.client->refusal().find("radius"), std::string::npos);
        EXPECT_FALSE(refused.client->turnedAway()) << "it is of no use to try again";
    }
    RegionFollower two(server->endpoint(), {"region:EYE,12", "EYE"});
    ASSERT_TRUE(pollUntil(*two.client, [&] { return !two.client->refusal().empty(); }));
}

}  // namespace
}  // namespace rtsg
