// rtsg merge: writes one log of two, with their scenes side by side in one scene.
#include <memory>

#include <fmt/format.h>

#include <rtsg/sync/log_merge.h>

#include "cli.h"
#include "files.h"
#include "log_store.h"

namespace rtsg::app {

namespace {

struct MergeArguments {
    std::string a, b, out;
    double apart = 0;
    bool bySceneTime = false, force = false, json = false;
};

int merge(const MergeArguments& options) {
    if (auto ok = checkFiles({options.a, options.b}, {{"-o", options.out, OutputKind::log}}, options.force); !ok)
        return printError(ok.error()), kBad;
    (void)interrupted();  // from here on an interruption ends the program in order and leaves no partial file
    MergeOptions to;
    to.bySceneTime = options.bySceneTime;
    to.apart = static_cast<float>(options.apart);
    to.log.existing = existing(options.force);
    const Progress bar = progressBar("merging " + options.a + " and " + options.b);
    to.progress = [&](std::uint64_t done, std::uint64_t total) {
        if (bar) bar(done, total);
        return !interrupted();
    };
    const auto report = mergeLogs(options.a, options.b, options.out, to);
    if (bar) bar(1, 1);
    if (interrupted() && !report) return printError("interrupted: " + options.out + " was not written"), kBad;
    if (!report) return printError(report.error()), kBad;
    if (options.json)
        fmt::print("{{\"states\":{},\"states_before\":{},\"complete\":{}}}\n", report->statesWritten,
                   report->statesRead, report->lacks.empty());
    else
        fmt::print("{} states of {} in both\n", report->statesWritten, report->statesRead);
    if (report->lacks.empty()) return kDone;
    printError(fmt::format("{} is not complete: {}", options.out, report->lacks));
    return kBad;
}

}  // namespace

Verb addMerge(Command& program) {
    auto options = std::make_shared<MergeArguments>();
    Command* command = program.addVerb("merge", "Write one log of two, with their scenes side by side");
    command->addOption("A", options->a, "log")->required();
    command->addOption("B", options->b, "another log")->required();
    command->addOption("-o,--output", options->out, "log to write (.rlog, or nats://HOST:PORT/NAME)")->required();
    command->addOption("--apart", options->apart, "distance of B from A, metres along x")->preset();
    command->addFlag("--scene-time", options->bySceneTime,
                     "align the logs by scene time, for two recordings of one event; without it, by their starts");
    addForce(*command, options->force);
    command->addFlag("--json", options->json, "the report as JSON");
    command->footer(
        "Example: rtsg merge door.rlog other.rlog -o both.rlog --apart 10\n"
        "The scenes are below two Transforms, A and B; names at the top level begin with A_ and B_. What is bound is\n"
        "A's. Each log has to be of one session without gaps. Exit status 1 where one of them lacks something.");
    return {command, [options]() -> int {
                const auto a = fetchLog("A", options->a), b = fetchLog("B", options->b);
                for (const auto* fetched : {&a, &b})
                    if (!*fetched) return printError(fetched->error()), kBad;
                auto stored = StoredLog::start("-o", options->out, LogUse::write, options->force);
                if (!stored) return printError(stored.error()), kBad;
                return stored->finish(merge(*options));
            }};
}

}  // namespace rtsg::app
