// States that a shared world hands to readers on other threads: whole, the newest there is, and made only for those who
// ask.
#include <atomic>
#include <chrono>
#include <memory>
#include <stdexcept>
#include <thread>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/renderers/light_renderer.h>

namespace rtsg {
namespace {

using namespace std::chrono_literals;
using State = std::shared_ptr<const WorldState>;

/// Counts the shapes, also in versions.
struct CallCounter final : InstanceSubscriber {
    Result<> apply(const Scene&, const ChangeSet&, const InstanceDelta& delta) override {
        if (fails) return fail("out of ideas");
        shapes += static_cast<int>(delta.added.size()) - static_cast<int>(delta.removed.size());
        return {};
    }
    std::shared_ptr<const void> freeze() override {
        ++frozen;
        return std::make_shared<const int>(shapes);
    }
    std::string subscriberName() const override {
        if (hasNoName) throw std::runtime_error("no name");
        return "counter";
    }
    int shapes = 0, frozen = 0;
    bool fails = false, hasNoName = false;
};

struct Stage {
    Scene scene;
    SharedWorld world{scene};
    CallCounter counter;
    std::uint64_t number = world.add(counter);
    NodeId last;

    void addBox() {
        last = scene.createNode(x3d::Transform::type);
        const NodeId shape = scene.createNode(x3d::Shape::type), box = scene.createNode(x3d::Box::type);
        ASSERT_TRUE(scene.set(shape, x3d::Shape::geometry, box));
        ASSERT_TRUE(scene.insertChild(last, x3d::Transform::children, shape));
        ASSERT_TRUE(scene.insertChild(scene.root(), x3d::RtsgScene::children, last));
        scene.seal();
    }
    void moveBox(float x) {
        ASSERT_TRUE(scene.set(last, x3d::Transform::translation, Vec3f(x, 0, 0)));
        scene.seal();
    }
    /// Without waiting: asked before, made by the delivery in between.
    State now() {
        const auto state = world.latest(0ns);
        return state ? *state : nullptr;
    }
    int shapesIn(const State& state) const { return *static_cast<const int*>(state->of(number).get()); }
};

TEST(WorldState, IsMadeForThoseWhoAskAndForNobodyElse) {
    Stage stage;
    stage.world.rays();
    stage.addBox();
    for (int i = 0; i < 100; ++i) stage.moveBox(static_cast<float>(i));
    EXPECT_EQ(stage.world.counts().handedOver, 0u);
    EXPECT_EQ(stage.counter.frozen, 0);

    const auto none = stage.world.latest(0ns);
    ASSERT_FALSE(none);
    EXPECT_NE(none.error().text.find("no state"), std::string::npos);
    stage.addBox();
    const State state = stage.now();
    ASSERT_TRUE(state);
    EXPECT_EQ(state->sequence, stage.scene.sequence());
    EXPECT_EQ(state->time, stage.scene.now());
    EXPECT_EQ(stage.shapesIn(state), 2);
    ASSERT_TRUE(state->rays);
    EXPECT_EQ(stage.world.counts().handedOver, 1u);
    EXPECT_EQ(stage.now(), state) << "while nothing changes";

    // A reader that was served wants the next one too; nobody wants the ones after that.
    for (int i = 0; i < 50; ++i) stage.moveBox(static_cast<float>(i));
    EXPECT_EQ(stage.world.counts().handedOver, 2u);
    EXPECT_EQ(stage.counter.frozen, 2);
}

TEST(WorldState, AWorldThatRestsHandsOverWhenItIsUpdated) {
    Stage stage;
    stage.addBox();
    EXPECT_EQ(stage.now(), nullptr);
    ASSERT_TRUE(stage.world.update());
    const State state = stage.now();
    ASSERT_TRUE(state);
    EXPECT_EQ(stage.shapesIn(state), 1);
    EXPECT_EQ(state->rays, nullptr) << "nobody has asked for rays";
    stage.world.rays();
    EXPECT_TRUE(stage.now()->rays);
}

TEST(WorldState, StaysWhatItWasWhileTheSceneGoesOn) {
    Stage stage;
    stage.world.rays();
    std::vector<State> states;
    for (int i = 0; i < 5; ++i) {
        (void)stage.now();
        stage.addBox();
        states.push_back(stage.now());
        ASSERT_TRUE(states.back());
    }
    for (int i = 0; i < 5; ++i) {
        EXPECT_EQ(stage.shapesIn(states[static_cast<std::size_t>(i)]), i + 1);
        int traced = 0;
        for (const RayInstance& instance : states[static_cast<std::size_t>(i)]->rays->instances())
            traced += bool(instance.info.id);
        EXPECT_EQ(traced, i + 1);
    }
}

/// Asks for a state, and for rays for the first time, in the middle of a delivery.
struct Meddler final : InstanceSubscriber {
    explicit Meddler(SharedWorld& w) : world(w) {}
    Result<> apply(const Scene&, const ChangeSet&, const InstanceDelta&) override {
        (void)world.latest(0ns);
        world.rays();
        if (const auto state = world.latest(0ns)) seen.push_back((*state)->sequence);
        return world.update();
    }
    SharedWorld& world;
    std::vector<std::uint64_t> seen;
};

TEST(WorldState, IsNotMadeInTheMiddleOfADelivery) {
    Scene scene;
    SharedWorld world(scene);
    Meddler meddler(world);
    CallCounter counter;
    world.add(meddler);
    EXPECT_TRUE(meddler.seen.empty()) << "it has not had its own turn to the end";
    const std::uint64_t number = world.add(counter);
    for (int i = 0; i < 3; ++i) {
        (void)scene.insertChild(scene.root(), x3d::RtsgScene::children, scene.createNode(x3d::Group::type));
        scene.seal();
        const auto state = world.latest(0ns);
        ASSERT_TRUE(state);
        EXPECT_EQ((*state)->sequence, scene.sequence());
        EXPECT_NE((*state)->of(number), nullptr) << "all have had their turn";
        if (i > 0) {
            EXPECT_LT(meddler.seen.back(), scene.sequence()) << "it was offered the state before";
        }
    }
}

TEST(WorldState, WithNoVersionLeftReadersGetTheNewestThereIsAtOnce) {
    Stage stage;
    stage.world.rays();
    std::vector<State> held;
    (void)stage.now();
    for (std::size_t i = 0; i < RayWorld::kMaxVersions; ++i) {
        stage.addBox();
        held.push_back(stage.now());
        ASSERT_TRUE(held.back());
        EXPECT_EQ(held.back()->sequence, stage.scene.sequence());
    }
    for (int i = 0; i < 3; ++i) {
        stage.addBox();
        const auto start = std::chrono::steady_clock::now();
        const auto state = stage.world.latest(60s);
        ASSERT_TRUE(state);
        EXPECT_EQ(*state, held.back());
        EXPECT_LT(std::chrono::steady_clock::now() - start, 30s) << "there was nothing to wait for";
    }
    EXPECT_GT(stage.world.counts().refused, 0u);
    held.erase(held.begin());
    stage.addBox();
    EXPECT_EQ(stage.now()->sequence, stage.scene.sequence()) << "as soon as one is let go";
}

TEST(WorldState, WhatNobodyAsksForAnyMoreIsForgotten) {
    Stage stage;
    (void)stage.now();
    stage.addBox();
    std::weak_ptr<const WorldState> first = stage.now();
    stage.moveBox(1);  // wanted by who took the first
    EXPECT_TRUE(first.expired());
    State kept = stage.now();
    ASSERT_TRUE(kept);
    std::weak_ptr<const WorldState> second = kept;
    kept.reset();
    for (std::uint64_t i = 0; i < SharedWorld::kForget + 10; ++i) stage.moveBox(static_cast<float>(i) + 2);
    EXPECT_TRUE(second.expired());
    EXPECT_EQ(stage.now(), nullptr);
    stage.moveBox(0);
    EXPECT_TRUE(stage.now());
}

TEST(WorldState, KnowsNothingOfThoseWhoCameLaterOrFailed) {
    Stage stage;
    (void)stage.now();
    stage.addBox();
    const State before = stage.now();
    CallCounter late;
    const std::uint64_t number = stage.world.add(late);
    const State after = stage.now();
    ASSERT_TRUE(before && after);
    EXPECT_EQ(before->of(number), nullptr);
    ASSERT_NE(after->of(number), nullptr) << "coming makes a new state for those who have asked";
    late.fails = true;
    stage.addBox();
    EXPECT_EQ(stage.now()->of(number), nullptr);
    EXPECT_EQ(stage.shapesIn(stage.now()), 2);
    stage.world.remove(late);
    CallCounter again;
    EXPECT_NE(stage.world.add(again), number);
}

TEST(WorldState, OfAWorldThatFailsThereIsNone) {
    Stage stage;
    (void)stage.now();
    stage.addBox();
    ASSERT_TRUE(stage.now());
    // A failure of a subscriber is its own; one beside all subscribers is the world's.
    stage.counter.fails = stage.counter.hasNoName = true;
    stage.addBox();
    EXPECT_NE(stage.world.failure(), "");
    const auto none = stage.world.latest(60s);
    ASSERT_FALSE(none) << "and nobody waits for it";
    EXPECT_NE(none.error().text.find("no longer"), std::string::npos);
}

TEST(WorldState, OutlivesItsWorldAndItsScene) {
    State state;
    std::uint64_t number = 0;
    {
        Stage stage;
        stage.world.rays();
        (void)stage.now();
        stage.addBox();
        state = stage.now();
        number = stage.number;
        stage.moveBox(100);
    }
    ASSERT_TRUE(state);
    EXPECT_EQ(*static_cast<const int*>(state->of(number).get()), 1);
    EXPECT_NEAR(state->rays->intersect({{0, 0, 9}, 0, {0, 0, -1}}).t, 8, 1e-5);
}

TEST(WorldState, AReaderWaitsForTheNextFrameAndTheSceneForNobody) {
    Stage stage;
    stage.world.rays();
    stage.addBox();
    std::atomic<bool> stop{false}, done{false};
    std::atomic<int> taken{0}, backwards{0}, failed{0};
    std::thread reader([&] {
        std::uint64_t last = 0;
        while (!stop) {
            const auto state = stage.world.latest(10s);
            if (!state) {
                ++failed;
                continue;
            }
            backwards += (*state)->sequence < last;
            last = (*state)->sequence;
            ++taken;
        }
        done = true;
    });
    for (int i = 0; !done; ++i) {
        stop = taken >= 200 || i > 100'000;
        stage.moveBox(static_cast<float>(i % 100));
        std::this_thread::sleep_for(100us);
    }
    reader.join();
    EXPECT_GE(taken, 200);
    EXPECT_EQ(backwards, 0);
    EXPECT_EQ(failed, 0);
}

/// Like navigation: it asks for rays, and so brings the world up to date, just before each frame.
TEST(WorldState, AReaderGetsAStateThoughEachIsOldAsSoonAsItIsHandedOver) {
    constexpr int kCalls = 20, kFrames = 600;  // some two a call are needed; some seventy if each must be the newest
    Stage stage;
    stage.world.rays();
    stage.addBox();
    std::atomic<bool> done{false};
    std::atomic<std::uint64_t> known{0};
    std::atomic<int> got{0};
    int frames = 0;
    const auto frame = [&] {
        (void)stage.world.update();
        stage.moveBox(static_cast<float>(frames++ % 100));
        known = stage.scene.sequence();
        std::this_thread::sleep_for(3ms);
    };
    frame();
    std::thread reader([&] {
        for (int i = 0; i < kCalls; ++i) {
            const std::uint64_t before = known;
            const auto state = stage.world.latest(600s);
            got += state && (*state)->sequence >= before;
        }
        done = true;
    });
    while (!done && frames < kFrames) frame();
    const int needed = frames;
    for (; !done; std::this_thread::sleep_for(3ms)) (void)stage.world.update();
    reader.join();
    EXPECT_EQ(got, kCalls) << "as new as the scene was at the call";
    EXPECT_LT(needed, kFrames) << "it waited until nothing moved";
}

const char* const kRoom = R"(#X3D V4.0 utf8
PROFILE Immersive
Viewpoint { }
DEF T Transform { children [
  DEF L PointLight { global FALSE location 0 0 3 }
  Shape { appearance Appearance { material DEF M Material { diffuseColor 1 .5 .2 } } geometry Box { } } ] }
LOD { range [5] children [ Shape { geometry Sphere { radius .5 } } Shape { geometry Box { size .3 .3 .3 } } ] }
)";

LightRenderer::Options small() {
    LightRenderer::Options options;
    options.image.settings.width = 40, options.image.settings.height = 30;
    return options;
}

TEST(WorldState, ThePictureOfAStateIsThatOfTheScenesThread) {
    Scene scene;
    Diagnostics diagnostics;
    ASSERT_TRUE(loadText(scene, kRoom, diagnostics));
    SharedWorld world(scene);
    LightRenderer here(world, small()), there(world, small());
    const NodeId box = scene.findName("T"), lamp = scene.findName("L"), paint = scene.findName("M");
    (void)world.latest(0ns);
    std::vector<State> states;
    std::vector<Picture> pictures;
    for (int i = 0; i < 8; ++i) {
        if (i % 2 == 0) {
            ASSERT_TRUE(scene.set(box, x3d::Transform::translation, Vec3f(.1f * static_cast<float>(i), 0, 0)));
        }
        if (i % 3 == 0) {
            ASSERT_TRUE(scene.set(lamp, x3d::PointLight::on, i % 2 != 0));
        }
        if (i % 3 == 1) {
            ASSERT_TRUE(scene.set(paint, x3d::Material::diffuseColor, Color{.1f * static_cast<float>(i), 1, 0}));
        }
        scene.newFrame(i);
        ASSERT_TRUE(here.renderFrame());
        const auto state = world.latest(0ns);
        ASSERT_TRUE(state);
        ASSERT_EQ((*state)->sequence, scene.sequence());
        states.push_back(*state);
        pictures.push_back(here.frame());
    }
    std::thread reader([&] {
        for (std::size_t i = states.size(); i-- > 0;) {
            ASSERT_TRUE(there.renderFrame(*states[i]));
            EXPECT_EQ(there.frame().pixels, pictures[i].pixels) << i;
        }
    });
    reader.join();
    EXPECT_NE(pictures[0].pixels, pictures[1].pixels);
    there.registerNodeRenderer("Box", {});
    std::thread([&] { EXPECT_FALSE(there.renderFrame(*states[0])) << "its own nodes need the scene's thread"; }).join();
    LightRenderer late(world, small());
    EXPECT_FALSE(late.renderFrame(*states[0])) << "it was not there";
}

/// A square lit from behind the eye, below three groups with a local light each: red, green and blue.
TEST(WorldState, LocalLightsAreSwitchedInTheStatesToCome) {
    Scene scene;
    Diagnostics diagnostics;
    ASSERT_TRUE(loadText(scene, R"(#X3D V4.0 utf8
PROFILE Immersive
NavigationInfo { headlight FALSE }
Viewpoint { }
DEF G0 Group { children [ DEF L0 DirectionalLight { global FALSE on FALSE color 1 0 0 }
  DEF G1 Group { children [ DEF L1 DirectionalLight { global FALSE on FALSE color 0 1 0 }
    DEF G2 Group { children [ DEF L2 DirectionalLight { global FALSE on FALSE color 0 0 1 }
      Shape { appearance Appearance { material Material { diffuseColor 1 1 1 } } geometry Box { } } ] } ] } ] }
)",
                         diagnostics));
    SharedWorld world(scene);
    LightRenderer here(world, small()), there(world, small());
    (void)world.latest(0ns);
    std::vector<State> states;
    const auto center = [](LightRenderer& light) { return Vec3f(light.frame().at(20, 15)); };
    const auto wanted = [](int lit) { return Vec3f(lit & 1 ? 1 : 0, lit & 2 ? 1 : 0, lit & 4 ? 1 : 0); };
    int lit = 0;
    std::vector<int> history;
    for (const int flip : {0, 2, 1, 0, 2, 0, 1, 2, 0, 1, 2}) {
        lit ^= 1 << flip;
        ASSERT_TRUE(
            scene.set(scene.findName(fmt::format("L{}", flip)), x3d::DirectionalLight::on, (lit >> flip & 1) != 0));
        scene.newFrame(scene.now() + 1);
        ASSERT_TRUE(here.renderFrame());
        EXPECT_EQ(center(here), wanted(lit));
        const auto state = world.latest(0ns);
        ASSERT_TRUE(state);
        if (states.size() + 1 < RayWorld::kMaxVersions) states.push_back(*state), history.push_back(lit);
    }
    for (std::size_t i = 0; i < states.size(); ++i) {
        ASSERT_TRUE(there.renderFrame(*states[i]));
        EXPECT_EQ(center(there), wanted(history[i])) << i;
    }
    // The group with the green light leaves the red one's: what is below sees the red one no longer.
    ASSERT_TRUE(scene.set(scene.findName("L0"), x3d::DirectionalLight::on, true));
    ASSERT_TRUE(scene.set(scene.findName("L1"), x3d::DirectionalLight::on, true));
    scene.newFrame(scene.now() + 1);
    ASSERT_TRUE(here.renderFrame());
    EXPECT_EQ(center(here), wanted((lit & 4) | 3));
    const NodeId inner = scene.findName("G1");
    ASSERT_TRUE(scene.insertChild(scene.root(), x3d::RtsgScene::children, inner));
    ASSERT_TRUE(scene.removeChild(scene.findName("G0"), x3d::Group::children.index, 1));
    scene.newFrame(scene.now() + 1);
    ASSERT_TRUE(here.renderFrame());
    EXPECT_EQ(center(here), wanted((lit & 4) | 2));
}

TEST(WorldState, WhereAReaderLooksFromChoosesTheLevelsOfTheNextState) {
    Scene scene;
    Diagnostics diagnostics;
    ASSERT_TRUE(loadText(scene, kRoom, diagnostics));
    SharedWorld world(scene);
    world.rays();
    const auto widest = [&] {  // the sphere is wider than the box that stands in for it
        (void)world.latest(0ns);
        EXPECT_TRUE(world.update());
        scene.newFrame(scene.now() + 1);
        const State state = *world.latest(0ns);
        const Hit hit = state->rays->intersect({{0, .4f, 10}, 0, {0, 0, -1}});
        return hit ? hit.t : 0.f;
    };
    ASSERT_TRUE(scene.set(scene.findName("T"), x3d::Transform::translation, Vec3f(90, 0, 0)));
    EXPECT_NEAR(widest(), 9.7f, .01f);
    std::thread([&] { world.lookFrom(Vec3d(0, 0, 50)); }).join();
    EXPECT_EQ(widest(), 0);
    std::thread([&] { world.lookFrom(Vec3d(0, 0, 0)); }).join();
    EXPECT_NEAR(widest(), 9.7f, .01f);
}

/// The eye jumps to and fro across a level's range in every frame, and has left when the picture is made.
TEST(WorldState, APreparedOneGivesThePictureOfItsInstantWhileTheSceneGoesOn) {
    struct Show {
        Show() {
            Diagnostics diagnostics;
            EXPECT_TRUE(loadText(scene, kRoom, diagnostics));
            scene.forEachNode([this](const Node& node) {
                if (node.type().name == "Viewpoint") eye = node.id();
            });
        }
        void frame(int k) {
            EXPECT_TRUE(
                scene.set(eye, x3d::Viewpoint::position, Vec3f(0, .01f * static_cast<float>(k), k % 2 ? 4 : 9)));
            scene.newFrame(k);
        }
        Scene scene;
        SharedWorld world{scene};
        LightRenderer light{world, small()};
        NodeId eye;
    } one, other;
    std::vector<Picture> pictures;
    for (int k = 0; k < 6; ++k) {
        one.frame(k);
        ASSERT_TRUE(one.light.renderFrame());
        EXPECT_EQ(one.light.presented(), one.scene.sequence());
        pictures.push_back(one.light.frame());
    }
    EXPECT_NE(pictures[0].pixels, pictures[1].pixels);
    other.frame(0);
    for (int k = 0; k < 6; ++k) {
        const auto state = other.light.prepare();
        ASSERT_TRUE(state);
        const std::uint64_t sequence = other.scene.sequence();
        if (k < 5) other.frame(k + 1);
        std::thread([&] {
            ASSERT_TRUE(other.light.renderFrame(**state));
            EXPECT_EQ(other.light.frame().pixels, pictures[static_cast<std::size_t>(k)].pixels) << k;
            EXPECT_EQ(other.light.presented(), sequence);
        }).join();
    }
    // Nobody else's eye came between: the levels were chosen as often.
    EXPECT_EQ(other.world.counts().commits, one.world.counts().commits);
}

TEST(WorldState, ThePresentOneIsNewEachTimeSomethingHasHappened) {
    Stage stage;
    stage.world.rays();
    const auto first = stage.world.present();
    ASSERT_TRUE(first);
    EXPECT_EQ(*first, *stage.world.present());  // nothing has happened
    ASSERT_TRUE(stage.scene.set(stage.scene.createNode(x3d::Transform::type), x3d::Transform::translation, Vec3f(1)));
    const auto second = stage.world.present();  // edits not yet sealed belong to it
    ASSERT_TRUE(second);
    EXPECT_EQ((*second)->sequence, stage.scene.sequence());
    EXPECT_NE((*second)->sequence, (*first)->sequence);
    std::vector<State> held{*first, *second};
    Result<State> more = *first;
    for (int i = 0; i < 20 && more; ++i) {
        stage.addBox();
        more = stage.world.present();
        if (more) held.push_back(*more);
    }
    ASSERT_FALSE(more);
    EXPECT_NE(more.error().text.find("too many"), std::string::npos);
    held.clear();
    EXPECT_TRUE(stage.world.present());
}

}  // namespace
}  // namespace rtsg
