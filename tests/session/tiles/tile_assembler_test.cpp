// Tiles that mirrors draw, joined: each picture has the bits that it has when one program draws it.
#include <algorithm>
#include <chrono>
#include <map>
#include <optional>

#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/renderers/image.h>
#include <rtsg/session/output_maker.h>
#include <rtsg/session/tile_assembler.h>

#include "session/recorded_notices.h"

namespace rtsg {
namespace {

constexpr int kWidth = 48, kHeight = 32;

TEST(TileAssembler, JoinsWhatTwoMirrorsDraw) {
    Scene scene;
    Diagnostics diagnostics("test");
    loadText(scene,
             "#X3D V4.0 utf8\nPROFILE Immersive\nDirectionalLight { }\nViewpoint { }\n"
             "DEF T Transform { children Shape { geometry Sphere { } } }\n",
             diagnostics);
    ASSERT_EQ(diagnostics.errors(), 0u);
    const NodeId transform = scene.findName("T");
    auto door = TileDoor::open("tcp://127.0.0.1:0", false);
    ASSERT_TRUE(door) << door.error().format();
    TileAssembler assembler(std::move(*door), 2, 2);

    test::RecordedNotices notices;
    OutputOptions options;
    options.tiles = assembler.address();
    options.picturesPerSecond = 10;
    options.image.settings.width = kWidth, options.image.settings.height = kHeight;
    options.image.settings.threads = 1;
    options.context = notices.context();
    std::vector<std::unique_ptr<OutputMaker>> mirrors;
    for (int i = 0; i < 2; ++i) {
        auto created = followOutputs(scene, options, Resources());
        ASSERT_TRUE(created) << created.error().format();
        ASSERT_TRUE((*created)->wantsSteps());
        mirrors.push_back(std::move(*created));
    }

    std::optional<TileAssembler::Joined> joined;
    std::map<std::uint64_t, Result<Picture>> alone;  // by state
    const auto end = std::chrono::steady_clock::now() + std::chrono::minutes(4);
    int frames = 0;
    for (; frames < 10 || (!joined && std::chrono::steady_clock::now() < end); ++frames) {
        ASSERT_TRUE(
            scene.set(transform, x3d::Transform::translation, Vec3f(.1f * static_cast<float>(frames % 10), 0, 0)));
        const auto set = scene.newFrame(1 + .1 * frames);
        RecordStep step;
        step.set = set;
        for (const auto& mirror : mirrors) mirror->step(scene, step);
        if (!joined) alone.emplace(scene.sequence(), pictureOf(scene, options, Resources()));
        if (auto whole = assembler.poll(std::chrono::milliseconds(100)); whole && !joined) joined = std::move(whole);
    }
    ASSERT_TRUE(joined) << frames << " frames; " << notices.said();
    EXPECT_EQ(assembler.counts().maxMirrors, 2u);
    EXPECT_EQ(assembler.takeProblems(), std::vector<std::string>());
    const auto same = alone.find(joined->sequence);
    ASSERT_NE(same, alone.end()) << joined->sequence;
    ASSERT_TRUE(same->second);
    const std::vector<std::uint8_t> expected = toSrgb8(*same->second, options.toneMap);
    EXPECT_TRUE(std::ranges::equal(expected, joined->pixels,
                                   [](std::uint8_t a, char b) { return a == static_cast<std::uint8_t>(b); }));
    for (const auto& mirror : mirrors) EXPECT_TRUE(mirror->finish());
}

TEST(TileAssembler, NobodyThereIsAnError) {
    OutputOptions options;
    options.tiles = "tcp://127.0.0.1:1";
    EXPECT_FALSE(followOutputs(Scene(), options, Resources()));
}

}  // namespace
}  // namespace rtsg
