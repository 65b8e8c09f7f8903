// rtsg render: makes a picture or an animation of a scene.
#include <algorithm>
#include <filesystem>
#include <memory>

#include <fmt/format.h>

#include <rtsg/ogre/ogre_renderer.h>
#include <rtsg/session/output_maker.h>
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
    bool json = false;
};

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
    Result<> remember(const ImageOptions& image) { return light_ ? light_->remember(image) : Result<>(); }
    Result<int> write(const std::string& file, const ImageOptions& image, const AnimationOptions& animation,
                      const ToneMap& toneMap) {
        if (light_) return renderToFile(*light_, file, image, animation, toneMap);
        const auto next = [&](RenderStats& stats) {
            return traces_ ? raster_->hybridPicture(image, &stats) : raster_->nextPicture(image, &stats);
        };
        return renderToFile(world_.scene(), next, file, image, animation, toneMap);
    }
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
};

/// `all` has, over all frames, the largest missing light, error and noise, and the means of samples and kept pixels.
void reportResult(const RenderArguments& options, const RenderSettings& settings, const RenderStats& all,
                  const Content& content, const std::optional<Flattener::Cuts>& cuts) {
    if (const auto warning = hiddenLightWarning(options.scene, all.hiddenLight)) say(*warning);
    if (options.json) {
        std::string more;
        if (settings.error > 0)
            more =
                fmt::format(",\"error\":{:.4g},\"rms_over_mean\":{:.4g},\"unreached\":{:.4g},\"hidden_light\":{:.4g}",
                            all.error, noiseOverMean(all), all.unreached, all.hiddenLight);
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
    if (settings.error > 0)
        fmt::print("error {:.2g} (asked: {:g}), noise {:.2g} of the mean, with {:.0f} samples a pixel\n", all.error,
                   settings.error, noiseOverMean(all), all.samples);
    if (const auto warning = hiddenLightWarning(options.scene, all.hiddenLight)) say(*warning);
}

/// Adds the figures of one frame to those of all.
void addFrame(RenderStats& all, const RenderStats& frame, int frames) {
    all.seconds += frame.seconds;
    all.missing = std::max(all.missing, frame.missing);
    all.error = std::max(all.error, frame.error), all.unreached = std::max(all.unreached, frame.unreached);
    all.hiddenLight = std::max(all.hiddenLight, frame.hiddenLight);
    if (noiseOverMean(frame) >= noiseOverMean(all)) all.noise = frame.noise, all.mean = frame.mean;
    all.samples += frame.samples / frames, all.kept += frame.kept / frames;
}

int render(RenderArguments options) {
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
    Diagnostics found = world.diagnostics();
    found.append(maker.diagnostics());
    found.setFile(options.scene);
    print(found);
    if (!written) return printError(written.error()), kBad;
    if (*written < options.frames) {
        printError(*written == 0 ? fmt::format("interrupted: {} was not written", options.out)
                                 : fmt::format("interrupted: {} of {} frames were written", *written, options.frames));
        return kBad;
    }
    reportResult(options, image.settings, all, maker.content(), running.world().cuts());
    if (const std::string missing = missingError(options.picture.error, all.error, all.unreached); !missing.empty())
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
    return {command, [options] { return render(*options); }};
}

}  // namespace rtsg::app
