// Logs in every coding: each state verified, seeking, and damage, which costs no more than in a raw log.
#include <rtsg/core/x3d.h>
#include <rtsg/sync/lossy_scene.h>

#include "bench/motion_sync.h"
#include "support/log_support.h"

namespace rtsg {
namespace {

class LogCoding : public test::LogFolder, public testing::WithParamInterface<Coding> {
  protected:
    static LogOptions options() {
        LogOptions result = test::denseKeyframes();
        result.keyframeBytes = 3000;
        result.mode.coding = GetParam();
        return result;
    }
};
INSTANTIATE_TEST_SUITE_P(Codings, LogCoding, testing::Values(Coding::raw, Coding::compact, Coding::smallest),
                         [](const auto& p) { return std::string(nameOf(p.param)); });

class LogCodingSizes : public test::LogFolder {};

TEST_P(LogCoding, ReplaysAndSeeksEveryState) {
    for (std::uint64_t seed = 1; seed <= 4; ++seed) {
        SCOPED_TRACE(testing::Message() << "seed " << seed);
        const Recorded recorded = record(file(), 120, seed, options());
        const Replayed replayed = replay(file(), recorded);
        EXPECT_EQ(replayed.states.size(), recorded.dumps.size());
        auto replayer = Replayer::open(file());
        ASSERT_TRUE(replayer);
        std::mt19937_64 random(seed);
        for (int i = 0; i < 30; ++i) {
            const auto& [state, time] =
                *std::next(recorded.times.begin(), std::ptrdiff_t(random() % recorded.times.size()));
            ASSERT_TRUE((*replayer)->seek(time));
            EXPECT_TRUE((*replayer)->scene().dump() == recorded.dumps.at(state)) << "state " << state;
            if (random() % 2) {
                ASSERT_TRUE((*replayer)->step());
                const std::uint64_t now = (*replayer)->scene().sequence();
                EXPECT_TRUE((*replayer)->scene().dump() == recorded.dumps.at(now)) << "state " << now;
            }
        }
    }
}

TEST_P(LogCoding, DamageCostsTheFramesUpToTheNextKeyframe) {
    const std::uint64_t seed = 3;
    const Recorded recorded = record(file(), 60, seed, options());
    const std::string bytes = test::readAll(file());
    const auto records = recordsOf(file());
    std::mt19937_64 random(seed);
    for (int i = 0; i < 40; ++i) {
        std::string bent = bytes;
        const std::size_t at = 200 + random() % (bytes.size() / 2);  // keyframes follow
        bent[at] = static_cast<char>(bent[at] ^ (1 << random() % 8));
        test::writeAll(file("bent.rlog"), bent);
        const Replayed replayed = replay(file("bent.rlog"), recorded);  // compares the dump of every state it reaches
        ASSERT_TRUE(replayed.opened) << at;
        EXPECT_EQ(replayed.damage, 1u) << at;
        EXPECT_GT(replayed.states.size(), recorded.dumps.size() / 3) << at;
        EXPECT_EQ(replayed.states.back(), recorded.last) << at;
    }
}

TEST_F(LogCodingSizes, CodingsTakeFewerBytesAndLossyFewerStill) {
    std::map<std::string, std::uint64_t> bytes;
    for (const bool lossyMode : {false, true})
        for (const Coding coding : {Coding::raw, Coding::compact, Coding::smallest}) {
            Scene origin;
            std::vector<NodeId> nodes;
            for (int i = 0; i < 100; ++i) {
                nodes.push_back(origin.createNode(x3d::Transform::type));
                ASSERT_TRUE(origin.setName(nodes.back(), "B" + std::to_string(i)));
            }
            auto lossy = LossyScene::follow(origin, 1e-3);
            ASSERT_TRUE(lossy);
            LogOptions logOptions;
            logOptions.mode = {lossyMode ? Mode::lossy : Mode::state, coding, lossyMode ? 1e-3 : 0};
            auto log = LogWriter::create(file(), builtinTypes(), logOptions);
            ASSERT_TRUE(log);
            Attachment attachment = (lossyMode ? (*lossy)->scene() : origin).bus().attach(**log);
            bench::Motion motion(bench::Movement::chaotic, 100);
            for (int frame = 0; frame < 100; ++frame) {
                for (const Change& change : motion.next().changes)
                    ASSERT_TRUE(origin.setField(nodes[(change.node.value - bench::Motion::kFirstNode) / 3],
                                                change.field, change.value));
                origin.newFrame(frame / 60.);
            }
            ASSERT_TRUE((*log)->close());
            bytes[std::string(nameOf(coding)) + (lossyMode ? " lossy" : "")] = (*log)->bytes();
            auto replayer = Replayer::open(file());
            ASSERT_TRUE(replayer);
            while (*(*replayer)->step()) {
            }
            EXPECT_EQ((*replayer)->verified(), (*replayer)->frames());
            EXPECT_GT((*replayer)->frames(), 100u);
        }
    EXPECT_LT(bytes["compact"], bytes["raw"] / 2);
    EXPECT_LT(bytes["smallest"], bytes["compact"]);
    EXPECT_LT(bytes["compact lossy"], bytes["compact"] * 2 / 3);
    EXPECT_LT(bytes["smallest lossy"], bytes["smallest"] * 2 / 3);
}

}  // namespace
}  // namespace rtsg
