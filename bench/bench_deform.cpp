// Deformation: what following a mesh whose coordinates change costs, beside a bare refit of the same mesh, and how fast
// rays run through it, beside a BVH built afresh at that moment.
#include <ctime>

#include <algorithm>
#include <cmath>
#include <random>

#include <fmt/format.h>
#include "embree/embree.h"

#include <rtsg/core/x3d.h>
#include <rtsg/renderers/flattener.h>
#include <rtsg/renderers/ray_world.h>

#include "bench.h"
#include "chart.h"
#include "charts.h"
#include "knot.h"

namespace rtsg::bench {

namespace {

/// Flattener and RayWorld behind a scene, each timed.
struct Stages final : Subscriber {
    explicit Stages(bool wait) : world({.buildThreads = 1}), waits(wait) {}
    Result<> apply(const Scene& scene, const ChangeSet& changes) override {
        if (waits) world.finishBackgroundWork();
        const double start = threadSeconds();
        const InstanceDelta& delta = flattener.apply(scene, changes);
        const double middle = threadSeconds();
        world.apply(delta);
        const double end = threadSeconds();
        flattenSeconds = middle - start, worldSeconds = end - middle;
        return {};
    }
    const Mesh& mesh() const {
        for (const RayInstance& instance : world.instances())
            if (instance.mesh) return *instance.mesh;
        static const Mesh none;
        return none;
    }

    Flattener flattener;
    RayWorld world;
    bool waits;  // for the rebuild that the frame before has begun
    double flattenSeconds = 0, worldSeconds = 0;
};

/// Embree alone, in the mode in which it refits.
class BareRefit {
  public:
    explicit BareRefit(const Mesh& mesh)
        : index_(mesh.triangles), device_(rtcNewDevice("threads=1")), scene_(rtcNewScene(device_)) {
        rtcSetSceneFlags(scene_, static_cast<RTCSceneFlags>(RTC_SCENE_FLAG_ROBUST | RTC_SCENE_FLAG_DYNAMIC));
        rtcSetSceneBuildQuality(scene_, RTC_BUILD_QUALITY_LOW);
        geometry_ = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
        setPositions(mesh);
        rtcSetSharedGeometryBuffer(geometry_, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, mesh.triangles.data(), 0,
                                   mesh.triangleStride * sizeof(std::int32_t), mesh.triangleCount);
        rtcSetGeometryBuildQuality(geometry_, RTC_BUILD_QUALITY_REFIT);
        rtcCommitGeometry(geometry_);
        rtcAttachGeometry(scene_, geometry_);
        rtcCommitScene(scene_);
    }
    ~BareRefit() {
        rtcReleaseGeometry(geometry_);
        rtcReleaseScene(scene_);
        rtcReleaseDevice(device_);
    }
    BareRefit(const BareRefit&) = delete;
    BareRefit& operator=(const BareRefit&) = delete;

    /// Seconds that a refit to the mesh takes, whose triangles are those of the first.
    double refit(const Mesh& mesh) {
        const double start = threadSeconds();
        setPositions(mesh);
        rtcUpdateGeometryBuffer(geometry_, RTC_BUFFER_TYPE_VERTEX, 0);
        rtcCommitGeometry(geometry_);
        rtcCommitScene(scene_);
        return threadSeconds() - start;
    }

  private:
    void setPositions(const Mesh& mesh) {
        rtcSetSharedGeometryBuffer(geometry_, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, mesh.positions.data(), 0,
                                   sizeof(Vec3f), mesh.positions.size());
    }

    Array<std::int32_t> index_;  // Embree reads it on and on
    RTCDevice device_;
    RTCScene scene_;
    RTCGeometry geometry_ = nullptr;
};

double mean(const std::vector<double>& values) {
    double sum = 0;
    for (const double v : values) sum += v;
    return values.empty() ? 0 : sum / static_cast<double>(values.size());
}

void update(const Report& report, const std::string& name, const KnotOptions& options, int frames) {
    Scene scene;
    addKnot(scene, options);
    Stages stages(false);
    const Attachment attachment = scene.bus().attach(stages);
    scene.newFrame(0);
    scene.newFrame(.01);
    BareRefit bare(stages.mesh());
    std::vector<double> cascade, flatten, world, refit, all;
    const double startAll = cpuSeconds(), startHere = threadSeconds();
    double refits = 0;
    for (int frame = 1; frame <= frames; ++frame) {
        const double start = threadSeconds();
        scene.newFrame(.01 + frame / 60.0);
        const double end = threadSeconds();
        const double first = bare.refit(stages.mesh());  // the second time, so that both find the points in the cache
        refit.push_back(bare.refit(stages.mesh()));
        refits += first + refit.back();
        cascade.push_back(end - start - stages.flattenSeconds - stages.worldSeconds);
        flatten.push_back(stages.flattenSeconds);
        world.push_back(stages.worldSeconds);
    }
    const double background = (cpuSeconds() - startAll) - (threadSeconds() - startHere);
    const double limit = median(refit) * 1e6;
    const std::string which = fmt::format("{}, {} triangles", name, stages.mesh().triangleCount);
    const auto line = [&](const char* metric, double seconds) {
        report({"deform", which, metric, "us", seconds * 1e6, "", 0, "bare Embree refit", limit});
    };
    line("interpolator and cascade, median", median(cascade));
    line("flattening and tessellation, median", median(flatten));
    line("RayWorld with commit, median", median(world));
    line("RayWorld with commit, mean", mean(world));
    line("rebuilding in the background, a frame", background / frames);
    report({"deform", which, "rebuilds in so many frames", "", static_cast<double>(stages.world.stats().meshRebuilds),
            "", 0, "frames", static_cast<double>(frames)});
}

// ---- quality ------------------------------------------------------------------------------------------------------

struct Deformation {
    const char* name;
    /// Where a point is at `phase`, 0 ... 1 over the round.
    Vec3f (*move)(Vec3f p, float phase, std::mt19937& random);
};

float wave(float phase) {
    return std::sin(6.2831853f * phase);
}
constexpr Deformation kDeformations[] = {
    {"twist to 4 rad/m and back",
     [](Vec3f p, float phase, std::mt19937&) {
         const float a = 4 * wave(phase / 2) * p.z, c = std::cos(a), s = std::sin(a);
         return Vec3f(c * p.x - s * p.y, s * p.x + c * p.y, p.z);
     }},
    {"scatter, growing and shrinking",
     [](Vec3f p, float phase, std::mt19937& random) {
         std::normal_distribution<float> normal(0, .3f);
         const float x = normal(random), y = normal(random), z = normal(random);
         return p + wave(phase / 2) * Vec3f(x, y, z);
     }},
    {"collapse to a point and back",
     [](Vec3f p, float phase, std::mt19937&) { return p * std::abs(std::cos(6.2831853f * phase / 2)); }},
    {"travel", [](Vec3f p, float phase, std::mt19937&) { return p + 100 * phase * Vec3f(1, 2, 3); }},
};

/// Single rays from around the box to points in it, a second.
double raySpeed(const RayWorld& world, int count) {
    const Bounds box = world.bounds();
    std::mt19937 random(5);
    std::uniform_real_distribution<float> u(0, 1);
    std::vector<Ray> rays;
    const float reach = glm::length(box.size()) / 2;
    for (int i = 0; i < count; ++i) {
        const float z = 2 * u(random) - 1, angle = 6.2831853f * u(random), r = std::sqrt(1 - z * z);
        const Vec3f from = box.center() + reach * Vec3f(r * std::cos(angle), r * std::sin(angle), z);
        const Vec3f to = box.min + box.size() * Vec3f(u(random), u(random), u(random));
        rays.push_back({.origin = from, .direction = to - from});
    }
    double best = 1e9;
    for (int repeat = 0; repeat < 3; ++repeat) {
        const double start = threadSeconds();
        std::size_t hits = 0;
        for (const Ray& ray : rays) hits += static_cast<bool>(world.intersect(ray));
        keep(hits);
        best = std::min(best, threadSeconds() - start);
    }
    return count / best;
}

/// Speed of rays through what was followed, in parts of their speed through what is built from scratch, per frame.
std::vector<double> speedRatios(const Deformation& motion, int triangles, int frames, int rays, std::size_t& rebuilds) {
    const KnotOptions options{.triangles = triangles, .creaseAngle = 0};
    Scene scene;
    const Knot knot = addKnot(scene, options);
    (void)scene.set(knot.clock, x3d::TimeSensor::enabled, false);
    Stages stages(true);
    const Attachment attachment = scene.bus().attach(stages);
    const Array<Vec3f> rest = knotPoints(options, 0);
    std::vector<double> ratios;
    for (int frame = 0; frame <= frames; ++frame) {
        std::mt19937 random(static_cast<unsigned>(9));
        Array<Vec3f> points = rest;
        Vec3f* out = points.mutableData();
        const float phase = static_cast<float>(frame) / static_cast<float>(frames);
        for (std::size_t i = 0; i < points.size(); ++i) out[i] = motion.move(out[i], phase, random);
        (void)scene.set(knot.coordinate, x3d::Coordinate::point, points);
        scene.newFrame(frame * .01);
        if (!(glm::length(stages.world.bounds().size()) > 1e-3f)) continue;
        RayWorld fresh({.buildThreads = 1});
        fresh.apply(stages.flattener.snapshot());
        // In turn, so that the machine's moods hit both alike.
        double ours = 0, theirs = 0;
        for (int i = 0; i < 2; ++i) {
            ours = std::max(ours, raySpeed(stages.world, rays));
            theirs = std::max(theirs, raySpeed(fresh, rays));
        }
        ratios.push_back(ours / theirs);
    }
    rebuilds = stages.world.stats().meshRebuilds;
    return ratios;
}

}  // namespace

void deform(const Report& report, bool quick) {
    const int frames = quick ? 60 : 480;
    update(report, "knot, rounded", {}, frames);
    update(report, "knot, faceted", {.creaseAngle = 0}, frames);
    update(report, "knot of quads, rounded", {.quads = true}, frames);
    if (!quick) update(report, "knot, rounded", {.triangles = 100'000}, 120);
    for (const Deformation& motion : kDeformations)
        for (const int triangles : {4600, 100'000}) {
            if (quick && triangles > 4600) break;
            std::size_t rebuilds = 0;
            std::vector<double> ratios = speedRatios(motion, triangles, quick ? 20 : 120, 20'000, rebuilds);
            std::sort(ratios.begin(), ratios.end());
            const std::string name = fmt::format("{}, {} triangles, {} rebuilds", motion.name, triangles, rebuilds);
            report({"deform", name, "speed of rays, slowest frame", "of rebuilt", ratios.front(), "", 0, "rebuilt", 1});
            report({"deform", name, "speed of rays, frame in the tenth percentile", "of rebuilt",
                    ratios[ratios.size() / 10], "", 0, "rebuilt", 1});
        }
}

bool chartDeform(const ChartSink& sink, bool quick) {
    Chart chart;
    chart.name = "deform-rays";
    chart.title = "Rays through a deforming mesh, beside a BVH built afresh each frame";
    chart.note = "Knot of 4,600 triangles; refitted each frame, rebuilt when the watch says so. Aim: .8 at all times.";
    chart.x = {.label = "frame"};
    chart.y = {.label = "speed of single rays, of rebuilt"};
    const int frames = quick ? 20 : 120;
    for (const Deformation& motion : kDeformations) {
        std::size_t rebuilds = 0;
        Series series;
        const std::vector<double> ratios = speedRatios(motion, 4600, frames, 20'000, rebuilds);
        series.name = fmt::format("{} ({} rebuilds)", motion.name, rebuilds);
        for (std::size_t i = 0; i < ratios.size(); ++i)
            series.points.push_back({static_cast<double>(i), ratios[i], {}});
        chart.series.push_back(std::move(series));
    }
    Series aim;
    aim.name = "aim";
    aim.reference = true;
    aim.points = {{0, .8, {}}, {static_cast<double>(frames), .8, {}}};
    chart.series.push_back(std::move(aim));
    sink(chart);
    return true;
}

}  // namespace rtsg::bench
