// One test for each scenario file and way of running it.
#include <algorithm>
#include <cctype>

#include <gtest/gtest.h>

#include "scenario.h"
#include "test_paths.h"

namespace rtsg::test {
namespace {

constexpr const char* kFolder = RTSG_SOURCE_DIR "/tests/scenarios";

/// Their names. As paths, of which each of two thousand tests copies several, they made each start of the program 3 ms
/// longer; and it starts once for each test.
std::vector<std::string> scenarioNames() {
    std::vector<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(kFolder))
        if (entry.path().extension() == ".scenario") names.push_back(entry.path().stem().string());
    std::ranges::sort(names);
    return names;
}

class Scenarios : public testing::TestWithParam<std::tuple<std::string, Mode>> {};

TEST_P(Scenarios, ComesOutAsTheClauseSays) {
    const auto& [stem, mode] = GetParam();
    const Scenario scenario = readScenario(std::filesystem::path(kFolder) / (stem + ".scenario"));
    const std::string problems = runScenario(scenario, mode);
    EXPECT_EQ(problems, "") << scenario.clause;
}

std::string nameOf(const testing::TestParamInfo<Scenarios::ParamType>& param) {
    static const char* const modes[] = {"direct", "replayed", "mirrored", "late", "input"};
    std::string name = std::get<0>(param.param) + '_' + modes[static_cast<int>(std::get<1>(param.param))];
    for (char& c : name)
        if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
    return name;
}

INSTANTIATE_TEST_SUITE_P(Files, Scenarios,
                         testing::Combine(testing::ValuesIn(scenarioNames()),
                                          testing::Values(Mode::direct, Mode::replayed, Mode::mirrored, Mode::late,
                                                          Mode::input)),
                         nameOf);

TEST(ScenarioRunner, NoticesWhatIsWrong) {
    const auto run = [](std::vector<Statement> statements) {
        return runScenario({"own.scenario", "X3D", std::move(statements), {}}, Mode::direct);
    };
    const Statement scene{1, "scene", "DEF P ScalarInterpolator { key [ 0 1 ] keyValue [ 0 2 ] }"};
    const Statement send{2, "send", "P.set_fraction 0.5"}, line{3, "----", ""};
    EXPECT_EQ(run({scene, send, line, {4, "expect", "P.value_changed 1"}}), "");
    EXPECT_NE(run({scene, send, line, {4, "expect", "P.value_changed 1.1"}}), "");
    EXPECT_NE(run({scene, send, line, {4, "silent", ""}}), "");
    EXPECT_NE(run({scene, line, {4, "expect", "P.value_changed 1"}}), "");
    EXPECT_NE(run({scene, send, line, {4, "get", "P.value_changed 2"}}), "");
    EXPECT_NE(run({{1, "scene", "Group { bogus 1 }"}, line, {3, "silent", ""}}), "");
    EXPECT_NE(run({scene, line, {3, "diagnostic", "anything"}}), "");
    EXPECT_NE(run({scene, line, {3, "absent", "P"}}), "");
}

}  // namespace
}  // namespace rtsg::test
