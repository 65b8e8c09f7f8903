// rtsg replay --blame: which changes are told one by one, and which together.
#include "program.h"

#include <gmock/gmock.h>

namespace rtsg::test {
namespace {

using testing::ContainsRegex;
using testing::HasSubstr;
using testing::Not;

using BlameOption = CommandLine;

TEST_F(BlameOption, ListsEachValueThatSomebodySet) {
    const std::string log = folder / "a.rlog";
    const Outcome made = rtsg({"record", file, "-o", log, "--for", "1s", "--fps", "20", "--set", "BOX.scale=2 1 1@0.2",
                               "--set", "BOX.scale=9 9 9@0.6"});
    ASSERT_EQ(made.status, 0) << made.err;
    const Outcome told = rtsg({"replay", log, "--blame", "BOX.scale"});
    EXPECT_EQ(told.status, 0) << told.err;
    EXPECT_THAT(told.out, ContainsRegex(" 0\\.2  2 1 1 +set from outside\n"));
    EXPECT_THAT(told.out, ContainsRegex(" 0\\.6  9 9 9 +set from outside\n"));
    EXPECT_THAT(told.out, Not(HasSubstr("changes)")));
    // What routes drive is one line.
    const Outcome driven = rtsg({"replay", log, "--blame", "BOX.translation"});
    EXPECT_THAT(driven.out, HasSubstr("changes)"));
}

}  // namespace
}  // namespace rtsg::test
