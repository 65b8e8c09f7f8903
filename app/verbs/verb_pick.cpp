// rtsg pick: finds what a ray, a point or a moving ball meets in a scene.
#include <memory>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <rtsg/core/terminal.h>
#include <rtsg/renderers/light_renderer.h>
#include <rtsg/renderers/picking.h>
#include <rtsg/renderers/shared_world.h>
#include <rtsg/session/output_maker.h>
#include <rtsg/session/running_scene.h>

#include "cli.h"
#include "command.h"
#include "output_arguments.h"
#include "start_time.h"

namespace rtsg::app {

namespace {

struct PickArguments {
    std::string scene, time = "0s";
    std::vector<double> ray, point, sweep, pixel;
    std::string size = "1280x720", viewpoint;
    ResourceArguments resources;
    StartTime start;
    bool json = false;
};

void printPick(const Scene& scene, const Pick& pick, bool json) {
    if (!pick) {
        fmt::print("{}\n", json ? "{\"hit\":false}" : "nothing there");
        return;
    }
    std::vector<std::string> path;
    for (const NodeId node : pick.path) path.push_back(labelOf(scene, node));
    if (!json) {
        fmt::print(
            "{} at {:.9g} m\n  point    {:.9g} {:.9g} {:.9g}\n  normal   {:.6g} {:.6g} {:.6g}\n  texture  {:.6g} "
            "{:.6g}\n",
            terminalText(fmt::format("{}", fmt::join(path, " / "))), pick.distance, pick.point.x, pick.point.y,
            pick.point.z, pick.normal.x, pick.normal.y, pick.normal.z, pick.texCoord.x, pick.texCoord.y);
        return;
    }
    for (std::string& name : path) name = jsonString(name);
    fmt::print(
        "{{\"hit\":true,\"path\":[{}],\"distance_m\":{},\"point\":[{},{},{}],\"normal\":[{},{},{}],"
        "\"texture\":[{},{}],\"triangle\":{}}}\n",
        fmt::join(path, ","), pick.distance, pick.point.x, pick.point.y, pick.point.z, pick.normal.x, pick.normal.y,
        pick.normal.z, pick.texCoord.x, pick.texCoord.y, pick.triangle);
}

int runPick(const PickArguments& options) {
    if (options.ray.empty() + options.point.empty() + options.sweep.empty() + options.pixel.empty() != 3) {
        printError("one of --ray, --point, --sweep and --pixel is needed");
        return kUsage;
    }
    const auto [width, height] = PictureSize::parse(options.size);
    if (const auto& at = options.pixel; !at.empty() && (at[0] < 0 || at[1] < 0 || at[0] >= width || at[1] >= height))
        throw UsageError("--pixel", fmt::format("{} {} is outside a picture of {} x {}: --size sets its size", at[0],
                                                at[1], width, height));
    const double time = parseMoment(options.time, options.start.seconds());
    RunningScene running(options.scene, options.resources.ofFile(options.scene), options.start.options(),
                         programContext());
    if (!running.load()) return kBad;
    running.runTo(time);
    running.reportDiagnostics();
    SharedWorld& world = running.world().get();
    const Picker picker(world.rays(), world.flattener());
    app::print(world.diagnostics());
    const auto at = [](const std::vector<double>& numbers, std::size_t first) {
        return Vec3d(numbers[first], numbers[first + 1], numbers[first + 2]);
    };
    const auto inPicture = [&]() -> Result<Pick> {
        LightRenderer light(world, LightRenderer::Options(running.resources()));
        const LightTracer& tracer = light.tracer();
        const auto camera = tracer.camera(world.rays(), static_cast<double>(width) / height, options.viewpoint);
        if (!camera) return std::unexpected(camera.error());
        const auto views = tracer.layers(world.rays(), *camera, width, height);
        if (auto ok =
                world.setViewer(EyePosition(camera->position, camera->up), LightTracer::sights(views, width, height));
            !ok)
            return std::unexpected(ok.error());
        return tracer.pick(picker, world.rays(), views, options.pixel[0], options.pixel[1]);
    };
    const auto pick = !options.pixel.empty() ? inPicture()
                      : !options.ray.empty() ? picker.ray(at(options.ray, 0), at(options.ray, 3))
                      : !options.point.empty()
                          ? picker.closest(at(options.point, 0))
                          : picker.sweep(at(options.sweep, 0), options.sweep[3], at(options.sweep, 4));
    if (!pick) return printError(pick.error()), kUsage;
    printPick(running.scene(), *pick, options.json);
    return kDone;
}

}  // namespace

Verb addPick(Command& program) {
    auto options = std::make_shared<PickArguments>();
    Command* command =
        program.addVerb("pick", "Find what a ray meets, what is nearest to a point, where a moving ball stops");
    command->addOption("SCENE", options->scene, "scene file, or -")->required();
    command->addOption("--ray", options->ray, "origin and direction: X Y Z DX DY DZ")->expected(6);
    command->addOption("--point", options->point, "nearest surface to X Y Z")->expected(3);
    command->addOption("--sweep", options->sweep, "ball at X Y Z of radius R moved by DX DY DZ")->expected(7);
    command
        ->addOption("--pixel", options->pixel,
                    "the surface at X Y in a picture, in pixels from the left and the top, through all layers")
        ->expected(2);
    command->addOption("--size", options->size, "of that picture")->preset();
    command->addOption("--viewpoint", options->viewpoint, "viewpoint of that picture: name or description");
    command->addOption("--time", options->time, "run the scene so long")->preset();
    options->start.addTo(*command);
    options->resources.addTo(*command);
    command->addFlag("--json", options->json, "one JSON object");
    command->footer("Example: rtsg pick hall.x3dv --ray 0 1.6 10 0 0 -1");
    return {command, [options] { return runPick(*options); }};
}

}  // namespace rtsg::app
