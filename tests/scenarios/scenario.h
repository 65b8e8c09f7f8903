// Scenario files: scenes, events and expectations as text. The format is described in README.md here.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace rtsg::test {

struct Statement {
    int line = 0;
    std::string verb;  // "expect" for an expected event
    std::string text;
};

struct Scenario {
    std::filesystem::path path;
    std::string clause;  // the first line, without its #
    std::vector<Statement> statements;
    std::string error;  // why it could not be read
};

Scenario readScenario(const std::filesystem::path& path);

enum class Mode { direct, replayed, mirrored, late, input };

/// Runs it; empty if everything came as expected, else one line a disappointment, with the file's line.
std::string runScenario(const Scenario& scenario, Mode mode);

}  // namespace rtsg::test
