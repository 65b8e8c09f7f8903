// Reads a scenario's text.
#include <algorithm>
#include <fstream>

#include <fmt/format.h>

#include "scenario.h"

namespace rtsg::test {

Scenario readScenario(const std::filesystem::path& path) {
    Scenario scenario;
    scenario.path = path;
    std::ifstream in(path);
    if (!in) scenario.error = "cannot be read";
    static const char* const verbs[] = {"scene",   "file",    "watch",  "send",   "set",     "time",
                                        "route",   "add",     "remove", "create", "destroy", "unroute",
                                        "----",    "ordered", "get",    "silent", "absent",  "diagnostic",
                                        "pointer", "key",     "text",   "wheel",  "viewer",  "hear"};
    bool expecting = false;
    int number = 0;
    for (std::string line; std::getline(in, line);) {
        ++number;
        if (number == 1) {
            if (!line.starts_with("# X3D V")) scenario.error = "the first line must cite edition and clause";
            scenario.clause = line.substr(std::min<std::size_t>(2, line.size()));
            continue;
        }
        if (line.starts_with('#')) continue;
        if (line.find_first_not_of(" \t") == std::string::npos) continue;
        if (line[0] == ' ' || line[0] == '\t') {
            if (scenario.statements.empty()) {
                scenario.error = fmt::format("line {} continues nothing", number);
                break;
            }
            scenario.statements.back().text += '\n' + line;
            continue;
        }
        const std::size_t end = line.find_first_of(" \t");
        const std::string word = line.substr(0, end);
        const bool isVerb = std::ranges::find(verbs, word) != std::end(verbs);
        if (!isVerb && (!expecting || word.find('.') == std::string::npos)) {
            scenario.error = fmt::format("line {}: what is '{}'?", number, word);
            break;
        }
        if (isVerb)
            expecting = word == "----" || (expecting && (word == "ordered" || word == "get" || word == "viewer" ||
                                                         word == "silent" || word == "absent" || word == "diagnostic"));
        std::size_t rest = isVerb ? line.find_first_not_of(" \t", end) : 0;
        scenario.statements.push_back(
            {number, isVerb ? word : "expect", rest == std::string::npos ? std::string() : line.substr(rest)});
    }
    if (scenario.error.empty() && std::ranges::none_of(scenario.statements, [](const Statement& s) {
            return s.verb == "expect" || s.verb == "get" || s.verb == "viewer" || s.verb == "diagnostic" ||
                   s.verb == "silent";
        }))
        scenario.error = "expects nothing";
    return scenario;
}

}  // namespace rtsg::test
