// rtsg render: a picture or an animation of a scene.
#include <algorithm>
#include <filesystem>
#include <memory>

#include <fmt/format.h>

#include "files.h"
#include "outputs.h"
#include "running_scene.h"

namespace rtsg::app {

namespace {

struct Options {
    std::string scene, out, time = "0";
    ResourceArguments resources;
    StartTime start;
    int frames = 1;
    double fps = 25;
    PictureArguments picture;
    bool json = false;
};

int render(const Options& options) {
    ImageOptions image = options.picture.parse();
    AnimationOptions animation;
    animation.frames = options.frames;
    animation.framesPerSecond = options.fps;
    const double time = parseSeconds(options.time);
    const std::filesystem::path out(options.out);
    if (options.frames > 1 && out.extension() != ".gif" && !numberedName(out.filename().string(), 0))
        throw UsageError("-o", "several frames need a .gif, or a place for their number such as %04d");

    const std::vector<OutputName> outputs{{"-o", options.out, OutputKind::picture}};
    if (auto ok = checkFiles({options.scene}, outputs, false); !ok) return printError(ok.error()), kBad;

    RunningScene running(options.scene, options.resources, options.start);
    if (!running.load()) return kBad;
    keepResources(running.scene(), running.resources(), outputs);
    SharedWorld world(running.scene(), worldOptions(running.resources()));
    LightRenderer light(world, LightRenderer::Options(running.resources()));
    running.runTo(time);
    animation.start = running.start() + time;
    animation.runTo = [&](double t) { running.frameAt(t); };
    const Progress progress = progressBar("rendering " + options.out);
    int finished = 0;
    animation.progress = [&](int done) {
        finished = done;
        return !interrupted();
    };
    image.settings.progress = [&](double share) {
        if (progress)
            progress(static_cast<std::uint64_t>((finished + std::min(share, 1.0)) / options.frames * 1e6), 1'000'000);
        return !interrupted();
    };
    double seconds = 0, missing = 0;
    animation.stats = [&](const RenderStats& stats) {
        seconds += stats.seconds;
        missing = std::max(missing, stats.missing);
    };
    const auto written = renderToFile(light, out, image, animation, options.picture.toneMap());
    if (progress) progress(1, 1);
    running.printDiagnostics();
    Diagnostics found = world.diagnostics();
    found.append(light.diagnostics());
    found.setFile(options.scene);
    print(found);
    if (!written) return printError(written.error()), kBad;
    if (*written < options.frames) {
        printError(*written == 0 ? fmt::format("interrupted: {} was not written", options.out)
                                 : fmt::format("interrupted: {} of {} frames were written", *written, options.frames));
        return kBad;
    }
    const RayWorld::Stats rays = world.rays().stats();
    if (options.json)
        fmt::print(
            "{{\"file\":{},\"width\":{},\"height\":{},\"frames\":{},\"spp\":{},\"seconds\":{:.6f},\"instances\":{},"
            "\"triangles\":{},\"missing\":{:.4g}}}\n",
            jsonString(options.out), image.settings.width, image.settings.height, options.frames,
            image.settings.samplesPerPixel, seconds, rays.traced, rays.instancedTriangles, missing);
    else
        fmt::print("{}: {} x {}, {} frame{}, {:.2f} s of tracing\n", options.out, image.settings.width,
                   image.settings.height, options.frames, options.frames == 1 ? "" : "s", seconds);
    return kDone;
}

}  // namespace

Verb addRender(Command& program) {
    auto options = std::make_shared<Options>();
    Command* command = program.addVerb("render", "Make a picture or an animation");
    command->addOption("SCENE", options->scene, "scene file, or -")->required();
    command->addOption("-o,--output", options->out, "file to write; .exr is linear radiance")->required();
    command->addOption("--time", options->time, "of the first frame, from the start")->preset();
    command->addOption("--frames", options->frames, "number of frames: into %04d, or a .gif")
        ->preset()
        ->range(1, 1'000'000);
    command->addOption("--fps", options->fps, "frames a second")->preset()->range(1e-3, 1e4);
    options->start.addTo(*command);
    options->resources.addTo(*command);
    options->picture.addTo(*command);
    command->addFlag("--json", options->json, "what was done, as JSON");
    command->footer("Example: rtsg render hall.x3dv -o hall.png --size 960x540 --time 2.5s --spp 16");
    return {command, [options] { return render(*options); }};
}

}  // namespace rtsg::app
