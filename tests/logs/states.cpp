// The committed logs and the states of example scenes, by the libraries alone: what has to be the same on every
// distribution and processor.
//
//     states LOGS [--record]
//
// LOGS is the folder of the logs, with states.txt, whose lines name a scene, how many frames it is run, and the hash of
// the state then. Logs are verified, and what kept its inputs is run again. --record writes states.txt anew.
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <sstream>
#include <string>
#include <vector>

#include <rtsg/documents/loader.h>
#include <rtsg/scripts/run_scripts.h>
#include <rtsg/sync/replay_test.h>

namespace {

namespace fs = std::filesystem;

rtsg::Result<> load(rtsg::Scene& scene, const fs::path& file) {
    rtsg::Diagnostics diagnostics;
    rtsg::runScripts(scene);
    if (!rtsg::loadFile(scene, file, diagnostics)) return rtsg::fail("cannot be loaded", {}, file.string());
    return {};
}

/// Whether all its states have their hashes.
bool verifies(const fs::path& log, const fs::path& scene) {
    rtsg::ReplayTest test;
    test.log = log;
    if (!scene.empty()) test.build = [&](rtsg::Scene& to) { return load(to, scene); };
    const auto report = rtsg::runReplayTest(test);
    const bool passed = report && report->passed();
    if (!passed)
        std::cout << log.filename().string() << (scene.empty() ? ", replayed: " : ", run again: ")
                  << (report ? report->format() : report.error().format()) << '\n';
    return passed;
}

std::string hashAfter(const fs::path& file, int frames) {
    rtsg::Scene scene;
    if (const auto loaded = load(scene, file); !loaded) return loaded.error().format();
    for (int frame = 0; frame <= frames; ++frame) scene.newFrame(frame / 30.0);
    return scene.hash().hex();
}

bool hasScriptNodes(const fs::path& file) {
    std::ostringstream text;
    text << std::ifstream(file).rdbuf();
    return text.view().contains("Script {");
}

}  // namespace

int main(int argc, char** argv) {
    if (argc < 2) return std::cerr << "usage: states LOGS [--record]\n", 2;
    const fs::path folder = argv[1], table = folder / "states.txt";
    const bool record = argc > 2, hasScripts = rtsg::ecmaScript() != nullptr;
    std::size_t logs = 0, goodLogs = 0, states = 0, goodStates = 0;

    std::vector<fs::path> files;
    for (const auto& entry : fs::directory_iterator(folder))
        if (entry.path().extension() == ".rlog") files.push_back(entry.path());
    std::ranges::sort(files);
    for (const fs::path& log : files) {
        const std::string name = log.stem().string();
        const std::string scene = name.substr(0, name.find('_'));
        const bool again = !name.ends_with("_lossy") && (scene != "scripts" || hasScripts);
        ++logs;
        goodLogs += verifies(log, {}) && (!again || verifies(log, folder / (scene + ".x3dv")));
    }

    std::ifstream in(table);
    std::ostringstream out;
    std::string scene, hash;
    for (int frames = 0; in >> scene >> frames >> hash;) {
        if (!hasScripts && hasScriptNodes(folder / scene)) {
            std::cout << scene << ": left out, as it has Scripts\n";
            out << scene << ' ' << frames << ' ' << hash << '\n';
            continue;
        }
        ++states;
        const std::string found = hashAfter(folder / scene, frames);
        out << scene << ' ' << frames << ' ' << found << '\n';
        goodStates += found == hash;
        if (found != hash) std::cout << scene << ", frame " << frames << ": " << found << ", not " << hash << '\n';
    }
    if (record) std::ofstream(table) << out.str();
    std::cout << goodLogs << " of " << logs << " logs, " << goodStates << " of " << states << " states equal"
              << (hasScripts ? "" : "; scripts left out") << '\n';
    return logs > 0 && states > 0 && goodLogs == logs && (record || goodStates == states) ? 0 : 1;
}
