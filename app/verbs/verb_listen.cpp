// rtsg listen: makes the sound of a scene, and the figures of its room.
#include <algorithm>
#include <filesystem>
#include <locale>
#include <memory>
#include <span>
#include <sstream>

#include <fmt/format.h>

#include <rtsg/audio/live_sound.h>
#include <rtsg/audio/sound_file.h>
#include <rtsg/core/output_file.h>
#include <rtsg/renderers/picture.h>
#include <rtsg/session/advice.h>
#include <rtsg/session/output_maker.h>
#include <rtsg/session/running_scene.h>

#include "cli.h"
#include "extensions.h"
#include "files.h"
#include "given_sounds.h"
#include "output_arguments.h"
#include "start_time.h"

namespace rtsg::app {

namespace {

struct ListenArguments {
    std::string scene, out, duration = "5s", ir, irLength, report, plan;
    std::vector<std::string> positions, maps;
    std::string noise, voice = "male", grid, figure = "STI";
    double speechLevel = SpeechOptions().level;
    ResourceArguments resources;
    StartTime start;
    SoundArguments sound;
    SentSoundArguments sent;
    std::string device;
    bool metrics = false, json = false, live = false;

    double irSeconds() const { return irLength.empty() ? 0 : parseSeconds(irLength); }
    SpeechOptions speech() const {
        SpeechOptions options{voice == "female", speechLevel, std::nullopt};
        if (noise.empty()) return options;
        auto levels = noiseLevels(noise);
        if (!levels) throw UsageError("--noise", levels.error().text);
        options.noise = *levels;
        return options;
    }
};

/// Takes over what a plan has and nobody typed.
Result<> takeSoundPlan(ListenArguments& options, const std::vector<std::string>& typed) {
    if (options.plan.empty()) return {};
    const auto plan = Plan::read(options.plan);
    if (!plan) return std::unexpected(plan.error());
    const auto isTyped = [&](std::string_view option) { return std::ranges::find(typed, option) != typed.end(); };
    if (plan->quality && !isTyped("--quality") && !isTyped("--rays")) options.sound.quality = *plan->quality;
    if (plan->diffraction && !isTyped("--diffraction")) options.sound.diffraction = *plan->diffraction;
    return {};
}

/// Plays the sound while the scene runs in real time.
int listenLive(const ListenArguments& options) {
    if (!options.out.empty() || !options.ir.empty() || !options.irLength.empty() || !options.report.empty() ||
        options.metrics || !options.grid.empty() || !options.maps.empty() || !options.sent.given.empty())
        throw UsageError("--live plays sound; make files and figures without it");
    if (options.sound.ambisonic > 0) throw UsageError("--ambisonic", "is for files: a device plays two channels");
    options.sound.given.check({options.scene});
    StartTime start = options.start;
    start.kind = StartTime::Kind::live;
    RunningScene running(options.scene, options.resources.ofFile(options.scene), start.options(), programContext());
    if (!running.load()) return kBad;
    LiveOptions live;
    live.render = options.sound.parse().render;
    live.render.document = options.scene;
    live.render.resources = running.resources();
    live.render.given =
        options.sound.given.open(running.scene(), true, parseSeconds(options.duration), live.render.sampleRate);
    live.device = options.device;
    SharedWorld& world = running.world().get();
    // The sound begins with the first frame, because in the file things are not yet where behaviours put them.
    Result<std::unique_ptr<LiveSound>> sound;
    Pace pace;
    pace.seconds = parseSeconds(options.duration);
    pace.realtime = true;
    (void)interrupted();  // from here on an interruption ends the program in order
    running.run(pace, "listening to " + options.scene, [&](std::uint64_t, const ChangeSet&) {
        if (sound && !*sound) sound = LiveSound::start(world, live);
        if (!sound) return false;
        (*sound)->sendEvents();
        return !interrupted() && (*sound)->report().failure.empty();
    });
    if (!sound) return printError(sound.error()), kBad;
    const LiveReport report = (*sound)->stop();
    running.reportDiagnostics();
    print(report.diagnostics);
    print(world.diagnostics());
    fmt::print("{{\"device\":{},{}}}\n", jsonString(report.device), liveFigures(report));
    if (!report.failure.empty()) return printError(report.failure), kBad;
    if (!interrupted() || running.time() >= pace.seconds) return kDone;
    printError(fmt::format("interrupted after {:.3f} of {} s", running.time(), pace.seconds));
    return kBad;
}

/// Parses "X Y Z", with or without commas.
ListeningPosition parsePosition(const std::string& text) {
    ListeningPosition listener{text, {}, {}};
    std::string plain = text;
    std::replace(plain.begin(), plain.end(), ',', ' ');
    std::istringstream in(plain);
    in.imbue(std::locale::classic());
    std::string rest;
    if (!(in >> listener.position.x >> listener.position.y >> listener.position.z) || in >> rest)
        throw UsageError(fmt::format("--place takes three numbers, metres, not '{}'", text));
    return listener;
}

bool isSofa(const std::string& file) {
    return std::filesystem::path(file).extension() == ".sofa";
}

/// Measures the room at many places, and writes the forms that the files' names ask for.
Result<> writeSurvey(const ListenArguments& options, SoundRenderer& sound) {
    std::vector<ListeningPosition> positions;
    for (const std::string& text : options.positions) positions.push_back(parsePosition(text));
    auto report = sound.survey(std::move(positions));
    if (interrupted())
        return fail(fmt::format("interrupted: {} not written", options.report.empty() ? options.ir + " was"
                                                               : isSofa(options.ir)
                                                                   ? options.report + " and " + options.ir + " were"
                                                                   : options.report + " was"));
    if (!report) return std::unexpected(report.error());
    print(report->diagnostics);
    const std::string scene = std::filesystem::path(options.scene).filename().string();
    if (isSofa(options.ir)) {
        report->title = "Impulse responses of " + scene;
        RoomResponses responses = sound.responses(*report, 48000, options.irSeconds());
        responses.scene = scene;
        responses.application = "rtsg";
        responses.applicationVersion = RTSG_VERSION;
        if (auto ok = writeSofa(options.ir, responses); !ok) return ok;
    }
    if (options.report.empty()) return {};
    report->title = "Room acoustics of " + scene;
    const std::string form = std::filesystem::path(options.report).extension().string();
    const std::string text = form == ".html"   ? report->toHtml()
                             : form == ".json" ? report->toJson() + "\n"
                                               : report->toText();
    return writeWholeFile(options.report, std::as_bytes(std::span(text)));
}

/// "Y,STEP", metres.
struct GridSpec {
    double height = 0, step = 0;

    static GridSpec parse(const std::string& text) {
        GridSpec spec;
        const std::size_t comma = text.find(',');
        std::string plain = text;
        if (comma != text.npos) plain[comma] = ' ';
        std::istringstream in(plain);
        in.imbue(std::locale::classic());
        std::string rest;
        if (comma == text.npos || !(in >> spec.height >> spec.step) || in >> rest || !(spec.step > 0))
            throw UsageError("--grid",
                             fmt::format("takes a height and a step, metres, such as 1.2,.5, not '{}'", text));
        return spec;
    }
};

/// Throws UsageError for options that exclude each other.
void checkMaps(const ListenArguments& options) {
    if (options.grid.empty() != options.maps.empty()) throw UsageError("--grid and --map go together");
    if (options.grid.empty()) return;
    static_cast<void>(GridSpec::parse(options.grid));
    if (auto figure = MapFigure::parse(options.figure); !figure) throw UsageError("--figure", figure.error().text);
}

Result<> writeMaps(const ListenArguments& options, SoundRenderer& sound) {
    const GridSpec spec = GridSpec::parse(options.grid);
    auto map = sound.map(spec.height, spec.step);
    if (interrupted()) {
        std::string files;
        for (const std::string& file : options.maps) files += (files.empty() ? "" : " and ") + file;
        return fail(fmt::format("interrupted: {} {} not written", files, options.maps.size() > 1 ? "were" : "was"));
    }
    if (!map) return std::unexpected(map.error());
    print(map->report.diagnostics);
    for (const std::string& file : options.maps) {
        Result<> written;
        if (std::filesystem::path(file).extension() == ".csv") {
            const std::string text = map->toCsv();
            written = writeWholeFile(file, std::as_bytes(std::span(text)));
        } else {
            written = writePicture(map->picture(*MapFigure::parse(options.figure)), file);
        }
        if (!written) return written;
    }
    return {};
}

/// The files that are asked for.
std::vector<OutputName> outputsOf(const ListenArguments& options) {
    std::vector<OutputName> outputs{{"-o", options.out, OutputKind::sound},
                                    {"--ir", options.ir, OutputKind::response},
                                    {"--report", options.report, OutputKind::report}};
    for (const std::string& file : options.sent.files()) outputs.push_back({"--stream-out", file, OutputKind::sound});
    for (const std::string& file : options.maps) outputs.push_back({"--map", file, OutputKind::map});
    return outputs;
}

/// Throws UsageError for options that exclude each other.
void checkListening(const ListenArguments& options) {
    if (!options.device.empty()) throw UsageError("--device is of --live");
    if (options.out.empty() && options.ir.empty() && options.report.empty() && options.maps.empty() &&
        options.grid.empty() && !options.metrics && !options.json && options.sent.given.empty())
        throw UsageError("-o, --ir, --report, --map, --stream-out or --metrics is required");
    options.sound.given.check({options.scene});
    if (!options.positions.empty() && options.report.empty() && !isSofa(options.ir))
        throw UsageError("--place is for --report and --ir FILE.sofa");
    for (const std::string& text : options.positions) static_cast<void>(parsePosition(text));
    checkMaps(options);
    // All of the sound is kept in memory until its end.
    constexpr double kLongest = 24 * 3600;
    if (parseSeconds(options.duration) > kLongest) throw UsageError("--for", options.duration + ": it is 24h at most");
    if (!options.irLength.empty() && options.ir.empty()) throw UsageError("--ir-length is of --ir");
    if (!options.irLength.empty() && !(options.irSeconds() >= 0.001 && options.irSeconds() <= 60))
        throw UsageError("--ir-length", options.irLength + ": it is 1ms to 60s");
}

int listenTo(const ListenArguments& options) {
    if (options.live) return listenLive(options);
    checkListening(options);
    const std::vector<OutputName> outputs = outputsOf(options);
    std::vector<std::string> inputs = options.sound.files();
    inputs.push_back(options.scene);
    if (auto ok = checkFiles(inputs, outputs, false); !ok) return printError(ok.error()), kBad;
    ListenOptions listening = options.sound.parse();
    listening.speech = options.speech();
    listening.seconds = parseSeconds(options.duration);
    RunningScene running(options.scene, options.resources.ofFile(options.scene), options.start.options(),
                         programContext());
    if (!running.load()) return kBad;
    keepResources(running.scene(), running.resources(), outputs);
    listening.render.document = options.scene;
    listening.render.resources = running.resources();
    listening.render.given =
        options.sound.given.open(running.scene(), false, listening.seconds, listening.render.sampleRate);
    listening.runTo = [&](double t) { running.frameAt(t); };
    listening.sound = !options.out.empty() || !options.sent.given.empty();
    listening.render.keepStreams = !options.sent.given.empty();
    listening.metrics = options.metrics || options.json || (!options.ir.empty() && !isSofa(options.ir));
    listening.impulseResponses = !options.ir.empty();
    const Progress progress = progressBar("listening to " + options.scene);
    listening.progress = [&](double fraction) {
        if (progress) progress(static_cast<std::uint64_t>(fraction * 1e6), 1'000'000);
        return !interrupted();
    };
    SharedWorld& world = running.world().get();
    SoundRenderer sound(world, listening);
    extensions().registerWith(sound);
    auto report = listen(sound, listening);
    if (progress) progress(1, 1);
    if (interrupted()) return printError("interrupted: nothing was written"), kBad;
    if (!report) return printError(report.error()), kBad;
    // A script may have loaded other clips since.
    keepResources(running.scene(), running.resources(), outputs);
    running.reportDiagnostics();
    print(report->diagnostics);
    reportGain(*report, programContext());
    print(world.diagnostics());
    if (!options.out.empty())
        if (auto ok = writeWav(options.out, report->sound); !ok) return printError(ok.error()), kBad;
    if (auto ok = options.sent.write(report->streams); !ok) return printError(ok.error()), kBad;
    // A response at one metre may exceed full scale, so it is written in floating point.
    if (!options.ir.empty() && !isSofa(options.ir))
        if (auto ok = writeWav(options.ir, report->impulseResponses(48000, options.irSeconds()), WavFormat::float32);
            !ok)
            return printError(ok.error()), kBad;
    if (!options.report.empty() || isSofa(options.ir))
        if (auto ok = writeSurvey(options, sound); !ok) return printError(ok.error()), kBad;
    if (!options.maps.empty())
        if (auto ok = writeMaps(options, sound); !ok) return printError(ok.error()), kBad;
    if (options.metrics || options.json) fmt::print("{}\n", report->toJson());
    return kDone;
}

}  // namespace

Verb addListen(Command& program) {
    auto options = std::make_shared<ListenArguments>();
    Command* command = program.addVerb("listen", "Make the sound that the listener hears; measure the room");
    command->addOption("SCENE", options->scene, "scene file, or -")->required();
    command->addOption("-o,--output", options->out, "WAV to write");
    command->addOption("--for", options->duration, "how long")->preset();
    command->addFlag("--live", options->live, "play it now, on a sound device");
    command->addOption("--device", options->device, "with --live; without it, the default device");
    command->addOption("--plan", options->plan, "settings that rtsg advise --plan found; what is typed counts more");
    options->start.addTo(*command);
    {
        const Command::Section section(*command, "Figures of the room");
        command->addFlag("--metrics", options->metrics,
                         "print EDT T20 T30 C50 C80 D50 Ts G LF IACC per octave band, and STI, as JSON");
        command->addFlag("--json", options->json, "the same as --metrics");
        command->addOption(
            "--report", options->report,
            "figures by ISO 3382 at all listeners of the scene and their averages: .html, .json or .txt");
        command->addOption(
            "--ir", options->ir,
            "impulse responses, mono or with the channels of --stereo, --binaural, --ambisonic: .wav at the "
            "listener, source "
            "by source, or .sofa (AES69) from every source to all listeners of the scene, or to --place");
        command->addOption("--ir-length", options->irLength,
                           "the length of impulse responses (default: until they fade)");
        command
            ->addOption("--place", options->positions,
                        "\"X Y Z\": a listening place for --report and .sofa (repeatable)")
            ->repeatable();
        command->addOption("--grid", options->grid,
                           "Y,STEP: for --map, measure at points STEP metres apart over the floor, at the height Y");
        command->addOption("--map", options->maps, "with --grid: .png shows a figure in colours, .csv has all figures")
            ->repeatable();
        command
            ->addOption("--figure", options->figure, "for --map: a figure such as STI, T20, or C80@1000 for one octave")
            ->preset();
        command->addOption(
            "--noise", options->noise,
            "background noise at listeners for STI: NC35, NR35, or dB of octaves from 125 Hz with commas "
            "between; default: none");
        command->addOption("--speech-level", options->speechLevel, "level of speech for STI: dB(A) at 1 m")
            ->preset()
            ->range(0.0, 140.0);
        command->addOption("--voice", options->voice, "voice for STI")->preset()->oneOf({"male", "female"});
        command
            ->addOption("--error", options->sound.error,
                        "trace until the figures' 95 % half width is this many noticeable differences")
            ->positive();
    }
    options->sound.addTo(*command);
    options->sent.addTo(*command);
    options->resources.addTo(*command);
    command->footer("Example: rtsg listen hall.x3dv -o hall.wav --for 5s --binaural --metrics");
    return {command, [command, options]() -> int {
                if (auto ok = takeSoundPlan(*options, command->given()); !ok) return printError(ok.error()), kBad;
                return listenTo(*options);
            }};
}

}  // namespace rtsg::app
