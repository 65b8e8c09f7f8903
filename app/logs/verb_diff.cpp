// rtsg diff: compares two logs or two scenes, and names the differences.
#include <cmath>
#include <filesystem>
#include <memory>
#include <system_error>

#include <fmt/format.h>

#include <rtsg/core/web_address.h>
#include <rtsg/sync/field_comparison.h>
#include <rtsg/sync/log.h>

#include "cli.h"
#include "files.h"
#include "log_store.h"
#include "replay_test.h"

namespace rtsg::app {

namespace {

struct DiffArguments {
    std::string a, b, shown[2];
    FieldSelection selection;
    std::uint64_t maximum = 20;
    ResourceArguments resources;
    bool json = false;
};

/// Prints one line for each difference, or one JSON object with `counts` as its last members.
int report(const DiffArguments& options, const std::vector<Divergence>& found, const std::string& compared,
           const std::string& counts = {}) {
    const std::size_t shown = std::min<std::size_t>(found.size(), options.maximum);
    if (options.json) {
        std::string list;
        for (std::size_t i = 0; i < shown; ++i) list += (i ? "," : "") + toJson(std::optional(found[i]));
        fmt::print("{{\"equal\":{},\"count\":{},\"differences\":[{}]{}}}\n", found.empty(), found.size(), list, counts);
        return found.empty() ? kDone : kBad;
    }
    for (std::size_t i = 0; i < shown; ++i) {
        const Divergence& d = found[i];
        const std::string location = d.node.empty() || d.field.empty() ? d.node + d.field : d.node + "." + d.field;
        const std::string when = d.frame > 0 ? fmt::format("frame {} (t = {} s), ", d.frame, d.time) : "";
        fmt::print("{}{}{}{}\n", when, location, location.empty() ? "" : ": ", d.text);
    }
    if (shown < found.size()) fmt::print("and {} more\n", found.size() - shown);
    if (found.empty()) fmt::print("{} and {} are equal{}\n", options.shown[0], options.shown[1], compared);
    return found.empty() ? kDone : kBad;
}

Divergence toDivergence(const FieldDifference& d, double start) {
    const double t = std::round((d.time - start) * 1e6) / 1e6;
    return {d.frame, t, d.node, d.field, d.cause.empty() ? d.text : fmt::format("{}, by {}", d.text, d.cause)};
}

int diffLogs(const DiffArguments& options) {
    std::vector<Divergence> found;
    if (!options.selection.any()) {
        const Progress progress = progressBar("comparing " + options.a);
        ComparedStates states;
        const auto first = rtsg::diffLogs(options.a, options.b, progress, &states);
        if (progress) progress(1, 1);
        if (!first) return printError(first.error()), kBad;
        warnOfDamage(options.a, options.b, states.damage);
        if (*first) found.push_back(*fromStart(*first, logStart(options.a)));
        return report(options, found, " " + states.format(), "," + toJson(states));
    }
    const auto fields = diffLogFields(options.a, options.b, options.selection);
    if (!fields) return printError(fields.error()), kBad;
    warnOf(fields->ignoredInVain);
    warnOfDamage(options.a, options.b, fields->damage);
    const double start = logStart(options.a);
    for (const FieldDifference& d : fields->differences) found.push_back(toDivergence(d, start));
    if (!fields->unequalEnds.empty()) found.push_back({0, fields->end, "", "", fields->unequalEnds});
    return report(options, found, fmt::format(" in {} fields and {} states", fields->fields, fields->states),
                  "," + toJson(fields->damage));
}

int diffScenes(const DiffArguments& options) {
    Scene scenes[2];
    for (int i = 0; i < 2; ++i) {
        const std::string& file = i == 0 ? options.a : options.b;
        Diagnostics diagnostics(file);
        if (!load(scenes[i], file, diagnostics, options.resources.ofFile(file))) return kBad;
    }
    if (!options.selection.any()) {
        std::vector<Divergence> found = sceneDifferences(scenes[0], scenes[1]);
        for (Divergence& d : found) d.frame = 0;
        return report(options, found, "");
    }
    FieldComparison fields(options.selection, scenes[0], scenes[1], {"first", "second"},
                           FieldComparison::Fields::ofEither);
    fields.first();
    if (const std::string why = fields.nothingCompared(); !why.empty())
        return printError(fmt::format("{}: {}", options.a, why)), kBad;
    warnOf(fields.ignoredInVain());
    std::vector<Divergence> found;
    for (const FieldDifference& d : fields.differences()) {
        found.push_back(toDivergence(d, 0));
        found.back().frame = 0;
    }
    return report(options, found, fmt::format(" in {} fields", fields.fieldCount()));
}

int diffFiles(DiffArguments options) {
    check(options.selection);
    options.shown[0] = shownLog(options.a), options.shown[1] = shownLog(options.b);
    const auto a = fetchLog("A", options.a), b = fetchLog("B", options.b);
    for (const auto* fetched : {&a, &b})
        if (!*fetched) return printError(fetched->error()), kBad;
    for (const std::string& name : {options.a, options.b})
        if (std::error_code error; name != "-" && !isWebAddress(name) && !std::filesystem::exists(name, error) &&
                                   filesOfLog(name).value_or(std::vector<std::filesystem::path>{}).size() < 2)
            return printError(fail("there is no such file", {}, name).error()), kBad;
    const bool log = isLogOrNamedSo(options.a);
    if (log != isLogOrNamedSo(options.b))
        throw UsageError(
            fmt::format("{} is a log, the other a scene: save a state first, rtsg replay {} --seek 2s "
                        "--save state.x3dv",
                        log ? options.a : options.b, log ? options.a : options.b));
    return log ? diffLogs(options) : diffScenes(options);
}

}  // namespace

Verb addDiff(Command& program) {
    auto options = std::make_shared<DiffArguments>();
    Command* command = program.addVerb("diff", "Compare two logs or two scenes, and name what differs");
    command->addOption("A", options->a, "log or scene")->required();
    command->addOption("B", options->b, "another of the same kind")->required();
    addFieldSelection(*command, options->selection);
    command->addOption("--most", options->maximum, "differences to print")
        ->preset()
        ->range(std::uint64_t{1}, UINT64_MAX);
    options->resources.addTo(*command);
    command->addFlag("--json", options->json, "the report as JSON");
    command->footer(
        "Example: rtsg diff door.x3dv same_door.x3dv\n"
        "Example: rtsg diff door.rlog other.rlog --field DOOR.* --ignore initial --tolerance 1e-4\n"
        "Logs are compared state by state; with --field, --ignore or --tolerance, logs of different sessions by\n"
        "time since their starts. Nodes are paired by their DEF names. Exit status 1 if anything differs.");
    return {command, [options] { return diffFiles(*options); }};
}

}  // namespace rtsg::app
