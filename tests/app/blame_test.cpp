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
    const Outcome created = rtsg({"record", file, "-o", log, "--for", "1s", "--fps", "20", "--set",
                                  "BOX.scale=2 1 1@0.2", "--set", "BOX.scale=9 9 9@0.6"});
    ASSERT_EQ(created.status, 0) << created.err;
    const Outcome reported = rtsg({"replay", log, "--blame", "BOX.scale"});
    EXPECT_EQ(reported.status, 0) << reported.err;
    EXPECT_THAT(reported.out, ContainsRegex(" 0\\.2  2 1 1 +set from outside\n"));
    EXPECT_THAT(reported.out, ContainsRegex(" 0\\.6  9 9 9 +set from outside\n"));
    EXPECT_THAT(reported.out, Not(HasSubstr("changes)")));
    // Changes that routes cause share one line.
    const Outcome driven = rtsg({"replay", log, "--blame", "BOX.translation"});
    EXPECT_THAT(driven.out, HasSubstr("changes)"));
}

/// Those without a name have a number, as pages and reports write it; and names may hold a slash.
TEST_F(BlameOption, NodesWithoutANameHaveTheirNumber) {
    const std::string named = folder / "slash.x3dv", log = folder / "c.rlog";
    writeFile(named, "#X3D V4.0 utf8\nPROFILE Full\nDEF A/B Transform { }\n");
    ASSERT_EQ(rtsg({"record", named, "-o", log, "--for", "0.2s", "--set", "A/B.scale=2 1 1@0.1"}).status, 0);
    const Outcome reported = rtsg({"replay", log, "--blame", "A/B.scale"});
    EXPECT_EQ(reported.status, 0) << reported.err;
    EXPECT_THAT(reported.out, HasSubstr("set from outside"));
    int found = 0;
    for (int number = 1; number < 8; ++number) {
        const Outcome numbered = rtsg({"replay", log, "--blame", "#" + std::to_string(number) + ".scale"});
        found += numbered.status == 0;
        EXPECT_TRUE(numbered.status != 0 || numbered.out.contains("set from outside")) << numbered.out;
    }
    EXPECT_EQ(found, 1);
    EXPECT_THAT(rtsg({"replay", log, "--blame", "#4000.scale"}).err, HasSubstr("no node is named #4000"));
}

/// A ROUTE sets the instance's field, and an IS sends it back from inside: the chain of causes leads out without a
/// loop.
TEST_F(BlameOption, LeadsOutOfAPrototypeToWhatSetIt) {
    const std::string lamp = folder / "lamp.x3dv", log = folder / "b.rlog";
    writeFile(
        lamp,
        "#X3D V4.0 utf8\nPROFILE Full\nPROTO Lamp [ inputOutput SFBool on FALSE ] { DEF L PointLight { on IS on } }\n"
        "DEF LAMP Lamp { }\nDEF PRESSED BooleanFilter { }\nDEF SWITCH BooleanToggle { }\n"
        "ROUTE PRESSED.inputTrue TO SWITCH.set_boolean\nROUTE SWITCH.toggle TO LAMP.on\n");
    const Outcome created =
        rtsg({"record", lamp, "-o", log, "--for", "1s", "--fps", "20", "--set", "PRESSED.set_boolean=TRUE@0.5"});
    ASSERT_EQ(created.status, 0) << created.err;
    const Outcome reported = rtsg({"replay", log, "--blame", "LAMP.on"});
    EXPECT_EQ(reported.status, 0) << reported.err;
    EXPECT_THAT(reported.out, HasSubstr("SWITCH.toggle > LAMP.on"));
    EXPECT_THAT(reported.out, HasSubstr("set from outside"));
    EXPECT_THAT(reported.out, Not(HasSubstr("LAMP.on > L.on")));
}

}  // namespace
}  // namespace rtsg::test
