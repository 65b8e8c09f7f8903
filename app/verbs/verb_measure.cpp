// rtsg measure: computes how much light falls on places of a scene, with intervals.
#include "verb_measure.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <memory>

#include <fmt/format.h>

#include <rtsg/renderers/irradiance.h>
#include <rtsg/renderers/shared_world.h>
#include <rtsg/renderers/tessellator.h>
#include <rtsg/session/output_report.h>
#include <rtsg/session/running_scene.h>

#include "extensions.h"
#include "say.h"
#include "start_time.h"

namespace rtsg::app {

namespace {

struct MeasureArguments {
    std::string scene, time = "0s", shadows = "auto";
    std::vector<std::string> positions;
    ResourceArguments resources;
    StartTime start;
    double error = 0.01, candela = 0;
    std::uint64_t samples = std::uint64_t{1} << 26, seed = 1;
    unsigned threads = 0;
    bool json = false;
};

/// Parses X,Y,Z,NX,NY,NZ. Throws UsageError.
std::array<double, 6> parseProbe(const std::string& text) {
    std::array<double, 6> numbers{};
    const char *at = text.data(), *end = at + text.size();
    for (std::size_t i = 0; i < numbers.size(); ++i) {
        const auto [next, problem] = std::from_chars(at, end, numbers[i]);
        const bool last = i + 1 == numbers.size();
        if (problem != std::errc() || !std::isfinite(numbers[i]) || (last ? next != end : next == end || *next != ','))
            throw UsageError("--irradiance",
                             "expected X,Y,Z,NX,NY,NZ: a place in metres and where it faces, not " + text);
        at = next + 1;
    }
    if (numbers[3] == 0 && numbers[4] == 0 && numbers[5] == 0)
        throw UsageError("--irradiance", "the normal NX,NY,NZ must not be 0 0 0 in " + text);
    return numbers;
}

/// How finely curved geometry is tessellated for an interval of `error`. The interval includes the light that curved
/// lamps lose by it: at most a sixth for a lamp head-on (CurvedLamps in irradiance.cpp).
struct Cut {
    double wanted;  // chordError
    double used;    // that of the level that is used
    explicit Cut(double error) : wanted(std::min(.0025, error / 32)) {
        int level = 0;
        const auto chordError = [&] { return double{Tessellator::levelOptions(level).chordError}; };
        while (level + 1 < Tessellator::kLevels && chordError() > wanted) ++level;
        used = chordError();
    }
};

void printIrradiance(const MeasureArguments& options, const std::array<double, 6>& at, const Irradiance& found) {
    const Vec3d &v = found.value, &i = found.interval;
    const double lux = found.luminous * options.candela, luxInterval = found.luminousInterval * options.candela;
    if (options.json) {
        fmt::print("{{\"place\":[{},{},{}],\"normal\":[{},{},{}],\"irradiance\":[{:.9g},{:.9g},{:.9g}],", at[0], at[1],
                   at[2], at[3], at[4], at[5], v.x, v.y, v.z);
        fmt::print("\"ci95\":[{:.4g},{:.4g},{:.4g}],\"luminous\":{:.9g},\"luminous_ci95\":{:.4g},", i.x, i.y, i.z,
                   found.luminous, found.luminousInterval);
        if (options.candela > 0) fmt::print("\"lux\":{:.9g},\"lux_ci95\":{:.4g},", lux, luxInterval);
        fmt::print(
            "\"luminous_cut\":{:.4g},\"samples\":{},\"reached\":{},\"missing\":{:.4g},\"hidden_light\":{:.4g},\"lost_"
            "light\":{:.4g}}}\n",
            found.luminousCut, found.samples, found.reached, found.missing, found.hiddenLight, found.lostLight);
        return;
    }
    fmt::print("({:g} {:g} {:g}) facing ({:g} {:g} {:g}): ", at[0], at[1], at[2], at[3], at[4], at[5]);
    fmt::print("{:.6g} +- {:.2g}", found.luminous, found.luminousInterval);
    if (options.candela > 0) fmt::print(", {:.6g} +- {:.2g} lux", lux, luxInterval);
    fmt::print("\n  red {:.6g} +- {:.2g}, green {:.6g} +- {:.2g}, blue {:.6g} +- {:.2g}; {} samples{}\n", v.x, i.x, v.y,
               i.y, v.z, i.z, found.samples, found.reached ? "" : ": fewer than the error needs");
}

/// Warns of lights that shine elsewhere.
void reportOfLights(const Scene& scene, const LightState& state, Diagnostics& into) {
    for (const NodeId id : lightsLeftOut(state)) {
        const std::string_view name = scene.name(id);
        into.warningAt(scene.locationOf(id),
                       fmt::format("{}{}{} is of a group or a layer alone: it counts by what it lights there, and not "
                                   "as a light on the place itself",
                                   scene.node(id).type().name, name.empty() ? "" : " ", name));
    }
}

/// Returns whether a value is complete, and warns of what it lacks.
bool isComplete(const MeasureArguments& options, const std::string& text, const Irradiance& found) {
    constexpr double kOfError = .1;
    if (found.missing > kOfError * options.error)
        reportError(
            "rtsg: warning: {}: ways of light were cut off after 10,000 bounces: up to {:.2g} % of what comes "
            "there is missing [picture]\n",
            text, 100 * found.missing);
    if (found.reached) return true;
    if (found.luminousCut > options.error * found.luminous) {
        printError(
            fmt::format("missing: {}: curved lamps are cut too coarsely for the error {:g}: up to {:.2g} % of what "
                        "comes there may be missing by that",
                        text, options.error, 100 * found.luminousCut / found.luminous));
        return false;
    }
    printError(fmt::format("missing: {}: the error {:g} needs more than {} samples; --samples allows more", text,
                           options.error, found.samples));
    return false;
}

int measure(const MeasureArguments& options) {
    std::vector<std::array<double, 6>> positions;
    for (const std::string& text : options.positions) positions.push_back(parseProbe(text));
    const double time = parseMoment(options.time, options.start.seconds());
    RunningScene running(options.scene, options.resources.ofFile(options.scene), options.start.options(),
                         programContext());
    if (!running.load()) return kBad;
    SharedWorld::Options flattened;
    flattened.flattening.maxOccurrences = running.resources().policy().maximumInstances;
    const Cut cut(options.error);
    flattened.flattening.error.ofRadius = static_cast<float>(cut.wanted);
    SharedWorld world(running.scene(), flattened);
    extensions().registerWith(world);
    LightTracer tracer(world, running.resources());
    world.add(tracer);
    running.runTo(time);
    running.reportDiagnostics();
    Diagnostics found = world.diagnostics();
    found.append(tracer.diagnostics());
    found.setFile(options.scene);
    const auto state = tracer.latest();
    reportOfLights(running.scene(), *state, found);
    app::print(found);
    IrradianceSettings settings;
    settings.error = options.error, settings.samples = options.samples;
    settings.chordError = cut.used;
    settings.seed = options.seed, settings.threads = options.threads;
    settings.shadows = options.shadows == "none"       ? Shadows::none
                       : options.shadows == "authored" ? Shadows::authored
                       : options.shadows == "all"      ? Shadows::all
                                                       : Shadows::automatic;
    settings.progress = [](std::uint64_t) { return !interrupted(); };
    bool whole = true;
    for (std::size_t i = 0; i < positions.size(); ++i) {
        const std::array<double, 6>& at = positions[i];
        const auto result =
            measureIrradiance(*state, world.rays(), {at[0], at[1], at[2]}, {at[3], at[4], at[5]}, settings);
        if (!result) return printError(result.error()), kBad;
        printIrradiance(options, at, *result);
        if (interrupted()) return printError("interrupted"), kBad;
        if (i == 0)
            for (const Diagnostic& warning : hiddenLightWarnings(options.scene, result->hiddenLight, result->lostLight))
                say(warning);
        if (!isComplete(options, options.positions[i], *result)) whole = false;
    }
    return whole ? kDone : kBad;
}

}  // namespace

Verb addMeasure(Command& program) {
    auto options = std::make_shared<MeasureArguments>();
    Command* command = program.addVerb("measure", "Measure the light that falls on places, with 95 % intervals");
    command->addOption("SCENE", options->scene, "scene file, or -")->required();
    command
        ->addOption(
            "--irradiance", options->positions,
            "X,Y,Z,NX,NY,NZ: at a place, in metres, on what faces there; pi under a light of intensity 1 head-on, "
            "all light between surfaces included, without the headlight")
        ->required();
    command->addOption("--error", options->error, "target: half the interval divided by the value")
        ->preset()
        ->range(1e-6, 1e3);
    command->addOption("--samples", options->samples, "at most, a place")
        ->preset()
        ->range(std::uint64_t{1}, std::uint64_t{1} << 36);
    command->addOption("--candela", options->candela, "candela per square metre of radiance 1: prints lux, too")
        ->range(1e-9, 1e12);
    command->addOption("--shadows", options->shadows, "as of render")
        ->preset()
        ->oneOf({"auto", "authored", "all", "none"});
    command->addOption("--time", options->time, "run the scene so long")->preset();
    command->addOption("--seed", options->seed, "of the sampling")->preset();
    command->addOption("--threads", options->threads, "0: as many as cores")->preset();
    options->start.addTo(*command);
    options->resources.addTo(*command);
    command->addFlag("--json", options->json, "one JSON object for each place");
    command->footer("Example: rtsg measure hall.x3dv --irradiance 0,0.8,0,0,1,0 --error 0.01 --candela 100");
    return {command, [options] { return measure(*options); }};
}

}  // namespace rtsg::app
