// Following a scene is reading it anew: seeded random edits, one session from the start, one attached late each time.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <random>
#include <string>
#include <tuple>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <rtsg/audio/sound_renderer.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>

#include "geometry/world_geometry.h"

namespace rtsg {
namespace {

using Described = std::tuple<std::string, double, double, double, double, bool, double>;

std::vector<Described> describe(const SoundScene& scene) {
    std::vector<Described> result;
    for (const SoundEmitter& emitter : scene.emitters()) {
        const SoundNode& sound = scene.sound(emitter);
        const glm::dvec3 p = scene.position(emitter);
        double voices = 0;
        for (const SoundVoice& voice : sound.voices) voices = 10 * voices + voice.gain;
        result.emplace_back(sound.name, p.x, p.y, p.z, sound.intensity, sound.enabled, voices);
    }
    std::sort(result.begin(), result.end());
    return result;
}

ListenOptions quiet() {
    ListenOptions options;
    options.sound = false;
    return options;
}

/// Random edits of a scene with groups, sounds and a wall.
struct SoundEdits {
    Scene& scene;
    std::mt19937_64& random;
    std::vector<NodeId> groups{scene.findName("A"), scene.findName("B"), scene.findName("C")};
    NodeId wall = scene.findName("WALL");
    std::vector<NodeId> sounds{}, clips{};

    std::size_t pick(std::size_t n) { return static_cast<std::size_t>(random() % n); }
    float number() { return static_cast<float>(random() % 1000) / 100.0f; }
    void step() {
        const NodeId group = groups[pick(groups.size())];
        const NodeId sound = sounds.empty() ? NodeId{} : sounds[pick(sounds.size())];
        switch (pick(9)) {
            case 0: {
                const bool spatial = pick(2) == 0;
                const NodeId fresh = *scene.createNode(spatial ? "SpatialSound" : "Sound");
                const NodeId clip = *scene.createNode("AudioClip");
                ASSERT_TRUE(scene.insertChild(group, x3d::Transform::children.index, fresh));
                const Result<> put = spatial ? scene.insertChild(fresh, x3d::SpatialSound::children.index, clip)
                                             : scene.set(fresh, x3d::Sound::source, clip);
                ASSERT_TRUE(put);
                sounds.push_back(fresh);
                clips.push_back(clip);
                break;
            }
            case 1:
                if (!sound) break;
                ASSERT_TRUE(scene.destroyNode(sound));
                std::erase(sounds, sound);
                break;
            case 2:
                ASSERT_TRUE(scene.set(group, x3d::Transform::translation, Vec3f(number(), number(), number())));
                break;
            case 3:
                if (!sound) break;
                ASSERT_TRUE(scene.node(sound).is(x3d::Sound::type)
                                ? scene.set(sound, x3d::Sound::intensity, number() / 10)
                                : scene.set(sound, x3d::SpatialSound::enabled, pick(2) == 0));
                break;
            case 4:  // USE it once more
                if (!sound) break;
                ASSERT_TRUE(scene.insertChild(group, x3d::Transform::children.index, sound));
                break;
            case 5: {
                const std::size_t count = scene.node(group).get(x3d::Transform::children).size();
                if (count == 0) break;
                ASSERT_TRUE(scene.removeChild(group, x3d::Transform::children.index, pick(count)));
                break;
            }
            case 6:
                if (clips.empty()) break;
                ASSERT_TRUE(scene.set(clips[pick(clips.size())], x3d::AudioClip::gain, number()));
                break;
            case 7:
                ASSERT_TRUE(scene.set(wall, x3d::AcousticProperties::absorption, number() / 10));
                break;
            default:
                ASSERT_TRUE(scene.sendEvent(scene.findName(pick(2) == 0 ? "V1" : "V2"), x3d::Viewpoint::set_bind.index,
                                            Value(pick(2) == 0)));
        }
    }
};

TEST(SoundScene, FollowingIsReadingAnew) {
    constexpr std::uint64_t kSeed = 1;
    SCOPED_TRACE(kSeed);
    std::mt19937_64 random(kSeed);
    Scene scene;
    Diagnostics diagnostics;
    ASSERT_TRUE(loadText(scene,
                         "#X3D V4.0 utf8\nPROFILE Full\n"
                         "DEF A Transform { } DEF B Transform { translation 1 2 3 } DEF C Transform { scale 2 2 2 }\n"
                         "Shape { geometry Box { size 40 40 40 } appearance Appearance { acousticProperties DEF WALL "
                         "AcousticProperties { absorption .25 } } }\n"
                         "DEF V1 Viewpoint { position 0 0 5 } DEF V2 Viewpoint { position 5 0 0 }\n",
                         diagnostics));
    SoundEdits edits{scene, random};
    SharedWorld merged(scene, {.flattening = {}, .rays = {}, .delivery = Delivery::polled});
    SoundRenderer follower(merged, quiet());
    ASSERT_EQ(follower.failure(), "");
    for (int step = 1; step <= 120; ++step) {
        for (std::size_t n = 1 + edits.pick(3); n > 0; --n) edits.step();
        if (HasFatalFailure()) return;
        scene.newFrame(step / 60.0);
        if (edits.pick(3) != 0) continue;  // several frames come merged
        ASSERT_TRUE(follower.renderFrame());
        SharedWorld fresh(scene);
        SoundRenderer late(fresh, quiet());
        ASSERT_TRUE(late.renderFrame());
        const SoundScene& a = follower.renderer().scene();
        const SoundScene& b = late.renderer().scene();
        ASSERT_EQ(describe(a), describe(b)) << "step " << step;
        ASSERT_EQ(a.listener().position, b.listener().position) << "step " << step;
        AcousticHit hitA, hitB;
        const OpenedGeometry roomA = follower.room({0, 0, 0}), roomB = late.room({0, 0, 0});
        ASSERT_TRUE(roomA.closest({0, 0, 0}, {1, 0, 0}, 100, kNoPlane, hitA));
        ASSERT_TRUE(roomB.closest({0, 0, 0}, {1, 0, 0}, 100, kNoPlane, hitB));
        ASSERT_EQ(hitA.distance, hitB.distance);
        ASSERT_EQ(roomA.materials()[hitA.material].absorption, roomB.materials()[hitB.material].absorption);
    }
    EXPECT_GT(edits.sounds.size(), 3u);
}

/// Other nodes have the same numbers then, and may be of other types.
TEST(SoundScene, OfASceneThatStartsOverHasTheWallsOfItsOwn) {
    const auto snapshotOf = [](const std::string& acoustics) {
        Scene scene;
        Diagnostics problems;
        EXPECT_TRUE(loadText(scene,
                             "#X3D V4.0 utf8\nPROFILE Full\nShape { appearance Appearance { acousticProperties " +
                                 acoustics + " } geometry Box { size 4 4 4 } }\n",
                             problems));
        return std::make_shared<const ChangeSet>(scene.snapshot());
    };
    Scene replica;
    replica.setBehavioursEnabled(false);
    ListenOptions options;
    options.metrics = false;
    SharedWorld world(replica);
    SoundRenderer sound(world, options);
    for (const double absorption : {.9, .3, .6}) {
        ASSERT_TRUE(replica.apply(snapshotOf(fmt::format("AcousticProperties {{ absorption {} }}", absorption))));
        const OpenedGeometry room = sound.room({0, 0, 0});
        AcousticHit hit;
        ASSERT_TRUE(room.closest({0, 0, 0}, {1, 0, 0}, 1e6, kNoPlane, hit));
        EXPECT_NEAR(room.materials()[hit.material].absorption[kBand1k], absorption, 1e-6);
        ASSERT_TRUE(replica.reset());
    }
}

/// By 16.4.16, intensity is from 0 to 1.
TEST(SoundScene, AnIntensityThatThereIsNotIsTheNearest) {
    for (const char* type : {"Sound", "SpatialSound"})
        for (const auto& [given, used] : {std::pair{-1.f, 0.}, {.25f, .25}, {2.f, 1.}}) {
            Scene scene;
            const NodeId sound = *scene.createNode(type);
            ASSERT_TRUE(scene.insertChild(scene.root(), x3d::RtsgScene::children, sound));
            ASSERT_TRUE(scene.setField(sound, scene.node(sound).type().find("intensity"), Value(given)));
            SharedWorld world(scene);
            const SoundRenderer renderer(world, quiet());
            const SoundScene& sounds = renderer.renderer().scene();
            ASSERT_EQ(sounds.emitters().size(), 1u);
            EXPECT_DOUBLE_EQ(sounds.sound(sounds.emitters()[0]).intensity, used) << type << " " << given;
        }
}

/// Whatever moves, and however often: what cannot be heard is named once.
TEST(SoundScene, WhatIsNotHeardIsNamedOnce) {
    Scene scene;
    Diagnostics diagnostics;
    ASSERT_TRUE(loadText(scene,
                         "#X3D V4.0 utf8\nPROFILE Full\n"
                         "DEF Film Sound { source MovieTexture { url \"film.mpg\" } }\n"
                         "DEF Talk SpatialSound { children [ MicrophoneSource { } StreamAudioSource { } Analyser { "
                         "children AudioClip { url \"no.wav\" } } ] }\n"
                         "DEF Out AudioDestination { children AudioClip { url \"no.wav\" } }\n"
                         "DEF Same SpatialSound { children AudioClip { url \"no.wav\" } }\n"
                         "DEF Text SpatialSound { children AudioClip { url \"notes.txt\" } }\nViewpoint { }\n",
                         diagnostics));
    ListenOptions options;
    options.metrics = false;
    options.seconds = .2;
    SharedWorld world(scene);
    SoundRenderer sound(world, options);
    for (int frame = 0; frame <= 12; ++frame) {
        for (const char* name : {"Film", "Talk", "Text"}) {
            const NodeId node = scene.findName(name);
            ASSERT_TRUE(scene.node(node).is(x3d::Sound::type)
                            ? scene.set(node, x3d::Sound::intensity, .01f * static_cast<float>(frame))
                            : scene.set(node, x3d::SpatialSound::intensity, .01f * static_cast<float>(frame)));
        }
        scene.newFrame(frame / 60.0);
        ASSERT_TRUE(sound.renderFrame());
    }
    const ListenReport report = sound.finish();
    std::vector<std::string> said;
    for (const Diagnostic& d : report.diagnostics.all()) said.push_back(d.text);
    EXPECT_EQ(said.size(), 5u) << testing::PrintToString(said);
    for (const char* part : {"film.mpg", "is silent: nobody has said what microphone",
                             "StreamAudioSource of Talk is not a source", "no.wav", "notes.txt"})
        EXPECT_EQ(std::count_if(said.begin(), said.end(),
                                [&](const std::string& text) { return text.find(part) != std::string::npos; }),
                  1)
            << part << testing::PrintToString(said);
}

/// A listener stays where it was, and as it was turned, while one of the two is nothing that can be.
TEST(SoundScene, AListenerKeepsTheLastPlaceThatIsOne) {
    constexpr float kInfinity = std::numeric_limits<float>::infinity();
    for (const std::string type : {"Viewpoint", "ListenerPointSource"}) {
        Scene scene;
        Diagnostics diagnostics;
        ASSERT_TRUE(loadText(scene,
                             "#X3D V4.0 utf8\nPROFILE Full\nDEF T Transform { children DEF EARS " + type +
                                 " { position 1 2 3 orientation 0 1 0 1.5707963 } }\n",
                             diagnostics));
        SharedWorld world(scene);
        SoundRenderer renderer(world, quiet());
        const SoundScene& sounds = renderer.renderer().scene();
        int frame = 0;
        const auto send = [&](const char* node, const char* field, const Value& value) {
            const NodeId id = scene.findName(node);
            ASSERT_TRUE(scene.sendEvent(id, scene.node(id).type().find(field), value)) << field;
            scene.newFrame(++frame / 60.0);
            ASSERT_TRUE(renderer.renderFrame());
        };
        const auto expect = [&](const glm::dvec3& position, const glm::dvec3& right, const std::string& what) {
            EXPECT_LT(glm::distance(sounds.listener().position, position), 1e-6) << type << what;
            EXPECT_LT(glm::distance(sounds.listener().right, right), 1e-6) << type << what;
            ASSERT_EQ(sounds.positions().size(), 1u);
            EXPECT_LT(glm::distance(sounds.positions()[0].position, position), 1e-6) << type << what;
        };
        send("T", "translation", Value(Vec3f(1, 0, 0)));
        expect({2, 2, 3}, {0, 0, -1}, " at first");
        for (const float strange : {static_cast<float>(NAN), kInfinity, -kInfinity}) {
            send("EARS", "position", Value(Vec3f(0, strange, 0)));
            expect({2, 2, 3}, {0, 0, -1}, " without a place");
            // The other one of the two goes on.
            send("EARS", "orientation", Value(Rotation{0, 1, 0, 0}));
            expect({2, 2, 3}, {1, 0, 0}, " turned without a place");
            send("EARS", "orientation", Value(Rotation{0, 1, 0, strange}));
            send("EARS", "position", Value(Vec3f(0, 0, 7)));
            expect({1, 0, 7}, {1, 0, 0}, " not turned");
            send("EARS", "orientation", Value(Rotation{strange, 1, 0, 1}));
            expect({1, 0, 7}, {1, 0, 0}, " round no axis");
            send("T", "translation", Value(Vec3f(strange, 0, 0)));
            expect({1, 0, 7}, {1, 0, 0}, " nowhere");
            send("T", "translation", Value(Vec3f(1, 0, 0)));
            send("EARS", "position", Value(Vec3f(1, 2, 3)));
            send("EARS", "orientation", Value(Rotation{0, 1, 0, 1.5707963f}));
            expect({2, 2, 3}, {0, 0, -1}, " again");
        }
        std::vector<std::string> said;
        for (const Diagnostic& d : sounds.diagnostics().all()) said.push_back(d.text);
        EXPECT_EQ(said, (std::vector<std::string>{
                            "EARS: its position in the world is no place: the last that was one counts, or 0 0 10",
                            "EARS: its orientation in the world is no rotation: the last that was one counts, or 0 0 "
                            "1 0"}))
            << type;
    }
}

}  // namespace
}  // namespace rtsg
