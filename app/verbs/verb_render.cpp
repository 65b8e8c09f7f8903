// rtsg render: makes a picture or an animation of a scene.
#include <algorithm>
#include <cmath>
#include <ctime>
#include <filesystem>
#include <functional>
#include <iterator>
#include <memory>

#include <fmt/format.h>

#include <rtsg/ogre/ogre_renderer.h>
#include <rtsg/session/advice.h>
#include <rtsg/session/output_maker.h>
#include <rtsg/session/provenance.h>
#include <rtsg/session/running_scene.h>

#include "cli.h"
#include "extensions.h"
#include "files.h"
#include "output_arguments.h"
#include "say.h"
#include "start_time.h"

namespace rtsg::app {

namespace {

struct RenderArguments {
    std::string scene, out, time = "0", layers, stereo = "none";
    double aperture = 0, focus = 0, eyeDistance = 0.063;
    bool panorama = false;
    ResourceArguments resources;
    StartTime start;
    std::vector<std::string> set;
    int frames = 1;
    double fps = 25;
    PictureArguments picture;
    std::string plan, budget;
    std::vector<std::string> typed;  // options by their long names
    bool json = false;

    bool isTyped(std::string_view option) const { return std::ranges::find(typed, option) != typed.end(); }
    double budgetSeconds() const { return budget.empty() ? 0 : parseSeconds(budget); }
};

/// Takes over what a plan has and nobody typed. Throws UsageError.
Result<> takePlan(RenderArguments& options) {
    if (options.plan.empty()) return {};
    auto plan = Plan::read(options.plan);
    if (!plan) return std::unexpected(plan.error());
    if (plan->integrator && !options.isTyped("--integrator")) {
        options.picture.integrator = *plan->integrator;
        if (plan->linear && !options.isTyped("--color-space")) options.picture.colorSpace = "linear";
    }
    if (plan->samples && !options.isTyped("--spp") && !options.isTyped("--error"))
        options.picture.samples = *plan->samples;
    return {};
}

/// Throws UsageError for what a budget decides by itself, or cannot be combined with.
void checkBudget(const RenderArguments& options) {
    if (options.budget.empty()) return;
    if (!(options.budgetSeconds() > 0)) throw UsageError("--budget", "must be more than 0");
    for (const char* option :
         {"--integrator", "--spp", "--error", "--color-space", "--plan", "--tile", "--stereo", "--layers"})
        if (options.isTyped(option)) throw UsageError("--budget", fmt::format("cannot be combined with {}", option));
}

struct LayerName {
    const char* name;
    std::uint32_t bits;
};
constexpr LayerName kLayers[] = {{"depth", kDepth},   {"position", kPosition}, {"normal", kNormal},
                                 {"albedo", kAlbedo}, {"node", kNode},         {"names", kObjects | kMaterials},
                                 {"motion", kMotion}, {"all", kAllLayers}};

/// Parses a list of names to DataLayers. Throws UsageError.
std::uint32_t parseLayers(std::string_view list) {
    std::uint32_t bits = 0;
    for (std::size_t at = 0; at < list.size();) {
        const std::size_t end = std::min(list.find(',', at), list.size());
        const std::string_view name = list.substr(at, end - at);
        const auto* known =
            std::ranges::find(kLayers, name, [](const LayerName& layer) { return std::string_view(layer.name); });
        if (known == std::end(kLayers)) {
            std::string all;
            for (const LayerName& layer : kLayers) all += fmt::format("{}{}", all.empty() ? "" : ", ", layer.name);
            throw UsageError("--layers", fmt::format("there is no layer \"{}\"; there are: {}", name, all));
        }
        bits |= known->bits;
        at = end + 1;
    }
    return bits;
}

/// Adds the options of the eye: lens, panorama, stereo. Throws UsageError.
void addEye(const RenderArguments& options, ImageOptions& image) {
    const std::string& integrator = options.picture.integrator;
    if (integrator == "raster" || integrator == "hybrid") {
        const auto refuse = [&](bool asked, const char* option) {
            if (asked) throw UsageError(option, fmt::format("is not supported by --integrator {}", integrator));
        };
        refuse(options.panorama, "--panorama"), refuse(options.aperture > 0, "--aperture");
        refuse(options.stereo != "none", "--stereo"), refuse(image.settings.layers != 0, "--layers");
    }
    if (options.panorama && (options.aperture > 0 || options.stereo != "none"))
        throw UsageError("--panorama", "cannot be combined with --stereo or a lens");
    if (options.stereo != "none" && !options.picture.tile.empty())
        throw UsageError("--tile", "cannot be combined with --stereo");
    if (options.aperture > 0 && !(options.focus > 0)) throw UsageError("--aperture", "needs --focus");
    image.panorama = options.panorama;
    image.lensRadius = options.aperture / 2, image.focus = options.focus;
    image.stereo = options.stereo == "beside"  ? Stereo::beside
                   : options.stereo == "above" ? Stereo::above
                                               : Stereo::none;
    image.eyeDistance = options.eyeDistance;
}

double noiseOverMean(const RenderStats& stats) {
    return stats.mean > 0 ? stats.noise / stats.mean : 0;
}

/// How much a picture shows.
struct Content {
    std::uint64_t instances = 0, triangles = 0;
};

/// The renderer that --integrator names, on a world.
class PictureMaker {
  public:
    PictureMaker(SharedWorld& world, const Resources& resources, const std::string& integrator)
        : world_(world), traces_(integrator != "raster") {
        LightRenderer::Options options(resources);
        if (integrator == "raster" || integrator == "hybrid")
            raster_ = std::make_unique<OgreRenderer>(world, std::move(options));
        else
            light_ = std::make_unique<LightRenderer>(world, std::move(options));
        if (light_) extensions().registerWith(*light_);
    }
    /// The best settings for so many CPU seconds a picture. Precondition: not by OGRE.
    Result<BudgetChoice> chooseFor(const ImageOptions& image, double cpuSeconds) {
        return rtsg::chooseFor(*light_, image, cpuSeconds, [] { return !interrupted(); });
    }
    Result<> remember(const ImageOptions& image) { return light_ ? light_->remember(image) : Result<>(); }
    Result<int> write(const std::string& file, const ImageOptions& image, const AnimationOptions& animation,
                      const ToneMap& toneMap) {
        const auto next = [&](RenderStats& stats) {
            auto picture = light_    ? light_->nextPicture(image, &stats)
                           : traces_ ? raster_->hybridPicture(image, &stats)
                                     : raster_->nextPicture(image, &stats);
            if (picture && notes_) std::ranges::move(notes_(), std::back_inserter(picture->notes));
            return picture;
        };
        return renderToFile(world_.scene(), next, file, image, animation, toneMap);
    }
    /// Of each picture, beside its own.
    void addNotes(std::function<PictureNotes()> notes) { notes_ = std::move(notes); }
    const Diagnostics& diagnostics() const { return light_ ? light_->diagnostics() : raster_->diagnostics(); }
    Content content() const {
        if (light_) return {world_.rays().stats().traced, world_.rays().stats().instancedTriangles};
        const RasterContent drawn = raster_->content();
        return {drawn.instances, drawn.triangles};
    }

  private:
    SharedWorld& world_;
    const bool traces_;
    std::unique_ptr<LightRenderer> light_;
    std::unique_ptr<OgreRenderer> raster_;
    std::function<PictureNotes()> notes_;
};

/// The error of pictures for a budget: that of path is measured, that of whitted was found by trials.
struct BudgetReport {
    double expected = 0, cpuSeconds = 0;
    bool path = false;
    double error(const RenderStats& all) const { return path ? noiseOverMean(all) : expected; }
};

std::string budgetJson(const BudgetReport& budget, const RenderStats& all) {
    const auto number = [](double value) { return std::isfinite(value) ? fmt::format("{:.4g}", value) : "null"; };
    return fmt::format(",\"integrator\":\"{}\",\"rms_over_mean\":{},\"expected_error\":{},\"cpu_seconds\":{:.4g}",
                       budget.path ? "path" : "whitted", number(budget.error(all)), number(budget.expected),
                       budget.cpuSeconds);
}

/// `all` has, over all frames, the largest missing light, error and noise, and the means of samples and kept pixels.
void reportResult(const RenderArguments& options, const RenderSettings& settings, const RenderStats& all,
                  const Content& content, const std::optional<Flattener::Cuts>& cuts,
                  const std::optional<BudgetReport>& budget) {
    for (const Diagnostic& warning : hiddenLightWarnings(options.scene, all.hiddenLight, all.lostLight)) say(warning);
    if (options.json) {
        std::string more;
        if (budget)
            more = budgetJson(*budget, all);
        else if (settings.error > 0)
            more = fmt::format(
                R"(,"error":{:.4g},"rms_over_mean":{:.4g},"unreached":{:.4g},"hidden_light":{:.4g},"lost_light":{:.4g})",
                all.error, noiseOverMean(all), all.unreached, all.hiddenLight, all.lostLight);
        if (options.frames > 1) more += fmt::format(",\"kept\":{:.4g}", all.kept);
        if (cuts) more += tessellationJson(*cuts);
        fmt::print(
            "{{\"file\":{},\"width\":{},\"height\":{},\"frames\":{},\"spp\":{:.6g},\"seconds\":{:.6f},\"instances\":{},"
            "\"triangles\":{},\"missing\":{:.4g}{}}}\n",
            jsonString(options.out), settings.width, settings.height, options.frames, all.samples, all.seconds,
            content.instances, content.triangles, all.missing, more);
        return;
    }
    const std::string& integrator = options.picture.integrator;
    const bool drawn = integrator == "raster" || integrator == "hybrid";
    fmt::print("{}: {} x {}, {} frame{}, {:.2f} s of {}{}\n", options.out, settings.width, settings.height,
               options.frames, options.frames == 1 ? "" : "s", all.seconds,
               integrator == "raster" ? "drawing"
               : drawn                ? "drawing and tracing"
                                      : "tracing",
               options.frames == 1 || drawn ? "" : keptText(all.kept));
    if (budget)
        fmt::print("--integrator {} --spp {:.0f}: error {:.2g} of the mean (expected: {:.2g}), {:.2g} CPU-s of {}\n",
                   budget->path ? "path" : "whitted", all.samples, budget->error(all), budget->expected,
                   budget->cpuSeconds, options.budget);
    else if (settings.error > 0)
        fmt::print("error {:.2g} (asked: {:g}), noise {:.2g} of the mean, with {:.0f} samples a pixel\n", all.error,
                   settings.error, noiseOverMean(all), all.samples);
}

/// Adds the figures of one frame to those of all.
void addFrame(RenderStats& all, const RenderStats& frame, int frames) {
    all.seconds += frame.seconds;
    all.missing = std::max(all.missing, frame.missing);
    all.error = std::max(all.error, frame.error), all.unreached = std::max(all.unreached, frame.unreached);
    all.hiddenLight = std::max(all.hiddenLight, frame.hiddenLight);
    all.lostLight = std::max(all.lostLight, frame.lostLight);
    if (noiseOverMean(frame) >= noiseOverMean(all)) all.noise = frame.noise, all.mean = frame.mean;
    all.samples += frame.samples / frames, all.kept += frame.kept / frames;
}

/// Pictures in a row, and tiles, say what they were made of; null for others.
std::function<PictureNotes()> notesOf(const RenderArguments& options, const ImageOptions& image, RunningScene& running,
                                      std::string session) {
    const PictureFiles files(options.out, options.fps);
    const bool inRow = files.takesSeveral() && !files.together();
    if (!inRow && options.picture.tile.empty()) return {};
    std::string how =
        fmt::format("{},hybrid={},layers={},fps={}",
                    pictureSettings(image, options.picture.toneMap(), options.picture.tessellationError()),
                    options.picture.integrator == "hybrid", image.settings.layers, options.fps);
    return [&running, session = std::move(session), how = std::move(how)] {
        const Scene& scene = running.scene();
        return Provenance::ofHere(session, how, fmt::format("{} {}", scene.sequence(), scene.hash().hex())).notes();
    };
}

/// Chooses the settings for --budget, if it is given.
Result<std::optional<BudgetReport>> applyBudget(const RenderArguments& options, PictureMaker& maker,
                                                ImageOptions& image) {
    if (options.budget.empty()) return std::nullopt;
    auto chosen = maker.chooseFor(image, options.budgetSeconds());
    if (!chosen) return std::unexpected(chosen.error());
    image = chosen->best;
    BudgetReport report{chosen->expectedError, 0, image.settings.integrator == Integrator::path};
    // Then the picture says which error it has reached.
    if (report.path) image.settings.error = 1e-6F;
    return report;
}

std::string interruptedText(const RenderArguments& options, int written) {
    return written == 0 ? fmt::format("interrupted: {} was not written", options.out)
                        : fmt::format("interrupted: {} of {} frames were written", written, options.frames);
}

void printFound(const RenderArguments& options, const SharedWorld& world, const PictureMaker& maker) {
    Diagnostics found = world.diagnostics();
    found.append(maker.diagnostics());
    found.setFile(options.scene);
    print(found);
}

int render(RenderArguments options) {
    checkBudget(options);
    if (auto ok = takePlan(options); !ok) return printError(ok.error()), kBad;
    options.out = options.picture.fileOf(options.out);
    ImageOptions image = options.picture.parse(true);
    (void)options.picture.tessellationError();  // throws
    image.settings.layers = parseLayers(options.layers);
    addEye(options, image);
    PictureArguments::checkSize(options.out, image);
    image.keep = options.frames > 1;
    const std::string extension = std::filesystem::path(options.out).extension();
    if (image.settings.layers != 0 && extension != ".exr" && extension != ".EXR")
        throw UsageError("--layers", "only .exr holds layers");
    AnimationOptions animation;
    animation.frames = options.frames;
    animation.framesPerSecond = options.fps;
    const double time = parseMoment(options.time, options.start.seconds());
    const std::filesystem::path out(options.out);
    if (options.frames > 1 && !PictureFiles(out, options.fps).takesSeveral())
        throw UsageError("-o", "several frames need a .mp4 or .gif, or a place for their number such as %04d");

    const std::vector<OutputName> outputs{{"-o", options.out, OutputKind::picture}};
    if (auto ok = checkFiles({options.scene}, outputs, false); !ok) return printError(ok.error()), kBad;

    RunningScene running(options.scene, options.resources.ofFile(options.scene), options.start.options(),
                         programContext());
    if (!running.load()) return kBad;
    const std::string session = running.scene().hash().hex();
    if (auto ok = refusingUsage(running.inject(options.set, time + (options.frames - 1) / options.fps)); !ok)
        return printError(ok.error()), kUsage;
    keepResources(running.scene(), running.resources(), outputs);
    if (auto ok = running.world().cut(options.picture.tessellationError()); !ok) return printError(ok.error()), kBad;
    // No picture is made of the frame before the first one, but its state is needed to know what has moved since.
    const double before = time - 1 / options.fps;
    const bool remembers = (image.settings.shutter > 0 || (image.settings.layers & kMotion)) && before >= 0;
    // Geometry is made from the first state that is seen, as earlier ones are not drawn.
    running.runTo(remembers ? before : time);
    SharedWorld& world = running.world().get();
    PictureMaker maker(world, running.resources(), options.picture.integrator);
    if (remembers) {
        if (auto ok = maker.remember(image); !ok) return printError(ok.error()), kBad;
        running.runTo(time);
    }
    animation.start = running.start() + time;
    animation.runTo = [&](double t) { running.frameAt(t); };
    maker.addNotes(notesOf(options, image, running, session));
    const double cpu = static_cast<double>(std::clock());
    auto budget = applyBudget(options, maker, image);
    if (!budget) return printError(interrupted() ? interruptedText(options, 0) : budget.error().text), kBad;
    const Progress progress = progressBar("rendering " + options.out);
    int finished = 0;
    animation.progress = [&](int done) {
        finished = done;
        return !interrupted();
    };
    image.settings.progress = [&](double fraction) {
        if (progress)
            progress(static_cast<std::uint64_t>((finished + std::min(fraction, 1.0)) / options.frames * 1e6),
                     1'000'000);
        return !interrupted();
    };
    RenderStats all;
    animation.stats = [&](const RenderStats& stats) { addFrame(all, stats, options.frames); };
    const auto written = maker.write(options.out, image, animation, options.picture.toneMap());
    if (progress) progress(1, 1);
    running.reportDiagnostics();
    printFound(options, world, maker);
    if (!written) return printError(written.error()), kBad;
    if (*written < options.frames) return printError(interruptedText(options, *written)), kBad;
    if (*budget) (*budget)->cpuSeconds = (static_cast<double>(std::clock()) - cpu) / CLOCKS_PER_SEC;
    reportResult(options, image.settings, all, maker.content(), running.world().cuts(), *budget);
    // A budget asks for no error: it reports the one that was reached.
    if (const std::string missing = missingError(options.picture.error, all.error, all.unreached);
        !*budget && !missing.empty())
        return printError("missing: " + missing), kBad;
    return kDone;
}

}  // namespace

Verb addRender(Command& program) {
    auto options = std::make_shared<RenderArguments>();
    Command* command = program.addVerb("render", "Make a picture or an animation");
    command->addOption("SCENE", options->scene, "scene file, or -")->required();
    command->addOption("-o,--output", options->out, "file to write; .exr is linear radiance")->required();
    command->addOption("--time", options->time, "time of the first frame, from the start")->preset();
    command->addOption("--frames", options->frames, "number of frames: into %04d, a .mp4 or .gif")
        ->preset()
        ->range(1, 1'000'000);
    command->addOption("--fps", options->fps, "frames a second")->preset()->range(1e-3, 1e4);
    command->addOption(
        "--set", options->set,
        "inject an event, as in rtsg run: DEF.field=VALUE@TIME; or pointer=, key=, text=, wheel=, head=");
    options->start.addTo(*command);
    command->addFlag("--json", options->json, "a summary as JSON");
    command->addOption("--plan", options->plan, "settings that rtsg advise --plan found; what is typed counts more");
    command->addOption(
        "--budget", options->budget,
        "CPU time of all threads for a picture, such as 2s: takes the integrator and samples with the smallest error");
    {
        const Command::Section section(*command, "Pictures");
        command->addOption(
            "--layers", options->layers,
            "of an .exr, besides colour: depth, position, normal, albedo, node (numbers of Shapes), names "
            "(Cryptomatte of DEF), motion (pixels to where it was 1/--fps s before), by commas; or all");
        command->addFlag("--panorama", options->panorama, "a panorama: longitudes across, latitudes down");
        command
            ->addOption("--stereo", options->stereo, "two eyes' pictures, each of --size: beside or above each other")
            ->preset()
            ->oneOf({"none", "beside", "above"});
        command->addOption("--eye-distance", options->eyeDistance, "for --stereo: distance of the eyes, metres")
            ->preset()
            ->range(1e-6, 1e6);
        command->addOption("--aperture", options->aperture, "a lens of this diameter, metres; sharp at --focus")
            ->range(1e-9, 1e6);
        command
            ->addOption("--focus", options->focus,
                        "metres along the view; for --stereo: the distance of the picture's plane")
            ->range(1e-6, 1e9);
        options->picture.addTo(*command);
        options->picture.addTileTo(*command);
    }
    options->resources.addTo(*command);
    command->footer("Example: rtsg render hall.x3dv -o hall.png --size 960x540 --time 2.5s --spp 16");
    return {command, [command, options]() -> int {
                options->typed = command->given();
                return render(*options);
            }};
}

}  // namespace rtsg::app
