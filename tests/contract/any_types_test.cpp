// Nodes of every type, with any values, under edits: all subscribers at once go on, and what they make is numbers.
#include <cmath>

#include <gtest/gtest.h>

#include <rtsg/audio/sound_renderer.h>
#include <rtsg/core/replica.h>
#include <rtsg/renderers/image.h>
#include <rtsg/renderers/light_renderer.h>

#include "support/any_types.h"
#include "support/long_form.h"

namespace rtsg {
namespace {

class EveryType : public testing::TestWithParam<std::uint64_t> {};
INSTANTIATE_TEST_SUITE_P(Seeds, EveryType, testing::Range<std::uint64_t>(1, test::fewOrMany(17, 2000)));

TEST_P(EveryType, IsSeenAndHeardWhateverItsFieldsHold) {
    const std::uint64_t seed = GetParam();
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    Scene scene;
    test::AnyTypes edits(scene, seed, seed % 3 == 0 ? .3 : .05);
    // Without one a picture frames all there is, and text in points is as large as the frame makes it: a circle.
    const NodeId eye = scene.createNode(x3d::Viewpoint::type);
    ASSERT_TRUE(scene.insertChild(scene.root(), x3d::RtsgScene::children, eye));
    for (int i = 0; i < 4; ++i) edits.grow();
    SharedWorld world(scene);
    LightRenderer light(world);
    ListenOptions listening;
    listening.metrics = false;
    listening.render.trace = AcousticOptions::heardTraceOf(20);
    SoundRenderer sound(world, listening);
    ASSERT_EQ(sound.failure(), "");
    ImageOptions picture;
    picture.settings.width = 12, picture.settings.height = 8;
    picture.settings.samplesPerPixel = 1;
    for (int frame = 1; frame <= 12; ++frame) {
        scene.newFrame(.02 * frame);
        if (frame == 12) picture.settings.integrator = Integrator::path;
        const auto drawn = light.picture(picture);
        ASSERT_TRUE(drawn) << drawn.error().format();
        for (const Vec4f& pixel : drawn->pixels)
            for (int c = 0; c < 4; ++c) ASSERT_TRUE(std::isfinite(pixel[c])) << "frame " << frame;
        const auto heard = sound.renderFrame();
        ASSERT_TRUE(heard) << heard.error().format();
        for (int i = 0; i < 6; ++i) edits.edit();
        if (edits.size() < 40) edits.grow();
    }
    scene.newFrame(.3);
    picture.settings.integrator = Integrator::whitted;
    picture.settings.width = 48, picture.settings.height = 32;
    const auto followed = light.picture(picture);
    ASSERT_TRUE(followed) << followed.error().format();
    SharedWorld freshWorld(scene);
    LightRenderer fresh(freshWorld);
    const auto scratch = fresh.picture(picture);
    ASSERT_TRUE(scratch) << scratch.error().format();
    int different = 0;
    for (std::size_t i = 0; i < followed->pixels.size(); ++i)
        different += glm::any(glm::greaterThan(glm::abs(followed->pixels[i] - scratch->pixels[i]),
                                               1e-3f * glm::max(Vec4f(1), glm::abs(scratch->pixels[i]))));
    EXPECT_LE(different, 20);
}

}  // namespace
}  // namespace rtsg
