// Reads the parser's tables, and guesses the meaning of a mistyped word.
#include "command_table.h"

#include <algorithm>
#include <numeric>
#include <regex>

#include <CLI/CLI.hpp>

#include "hints.h"

namespace rtsg::app {

namespace {

/// Finds the choices: "TEXT:{a,b}" gives a and b.
std::vector<std::string> choicesOf(const std::string& type) {
    std::vector<std::string> choices;
    const auto open = type.find('{'), close = type.find('}');
    if (open == std::string::npos || close == std::string::npos) return choices;
    std::string word;
    for (const char c : type.substr(open + 1, close - open - 1) + ",") {
        if (c != ',') {
            word += c;
            continue;
        }
        if (!word.empty()) choices.push_back(word);
        word.clear();
    }
    return choices;
}

/// Number of letters to insert, remove, replace or swap with their neighbour.
std::size_t editDistance(const std::string& a, const std::string& b) {
    std::vector<std::vector<std::size_t>> d(a.size() + 1, std::vector<std::size_t>(b.size() + 1));
    for (std::size_t i = 0; i <= a.size(); ++i) d[i][0] = i;
    std::iota(d[0].begin(), d[0].end(), std::size_t{0});
    for (std::size_t i = 1; i <= a.size(); ++i)
        for (std::size_t j = 1; j <= b.size(); ++j) {
            d[i][j] = std::min({d[i - 1][j] + 1, d[i][j - 1] + 1, d[i - 1][j - 1] + (a[i - 1] != b[j - 1])});
            if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
                d[i][j] = std::min(d[i][j], d[i - 2][j - 2] + 1);
        }
    return d[a.size()][b.size()];
}

std::vector<OptionRow> rowsOf(const CLI::App& command) {
    std::vector<OptionRow> rows;
    for (const CLI::Option* option : command.get_options()) {
        OptionRow row;
        row.positional = option->get_positional();
        if (row.positional) row.names.push_back(option->get_name(true));
        for (const std::string& name : option->get_snames()) row.names.push_back("-" + name);
        for (const std::string& name : option->get_lnames()) row.names.push_back("--" + name);
        row.takesValue = option->get_items_expected_max() > 0;
        const std::string type = option->get_type_name();
        row.choices = choicesOf(type);
        if (row.takesValue) row.value = type.substr(0, type.find(':'));
        row.preset = option->get_default_str();
        row.description = option->get_description();
        rows.push_back(std::move(row));
    }
    return rows;
}

}  // namespace

std::vector<VerbRow> commandTable(const Command& program) {
    std::vector<VerbRow> rows;
    for (const CLI::App* verb : program.parser().get_subcommands([](const CLI::App*) { return true; }))
        rows.push_back({verb->get_name(), verb->get_description(), verb->get_footer(), rowsOf(*verb)});
    return rows;
}

std::string nearest(const std::string& typed, const std::vector<std::string>& known) {
    std::string best;
    std::size_t minimum = std::max<std::size_t>(1, typed.size() / 3) + 1;
    for (const std::string& name : known) {
        // The beginning of a word counts like one wrong letter.
        const bool begins = typed.size() >= 3 && name.starts_with(typed);
        if (const std::size_t distance = begins ? 1 : editDistance(typed, name); distance < minimum) {
            minimum = distance;
            best = name;
        }
    }
    return best;
}

std::string suggestion(const Command& program, const UsageError& error) {
    static const std::regex kNotIn(R"((\S+) not in \{([^}]*)\})");
    if (!error.meant.empty()) return error.meant;
    const std::string text = error.what();
    if (std::smatch found; std::regex_search(text, found, kNotIn))
        return nearest(found[1], choicesOf("{" + found[2].str() + "}"));
    const Command* verb = program.parsedVerb();
    const CLI::App& command = verb ? verb->parser() : program.parser();
    std::vector<std::string> known;
    for (const OptionRow& row : rowsOf(command))
        if (!row.positional) known.insert(known.end(), row.names.begin(), row.names.end());
    const std::vector<std::string> given = verb ? verb->given() : std::vector<std::string>();
    const auto has = [](const std::vector<std::string>& names) {
        return std::ranges::find(names, "--output") != names.end();
    };
    const bool lacksOutput = has(known) && !has(given);
    for (std::string typed : command.remaining()) {
        if (lacksOutput && !typed.starts_with('-') && typed.contains('.')) return "-o " + typed;
        if (!typed.starts_with('-')) continue;
        typed = typed.substr(0, typed.find('='));
        if (std::string name = hintForOption(typed, known); !name.empty()) return name;
        if (!typed.starts_with("--")) continue;  // every single letter is close to every other
        if (std::string name = nearest(typed, known); !name.empty()) return name;
    }
    return {};
}

}  // namespace rtsg::app
