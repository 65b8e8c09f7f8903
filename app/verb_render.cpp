#include <cmath>
#include <memory>

#include <fmt/format.h>

#include <rtsg/renderers/image.h>

#include "cli.h"

namespace rtsg::app {

namespace {

struct Options {
    std::string scene, out, size = "1280x720", time = "0s", viewpoint, integrator = "whitted", shadows = "all";
    int spp = 4, frames = 1, depth = 8;
    unsigned threads = 0;
    std::uint64_t seed = 1;
    double fps = 25, exposure = 1;
    bool json = false;
};

/// "1280x720"
bool parseSize(const std::string& text, int& width, int& height) {
    std::size_t used = 0, rest = 0;
    const auto x = text.find('x');
    if (x == std::string::npos || x == 0 || x > 6 || text.size() - x > 7) return false;
    try {
        width = std::stoi(text.substr(0, x), &used);
        height = std::stoi(text.substr(x + 1), &rest);
    } catch (const std::exception&) {
        return false;
    }
    return used == x && x + 1 + rest == text.size() && width > 0 && height > 0;
}

int run(const Options& options) {
    ImageOptions image;
    image.viewpoint = options.viewpoint;
    image.integrator = options.integrator == "path"     ? Integrator::path
                       : options.integrator == "raster" ? Integrator::raster
                                                        : Integrator::whitted;
    RenderSettings& settings = image.settings;
    if (!parseSize(options.size, settings.width, settings.height))
        return printError(options.size + ": expected WIDTHxHEIGHT such as 1280x720"), kUsage;
    settings.samplesPerPixel = options.spp;
    settings.maxDepth = options.depth;
    settings.threads = options.threads;
    settings.seed = options.seed;
    settings.shadows = options.shadows == "none"       ? Shadows::none
                       : options.shadows == "authored" ? Shadows::authored
                                                       : Shadows::all;
    AnimationOptions animation;
    animation.frames = options.frames;
    animation.framesPerSecond = options.fps;
    animation.start = parseSeconds(options.time);

    Scene scene;
    Diagnostics diagnostics(options.scene);
    if (!load(scene, options.scene, diagnostics)) return kBad;
    Imager::Options imagerOptions;
    if (options.scene != "-") imagerOptions.folder = std::filesystem::path(options.scene).parent_path();
    Imager imager(scene, std::move(imagerOptions));
    if (animation.start > 0) scene.newFrame(0);  // what starts at 0 has then started

    const Progress progress = progressBar("rendering " + options.scene);
    double seconds = 0;
    int done = 0;
    if (progress && options.frames == 1)
        settings.progress = [&](double share) {
            return progress(static_cast<std::uint64_t>(share * 1000), 1000), true;
        };
    animation.progress = [&](int frame) {
        if (progress) progress(static_cast<std::uint64_t>(frame), static_cast<std::uint64_t>(options.frames));
        done = frame;
        return true;
    };
    animation.stats = [&](const RenderStats& stats) { seconds += stats.seconds; };
    const auto written =
        renderToFile(scene, imager, options.out, image, animation, ToneMap{static_cast<float>(options.exposure)});
    Diagnostics all = imager.diagnostics();
    all.setFile(options.scene);
    print(all);
    if (!written)
        return printError((written.error().file.empty() ? "" : written.error().file + ": ") + written.error().text),
               kBad;
    const RayWorld::Stats world = imager.world().stats();
    if (options.json)
        fmt::print(
            "{{\"file\":{},\"width\":{},\"height\":{},\"frames\":{},\"seconds\":{:.6f},\"instances\":{},\"triangles\":{"
            "}}}\n",
            jsonString(options.out), settings.width, settings.height, done, seconds, world.traced,
            world.instancedTriangles);
    else
        fmt::print("{}: {} x {}, {} frame{}, {:.2f} s of tracing\n", options.out, settings.width, settings.height, done,
                   done == 1 ? "" : "s", seconds);
    return kDone;
}

}  // namespace

Verb addRender(CLI::App& program) {
    auto options = std::make_shared<Options>();
    CLI::App* command = program.add_subcommand("render", "Trace pictures of a scene");
    command->add_option("SCENE", options->scene, "scene file, or -")->required();
    command
        ->add_option("-o,--output", options->out,
                     "picture: .png .jpg .gif ... tone-mapped, .exr linear; %04d numbers frames")
        ->required();
    command->add_option("--size", options->size, "WIDTHxHEIGHT in pixels")->capture_default_str();
    command->add_option("--time", options->time, "scene time of the (first) picture, such as 1.5s")
        ->capture_default_str();
    command->add_option("--viewpoint", options->viewpoint, "DEF name or description; default: the bound or first one");
    command->add_option("--integrator", options->integrator, "whitted, path or raster")
        ->capture_default_str()
        ->check(CLI::IsMember({"whitted", "path", "raster"}));
    command->add_option("--spp", options->spp, "samples per pixel")
        ->capture_default_str()
        ->check(CLI::Range(1, 1 << 20));
    command->add_option("--frames", options->frames, "pictures of an animation")
        ->capture_default_str()
        ->check(CLI::Range(1, 1000000));
    command->add_option("--fps", options->fps, "frames a second of an animation")
        ->capture_default_str()
        ->check(CLI::Range(1e-3, 1e6));
    command->add_option("--shadows", options->shadows, "all: every light casts them; authored: as its field says; none")
        ->capture_default_str()
        ->check(CLI::IsMember({"all", "authored", "none"}));
    command->add_option("--depth", options->depth, "mirrorings and refractions along one path")
        ->capture_default_str()
        ->check(CLI::Range(0, 250));
    command->add_option("--exposure", options->exposure, "factor before tone mapping")
        ->capture_default_str()
        ->check(CLI::Range(1e-6, 1e6));
    command->add_option("--seed", options->seed, "of the sampling")->capture_default_str();
    command->add_option("--threads", options->threads, "0: as many as cores")->capture_default_str();
    command->add_flag("--json", options->json, "what was done, as JSON");
    command->footer("Example: rtsg render hall.x3dv -o hall.png --size 1280x720 --time 2s --spp 16");
    return {command, [options] { return run(*options); }};
}

}  // namespace rtsg::app
