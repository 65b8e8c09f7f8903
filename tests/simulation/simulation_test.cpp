// The simulator itself: the same seed is the same run, plans are read as they were written, and shrinking keeps what
// matters.
#include "session.h"

#include <algorithm>
#include <fstream>

#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>

#include "mirror.h"
#include "support/temp_folder.h"

namespace rtsg::simulation {
namespace {

class Simulation : public testing::Test {
  protected:
    Outcome run(const Plan& plan) const { return runSession(plan, folder_.path() / "log"); }
    test::TempFolder folder_;
};

TEST_F(Simulation, TheSameSeedIsTheSameRun) {
    for (std::uint64_t seed = 1000; seed < 1010; ++seed) {
        const Plan plan = drawPlan(seed);
        const Outcome first = run(plan), second = run(plan);
        EXPECT_EQ(first.failure, "") << "seed " << seed;
        EXPECT_EQ(first.digest, second.digest) << "seed " << seed;
        EXPECT_EQ(first.events, second.events) << "seed " << seed;
        EXPECT_GT(first.messages, 0u);
    }
    EXPECT_NE(run(drawPlan(1)).digest, run(drawPlan(2)).digest);
}

TEST_F(Simulation, APlanIsReadAsItWasWritten) {
    const auto file = folder_.path() / "a.plan";
    Plan plan = drawPlan(7);
    for (std::size_t kind = 0; kind < kFaultNames.size(); ++kind)
        plan.faults.push_back({plan.steps, static_cast<FaultKind>(kind), 3, static_cast<std::uint32_t>(kind)});
    std::ofstream(file) << "# why\n" << textOf(plan);
    const auto read = readPlan(file);
    ASSERT_TRUE(read) << read.error().format();
    EXPECT_EQ(*read, plan);
}

TEST_F(Simulation, AFileThatIsNoPlanIsRefusedAtItsLine) {
    const auto file = folder_.path() / "a.plan";
    for (const auto& [text, line] : {std::pair("seed x\n", 1), std::pair("seed 1\nsteps 2\n1 explode 1 1\n", 3),
                                     std::pair("seed 1\nsteps 9\n5 cut 1 1\n4 cut 1 1\n", 4),
                                     std::pair("steps 9 9\n", 1), std::pair("steps 9\n1 cut 1\n", 2)}) {
        std::ofstream(file) << text;
        const auto read = readPlan(file);
        ASSERT_FALSE(read) << text;
        EXPECT_EQ(read.error().where.line, static_cast<unsigned>(line)) << text;
    }
    EXPECT_FALSE(readPlan(folder_.path() / "none"));
}

TEST_F(Simulation, ShrinkingLeavesTheFaultsThatMatter) {
    Plan plan = drawPlan(3);
    plan.steps = 200;
    plan.faults.clear();
    for (std::uint32_t step = 1; step < 150; ++step) plan.faults.push_back({step, FaultKind::stall, step, 1});
    plan.faults[30].kind = FaultKind::killOrigin;
    plan.faults[90].kind = FaultKind::cut;
    int runs = 0;
    const Plan small = shrink(plan, [&](const Plan& candidate) {
        ++runs;
        const auto has = [&](FaultKind kind) {
            return std::ranges::any_of(candidate.faults, [&](const Fault& f) { return f.kind == kind; });
        };
        return has(FaultKind::killOrigin) && has(FaultKind::cut);
    });
    ASSERT_EQ(small.faults.size(), 2u);
    EXPECT_EQ(small.faults[0], plan.faults[30]);
    EXPECT_EQ(small.faults[1], plan.faults[90]);
    EXPECT_EQ(small.steps, 92u) << "nothing behind the last fault";
    EXPECT_LE(runs, 300);
}

TEST_F(Simulation, AnEditThatIsLostOrCarriedOutTwiceIsFound) {
    Scene scene;
    EditLedger ledger;
    ledger.ask("EDIT1_0");
    EXPECT_EQ(ledger.check(scene, 1), "") << "nobody has promised anything";
    ledger.answer("EDIT1_0", {.request = 1, .refusal = {}, .state = 5, .created = {}}, 1);
    EXPECT_EQ(ledger.check(scene, 1), "the edit EDIT1_0, acknowledged for state 5, is lost");
    EXPECT_EQ(ledger.check(scene, 2), "") << "another session";
    const auto carryOut = [&] {
        ASSERT_TRUE(scene.set(*scene.createNode("WorldInfo"), x3d::WorldInfo::title, String("EDIT1_0")));
    };
    carryOut();
    EXPECT_EQ(ledger.check(scene, 1), "");
    carryOut();
    EXPECT_EQ(ledger.check(scene, 1), "the edit EDIT1_0 was carried out 2 times");
    ledger.answer("EDIT1_0", {.request = 1, .refusal = "locked", .state = 5, .created = {}}, 1);
    EXPECT_NE(ledger.check(scene, 1), "");
}

}  // namespace
}  // namespace rtsg::simulation
