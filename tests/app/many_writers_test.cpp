// Several people write to a served scene by their mirrors: edits, undo and locks as a script asks for them.
#include <gmock/gmock.h>

#include "mirror_session.h"

namespace rtsg::test {
namespace {

using nlohmann::json;
using testing::AllOf;
using testing::HasSubstr;

class ManyWriters : public Mirror {
  protected:
    void SetUp() override {
        Mirror::SetUp();
        log = folder / "writers.rlog";
        serve({"--for", "60s", "--record", log, "--upstream", "edits"}, "ipc://" + folder / "writers");
    }
    /// A mirror by this name that asks for something and leaves.
    Outcome ask(const std::string& name, std::vector<std::string> what) {
        std::vector<std::string> arguments{"mirror", "--json", endpoint, "--name", name, "--for", "300ms"};
        arguments.insert(arguments.end(), what.begin(), what.end());
        return rtsg(arguments);
    }
    /// Values of the box's size and who gave them, when all is over.
    std::vector<std::pair<std::string, std::string>> sizes() {
        server->signal(SIGINT);
        EXPECT_NE(server->wait().status, -1);
        const json blame = json::parse(rtsg({"replay", log, "--blame", "BOX.scale", "--json"}).out);
        std::vector<std::pair<std::string, std::string>> result;
        for (const json& step : blame.at("steps")) result.emplace_back(step.at("author"), step.at("value"));
        return result;
    }
    std::string log;
};

using Sizes = std::vector<std::pair<std::string, std::string>>;

TEST_F(ManyWriters, AnEditIsTakenBackAndDoneAgainByItsAuthorAlone) {
    EXPECT_EQ(ask("Ann", {"--edit", "BOX.scale=2 2 2@0"}).status, 0);
    const Outcome nothing = ask("Bob", {"--undo", "0"});
    EXPECT_EQ(nothing.status, 1) << "Bob has done nothing";
    EXPECT_THAT(nothing.err, HasSubstr("refused"));
    const Outcome back = ask("Ann", {"--undo", "0", "--redo", "0.1", "--undo", "0.2"});
    EXPECT_EQ(back.status, 0) << back.err;
    EXPECT_EQ(json::parse(back.out).at("accepted"), 3);
    EXPECT_EQ(sizes(), (Sizes{{"", "1 1 1"}, {"Ann", "2 2 2"}, {"Ann", "1 1 1"}, {"Ann", "2 2 2"}, {"Ann", "1 1 1"}}));
}

TEST_F(ManyWriters, WhatAnotherHasChangedSinceIsLeftAndSaid) {
    EXPECT_EQ(ask("Ann", {"--edit", "BOX.scale=2 2 2@0"}).status, 0);
    EXPECT_EQ(ask("Bob", {"--edit", "BOX.scale=3 3 3@0"}).status, 0);
    const Outcome back = ask("Ann", {"--undo", "0"});
    EXPECT_EQ(back.status, 1);
    EXPECT_THAT(back.err, HasSubstr("--undo 0: refused: BOX.scale was changed since"));
    EXPECT_EQ(sizes(), (Sizes{{"", "1 1 1"}, {"Ann", "2 2 2"}, {"Bob", "3 3 3"}}));
}

TEST_F(ManyWriters, WhatIsLockedIsKeptFromOthersUntilItIsLetGo) {
    EXPECT_EQ(ask("Ann", {"--lock", "BOX,CLOCK=50s@0", "--edit", "BOX.scale=2 2 2@0"}).status, 0);
    for (const char* kind : {"--edit", "--set"}) {
        const Outcome kept = ask("Bob", {kind, "BOX.scale=3 3 3@0"});
        EXPECT_EQ(kept.status, 1);
        EXPECT_THAT(kept.err, HasSubstr(std::string(kind) + " BOX.scale=3 3 3@0: refused: "));
        EXPECT_THAT(kept.err, HasSubstr("Ann"));
    }
    EXPECT_EQ(ask("Bob", {"--edit", "CLOCK.cycleInterval=3@0"}).status, 1);
    EXPECT_EQ(ask("Ann", {"--lock", "BOX=0@0"}).status, 0);
    EXPECT_EQ(ask("Bob", {"--edit", "BOX.scale=4 4 4@0"}).status, 0);
    EXPECT_EQ(sizes(), (Sizes{{"", "1 1 1"}, {"Ann", "2 2 2"}, {"Bob", "4 4 4"}}));
}

TEST_F(ManyWriters, WhatCannotBeAskedIsSaidWithTheOption) {
    const auto wrong = [&](std::vector<std::string> what, const std::string& why) {
        const Outcome outcome = ask("Ann", what);
        EXPECT_EQ(outcome.status, 2) << what[1];
        EXPECT_THAT(outcome.err, HasSubstr(why)) << what[1];
        EXPECT_THAT(outcome.err, HasSubstr(what[0])) << what[1];
    };
    wrong({"--edit", "pointer=.5 .5@0"}, "events only");
    wrong({"--edit", "FLAG.set_boolean=TRUE@0"}, "events only");
    wrong({"--edit", "NOBODY.scale=1 1 1@0"}, "NOBODY");
    wrong({"--lock", "BOX,NOBODY=1s@0"}, "NOBODY");
    wrong({"--lock", "BOX=61s@0"}, "60 s at most");
    wrong({"--lock", "BOX@0"}, "expected");
    wrong({"--lock", "BOX=1s"}, "expected");
    const Outcome soon = ask("Ann", {"--undo", "soon"});
    EXPECT_EQ(soon.status, 2);
    EXPECT_THAT(soon.err, HasSubstr("soon: expected a duration"));
    std::string many = "BOX";
    for (int i = 0; i < 1024; ++i) many += ",BOX";
    const Outcome tooMany = ask("Ann", {"--lock", many + "=1s@0"});
    EXPECT_EQ(tooMany.status, 1);
    EXPECT_THAT(tooMany.err, AllOf(HasSubstr("1024"), HasSubstr("--lock")));
    const Outcome unsent = ask("Ann", {"--undo", "9"});
    EXPECT_EQ(unsent.status, 1);
    EXPECT_THAT(unsent.err, HasSubstr("not sent"));
}

}  // namespace
}  // namespace rtsg::test
