// Images that are played each for itself: nothing is taken from the heap while they move, come and go.
#include <cmath>
#include <filesystem>
#include <functional>
#include <memory>
#include <vector>

#include <gtest/gtest.h>

#include "engine/image_player.h"
#include "support/counting_malloc.h"

namespace rtsg {
namespace {

constexpr std::size_t kImageBlock = 64, kImageFade = 5 * kImageBlock;
const std::filesystem::path kMeasuredHead = "/usr/share/libmysofa/default.sofa";

using Channels = ImpulseResponseOptions::Channels;

/// Some images, every other one coloured by walls.
ImagePlayer::Images someImages(std::size_t count) {
    std::vector<FollowedImage> images(count);
    Bands amplitudes{};
    for (std::size_t b = 0; b < kBandCount; ++b) amplitudes[b] = 1 / (1 + .1 * static_cast<double>(b));
    for (std::size_t k = 0; k < count; ++k) {
        images[k].offset = {3.0 * static_cast<double>(k), 1, -4};
        images[k].filtered = k % 2 == 1;
        if (images[k].filtered)
            images[k].filter = Convolver::prepare(kImageBlock, minimumPhase(amplitudes, 48000, kImageBlock));
    }
    return std::make_shared<const std::vector<FollowedImage>>(std::move(images));
}

/// A player whose source circles, block by block.
struct Circling {
    ImagePlayer player{kImageBlock, kImageFade};
    ImpulseResponseOptions response;
    std::vector<std::vector<float>> late, out, ears;
    int blocks = 0;

    Circling(Channels channels, std::size_t inputs, std::shared_ptr<const Hrtf> head) {
        response.channels = channels;
        response.ambisonicOrder = 3;
        response.hrtf = std::move(head);
        late.assign(inputs, std::vector<float>(kImageBlock));
        out.assign(channels == Channels::ambisonic ? 16 : 2, std::vector<float>(kImageBlock));
        if (response.hrtf) ears.assign(2, std::vector<float>(kImageBlock));
    }
    glm::dvec3 source(double samples) const {
        return {.5 * std::sin(samples / 1000), 0, -1 + .5 * std::cos(samples / 1000)};
    }
    void step() {
        const double start = static_cast<double>(blocks++ * kImageBlock), metres = 343.0 / 48000;
        for (auto* channels : {&out, &ears})
            for (std::vector<float>& channel : *channels) std::fill(channel.begin(), channel.end(), 0.0f);
        for (std::vector<float>& input : late)
            for (std::size_t i = 0; i < kImageBlock; ++i)
                input[i] = static_cast<float>(std::sin(.1 * (start + static_cast<double>(i))));
        const auto find = [&](const FollowedImage& image, int step, double& delay, double& slope) {
            const double at = start + (step + 1) * static_cast<double>(ImagePlayer::kStep);
            delay = glm::length(image.at(source(at))) / metres;
            slope = (glm::length(image.at(source(at + 1))) / metres - delay);
        };
        const auto from = [&](const FollowedImage& image, double) {
            return image.at(source(start + static_cast<double>(kImageBlock)));
        };
        player.render({late, std::cref(find), std::cref(from), response, false, out, ears});
    }
    double energy() const {
        double sum = 0;
        for (const auto* channels : {&out, &ears})
            for (const std::vector<float>& channel : *channels)
                for (const float sample : channel) sum += static_cast<double>(sample) * static_cast<double>(sample);
        return sum;
    }
};

TEST(ImagePlayer, TakesNothingFromTheHeapOnceItHasHeardItsLargestSets) {
    if (!RTSG_HEAP_IS_OURS) GTEST_SKIP() << "the sanitizer owns the heap";
    std::shared_ptr<const Hrtf> head;
    if (std::filesystem::exists(kMeasuredHead)) head = *Hrtf::load(kMeasuredHead, 48000);
    struct Case {
        const char* name;
        Channels channels;
        std::size_t inputs;
        std::shared_ptr<const Hrtf> head;
    };
    std::vector<Case> cases{{"stereo", Channels::stereo, 1, nullptr},
                            {"two inputs", Channels::stereo, 2, nullptr},
                            {"binaural", Channels::binaural, 1, nullptr},
                            {"ambisonic", Channels::ambisonic, 1, nullptr}};
    if (head) cases.push_back({"through a head", Channels::binaural, 1, head});
    for (const Case& one : cases) {
        Circling circling(one.channels, one.inputs, one.head);
        const std::vector<ImagePlayer::Images> sets{someImages(6), someImages(3), nullptr, someImages(5),
                                                    someImages(6)};
        const auto hearAll = [&] {
            for (const ImagePlayer::Images& set : sets) {
                circling.player.set(set);
                for (int i = 0; i < 12; ++i) circling.step();
            }
        };
        // Each of the player's two sets, and each of three responses of a filter, has been the largest by then.
        for (int i = 0; i < 6; ++i) hearAll();
        EXPECT_GT(circling.energy(), 1e-6) << one.name;
        EXPECT_EQ(test::allocationsOf(hearAll), 0u) << one.name;
        EXPECT_GT(circling.energy(), 1e-6) << one.name;
    }
}

/// The first set finds a source that sounds already, or one that begins with it.
TEST(ImagePlayer, FirstImagesOfWhatSoundsAlreadyFadeIn) {
    for (const int before : {0, 9}) {
        Circling circling(Channels::stereo, 1, nullptr);
        circling.response.speedOfSound = 343;
        for (int i = 0; i < before; ++i) circling.step();
        circling.player.set(someImages(3));
        std::vector<double> energies;
        for (int i = 0; i < 60; ++i) {
            circling.step();
            energies.push_back(circling.energy());
        }
        if (before > 0) {
            EXPECT_LT(energies[0], .01 * energies[4]) << "in a fifth of the fade";
        }
        EXPECT_GT(energies[10], 1e-6);
    }
}

/// A set that was played before is heard as if it were the first: nothing is left of what was heard by then.
TEST(ImagePlayer, WhatIsKeptOfASetIsNotHeardInTheNext) {
    std::shared_ptr<const Hrtf> head;
    if (std::filesystem::exists(kMeasuredHead)) head = *Hrtf::load(kMeasuredHead, 48000);
    for (const bool through : {false, true}) {
        if (through && !head) continue;
        const auto channels = through ? Channels::binaural : Channels::stereo;
        Circling once(channels, 1, through ? head : nullptr), again(channels, 1, through ? head : nullptr);
        const ImagePlayer::Images other = someImages(4), set = someImages(6);
        again.player.set(other);
        once.player.set(nullptr);
        const auto both = [&](int steps) {
            for (int i = 0; i < steps; ++i) {
                once.step();
                again.step();
            }
        };
        both(20);
        for (const ImagePlayer::Images& next : {ImagePlayer::Images(), set}) {
            once.player.set(next);
            again.player.set(next);
            both(12);
        }
        const auto& a = through ? once.ears : once.out;
        const auto& b = through ? again.ears : again.out;
        EXPECT_EQ(a, b);
        EXPECT_GT(once.energy(), 1e-6);
    }
}

}  // namespace
}  // namespace rtsg
