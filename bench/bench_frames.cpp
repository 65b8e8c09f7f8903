// Follows a bench scene frame by frame as several methods do, with the least time that any could take beside them.
#include "bench_frames.h"

#include <algorithm>
#include <fstream>
#include <iterator>

#include <fmt/format.h>
#include <unistd.h>

#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/renderers/image.h>
#include <rtsg/renderers/parallel_for.h>

#include "bare_embree.h"
#include "bench/scenes/scenes.h"
#include "frame_rays.h"
#include "world/full_traversal.h"

namespace rtsg::bench {

namespace {

constexpr int kFrameWidth = 640, kFrameHeight = 480;  // of whole frames

/// Removed with everything in it.
struct Folder {
    std::filesystem::path path = std::filesystem::temp_directory_path() / fmt::format("rtsg-bench-frames-{}", getpid());
    ~Folder() {
        std::error_code ignored;
        std::filesystem::remove_all(path, ignored);
    }
};

struct Samples {
    std::vector<double> sceneWork, flatten, traversal, fullUpdate, minimum;
    std::array<std::vector<double>, 3> update;
};

/// The competitors: what follows the scene when it is polled.
struct Contest {
    LightTracer tracer;
    std::array<std::unique_ptr<SharedWorld>, 3> worlds;  // the first has the tracer on it
    bool merged;
    FullTraversalRenderer full{RayWorld::Options{.buildThreads = 1}};

    /// Without `merged` where a flat copy of everything is out of the question.
    Contest(std::filesystem::path folder, bool withMerged) : tracer(std::move(folder)), merged(withMerged) {}
    Result<> attach(Scene& scene) {
        for (std::size_t i = 0; i < kMappings.size(); ++i) {
            if (!merged && kMappings[i] == RayWorld::Mapping::merged) continue;
            worlds[i] = std::make_unique<SharedWorld>(
                scene, SharedWorld::Options{.flattening = {},
                                            .rays = {.mapping = kMappings[i], .buildThreads = 1},
                                            .delivery = Delivery::polled,
                                            .timed = true});
            (void)worlds[i]->rays();
        }
        worlds[0]->add(tracer);
        return full.attachToScene(scene);
    }
    /// Whether anything had happened.
    bool catchUp() {
        bool any = false;
        for (std::size_t i = 0; i < worlds.size(); ++i) any = (worlds[i] && poll(i)) || any;
        return any;
    }
    bool poll(std::size_t i) {
        const std::uint64_t before = worlds[i]->counts().deliveries;
        return worlds[i]->update() && worlds[i]->counts().deliveries != before;
    }
    const RayWorld& world(std::size_t i) const { return worlds[i]->rays(); }
};

class Measurement {
  public:
    Measurement(const FrameOptions& options, FrameFigures& figures) : options_(options), figures_(figures) {}

    Result<> load(const std::filesystem::path& file);
    Result<> firstPicture(const std::filesystem::path& folder);
    Result<> wholeFrames();
    Result<> frames();

  private:
    double newFrame();
    void follow(Contest& contest, std::size_t mapping, int frames, SmallestUpdate* minimum, Samples& out);
    Result<> traverse(Contest& contest, int frames, Samples& out);
    void trace(const Contest& contest);

    const FrameOptions& options_;
    FrameFigures& figures_;
    std::unique_ptr<Scene> scene_;
    std::filesystem::path folder_;
    double before_ = residentBytes();
    RenderStats frameRays_;  // of a whole frame
    const unsigned cores_ = availableThreads();
};

Result<> Measurement::load(const std::filesystem::path& file) {
    folder_ = file.parent_path();
    figures_.fileBytes = static_cast<double>(std::filesystem::file_size(file));
    std::vector<double> ours, limit;
    const int runs = figures_.fileBytes > 5e7 ? 1 : 3;
    for (int i = 0; i < runs; ++i) {
        {
            std::ifstream in(file, std::ios::binary);
            limit.push_back(fromCharsSeconds({std::istreambuf_iterator<char>(in), {}}));
        }
        scene_ = std::make_unique<Scene>();
        Diagnostics diagnostics(file.string());
        const double start = cpuSeconds();
        if (!loadFile(*scene_, file, diagnostics)) return fail("nothing usable in it", {}, file.string());
        ours.push_back(cpuSeconds() - start);
        figures_.errors = diagnostics.errors() + diagnostics.warnings();
        if (figures_.errors > 0 && !diagnostics.all().empty()) return std::unexpected(diagnostics.all().front());
    }
    figures_.load = median(ours);
    figures_.loadLimit = median(limit);
    figures_.nodes = scene_->nodeCount();
    figures_.rssLoaded = residentBytes() - before_;
    return {};
}

Result<> Measurement::firstPicture(const std::filesystem::path& folder) {
    const double start = cpuSeconds();
    scene_->newFrame(0);
    SharedWorld world(*scene_, {.flattening = {}, .rays = {.buildThreads = 1}});
    LightRenderer light(world, LightRenderer::Options(folder));
    ImageOptions image;
    image.settings.width = options_.width;
    image.settings.height = options_.height;
    image.settings.threads = 1;
    if (const auto picture = light.picture(image); !picture) return std::unexpected(picture.error());
    figures_.firstPicture = cpuSeconds() - start;
    figures_.rssPicture = residentBytes() - before_;
    return {};
}

/// The pictures of somebody who walks: the eye moves, so that no pixel of the last picture can be reused.
Result<> Measurement::wholeFrames() {
    constexpr int kFrames = 9;
    NodeId eye;
    scene_->forEachNode([&](const Node& node) {
        if (!eye && node.is(x3d::Viewpoint::type)) eye = node.id();
    });
    if (!eye) return fail("it has no viewpoint");
    SharedWorld world(*scene_);
    LightRenderer light(world, LightRenderer::Options(folder_));
    ImageOptions image;
    image.settings.width = kFrameWidth;
    image.settings.height = kFrameHeight;
    image.settings.samplesPerPixel = 1;
    std::vector<double> seconds, ofCpu;
    for (int i = 0; i < kFrames; ++i) {
        const Vec3f at = scene_->node(eye).get(x3d::Viewpoint::position);
        if (auto ok = scene_->set(eye, x3d::Viewpoint::position, at + Vec3f(.01f, 0, .01f)); !ok) return ok;
        const double start = wallSeconds(), cpu = cpuSeconds();
        scene_->newFrame(scene_->now() + 1.0 / 60);
        if (const auto picture = light.picture(image, &frameRays_); !picture) return std::unexpected(picture.error());
        seconds.push_back(wallSeconds() - start), ofCpu.push_back(cpuSeconds() - cpu);
    }
    figures_.wholeFrame = median(seconds), figures_.wholeFrameCpu = median(ofCpu) / cores_;
    return {};
}

double Measurement::newFrame() {
    const double start = threadSeconds();
    scene_->newFrame(scene_->now() + 1.0 / 60);
    return threadSeconds() - start - cpuClockSeconds();
}

void Measurement::follow(Contest& contest, std::size_t mapping, int frames, SmallestUpdate* minimum, Samples& out) {
    SharedWorld& world = *contest.worlds[mapping];
    contest.poll(mapping);  // what went by while others were measured
    for (int i = 0; i < frames; ++i) {
        const double work = newFrame();
        const bool changed = contest.poll(mapping);
        if (mapping == 0) out.sceneWork.push_back(work);
        if (mapping == 0)
            out.flatten.push_back(changed ? std::max(0., world.times().flattening - cpuClockSeconds()) : 0);
        out.update[mapping].push_back(changed ? std::max(0., world.times().rays - cpuClockSeconds()) : 0);
        if (changed && minimum) out.minimum.push_back(minimum->follow(world.rays(), world.delta()));
    }
}

Result<> Measurement::traverse(Contest& contest, int frames, Samples& out) {
    for (int i = 0; i < frames; ++i) {
        newFrame();
        const double start = threadSeconds(), wall = wallSeconds();
        if (auto ok = contest.full.renderFrame(); !ok) return ok;
        const double all = threadSeconds() - start;
        const double fraction = contest.full.stats().traverseSeconds / std::max(1e-9, wallSeconds() - wall);
        out.traversal.push_back(all * std::min(1.0, fraction));
        out.fullUpdate.push_back(all);
    }
    return {};
}

void Measurement::trace(const Contest& contest) {
    const RayWorld& first = contest.world(0);
    const auto camera = contest.tracer.camera(first, static_cast<double>(options_.width) / options_.height);
    if (!camera) return;
    const ViewRays rays(first, *camera, options_.width, options_.height);
    std::unique_ptr<FlatScene> flat;
    if (figures_.triangles <= options_.flatTriangles) flat = std::make_unique<FlatScene>(first);
    std::array<std::vector<double>, 3> ours;
    std::vector<double> bare;
    for (int run = 0; run < 5; ++run) {
        for (std::size_t i = 0; i < 3; ++i)
            if (contest.worlds[i]) ours[i].push_back(rays.trace(contest.world(i)));
        if (flat) bare.push_back(rays.trace(*flat));
    }
    const std::vector<float> reference = flat ? rays.distances(*flat) : rays.distances(first);
    for (std::size_t i = 0; i < 3; ++i) {
        figures_.trace[i] = median(ours[i]);
        if (contest.worlds[i]) figures_.differing[i] = differing(rays.distances(contest.world(i)), reference);
    }
    RenderSettings settings;
    settings.width = options_.width, settings.height = options_.height, settings.threads = 1;
    std::vector<double> pictures;
    for (int run = 0; run < 2; ++run) {
        const double start = cpuSeconds();
        if (contest.tracer.render(first, *camera, settings)) pictures.push_back(cpuSeconds() - start);
    }
    figures_.picture = median(pictures);
    if (!flat) return;
    const auto whole = contest.tracer.camera(first, static_cast<double>(kFrameWidth) / kFrameHeight);
    if (!whole) return;
    const FrameRays frame(first, *whole, kFrameWidth, kFrameHeight, lampsOf(*scene_));
    figures_.bareFrame = frame.minSeconds(first, frameRays_) / cores_;
    figures_.flatTrace = median(bare);
    figures_.flatBuild = flat->buildSeconds();
    figures_.flatBytes = static_cast<double>(flat->bvhBytes());
}

Result<> Measurement::frames() {
    Contest contest(folder_, figures_.triangles <= options_.flatTriangles);
    if (auto ok = contest.attach(*scene_); !ok) return ok;
    newFrame();
    contest.catchUp();
    newFrame();
    const bool moving = contest.catchUp();
    const InstanceDelta& delta = contest.worlds[0]->delta();
    if (moving) figures_.moved = delta.moved.size(), figures_.deformed = delta.geometries.size();
    for (std::size_t i = 0; i < 3; ++i)
        if (contest.worlds[i]) figures_.memory[i] = contest.world(i).memory();
    if (figures_.memory[0].instancedTriangles != figures_.triangles)
        return fail(fmt::format("{}: {} triangles written, {} seen", figures_.scene, figures_.triangles,
                                figures_.memory[0].instancedTriangles));
    figures_.uniqueTriangles = figures_.memory[0].triangles;
    figures_.instances = figures_.memory[0].instances;
    std::unique_ptr<SmallestUpdate> minimum;
    if ((figures_.moved > 0 || figures_.deformed > 0) && figures_.triangles <= options_.flatTriangles)
        minimum = std::make_unique<SmallestUpdate>(contest.world(0), delta);
    // In turn, a few frames each, as frames follow each other in use; who takes long gets few.
    Samples samples;
    const double start = cpuSeconds();
    for (int round = 0; round < 20 && (round < 3 || cpuSeconds() - start < options_.budget); ++round) {
        for (std::size_t i = 0; i < 3; ++i) {
            if (!contest.worlds[i]) continue;
            const bool slow = median(samples.update[i]) > options_.budget / 200;
            if (round == 0 || !slow) follow(contest, i, round == 0 ? 2 : 10, i == 0 ? minimum.get() : nullptr, samples);
        }
        const bool slow = median(samples.traversal) > options_.budget / 200;
        if (auto ok = traverse(contest, slow || round == 0 ? 1 : 5, samples); !ok) return ok;
    }
    contest.catchUp();
    minimum.reset();
    trace(contest);
    figures_.sceneWork = median(samples.sceneWork);
    figures_.flatten = median(samples.flatten);
    figures_.fullTraversal = median(samples.traversal);
    figures_.fullUpdate = median(samples.fullUpdate);
    figures_.smallestUpdate = median(samples.minimum);
    for (std::size_t i = 0; i < 3; ++i) figures_.update[i] = median(samples.update[i]);
    return {};
}

/// Frames a second of the paper's ray tracers, the better of the two (tables 1 and 2), on four cores of 2008; 0: not
/// there.
double paperRate(std::string_view scene) {
    constexpr std::pair<std::string_view, double> kRates[] = {
        {"Beetles", 4.1}, {"Venice", 5.6},        {"Conference", 17.4}, {"Conference+teapot", 11.2},
        {"Campus", 4.8},  {"Campus+teapot", 2.9}, {"Kitchen", 1.9},     {"Troopers", 16.7}};
    for (const auto& [name, rate] : kRates)
        if (name == scene) return rate;
    return 0;
}

void reportFrames(const FrameFigures& f, const Report& report) {
    const std::string name = fmt::format("{}, {} triangles", f.scene, f.triangles);
    const auto line = [&](const std::string& metric, const char* unit, double value, const char* baselineName = "",
                          double baseline = 0, const char* limitName = "", double limit = 0) {
        report({"frames", name, metric, unit, value, baselineName, baseline, limitName, limit});
    };
    const bool flat = f.flatTrace > 0;
    line("load", "ms", f.load * 1e3, "", 0, "std::from_chars over the file", f.loadLimit * 1e3);
    line("first picture", "ms", f.firstPicture * 1e3, "", 0, flat ? "building one flat BVH, and its rays" : "",
         (f.flatBuild + f.flatTrace) * 1e3);
    line("scene and bus, per frame", "us", f.sceneWork * 1e6, "full traversal", f.fullTraversal * 1e6);
    line("flattener, per frame", "us", f.flatten * 1e6, "full traversal", f.fullTraversal * 1e6);
    for (std::size_t i = 0; i < 3; ++i) {
        if (f.trace[i] == 0) continue;  // merged, where that is too large
        line(fmt::format("RayWorld's update, {}", kMappingNames[i]), "us", f.update[i] * 1e6,
             "full traversal and its update", f.fullUpdate * 1e6,
             f.smallestUpdate > 0 ? (f.deformed > 0 ? "bare refit" : "bare rtcCommitScene of what moves and the rest")
                                  : "",
             f.smallestUpdate * 1e6);
        line(fmt::format("primary rays, {}", kMappingNames[i]), "ms", f.trace[i] * 1e3, "", 0,
             flat ? "rtcIntersect16, one flat scene" : "", f.flatTrace * 1e3);
        line(fmt::format("rays that hit otherwise, {}", kMappingNames[i]), "ppm", f.differing[i] * 1e6);
        const RayWorld::Memory& m = f.memory[i];
        const double unique = std::max(1.0, static_cast<double>(f.uniqueTriangles));
        line(fmt::format("BVH, copies and instances, {}", kMappingNames[i]), "bytes a triangle",
             static_cast<double>(m.bvhBytes + m.copyBytes + m.instanceBytes) / unique, "", 0,
             flat ? "one flat BVH" : "", f.flatBytes / unique);
    }
    line("picture, Whitted with shadows", "ms", f.picture * 1e3, "", 0, flat ? "rtcIntersect16, primary rays only" : "",
         f.flatTrace * 1e3);
    const auto frameLine = [&](const char* metric, double seconds) {
        line(metric, "1/s", 1 / seconds, paperRate(f.scene) > 0 ? "the paper's best" : "", paperRate(f.scene),
             f.bareFrame > 0 ? "as many rays of each kind through bare Embree, one flat scene" : "",
             f.bareFrame > 0 ? 1 / f.bareFrame : 0);
    };
    frameLine("whole frames of 640x480, Whitted with shadows, one sample, all cores", f.wholeFrame);
    // How far from bare Embree it is, where others are at work on the cores, too.
    frameLine("whole frames of 640x480, Whitted with shadows, one sample, by CPU time", f.wholeFrameCpu);
    const double arrays = static_cast<double>(f.memory[0].sceneBytes + f.memory[0].tessellatedBytes);
    line("arrays of the scene", "bytes a triangle", arrays / std::max(1.0, static_cast<double>(f.uniqueTriangles)), "",
         0, "three indices and half a vertex", 18);
    line("resident, scene loaded", "MB", f.rssLoaded / 1e6, "", 0, "the file", f.fileBytes / 1e6);
    line("resident, first picture made", "MB", f.rssPicture / 1e6, "", 0, "arrays and BVH",
         static_cast<double>(f.memory[0].total()) / 1e6);
}

}  // namespace

Result<FrameFigures> measureFrames(const std::string& scene, const FrameOptions& options) {
    const std::size_t plus = scene.find('+');
    const std::string name = scene.substr(0, plus);
    const bool teapot = plus != std::string::npos;
    if (teapot && scene.substr(plus) != "+teapot") return fail(fmt::format("no scene is called {}", scene));
    const Folder folder;
    const auto written = writeBenchScene(name, options.scale, teapot, folder.path);
    if (!written) return std::unexpected(written.error());
    FrameFigures figures;
    figures.triangles = *written;
    figures.scene = std::string(findBenchScene(name)->name) + (teapot ? "+teapot" : "");
    Measurement measurement(options, figures);
    if (auto ok = measurement.load(folder.path / fmt::format("{}.x3dv", findBenchScene(name)->name)); !ok)
        return std::unexpected(ok.error());
    if (auto ok = measurement.firstPicture(folder.path); !ok) return std::unexpected(ok.error());
    if (auto ok = measurement.wholeFrames(); !ok) return std::unexpected(ok.error());
    if (auto ok = measurement.frames(); !ok) return std::unexpected(ok.error());
    return figures;
}

bool frames(const FrameOptions& options, const Report& report) {
    std::vector<std::string> names = options.scenes;
    if (names.empty())
        for (const SceneInfo& s : benchScenes()) {
            names.emplace_back(s.name);
            if (s.teapotScale > 0) names.push_back(std::string(s.name) + "+teapot");
        }
    bool good = true;
    for (const std::string& name : names) {
        const auto figures = measureFrames(name, options);
        if (!figures) {
            fmt::print(stderr, "{}\n", figures.error().format());
            good = false;
            continue;
        }
        reportFrames(*figures, report);
        // A few rays graze edges, where rounding decides.
        for (const double fraction : figures->differing) good = good && fraction < 1e-3;
    }
    return good;
}

}  // namespace rtsg::bench
