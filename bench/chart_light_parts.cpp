// The benefit of each part of the path tracer: the error of pictures with and without it against time.
#include <algorithm>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include <rtsg/core/scene.h>
#include <rtsg/documents/loader.h>
#include <rtsg/renderers/denoise.h>
#include <rtsg/renderers/light_renderer.h>

#include "bench.h"
#include "charts.h"
#include "lighting/path_parts.h"
#include "panel_room.h"
#include "under_sky.h"

namespace rtsg::bench {

namespace {

/// The parts as they were, whatever happens in between.
class PartsFor {
  public:
    explicit PartsFor(const trace::PathParts& parts) { trace::pathParts() = parts; }
    PartsFor(const PartsFor&) = delete;
    PartsFor& operator=(const PartsFor&) = delete;
    ~PartsFor() { trace::pathParts() = before_; }

  private:
    trace::PathParts before_ = trace::pathParts();
};

struct Taken {
    Picture picture;
    double seconds = 0;  // CPU time of the picture alone
};

/// A scene that many pictures are made of.
class PartsStage {
  public:
    explicit PartsStage(const std::string& text) {
        Diagnostics diagnostics;
        if (!loadText(scene_, text, diagnostics)) throw std::runtime_error("a chart's scene could not be read");
        scene_.newFrame(0);
        // Structures that a first picture builds are not timed.
        (void)take(pathOptions(4, 0, 2));
    }

    Taken take(const ImageOptions& options) {
        Taken taken;
        const double start = cpuSeconds();
        auto picture = light_.picture(options);
        taken.seconds = cpuSeconds() - start;
        if (!picture) throw std::runtime_error(picture.error().text);
        taken.picture = std::move(*picture);
        return taken;
    }

    /// A picture of as many samples a pixel, in independent pairs.
    Taken independent(int side, int samples) {
        Taken sum;
        ImageOptions options = pathOptions(side, 0, 2);
        sum.picture = Picture(side, side);
        const int pairs = samples / 2;
        for (int pair = 0; pair < pairs; ++pair) {
            options.settings.seed = 1000 + static_cast<std::uint64_t>(pair);
            const Taken one = take(options);
            sum.seconds += one.seconds;
            for (std::size_t i = 0; i < sum.picture.pixels.size(); ++i)
                sum.picture.pixels[i] += one.picture.pixels[i] / static_cast<float>(pairs);
        }
        return sum;
    }

    /// A live picture of so many samples.
    Taken denoised(int side, int samples) {
        ImageOptions options = pathOptions(side, 0, samples);
        options.settings.layers = kLayersOfDenoising;
        Taken taken = take(options);
        const double start = cpuSeconds();
        if (const Result<> done = denoise(taken.picture); !done) throw std::runtime_error(done.error().text);
        taken.seconds += cpuSeconds() - start;
        return taken;
    }

  private:
    Scene scene_;
    SharedWorld world_{scene_, {.flattening = {}, .rays = {.buildThreads = 1}}};
    LightRenderer light_{world_};
};

/// A scene, and the parts that it has use for.
struct PartsScene {
    std::string name, title, text;
    std::vector<std::pair<std::string, trace::PathParts>> without;
};

std::vector<PartsScene> partsScenes() {
    const trace::PathParts bounces{.emitters = false}, evenly{.lightTree = false}, late{.roulette = 0x1p-10f};
    return {
        {"room",
         "A room lit by two panels",
         panelRoom(2, false),
         {{"triangles that shine not asked", bounces}, {"roulette from weights of 1/1024 on", late}}},
        {"lamps",
         "A room lit by 1,000 lamps out of sight",
         panelRoom(1000, false, false),
         {{"any lamp as likely, no tree", evenly}, {"triangles that shine not asked", bounces}}},
        {"sun",
         "Things in the open under a small bright part of the sky",
         "#X3D V4.0 utf8\nPROFILE Immersive\nNavigationInfo { headlight FALSE }\n"
         "Viewpoint { position 0 2.5 4 orientation 1 0 0 -.5 }\n"
         "Background { skyColor [1 1 1, 1 1 1, .1 .12 .2, .1 .12 .2] skyAngle [.15, .16, 3.1] }\n"
         "Shape { appearance Appearance { material Material { diffuseColor .8 .8 .8 } } geometry Box { size 20 .1 20 } "
         "}\n"
         "Transform { translation -.7 .6 0 children Shape { appearance Appearance { material Material { diffuseColor "
         ".8 .3 .2 specularColor .2 .2 .2 shininess .3 } } geometry Sphere { radius .5 } } }\n"
         "Transform { translation .7 .6 0 children Shape { appearance Appearance { material PhysicalMaterial { "
         "baseColor .2 .5 .8 roughness .4 metallic .5 } } geometry Box { } } }\n",
         {{"sky not asked", {.skyLight = false}}, {"roulette from weights of 1/1024 on", late}}}};
}

/// Pictures of one size beside each other.
Picture besideEachOther(const std::vector<Picture>& pictures) {
    constexpr int kGap = 4;
    const int side = pictures.front().width;
    Picture row(static_cast<int>(pictures.size()) * (side + kGap) - kGap, side, Vec4f(1));
    for (std::size_t i = 0; i < pictures.size(); ++i)
        for (int y = 0; y < side; ++y)
            for (int x = 0; x < side; ++x) row.at(static_cast<int>(i) * (side + kGap) + x, y) = pictures[i].at(x, y);
    return row;
}

/// That shows a picture's mean as a middle grey.
float exposureOf(const Picture& picture) {
    double sum = 0;
    for (const Vec4f& pixel : picture.pixels) sum += double{pixel.g};
    return static_cast<float>(.3 * static_cast<double>(picture.pixels.size()) / sum);
}

/// The sizes and settings of a scene's series.
struct PartsSizes {
    int side, maximum, truth;
};

class PartsChart {
  public:
    PartsChart(const PartsScene& scene, const PartsSizes& sizes)
        : sizes_(sizes), stage_(scene.text), truth_(truthOf(stage_, sizes)) {
        chart_ = {"light-parts-" + scene.name,
                  scene.title + ": what each part of the path tracer is worth",
                  fmt::format("{0} x {0} pixels, CPU time of one thread for the picture alone; relative error from a "
                              "picture of {1} samples a pixel, root mean square over the pixels. Labelled with samples "
                              "a pixel, or with the error that was asked for.",
                              sizes.side, sizes.truth),
                  {"time (s)", true},
                  {"relative error of a pixel", true},
                  {},
                  {}};
        alike("path, all pixels alike", {});
        for (const auto& [name, parts] : scene.without) alike(name, parts);
        bySamples("pairs of samples by chance, no Sobol points", 4,
                  [&](int n) { return stage_.independent(side(), n); });
        byError();
        bySamples("denoised preview", 1, [&](int n) { return stage_.denoised(side(), n); });
        ImageOptions whitted = pathOptions(side(), 0, 16);
        whitted.settings.integrator = Integrator::whitted;
        whitted.settings.colorSpace = ColorSpace::linear;
        add({"whitted", {}}, {{stage_.take(whitted), ""}});
        beside(whitted);
    }
    const Chart& chart() const { return chart_; }

  private:
    static Picture truthOf(PartsStage& stage, const PartsSizes& sizes) {
        ImageOptions options = pathOptions(sizes.side, 0, sizes.truth);
        options.settings.seed = 77;
        return stage.take(options).picture;
    }
    int side() const { return sizes_.side; }
    void add(Series series, const std::vector<std::pair<Taken, std::string>>& all) {
        for (const auto& [taken, label] : all)
            series.points.push_back({taken.seconds, UnderSky::errorFrom(taken.picture, truth_), label});
        chart_.series.push_back(std::move(series));
    }
    template <class Take>
    void bySamples(const std::string& name, int minimum, const Take& take) {
        std::vector<std::pair<Taken, std::string>> all;
        for (int samples = minimum; samples <= sizes_.maximum; samples *= 4)
            all.emplace_back(take(samples), std::to_string(samples));
        add({name, {}}, all);
    }
    void alike(const std::string& name, const trace::PathParts& parts) {
        const PartsFor these(parts);
        bySamples(name, 4, [&](int samples) { return stage_.take(pathOptions(side(), 0, samples)); });
    }
    void byError() {
        std::vector<std::pair<Taken, std::string>> all;
        for (double error = .2; error > 12.0 / (sizes_.maximum + 64); error /= 2)
            all.emplace_back(stage_.take(pathOptions(side(), error, 1 << 14)), fmt::format("{:g}", error));
        add({"path with --error", {}}, all);
    }
    /// The pictures by each method, in a file beside the chart.
    void beside(const ImageOptions& whitted) {
        const std::string file = chart_.name + ".png";
        chart_.note +=
            fmt::format(" {}: whitted, path of 16 samples, denoised, path with --error .05, the truth.", file);
        std::vector<Picture> all;
        all.push_back(stage_.take(whitted).picture);
        all.push_back(stage_.take(pathOptions(side(), 0, 16)).picture);
        all.push_back(stage_.denoised(side(), 16).picture);
        all.push_back(stage_.take(pathOptions(side(), .05, 1 << 14)).picture);
        all.push_back(truth_);
        const ToneMap seen{.exposure = exposureOf(truth_)};
        chart_.beside = [row = besideEachOther(all), file, seen](const std::filesystem::path& folder) {
            return writePicture(row, folder / file, seen);
        };
    }

    PartsSizes sizes_;
    PartsStage stage_;
    Picture truth_;
    Chart chart_;
};

}  // namespace

void chartLightParts(const ChartSink& sink, bool quick) {
    const PartsSizes sizes = quick ? PartsSizes{24, 16, 256} : PartsSizes{96, 256, 8192};
    for (const PartsScene& scene : partsScenes()) sink(PartsChart(scene, sizes).chart());
}

}  // namespace rtsg::bench
