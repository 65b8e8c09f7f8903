// Pictures for somebody who looks on: coarse in motion, whole at rest, then better, and none where nothing changes.
#include <chrono>
#include <cmath>
#include <mutex>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/ogre/ogre_renderer.h>
#include <rtsg/renderers/light_renderer.h>
#include <rtsg/window/live_picture.h>

#include "ogre/display.h"

namespace rtsg {
namespace {

using namespace std::chrono_literals;

constexpr int kWidth = 160, kHeight = 90;

struct Seen {
    Scene scene;
    std::unique_ptr<SharedWorld> world;
    std::unique_ptr<LivePicture> pictures;
    LivePicture* there = nullptr;  // also while it goes
    NodeId box;
    double time = 0;
    std::mutex mutex;
    std::vector<std::shared_ptr<const LivePictureShown>> all;  // every picture, in order
    std::size_t looked = 0;

    ~Seen() { pictures.reset(); }  // before what its thread writes to
    explicit Seen(double budget = 1 / 30.0, int maxSamples = 8, Integrator integrator = Integrator::whitted) {
        Diagnostics diagnostics;
        EXPECT_TRUE(loadText(scene,
                             "#X3D V4.0 utf8\nPROFILE Immersive\nViewpoint { position 0 0 6 }\n"
                             "DEF B Transform { children Shape { appearance Appearance { material Material { "
                             "diffuseColor 1 .5 .2 } } geometry Sphere { } } }\nDEF FREE WorldInfo { }\n",
                             diagnostics));
        box = scene.findName("B");
        scene.newFrame(time);
        world = std::make_unique<SharedWorld>(scene);
        LivePictureOptions options;
        options.settings.width = kWidth, options.settings.height = kHeight;
        options.settings.samplesPerPixel = 4;
        options.settings.threads = 1;
        options.settings.integrator = integrator;
        options.budget = budget;
        options.maxSamples = maxSamples;
        options.restsAfter = .02;
        options.wake = [this] {
            const std::scoped_lock lock(mutex);
            if (auto shown = there->take()) all.push_back(std::move(shown));
        };
        pictures = std::make_unique<LivePicture>(*world, options);
        there = pictures.get();
        EXPECT_TRUE(pictures->show());
    }
    void move() {
        EXPECT_TRUE(scene.set(box, x3d::Transform::translation, Vec3f(float(time + 1) / 50, 0, 0)));
        scene.newFrame(time += 1);
        EXPECT_TRUE(pictures->show());
    }
    /// The next picture that is as asked for.
    template <class Wanted>
    std::shared_ptr<const LivePictureShown> next(const Wanted& wanted) {
        const auto end = std::chrono::steady_clock::now() + 60s;
        while (std::chrono::steady_clock::now() < end) {
            {
                const std::scoped_lock lock(mutex);
                while (looked < all.size())
                    if (const auto& shown = all[looked++]; wanted(*shown)) return shown;
            }
            std::this_thread::sleep_for(1ms);
        }
        ADD_FAILURE() << "no such picture came";
        return std::make_shared<LivePictureShown>();
    }
    Picture rendered(int samples) {
        LightRenderer renderer(*world);
        ImageOptions options;
        options.settings.width = kWidth, options.settings.height = kHeight;
        options.settings.samplesPerPixel = samples;
        return *renderer.picture(options);
    }
};

std::vector<std::uint8_t> bytesOf(const Picture& picture) {
    std::vector<std::uint8_t> bytes = toSrgb8(picture);
    for (std::size_t i = 0; i < bytes.size(); i += 4) std::swap(bytes[i], bytes[i + 2]), bytes[i + 3] = 255;
    return bytes;
}

TEST(LivePictures, AtRestThePictureIsWholeThenBetterAndThenNoneIsMade) {
    Seen seen;
    const auto whole = seen.next([](const auto& shown) { return shown.whole; });
    EXPECT_EQ(whole->width, kWidth);
    EXPECT_EQ(whole->height, kHeight);
    EXPECT_EQ(whole->samples, 1);
    EXPECT_EQ(whole->pixels, bytesOf(seen.rendered(1))) << "the picture that render makes";
    const auto four = seen.next([](const auto& shown) { return shown.samples == 4; });
    EXPECT_EQ(four->pixels, bytesOf(seen.rendered(4)));
    (void)seen.next([](const auto& shown) { return shown.samples == 8; });
    const auto end = std::chrono::steady_clock::now() + 60s;
    while (!seen.pictures->isDone() && std::chrono::steady_clock::now() < end) std::this_thread::sleep_for(1ms);
    EXPECT_TRUE(seen.pictures->isDone());
    // Frames that change nothing that is seen change nothing.
    const std::uint64_t rendered = seen.pictures->statistics().whole;
    seen.scene.newFrame(seen.time += 1);
    EXPECT_TRUE(seen.pictures->show());
    std::this_thread::sleep_for(100ms);
    EXPECT_EQ(seen.pictures->statistics().whole + seen.pictures->statistics().moving,
              rendered + seen.pictures->statistics().moving);
}

TEST(LivePictures, InMotionAPictureHasAsManyPixelsAsTheBudgetAllows) {
    Seen seen(1e-6);  // for no pixel at all
    (void)seen.next([](const auto&) { return true; });
    seen.move();
    const std::uint64_t state = seen.scene.sequence();
    const auto coarse = seen.next([&](const auto& shown) { return shown.sequence == state; });
    EXPECT_FALSE(coarse->whole);
    EXPECT_LE(coarse->width, kWidth / 2) << "as coarse as pictures get, in steps of 16 pixels";
    EXPECT_NEAR(static_cast<double>(coarse->width) / coarse->height, 16. / 9, .15);
    const auto whole = seen.next([](const auto& shown) { return shown.whole; });
    EXPECT_EQ(whole->sequence, state);

    Seen rich(10);  // for every pixel
    (void)rich.next([](const auto& shown) { return shown.whole; });
    rich.move();
    EXPECT_TRUE(rich.next([&](const auto& shown) { return shown.sequence == rich.scene.sequence(); })->whole);
}

TEST(LivePictures, AChangeEndsWhatIsBeingMadeAtRest) {
    Seen seen(1 / 30.0, 1 << 20);
    (void)seen.next([](const auto& shown) { return shown.samples >= 4; });
    for (int i = 0; i < 20; ++i) {
        seen.move();
        const std::uint64_t state = seen.scene.sequence();
        (void)seen.next([&](const auto& shown) { return shown.sequence == state; });
        std::this_thread::sleep_for(40ms);  // what is at rest by then is under way
    }
    const auto better = seen.next([&](const auto& shown) { return shown.samples >= 8; });
    EXPECT_EQ(better->sequence, seen.scene.sequence()) << "no sample of an earlier state is in it";
}

TEST(LivePictures, AnotherSizeIsAnotherPicture) {
    Seen seen;
    (void)seen.next([](const auto& shown) { return shown.whole; });
    seen.pictures->setSize(64, 64);
    const auto square = seen.next([](const auto& shown) { return shown.whole && shown.width == 64; });
    EXPECT_EQ(square->height, 64);
    EXPECT_EQ(square->pixels.size(), 4u * 64 * 64);
}

TEST(LivePictures, AnEyeOfOnesOwnIsLookedThrough) {
    Seen seen;
    (void)seen.next([](const auto& shown) { return shown.whole; });
    const Camera away = Camera::perspective(WorldFromLocal(1), {0, 0, 6}, Rotation{0, 1, 0, 3.1415926f}, .8, 16. / 9);
    ASSERT_TRUE(seen.pictures->show(away));
    (void)seen.next([](const auto& shown) {
        bool isBlack = shown.whole;
        for (std::size_t i = 0; i < shown.pixels.size(); ++i) isBlack = isBlack && (i % 4 == 3 || shown.pixels[i] == 0);
        return isBlack;
    });
    RenderSettings settings;
    settings.width = 32, settings.height = 18;
    const auto same = seen.pictures->picture(settings);
    ASSERT_TRUE(same);
    EXPECT_EQ(same->at(16, 9).x, 0);
    ASSERT_TRUE(seen.pictures->show());
    const std::size_t middle = 4 * (kWidth * kHeight / 2 + kWidth / 2) + 2;
    (void)seen.next([&](const auto& shown) { return shown.whole && shown.pixels[middle] > 100; });
}

/// The sphere moves in a corner before a wall of boxes.
struct Corner : Seen {
    explicit Corner(double budget) : Seen(budget) {
        Diagnostics diagnostics;
        EXPECT_TRUE(loadText(scene,
                             "#X3D V4.0 utf8\nPROFILE Immersive\nViewpoint { position 0 0 9 }\n"
                             "DEF B Transform { translation -3 1 0 children Shape { appearance Appearance { material "
                             "Material { } } geometry Sphere { radius .3 } } }\n"
                             "Transform { translation 3 0 0 children Shape { appearance Appearance { material "
                             "Material { diffuseColor 1 .5 .2 } } geometry Box { } } }\n",
                             diagnostics));
        box = scene.findName("B");
        scene.newFrame(time += 1);
        EXPECT_TRUE(pictures->show());
    }
    void step(int i) {
        EXPECT_TRUE(scene.set(box, x3d::Transform::translation, Vec3f(-3, 1 + float(i) / 50, 0)));
        scene.newFrame(time += 1);
        EXPECT_TRUE(pictures->show());
    }
};

TEST(LivePictures, WhileTheEyeRestsPixelsThatNoChangeTouchesAreTakenOver) {
    Corner seen(10);
    (void)seen.next([&](const auto& shown) { return shown.sequence == seen.scene.sequence() && shown.whole; });
    for (int i = 1; i < 6; ++i) {
        seen.step(i);
        const auto moved = seen.next([&](const auto& shown) { return shown.sequence == seen.scene.sequence(); });
        EXPECT_TRUE(moved->whole);
        EXPECT_GT(moved->kept, .3);
        EXPECT_LT(moved->kept, 1);
        EXPECT_EQ(moved->pixels, bytesOf(seen.rendered(1))) << "as if all had been made anew";
    }
}

// A trial that takes too long costs no picture.
TEST(LivePictures, WithoutTimeForAllPixelsThereAreFewerOfThem) {
    Corner seen(1e-6);
    for (int i = 1; i < 6; ++i) {
        (void)seen.next([](const auto& shown) { return shown.whole && shown.samples == 8; });
        seen.step(i);
        const auto moved = seen.next([&](const auto& shown) { return shown.sequence == seen.scene.sequence(); });
        EXPECT_FALSE(moved->whole);
    }
}

// A viewer who begins to move need not wait for a picture of the old place: the next one is of the new place.
TEST(LivePictures, AnEyeThatBeginsToMoveIsShownAtOnce) {
    Seen seen(10);
    const auto from = [](float z) {
        return Camera::perspective(WorldFromLocal(1), {0, 0, z}, Rotation{0, 1, 0, 0}, .8, 16. / 9);
    };
    for (int round = 0; round < 5; ++round) {
        ASSERT_TRUE(seen.pictures->show(from(6)));
        (void)seen.next([&](const auto& shown) { return shown.whole && shown.camera.position.z == 6; });
        seen.scene.newFrame(seen.time += 1);
        ASSERT_TRUE(seen.pictures->show(from(6)));
        for (int i = 1; i < 4; ++i) {
            const float z = 6 + float(i) / 8;
            ASSERT_TRUE(seen.scene.set(seen.box, x3d::Transform::translation, Vec3f(z / 9, float(round) / 9, 0)));
            seen.scene.newFrame(seen.time += 1);
            ASSERT_TRUE(seen.pictures->show(from(z)));
            const auto moved = seen.next([&](const auto& shown) { return shown.camera.position.z == z; });
            EXPECT_EQ(moved->sequence, seen.scene.sequence());
        }
    }
}

// The light of a sphere under a sky is even: from two samples on it is denoised, and that is nearer to the truth.
TEST(LivePictures, ByPathTheyAreDenoisedAtRestWhileThatIsBetter) {
    Seen seen(1 / 30.0, 64, Integrator::path);
    Diagnostics diagnostics;
    ASSERT_TRUE(
        loadText(seen.scene,
                 "#X3D V4.0 utf8\nPROFILE Immersive\nBackground { skyColor [ 1 1 1, .1 .1 .1 ] skyAngle 1.2 }\n"
                 "Transform { translation 0 -1.1 0 children Shape { appearance Appearance { material Material { } } "
                 "geometry Box { size 20 .2 20 } } }\n",
                 diagnostics));
    seen.scene.newFrame(seen.time += 1);
    ASSERT_TRUE(seen.pictures->show());
    const std::uint64_t state = seen.scene.sequence();
    const auto at = [&](int samples) {
        return seen.next(
            [&](const auto& shown) { return shown.sequence == state && shown.whole && shown.samples == samples; });
    };
    const auto one = at(1), two = at(2), last = at(66);
    EXPECT_EQ(one->denoised, 0);
    EXPECT_GT(two->denoised, .2);
    RenderSettings settings;
    settings.integrator = Integrator::path, settings.width = kWidth, settings.height = kHeight;
    settings.samplesPerPixel = 256;
    const auto rendered = seen.pictures->picture(settings);
    ASSERT_TRUE(rendered);
    const std::vector<std::uint8_t> truth = bytesOf(*rendered);
    const auto error = [&](const LivePictureShown& shown) {
        double sum = 0;
        for (std::size_t i = 0; i < truth.size(); ++i) sum += std::pow(double(shown.pixels[i]) - double(truth[i]), 2);
        return sum;
    };
    EXPECT_LT(error(*two), .4 * error(*one)) << "half would be no more than a second sample does";
    EXPECT_LT(error(*last), .5 * error(*two));
}

/// Pictures by OGRE, as rtsg::OgreRenderer makes them by itself.
struct Rastered : Seen {
    Rastered() : Seen(1 / 30.0, 8, Integrator::raster) {}
    Picture drawn(int samples) {
        OgreRenderer renderer(*world);
        ImageOptions options;
        options.settings.width = kWidth, options.settings.height = kHeight;
        options.settings.samplesPerPixel = samples;
        return *renderer.nextPicture(options);
    }
};

class RasteredPictures : public testing::Test {
  protected:
    void SetUp() override {
        if (!test::haveDisplay()) GTEST_SKIP() << "there is no display, and no Xvfb";
        Scene scene;
        SharedWorld world(scene);
        OgreRenderer renderer(world);
        if (auto ok = renderer.open(); !ok) GTEST_SKIP() << ok.error().format();
    }
};

TEST_F(RasteredPictures, AreWholeAtRestThenBetterAndFollowWhatChanges) {
    Rastered seen;
    const auto whole = seen.next([](const auto& shown) { return shown.whole; });
    EXPECT_EQ(whole->pixels, bytesOf(seen.drawn(1))) << "the picture that render makes";
    const auto four = seen.next([](const auto& shown) { return shown.samples == 4; });
    EXPECT_EQ(four->pixels, bytesOf(seen.drawn(4)));
    (void)seen.next([](const auto& shown) { return shown.samples == 8; });
    for (int i = 0; i < 10; ++i) seen.move();
    const auto moved =
        seen.next([&](const auto& shown) { return shown.whole && shown.sequence == seen.scene.sequence(); });
    EXPECT_EQ(moved->pixels, bytesOf(seen.drawn(1)));
    EXPECT_NE(moved->pixels, whole->pixels);
    EXPECT_NE(seen.pictures->renderer().find("OGRE"), std::string::npos);
}

TEST_F(RasteredPictures, OneOfAnotherSizeIsMadeInBetween) {
    Rastered seen;
    RenderSettings settings;
    settings.integrator = Integrator::raster;
    settings.width = 64, settings.height = 64;
    for (int i = 0; i < 20; ++i) {
        seen.move();
        const auto rendered = seen.pictures->picture(settings);
        ASSERT_TRUE(rendered) << rendered.error().format();
        EXPECT_EQ(rendered->width, 64);
    }
    seen.pictures->setSize(64, 64);
    (void)seen.next([](const auto& shown) { return shown.whole && shown.width == 64 && shown.height == 64; });
    ASSERT_TRUE(seen.pictures->show(
        Camera::perspective(WorldFromLocal(1), {0, 0, 6}, Rotation{0, 1, 0, 3.1415926f}, .8, 16. / 9)));
    (void)seen.next([](const auto& shown) {
        bool isBlack = shown.whole;
        for (std::size_t i = 0; i < shown.pixels.size(); ++i) isBlack = isBlack && (i % 4 == 3 || shown.pixels[i] == 0);
        return isBlack;
    });
}

}  // namespace
}  // namespace rtsg
