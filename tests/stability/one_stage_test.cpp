// One scene edited at random on its thread, while light, sound and rays are at work on three others. Stated outcome:
// every state that a reader gets is whole and of one sequence number; a picture of it is, bit for bit, the one that the
// scene's thread makes in that state, and so is the sound; rays answer as a brute force over that state does; and the
// scene waits for nobody. Run it under the thread sanitizer. RTSG_LONG=1: 20 rounds instead of one.
#include <atomic>
#include <map>
#include <thread>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <rtsg/audio/sound_renderer.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/renderers/light_renderer.h>

#include "renderers/ray_support.h"
#include "support/long_form.h"

namespace rtsg {
namespace {

using State = std::shared_ptr<const WorldState>;

constexpr std::uint64_t kSeed = 20261120;

/// A room of things that come, go, move, deform, are painted and lit at random.
class Play {
  public:
    explicit Play(std::uint64_t seed) : random_(seed) {
        std::string text =
            "#X3D V4.0 utf8\nPROFILE Full\nViewpoint { position 0 0 12 }\nDEF LAMP PointLight { location 3 4 5 }\n"
            "Transform { scale 9 9 9 children Shape { appearance Appearance { material Material { } } geometry Box { "
            "solid FALSE } } }\n"
            "DEF VOICE Transform { children Sound { maxBack 50 maxFront 50 source OscillatorSource { frequency 440 } } "
            "}\n"
            "Shape { geometry IndexedFaceSet { solid FALSE coordIndex [0 1 2 3 -1] coord DEF SHEET Coordinate { point "
            "[-1 -3 0, 1 -3 0, 1 -2 0, -1 -2 0] } } }\n";
        for (int i = 0; i < kItems; ++i)
            text += fmt::format(
                "DEF T{0} Transform {{ translation {1} {2} {3} children [ DEF L{0} PointLight {{ global FALSE }} DEF "
                "S{0} "
                "Shape {{ appearance Appearance {{ material DEF M{0} Material {{ }} }} geometry {4} }} ] }}\n",
                i, number(5), number(5), number(5), i % 2 ? "Box { }" : "Sphere { radius .7 }");
        Diagnostics diagnostics;
        EXPECT_TRUE(loadText(scene, text, diagnostics));
        for (const Diagnostic& d : diagnostics.all()) ADD_FAILURE() << d.format();
    }
    void frame() {
        for (std::size_t edits = random_() % 4; edits > 0; --edits) edit();
        scene.newFrame(static_cast<double>(++frames_) / 5000);
    }
    Scene scene;

  private:
    static constexpr int kItems = 24;

    float number(float spread) { return std::uniform_real_distribution<float>(-spread, spread)(random_); }
    NodeId any(const char* kind) { return scene.findName(fmt::format("{}{}", kind, random_() % kItems)); }
    Vec3f position() { return {number(5), number(5), number(5)}; }
    void edit() {
        switch (random_() % 9) {
            case 0:
            case 1:
                (void)scene.set(any("T"), x3d::Transform::translation, position());
                break;
            case 2:
                (void)scene.set(any("L"), x3d::PointLight::on, random_() % 2 == 0);
                break;
            case 3:
                (void)scene.set(any("M"), x3d::Material::diffuseColor, Color{std::abs(number(1)), .5f, .5f});
                break;
            case 4:
                (void)scene.set(any("M"), x3d::Material::transparency, random_() % 2 ? 0.f : .5f);
                break;
            case 5: {  // comes or goes
                const NodeId node = any("T"), shape = any("S");
                const auto& children = scene.node(node).get(x3d::Transform::children);
                if (children.size() > 1)
                    (void)scene.removeChild(node, x3d::Transform::children.index, 1);
                else
                    (void)scene.insertChild(node, x3d::Transform::children.index, shape, 1);
                break;
            }
            case 6:
                (void)scene.set(any("S"), x3d::Shape::castShadow, random_() % 2 == 0);
                break;
            case 7: {
                const float z = number(2);
                (void)scene.set(scene.findName("SHEET"), x3d::Coordinate::point,
                                Array<Vec3f>{{-1, -3, z}, {1, -3, -z}, {1, -2, z}, {-1, -2, z}});
                break;
            }
            default:
                (void)scene.set(scene.findName("VOICE"), x3d::Transform::translation, position());
                break;
        }
    }
    std::mt19937_64 random_;
    int frames_ = 0;
};

/// The expected hits of rays, in versions.
struct Truth final : InstanceSubscriber {
    struct Version {
        std::uint64_t sequence = 0;
        test::BruteForce now;
    };
    Result<> apply(const Scene&, const ChangeSet& changes, const InstanceDelta& delta) override {
        version.sequence = changes.to;
        auto& items = version.now.items;
        for (const InstanceDelta::Geometry& g : delta.geometries) meshes[g.node.value] = g.mesh;
        for (const InstanceId& id : delta.removed) items.erase(id.slot);
        for (const auto* list : {&delta.added, &delta.rebound})
            for (const Instance& i : *list) items[i.id.slot].info = i;
        for (const InstanceDelta::Moved& m : delta.moved) items[m.id.slot].info.worldFromLocal = m.worldFromLocal;
        for (auto& [slot, item] : items) item.mesh = meshes[item.info.geometry.value];
        return {};
    }
    std::shared_ptr<const void> freeze() override { return std::make_shared<const Version>(version); }
    Version version;
    std::map<std::uint32_t, std::shared_ptr<const Mesh>> meshes;
};

LightRenderer::Options smallPicture() {
    LightRenderer::Options options;
    options.image.settings.width = 32, options.image.settings.height = 24;
    options.image.settings.threads = 1;
    return options;
}
ListenOptions shortSound() {
    ListenOptions options;
    options.metrics = false;
    options.render.ambisonicOrder = 1;
    options.render.trace.rays = 50;
    options.render.trace.maxSeconds = .2;
    options.render.trace.maxImageCandidates = 20;
    return options;
}
SharedWorld::Options repeatable() {
    SharedWorld::Options options;
    options.rays.restFrames = 3;
    options.rays.background = false;  // what it does is done here, at the same frames each time
    return options;
}
void tidy(SharedWorld& world, int frame) {
    if (frame % 10 == 9) world.finishBackgroundWork();
}

/// Rays against the brute force of the same version.
void compareRays(const WorldState& state, const Truth::Version& truth, std::mt19937& random, std::atomic<int>& compared,
                 std::atomic<int>& wrong) {
    wrong += truth.sequence != state.sequence;
    for (int i = 0; i < 20; ++i) {
        const Ray ray = test::randomRay(random, 8);
        const test::BruteForce::Answer expected = truth.now.intersect(ray, state.rays->origin());
        if (expected.margin < 1e-4) continue;
        const Hit hit = state.rays->intersect(ray);
        ++compared;
        wrong += hit.instance != expected.instance || hit.triangle != expected.triangle ||
                 (hit && std::abs(hit.t - expected.t) > 1e-4 * expected.t + 1e-4);
    }
}

/// The results of the readers of a round.
struct Round {
    int frames = 0;
    std::map<std::uint64_t, Picture> pictures, wanted;  // by sequence
    std::vector<std::uint64_t> heardStates;
    SoundBuffer sound;
    std::atomic<int> compared{0}, wrong{0}, errors{0}, taken[3]{};
};

void play(std::uint64_t seed, int frames, Round& round) {
    Play scene(seed);
    SharedWorld world(scene.scene, repeatable());
    Truth truth;
    const std::uint64_t number = world.add(truth);
    LightRenderer here(world, smallPicture()), light(world, smallPicture());
    SoundRenderer sound(world, shortSound());
    std::atomic<bool> stop{false};
    const auto follow = [&](int who, auto&& use) {
        std::uint64_t last = 0;
        while (!stop) {
            const auto state = world.latest(std::chrono::seconds(20));
            if (!state) {
                round.errors += !stop;
                continue;
            }
            if ((*state)->moment == last) continue;
            last = (*state)->moment;
            if (!use(**state)) ++round.errors;
            ++round.taken[who];
        }
    };
    std::thread lightThread([&] {
        follow(0, [&](const WorldState& state) {
            const bool done = light.renderFrame(state).has_value();
            round.pictures[state.sequence] = light.frame();
            return done;
        });
    });
    std::thread soundThread([&] {
        follow(1, [&](const WorldState& state) {
            round.heardStates.push_back(state.sequence);
            return sound.renderFrame(state).has_value();
        });
    });
    std::thread rayThread([&] {
        std::mt19937 random(static_cast<std::uint32_t>(seed));
        std::vector<State> held;  // some for a while
        follow(2, [&](const WorldState& state) {
            compareRays(state, *static_cast<const Truth::Version*>(state.of(number).get()), random, round.compared,
                        round.wrong);
            return true;
        });
    });
    const auto allHave = [&](int states) {
        return round.taken[0] >= states && round.taken[1] >= states && round.taken[2] >= states;
    };
    for (; round.frames < frames || (!allHave(6) && round.frames < 50 * frames); ++round.frames) {
        if (round.frames >= frames) std::this_thread::sleep_for(std::chrono::milliseconds(3));
        scene.frame();
        ASSERT_TRUE(here.renderFrame());
        round.wanted[scene.scene.sequence()] = here.frame();
        tidy(world, round.frames);
    }
    stop = true;
    for (std::thread* thread : {&lightThread, &soundThread, &rayThread}) {
        for (int i = 0; i < 3; ++i) EXPECT_TRUE(world.update());  // who waits for a state gets one
        thread->join();
    }
    EXPECT_TRUE(allHave(6)) << round.taken[0] << ", " << round.taken[1] << ", " << round.taken[2];
    EXPECT_GT(world.counts().handedOver, 5u);
    round.sound = sound.finish().sound;
}

/// The same play on one thread, heard in the same states.
SoundBuffer hearAgain(std::uint64_t seed, const Round& round) {
    Play scene(seed);
    SharedWorld world(scene.scene, repeatable());
    Truth truth;
    world.add(truth);
    LightRenderer here(world, smallPicture()), light(world, smallPicture());
    SoundRenderer sound(world, shortSound());
    std::size_t next = 0;
    const auto hear = [&] {
        if (next == round.heardStates.size() || round.heardStates[next] != scene.scene.sequence()) return;
        ++next;
        EXPECT_TRUE(sound.renderFrame());
    };
    hear();
    for (int frame = 0; frame < round.frames; ++frame) {
        scene.frame();
        hear();
        tidy(world, frame);
    }
    EXPECT_EQ(next, round.heardStates.size());
    return sound.finish().sound;
}

TEST(OneStage, LightSoundAndRaysAtTheirOwnRatesSeeWholeStates) {
    const std::uint64_t rounds = test::fewOrMany(1, 20);
    for (std::uint64_t r = 0; r < rounds && !HasFailure(); ++r) {
        SCOPED_TRACE(testing::Message() << "seed " << kSeed + r);
        Round round;
        play(kSeed + r, 200, round);
        EXPECT_EQ(round.errors, 0);
        EXPECT_GT(round.compared, 100);
        EXPECT_EQ(round.wrong, 0);
        std::size_t compared = 0;
        for (const auto& [sequence, picture] : round.pictures) {
            const auto wanted = round.wanted.find(sequence);
            if (wanted == round.wanted.end()) continue;  // before the first frame
            ++compared;
            EXPECT_EQ(picture.pixels, wanted->second.pixels) << "state " << sequence;
        }
        EXPECT_GE(compared, 5u);
        EXPECT_EQ(round.sound.samples, hearAgain(kSeed + r, round).samples);
        EXPECT_GT(round.sound.samples.size(), 0u);
        RecordProperty("states", fmt::format("{} frames; light {}, sound {}, rays {}", round.frames,
                                             round.taken[0].load(), round.taken[1].load(), round.taken[2].load()));
    }
}

}  // namespace
}  // namespace rtsg
