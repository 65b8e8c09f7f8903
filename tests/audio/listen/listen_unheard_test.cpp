// The warning when nothing is heard: the reason, the node, and the line.
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "listen_scene.h"

namespace rtsg {
namespace {

class Unheard : public test::Listen {
  protected:
    /// All that is said, each with its line.
    std::vector<std::string> said(const std::string& body, std::function<void(Scene&, double)> change = {}) {
        Scene scene;
        load(scene, body);
        ListenOptions asked = options();
        asked.render.reflections = false;
        asked.runTo = [&](double t) {
            if (change) change(scene, t);
            scene.newFrame(t);
        };
        const auto report = listen(scene, asked);
        EXPECT_TRUE(report);
        std::vector<std::string> all;
        for (const Diagnostic& d : report->diagnostics.all())
            all.push_back((d.where.line > 0 ? std::to_string(d.where.line) + ": " : "") + d.text);
        return all;
    }
};

const std::string kAnyTone = "OscillatorSource { }";

TEST_F(Unheard, ASoundOutOfReachIsNamedWithItsLineAndHowFarItWas) {
    using testing::ElementsAre;
    const std::string view = "Viewpoint { position 0 0 0 }\n";
    EXPECT_THAT(
        said(view + "DEF Horn Sound { location 100 0 0 maxFront 20 source " + kAnyTone + " }"),
        ElementsAre("4: nothing is heard of Horn: the listener is out of its reach: maxFront 20, maxBack 10, 100 m "
                    "away at the nearest"));
    EXPECT_THAT(
        said(view + "DEF Bell SpatialSound { distanceModel \"LINEAR\" maxDistance 50 location 0 60 0 children " +
             kAnyTone + " }"),
        ElementsAre("4: nothing is heard of Bell: the listener is out of its reach: maxDistance 50, 60 m away at "
                    "the nearest"));
    // On its way: the nearest it was counts, and once it is heard there is nothing to tell.
    const auto coming = [&](float nearest) {
        return said(view + "DEF T Transform { children DEF Horn Sound { source " + kAnyTone + " } }",
                    [nearest](Scene& scene, double t) {
                        EXPECT_TRUE(scene.set(scene.findName("T"), x3d::Transform::translation,
                                              Vec3f(nearest + 400 * static_cast<float>(std::abs(t - .1)), 0, 0)));
                    });
    };
    EXPECT_THAT(coming(5), ElementsAre());
    const auto passing = coming(30);
    ASSERT_EQ(passing.size(), 1u);
    EXPECT_THAT(passing[0],
                testing::MatchesRegex("4: nothing is heard of Horn: .* 3[0-3][.0-9]* m away at the nearest"));
    // Another one is heard: authors give sounds a reach on purpose.
    EXPECT_THAT(said(view + "Sound { location 100 0 0 source " + kAnyTone + " } Sound { source " + kAnyTone + " }"),
                ElementsAre());
}

TEST_F(Unheard, WhatIsOffEmptyOrSilentIsTold) {
    using testing::ElementsAre;
    EXPECT_THAT(said("DEF A SpatialSound { enabled FALSE children " + kAnyTone +
                     " }\nDEF B SpatialSound { }\nDEF C "
                     "SpatialSound { gain 0 children " +
                     kAnyTone + " }\nDEF D AudioDestination { gain 0 children " + kAnyTone + " }"),
                ElementsAre("3: nothing is heard of A: it is not enabled",
                            "4: nothing is heard of B: nothing that sounds leads into it",
                            "5: nothing is heard of C: its intensity or its gain is 0",
                            "6: nothing is heard of D: its intensity or its gain is 0"));
    EXPECT_THAT(said("DEF A SpatialSound { children " + kAnyTone + " }\nListenerPointSource { gain 0 }"),
                ElementsAre("3: nothing is heard of A: the gain of the listener is 0"));
    // In reach, and it plays: but not now.
    const auto playedFrom = [&](double start) {
        return said("DEF A SpatialSound { children OscillatorSource { startTime " + std::to_string(start) + " } }");
    };
    EXPECT_THAT(playedFrom(1e4), ElementsAre("3: nothing is heard of A: what leads into it made no sound in that time "
                                             "(a clip plays once, from its startTime on)"));
    EXPECT_THAT(playedFrom(0), ElementsAre());
    std::string many;
    for (int i = 0; i < 11; ++i) many += "SpatialSound { }\n";
    const auto all = said(many);
    ASSERT_EQ(all.size(), 9u);
    EXPECT_EQ(all.back(), "nor is anything heard of 3 more sounds");
}

TEST_F(Unheard, ASceneHasNoSoundsOnlyIfThereAreNone) {
    using testing::ElementsAre;
    EXPECT_THAT(said("Shape { }"), ElementsAre("the scene has no sounds"));
    EXPECT_THAT(
        said("Switch { children [ DEF Horn Sound { source " + kAnyTone + " } Sound { } ] }"),
        ElementsAre("3: nothing is heard of Horn and the scene's 1 other sounds: it was never in what is shown (a "
                    "Switch or LOD may leave it out)"));
}

}  // namespace
}  // namespace rtsg
