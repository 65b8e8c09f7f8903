// Loads the plug-ins and node tables that the user names.
#include "extensions.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <ranges>
#include <string>
#include <string_view>
#include <vector>

#include "cli.h"

namespace rtsg::app {

namespace {

/// The plug-ins and tables that were typed, and the result. The program has one set, as it has one command line.
struct Given {
    std::vector<std::string> plugins, tables;
    Extensions extensions;
} given;

/// Verbs whose scenes come from peers and logs.
constexpr std::array<std::string_view, 3> kOfOthers{"mirror", "relay", "replay"};

void addPlugin(const std::string& file) {
    const Result<> loaded = loadPlugin(file, given.extensions);
    if (loaded) return;
    printError(loaded.error());
    noteLeftOut();
}

}  // namespace

void addExtensions(Command& command) {
    const Command::Section section(command, "Extensions");
    command
        .addOption(
            "--plugin", given.plugins,
            "a shared library that adds nodes, formats and more (repeatable); its code runs as the program's own")
        ->repeatable();
    command.addOption("--nodes", given.tables, "a table of node types, .x3dspec (repeatable)")->repeatable();
}

void loadExtensions(const Command& verb) {
    const std::string name = verb.name();
    const char* const listed = ::secure_getenv("RTSG_PLUGINS");
    if (listed && std::ranges::find(kOfOthers, name) == kOfOthers.end())
        for (const auto part : std::views::split(std::string_view(listed), ':'))
            if (!part.empty()) addPlugin(std::string(part.begin(), part.end()));
    for (const std::string& file : given.plugins) addPlugin(file);
    for (const std::string& file : given.tables) {
        Diagnostics diagnostics(file);
        if (loadNodeTable(file, given.extensions, diagnostics)) continue;
        print(diagnostics);
        noteLeftOut();
    }
}

const Extensions& extensions() {
    return given.extensions;
}

}  // namespace rtsg::app
