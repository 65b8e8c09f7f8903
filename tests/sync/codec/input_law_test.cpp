// The law of input mode: a scene that is given only what came in from outside has the origin's hash after every frame.
#include <gtest/gtest.h>

#include <rtsg/sync/replay.h>

#include "sync/input_support.h"

namespace rtsg {
namespace {

using namespace test;

class InputLaw : public testing::TestWithParam<std::uint64_t> {};

/// Follows by inputs; by the set itself where the input is not complete.
struct Again {
    Scene scene;
    std::uint64_t byInput = 0, byState = 0;
    explicit Again(bool withSteady = true) {
        if (withSteady) scene.registerBehaviour(x3d::Material::type, steady());
    }
    void take(const ChangeSet& set, const Scene* origin = nullptr) {
        if (testing::Test::HasFatalFailure()) return;  // the first one tells enough
        ASSERT_TRUE(set.input);
        if (set.input->complete) {
            ++byInput;
            const auto done = scene.runInput(*set.input, set.time);
            ASSERT_TRUE(done) << done.error().text;
            ASSERT_EQ((*done)->from, set.from);
            ASSERT_EQ((*done)->to, set.to);
        } else {
            ++byState;
            const auto done = scene.apply(std::make_shared<const ChangeSet>(set));
            ASSERT_TRUE(done) << done.error().text;
        }
        const auto where = origin && scene.hash() != set.hash ? firstDifference(scene, *origin) : std::nullopt;
        ASSERT_EQ(scene.hash(), set.hash)
            << "state " << set.to << (where ? ": " + where->node + "." + where->field + ' ' + where->text : "");
    }
    std::string complaints() {
        std::string all;
        for (const Diagnostic& one : scene.diagnostics().all())
            if (one.text.find("replayed") != std::string::npos) all += one.text + '\n';
        return all;
    }
};

TEST_P(InputLaw, SameHashEveryFrame) {
    SCOPED_TRACE("seed " + std::to_string(GetParam()));
    Scene origin;
    origin.setInputRecording(true);
    Again again(false);
    live(origin, GetParam(), 80, false, false, [&](const ChangeSet& set) { again.take(set, &origin); });
    EXPECT_EQ(again.scene.dump(), origin.dump());
    EXPECT_EQ(again.complaints(), "");
    EXPECT_GT(again.byInput, 40u);
    EXPECT_EQ(again.byState, 0u);
}

TEST_P(InputLaw, BehavioursOfTheirOwnWillArePlayedBack) {
    SCOPED_TRACE("seed " + std::to_string(GetParam()));
    Scene origin;
    origin.setInputRecording(true);
    Again again;
    live(origin, GetParam(), 80, true, false, [&](const ChangeSet& set) { again.take(set, &origin); });
    EXPECT_EQ(again.scene.dump(), origin.dump());
    EXPECT_EQ(again.complaints(), "");
    EXPECT_EQ(again.byState, 0u);
    EXPECT_GT(fate().calls, 10u);
}

TEST_P(InputLaw, EditsFromWithinTheCascadeFallBackToState) {
    SCOPED_TRACE("seed " + std::to_string(GetParam()));
    Scene origin;
    origin.setInputRecording(true);
    Again again;
    live(origin, GetParam(), 80, true, true, [&](const ChangeSet& set) { again.take(set, &origin); });
    EXPECT_EQ(again.scene.dump(), origin.dump());
    EXPECT_EQ(again.complaints(), "");
    EXPECT_LE(again.byState, fate().meddled);
    EXPECT_GT(again.byInput, 20u);
}

TEST_P(InputLaw, WhoJoinsLateRunsOnExactly) {
    SCOPED_TRACE("seed " + std::to_string(GetParam()));
    Scene origin;
    origin.setInputRecording(true);
    std::vector<std::unique_ptr<Again>> all;
    int count = 0;
    live(origin, GetParam(), 60, true, false, [&](const ChangeSet& set) {
        for (auto& one : all) one->take(set, &origin);
        if (++count % 7) return;
        all.push_back(std::make_unique<Again>());
        auto joined = all.back()->scene.apply(std::make_shared<const ChangeSet>(origin.snapshot()));
        ASSERT_TRUE(joined) << joined.error().text;
        EXPECT_EQ(all.back()->scene.runState().active, origin.runState().active);
        EXPECT_EQ(all.back()->scene.runState().sleepers, origin.runState().sleepers);
    });
    for (auto& one : all) {
        EXPECT_EQ(one->scene.dump(), origin.dump());
        EXPECT_EQ(one->complaints(), "");
    }
}

TEST_P(InputLaw, ARelayHandsOnWhatItGot) {
    SCOPED_TRACE("seed " + std::to_string(GetParam()));
    Scene origin;
    origin.setInputRecording(true);
    Again first, second;
    first.scene.setInputRecording(true);
    struct Handing : Subscriber {
        Again& to;
        explicit Handing(Again& target) : to(target) {}
        Result<> apply(const Scene&, const ChangeSet& set) override {
            if (set.to > 0) to.take(set);
            return {};
        }
    } handing(second);
    const Attachment attachment = first.scene.bus().attach(handing);
    live(origin, GetParam(), 60, true, true, [&](const ChangeSet& set) { first.take(set, &origin); });
    EXPECT_EQ(second.scene.dump(), origin.dump());
    EXPECT_EQ(second.complaints(), "");
}

INSTANTIATE_TEST_SUITE_P(Seeds, InputLaw, testing::Range<std::uint64_t>(1, 31));

}  // namespace
}  // namespace rtsg
