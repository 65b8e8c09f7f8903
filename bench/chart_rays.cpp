// Charts "rays": how far a path-traced picture is from the truth, against the time it took.
#include <cmath>

#include <fmt/format.h>

#include <rtsg/documents/loader.h>
#include <rtsg/renderers/image.h>

#include "bench.h"
#include "charts.h"

namespace rtsg::bench {

namespace {

/// Closed and glowing: every pixel is Le / (1 - rho) = 1.
// .735357 is .5 in linear light.
constexpr const char* kFurnace = R"(#X3D V4.0 utf8
PROFILE Immersive
NavigationInfo { headlight FALSE }
Viewpoint { position .2 .1 .3 }
Shape { appearance Appearance { material Material { diffuseColor .735357 .735357 .735357 emissiveColor .735357 .735357 .735357 } }
  geometry Sphere { solid FALSE } }
)";
/// A room with a panel of light, a mirror and a box, seen from its open side.
constexpr const char* kRoom = R"(#X3D V4.0 utf8
PROFILE Immersive
NavigationInfo { headlight FALSE }
Viewpoint { position 0 1 3.6 fieldOfView .7 }
Shape { appearance DEF WHITE Appearance { material Material { diffuseColor .7 .7 .7 } } geometry IndexedFaceSet { solid FALSE
  coord Coordinate { point [ -1 0 1, 1 0 1, 1 0 -1, -1 0 -1, -1 2 1, 1 2 1, 1 2 -1, -1 2 -1 ] }
  coordIndex [ 0 1 2 3 -1, 4 5 6 7 -1, 3 2 6 7 -1 ] } }
Shape { appearance Appearance { material Material { diffuseColor .6 .1 .1 } } geometry IndexedFaceSet { solid FALSE
  coord Coordinate { point [ -1 0 1, -1 0 -1, -1 2 -1, -1 2 1 ] } coordIndex [ 0 1 2 3 -1 ] } }
Shape { appearance Appearance { material Material { diffuseColor .1 .5 .15 } } geometry IndexedFaceSet { solid FALSE
  coord Coordinate { point [ 1 0 1, 1 0 -1, 1 2 -1, 1 2 1 ] } coordIndex [ 0 1 2 3 -1 ] } }
Shape { appearance Appearance { material UnlitMaterial { emissiveColor 8 8 8 } } geometry IndexedFaceSet { solid FALSE
  coord Coordinate { point [ -.3 1.99 .3, .3 1.99 .3, .3 1.99 -.3, -.3 1.99 -.3 ] } coordIndex [ 0 1 2 3 -1 ] } }
Transform { translation -.35 .45 -.4 rotation 0 1 0 .4 children Shape { appearance USE WHITE geometry Box { size .6 .9 .6 } } }
Transform { translation .4 .35 .2 children Shape { appearance Appearance { material Material { diffuseColor .1 .1 .1
  metadata MetadataSet { name "RTSG" value MetadataFloat { name "reflectivity" value .8 } } } } geometry Sphere { radius .35 } } }
)";

struct Run {
    Picture picture;
    double seconds = 0;
};

class Subject {
  public:
    explicit Subject(const char* text) {
        Diagnostics diagnostics;
        good_ = loadText(scene_, text, diagnostics) && diagnostics.errors() == 0;
        scene_.newFrame(0);
        world_ = std::make_unique<SharedWorld>(scene_);
        light_ = std::make_unique<LightRenderer>(*world_);
    }
    bool good() const { return good_; }
    Run run(Integrator integrator, int samples, std::uint64_t seed) {
        ImageOptions options;
        options.settings.integrator = integrator;
        options.settings.colorSpace = ColorSpace::linear;
        options.settings.width = options.settings.height = 64;
        options.settings.samplesPerPixel = samples;
        options.settings.seed = seed;
        options.settings.threads = 1;
        const double start = cpuSeconds();
        auto picture = light_->picture(options);
        Run out{{}, cpuSeconds() - start};
        if (picture) out.picture = *std::move(picture);
        return out;
    }

  private:
    Scene scene_;
    std::unique_ptr<SharedWorld> world_;
    std::unique_ptr<LightRenderer> light_;
    bool good_ = false;
};

double rmsError(const Picture& picture, const Picture& truth) {
    const auto difference = compare(picture, truth);
    return difference ? difference->rmse : NAN;
}

}  // namespace

bool chartRays(const ChartSink& sink, bool quick) {
    const int maximum = quick ? 64 : 1024;
    Chart chart{
        "rays-error",
        "Path tracing: error against time",
        fmt::format("64 x 64 pixels, 1 to {} samples each (labelled); CPU time of one thread. Furnace: RMS "
                    "distance from the closed form L = Le / (1 - rho) = 1. Room (panel light, mirror ball): from "
                    "{} samples with another seed.",
                    maximum, maximum * 8),
        {"time (ms)", true},
        {"RMS error of a pixel", true},
        {{"glowing furnace", {}}, {"room, path", {}}, {"room, Whitted", {}}, {"1 / √time", {}, true}},
        {}};
    Subject furnace(kFurnace), room(kRoom);
    if (!furnace.good() || !room.good()) return false;
    const Picture one(64, 64, Vec4f(1));
    const Picture truth = room.run(Integrator::path, maximum * 8, 99).picture;
    for (int samples = 1; samples <= maximum; samples *= 4) {
        const std::string label = std::to_string(samples);
        const Run f = furnace.run(Integrator::path, samples, 1), r = room.run(Integrator::path, samples, 1),
                  w = room.run(Integrator::whitted, samples, 1);
        chart.series[0].points.push_back({f.seconds * 1e3, rmsError(f.picture, one), label});
        chart.series[1].points.push_back({r.seconds * 1e3, rmsError(r.picture, truth), label});
        if (samples <= 64) chart.series[2].points.push_back({w.seconds * 1e3, rmsError(w.picture, truth), {}});
    }
    // The slope of independent samples, from the room's first point on.
    const ChartPoint &first = chart.series[1].points.front(), &last = chart.series[1].points.back();
    chart.series[3].points = {{first.x, first.y, {}}, {last.x, first.y * std::sqrt(first.x / last.x), {}}};
    sink(chart);
    return true;
}

}  // namespace rtsg::bench
