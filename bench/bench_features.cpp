// Features: what Text, lines and points take, and what each kind of content costs a picture that does not show it.
#include <algorithm>
#include <random>

#include <fmt/format.h>

#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/renderers/image.h>
#include <rtsg/renderers/tessellate.h>
#include <rtsg/renderers/tessellator.h>

#include "bench.h"
#include "embree/embree.h"

namespace rtsg::bench {

namespace {

/// A scene, its world and pictures of it, on one thread.
struct Stage {
    Scene scene;
    std::unique_ptr<SharedWorld> world;
    std::unique_ptr<LightRenderer> light;
    ImageOptions options;
    RenderStats stats;

    explicit Stage(const std::string& body, bool quick, const TessellationError& cut = {}) {
        Diagnostics diagnostics;
        (void)loadText(scene, "#X3D V4.0 utf8\nPROFILE Full\n" + body, diagnostics);
        SharedWorld::Options flattened;
        flattened.flattening.error = cut;
        world = std::make_unique<SharedWorld>(scene, flattened);
        light = std::make_unique<LightRenderer>(*world);
        scene.newFrame(0);
        options.settings.width = quick ? 320 : 1280, options.settings.height = quick ? 180 : 720;
        options.settings.threads = 1;
        world->rays();
        world->finishBackgroundWork();
    }
    /// CPU seconds. `inSeries`: what cannot have changed is taken from the one before.
    double picture(bool inSeries = false) {
        const double start = cpuSeconds();
        const auto created = inSeries ? light->nextPicture(options, &stats) : light->picture(options, &stats);
        if (created) keep(created->pixels.data());
        return cpuSeconds() - start;
    }
};

/// A box that the eye is in, some balls in it, a lamp with shadows.
std::string room() {
    std::string text =
        "Viewpoint { position 0 0 8 } NavigationInfo { headlight FALSE } PointLight { location 0 3 4 }\n"
        "Shape { appearance Appearance { material Material { } } geometry Box { size 18 8 26 solid FALSE } }\n";
    std::mt19937 random(7);
    std::uniform_real_distribution<double> coordinate(-6, 6);
    for (int i = 0; i < 60; ++i)
        text += fmt::format(
            "Transform {{ translation {} {} {} children Shape {{ appearance Appearance {{ material Material "
            "{{ specularColor .5 .5 .5 }} }} geometry Sphere {{ radius .7 }} }} }}\n",
            coordinate(random), .4 * coordinate(random), coordinate(random) - 6);
    return text;
}

struct Feature {
    const char* name;
    const char* text;
};
constexpr Feature kFeatures[] = {
    {"Text", "Shape { geometry Text { string \"unseen\" } }"},
    {"lines", "Shape { geometry IndexedLineSet { coordIndex [ 0 1 ] coord Coordinate { point [ 0 0 0, 1 0 0 ] } } }"},
    {"points", "Shape { geometry PointSet { coord Coordinate { point [ 0 0 0 ] } } }"},
    {"a clear square of 1 mm",
     "Shape { appearance Appearance { material Material { transparency .5 } } geometry Rectangle2D { size .001 .001 } "
     "}"},
    {"Billboard", "Billboard { children Shape { geometry Box { } } }"},
    {"ParticleSystem", "ParticleSystem { maxParticles 10 emitter PointEmitter { } }"},
    {"VolumeData", "VolumeData { voxels PixelTexture3D { image [ 1 1 1 2 20 60 ] } }"},
    {"ClipPlane", "Group { children [ ClipPlane { } Shape { geometry Box { } } ] }"},
    {"LocalFog", "Group { children [ LocalFog { visibilityRange 50 } Shape { geometry Box { } } ] }"},
    {"EnvironmentLight", "Group { children [ EnvironmentLight { global FALSE } Shape { geometry Box { } } ] }"},
    {"FogCoordinate",
     "Shape { geometry IndexedFaceSet { coordIndex [ 0 1 2 ] fogCoord FogCoordinate { depth [ 0 .5 1 ] } coord "
     "Coordinate "
     "{ point [ 0 0 0, 1 0 0, 0 1 0 ] } } }"},
    {"a cube map",
     "Shape { appearance Appearance { texture ComposedCubeMapTexture { frontTexture PixelTexture { image 1 1 1 255 } } "
     "} "
     "geometry Sphere { } }"},
    {"Texture3D",
     "Shape { appearance Appearance { texture PixelTexture3D { image [ 1 1 1 2 0 255 ] } } geometry Box { } }"},
    {"NURBS",
     "Shape { geometry NurbsPatchSurface { uDimension 3 vDimension 3 solid FALSE controlPoint Coordinate { point [ 0 0 "
     "0, 1 0 0, "
     "2 0 0, 0 1 0, 1 1 1, 2 1 0, 0 2 0, 1 2 0, 2 2 0 ] } } }"},
    {"bboxDisplay", "Group { bboxDisplay TRUE children Shape { geometry Box { } } }"},
    {"TextureCoordinateGenerator",
     "Shape { appearance Appearance { texture PixelTexture { image 1 1 1 255 } } geometry IndexedFaceSet { coordIndex "
     "[ 0 1 2 ] "
     "texCoord TextureCoordinateGenerator { } coord Coordinate { point [ 0 0 0, 1 0 0, 0 1 0 ] } } }"},
};

/// Pictures of both in turn; the median of how much longer the other takes.
double ratio(Stage& plain, Stage& other, int times) {
    std::vector<double> ratios;
    plain.picture(), other.picture();
    for (int i = 0; i < times; ++i) {
        const double before = plain.picture(), now = other.picture(), after = plain.picture();
        ratios.push_back(2 * now / (before + after));
    }
    return median(ratios);
}

void unused(const Report& report, bool quick) {
    // Both have something there: a wider world has another BVH, which costs more or less by itself.
    const std::string there = room() +
                              "Transform { translation 0 0 100 children Shape { appearance Appearance { material "
                              "Material { } } geometry Rectangle2D { size .001 .001 } } }\n";
    Stage plain(there, quick), same(there, quick);
    const int times = quick ? 3 : 15;
    const double floor = ratio(plain, same, times);
    const auto line = [&](const std::string& name, Stage& other, const char* limitName, double limit) {
        report({"features", name, "time of a picture", "times that without", ratio(plain, other, times),
                "the same scene twice", floor, limitName, limit});
    };
    for (const Feature& f : kFeatures) {
        Stage beside(there + fmt::format("Transform {{ translation 0 0 100 children [ {} ] }}", f.text), quick);
        line(fmt::format("a room with {} where no ray comes", f.name), beside, "wanted at most", 1.01);
        Stage within(there + f.text, quick);
        line(fmt::format("a room with {} in its middle", f.name), within, "", 0);
    }
}

void text(const Report& report, bool quick) {
    const int lines = quick ? 12 : 125;
    std::mt19937 random(1);
    std::uniform_int_distribution<int> letter('!', '~');
    TextParams page;
    page.family = {"SANS"};
    for (int i = 0; i < lines; ++i) {
        std::string& line = page.strings.emplace_back();
        for (int k = 0; k < 80; ++k) line += static_cast<char>(letter(random));
    }
    std::vector<double> seconds, again;
    Scene scene;
    const NodeId node = scene.createNode(x3d::Text::type);
    Array<String> strings;
    for (const std::string& line : page.strings) strings.push_back(String(line));
    (void)scene.set(node, x3d::Text::string, strings);
    (void)tessellate(page);  // fonts are found once a process
    for (int i = 0; i < 9; ++i) {
        double start = cpuSeconds();
        keep(tessellate(page));
        seconds.push_back(cpuSeconds() - start);
        static Tessellator warm;
        start = cpuSeconds();
        keep(warm.mesh(scene, node));
        again.push_back(cpuSeconds() - start);
    }
    // Every letter cut by itself.
    double start = cpuSeconds();
    TextParams one = page;
    const int sample = quick ? 40 : 400;
    for (int i = 0; i < sample; ++i) {
        one.strings = {page.strings[static_cast<std::size_t>(i) / 80].substr(static_cast<std::size_t>(i) % 80, 1)};
        keep(tessellate(one));
    }
    const double alone = (cpuSeconds() - start) / sample * lines * 80;
    const std::string name = fmt::format("a page of {} glyphs", lines * 80);
    report({"features", name, "mesh, no glyph known", "ms", median(seconds) * 1e3, "each glyph by itself", alone * 1e3,
            "wanted at most", 50});
    report({"features", name, "mesh, glyphs known", "ms", median(again) * 1e3, "each glyph by itself", alone * 1e3,
            "wanted at most", 50});
}

/// `corner(random)` makes the text of one thing's corners; all are of one node.
std::string many(int count, const char* head, const char* index, int corners, float size) {
    std::mt19937 random(5);
    std::uniform_real_distribution<float> coordinate(-4, 4), step(-size, size);
    std::string text =
        "Viewpoint { position 0 0 10 } Shape { appearance Appearance { material UnlitMaterial { } } geometry ";
    text += head;
    std::string points;
    std::string indices;
    for (int i = 0; i < count; ++i) {
        const Vec3f at(coordinate(random), coordinate(random), coordinate(random));
        for (int k = 0; k < corners; ++k) {
            const Vec3f p = k == 0 ? at : at + Vec3f(step(random), step(random), step(random));
            points += fmt::format("{} {} {},", p.x, p.y, p.z);
            indices += fmt::format("{} ", i * corners + k);
        }
        if (corners == 2) indices += "-1 ";
    }
    if (*index) text += fmt::format(" {} [ {} ]", index, indices);
    return text + " coord Coordinate { point [" + points + "] } } }";
}

/// The least that an eye that moves would cost if widths were part of the BVH.
double embreeRebuild(const Mesh& mesh) {
    RTCDevice device = rtcNewDevice("threads=1");
    RTCScene scene = rtcNewScene(device);
    rtcSetSceneFlags(scene, RTC_SCENE_FLAG_DYNAMIC);
    rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_LOW);
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_ROUND_LINEAR_CURVE);
    auto* points = static_cast<float*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT4,
                                                               16, std::size_t{mesh.strokeCount} * 2));
    auto* index = static_cast<unsigned*>(
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT, 4, mesh.strokeCount));
    for (unsigned i = 0; i < mesh.strokeCount; ++i) {
        for (unsigned k = 0; k < 2; ++k) {
            const Vec3f p = mesh.vertex(i, k);
            float* to = points + 4 * (2 * i + k);
            to[0] = p.x, to[1] = p.y, to[2] = p.z, to[3] = .005f;
        }
        index[i] = 2 * i;
    }
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene, geometry);
    rtcCommitScene(scene);
    std::vector<double> times;
    for (int i = 0; i < 5; ++i) {
        const double start = cpuSeconds();
        for (std::size_t k = 0; k < std::size_t{mesh.strokeCount} * 2; ++k) points[4 * k + 3] *= 1.01f;
        rtcUpdateGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0);
        rtcCommitGeometry(geometry);
        rtcCommitScene(scene);
        times.push_back(cpuSeconds() - start);
    }
    rtcReleaseGeometry(geometry);
    rtcReleaseScene(scene);
    rtcReleaseDevice(device);
    return median(times);
}

void strokes(const Report& report, bool quick) {
    const int count = quick ? 2000 : 100'000, times = quick ? 2 : 7;
    Stage triangles(many(count, "IndexedTriangleSet { solid FALSE", "index", 3, .06f), quick);
    Stage lines(many(count, "IndexedLineSet {", "coordIndex", 2, .06f), quick);
    Stage points(many(count, "PointSet {", "", 1, 0), quick);
    const auto rate = [&](Stage& stage) {
        std::vector<double> rates;
        stage.picture();
        for (int i = 0; i < times; ++i) {
            const double seconds = stage.picture();
            rates.push_back(static_cast<double>(stage.stats.primaryRays) / seconds * 1e-6);
        }
        return median(rates);
    };
    const double reference = rate(triangles);
    for (Stage* stage : {&lines, &points})
        report({"features", fmt::format("{} {} in a picture", count, stage == &lines ? "lines" : "points"),
                "primary rays", "M/s", rate(*stage), "as many triangles", reference, "wanted at least",
                .5 * reference});
    StrokeParams params;
    std::mt19937 random(5);
    std::uniform_real_distribution<float> coordinate(-4, 4);
    params.coord = Array<Vec3f>::ofSize(2 * static_cast<std::size_t>(count));
    Vec3f* out = params.coord.mutableData();
    for (int i = 0; i < count; ++i) {
        const Vec3f at(coordinate(random), coordinate(random), coordinate(random));
        *out++ = at, *out++ = at + .01f * Vec3f(coordinate(random), coordinate(random), coordinate(random));
        params.vertexCount.push_back(2);
    }
    const Mesh mesh = tessellate(params);
    double start = cpuSeconds();
    RayWorld world;
    InstanceDelta delta;
    Instance instance;
    instance.id = {0, 0}, instance.shape = instance.geometry = NodeId{1};
    delta.geometries.push_back({instance.geometry, std::make_shared<Mesh>(mesh)});
    delta.added.push_back(instance);
    world.apply(delta);
    const double built = cpuSeconds() - start;
    delta.clear();
    auto moved = std::make_shared<Mesh>(mesh);
    Vec3f* p = moved->positions.mutableData();
    for (std::size_t i = 0; i < moved->positions.size(); ++i) p[i].y += .01f * std::sin(p[i].x);
    delta.geometries.push_back({instance.geometry, moved});
    start = cpuSeconds();
    world.apply(delta);
    const double refitted = cpuSeconds() - start;
    const double embree = embreeRebuild(mesh);
    report({"features", fmt::format("{} lines that change", count), "their tree", "ms", refitted * 1e3, "built anew",
            built * 1e3, "Embree's curves, rebuilt", embree * 1e3});
    report({"features", fmt::format("{} lines and an eye that moves", count), "their tree", "ms", 0,
            "Embree's curves, rebuilt", embree * 1e3, "", 0});
}

/// Balls of all sizes, most of them far away, cut by the pixels that their error is seen as.
void cuts(const Report& report, bool quick) {
    const int count = quick ? 300 : 10'000;
    std::mt19937 random(3);
    std::uniform_real_distribution<float> across(-1, 1), depth(2, 400), radius(.1f, .6f);
    std::string text = "Viewpoint { position 0 0 0 }\n";
    for (int i = 0; i < count; ++i) {
        const float z = depth(random);
        text += fmt::format(
            "Transform {{ translation {} {} {} children Shape {{ appearance Appearance {{ material Material {{ }} }} "
            "geometry Sphere {{ radius {} }} }} }}\n",
            z * across(random) * .5f, z * across(random) * .3f, -z, radius(random));
    }
    Stage plain(text, quick), cut(text, quick, {.pixels = .5f});
    const double before = plain.picture(), now = cut.picture();
    const std::string name = fmt::format("{} balls, cut to half a pixel", count);
    const auto triangles = [](Stage& stage) {
        return static_cast<double>(stage.world->rays().stats().instancedTriangles);
    };
    report({"features", name, "triangles", "", triangles(cut), "as usual", triangles(plain), "", 0});
    report({"features", name, "the first picture", "s", now, "as usual", before, "", 0});
    std::vector<double> moves, others;
    for (int i = 1; i <= (quick ? 3 : 20); ++i) {
        const auto look = [&](Stage& stage) {
            const double start = cpuSeconds();
            stage.options.viewpoint.clear();
            const Vec3d eye(0, 0, -2.0 * i);
            LayerSight sight;
            sight.width = stage.options.settings.width, sight.height = stage.options.settings.height;
            sight.eye = eye;
            (void)stage.world->setViewer(eye, {sight});
            return cpuSeconds() - start;
        };
        moves.push_back(look(cut)), others.push_back(look(plain));
    }
    report({"features", name, "an eye that moves 2 m, before the picture", "ms", median(moves) * 1e3, "as usual",
            median(others) * 1e3, "", 0});
}

/// The flight of a cone of particles and nothing else: no scene, no lives, no colours.
double bareFlight(std::size_t count, double now, std::vector<Vec3f>& positions) {
    const double start = cpuSeconds();
    positions.resize(count);
    for (std::size_t i = 0; i < count; ++i) {
        std::uint64_t state = i * 0x9E3779B97F4A7C15ull;
        const auto draw = [&] {
            std::uint64_t x = state += 0x9E3779B97F4A7C15ull;
            x = (x ^ x >> 30) * 0xBF58476D1CE4E5B9ull;
            x = (x ^ x >> 27) * 0x94D049BB133111EBull;
            return static_cast<double>((x ^ x >> 31) >> 11) * 0x1p-53;
        };
        const double age = std::fmod(now + draw() * 5, 5.0), speed = 3 * (.75 + .5 * draw());
        const double along = 1 - .3 * draw(), angle = 6.283185307179586 * draw();
        const double across = std::sqrt(1 - along * along);
        const Vec3d v = Vec3d(across * std::cos(angle), along, across * std::sin(angle)) * speed;
        positions[i] = Vec3f(v * age + Vec3d(0, -9.8, 0) * (.5 * age * age));
    }
    keep(positions.data());
    return cpuSeconds() - start;
}

void particles(const Report& report, bool quick) {
    const std::size_t count = quick ? 1000 : 10'000;
    Scene scene;
    Diagnostics diagnostics;
    (void)loadText(scene,
                   fmt::format("#X3D V4.0 utf8\nPROFILE Full\nDEF P ParticleSystem {{ geometryType \"POINT\" "
                               "maxParticles {} emitter ConeEmitter {{ speed 3 }} physics ForcePhysicsModel {{ }} }}",
                               count),
                   diagnostics);
    std::vector<double> events, points, trees, bare;
    std::vector<Vec3f> positions;
    Tessellator tessellator;
    RayWorld world;
    InstanceDelta delta;
    Instance instance;
    instance.id = {0, 0}, instance.shape = instance.geometry = scene.findName("P");
    delta.added.push_back(instance);
    for (int frame = 0; frame < 40; ++frame) {
        // The first frame begins it; all places are taken in the others.
        const double time = frame == 0 ? 0 : 20 + frame / 60.0;
        double start = cpuSeconds();
        scene.newFrame(time);
        events.push_back(cpuSeconds() - start);
        start = cpuSeconds();
        delta.geometries.push_back({instance.geometry, tessellator.mesh(scene, instance.geometry)});
        points.push_back(cpuSeconds() - start);
        start = cpuSeconds();
        world.apply(delta);
        trees.push_back(cpuSeconds() - start);
        delta.clear();
        bare.push_back(bareFlight(count, time, positions));
    }
    const std::string name = fmt::format("{} particles, a frame", count);
    const double loop = median(bare) * 1e3;
    report({"features", name, "events", "ms", median(events) * 1e3, "a bare loop over their flight", loop, "", 0});
    report({"features", name, "their places as points", "ms", median(points) * 1e3, "a bare loop over their flight",
            loop, "", 0});
    report({"features", name, "their tree", "ms", median(trees) * 1e3, "a bare loop over their flight", loop,
            "a frame at 60 Hz, all of it", 1000.0 / 60});
}

/// Frames in which nothing changed, or one ball of sixty moved.
void little(const Report& report, bool quick) {
    for (const Integrator integrator : {Integrator::whitted, Integrator::path}) {
        Stage s(room() +
                    "DEF MOVING Transform { translation 2 -1 3 children Shape { appearance Appearance { material "
                    "Material { } } geometry Sphere { radius .4 } } }",
                quick);
        s.options.settings.integrator = integrator;
        const NodeId moving = s.scene.findName("MOVING");
        std::vector<double> whole, still, moved, copies;
        double kept = 0;
        const int frames = quick ? 5 : 15;
        s.picture(true);
        for (int i = 0; i < frames; ++i) {
            whole.push_back(s.picture());
            still.push_back(s.picture(true));
            (void)s.scene.set(moving, x3d::Transform::translation, Vec3f(2 + .05f * static_cast<float>(i), -1, 3));
            s.scene.newFrame(s.scene.now() + 1);
            moved.push_back(s.picture(true));
            kept += s.stats.kept / frames;
            const double start = cpuSeconds();
            const Picture copy(s.options.settings.width, s.options.settings.height);
            keep(copy.pixels.data());
            copies.push_back(cpuSeconds() - start);
        }
        const std::string name =
            fmt::format("a room with 61 balls, {}", integrator == Integrator::path ? "path" : "whitted");
        report({"features", name, "a frame in which nothing changed, CPU", "ms", median(still) * 1e3,
                "the picture anew", median(whole) * 1e3, "memory for its pixels", median(copies) * 1e3});
        report({"features", name, "a frame in which one ball moved, CPU", "ms", median(moved) * 1e3, "the picture anew",
                median(whole) * 1e3, "", 0});
        report({"features", name, "pixels kept when it moved", "share", kept, "", 0, "", 0});
    }
}

}  // namespace

void features(const Report& report, bool quick) {
    little(report, quick);
    text(report, quick);
    strokes(report, quick);
    cuts(report, quick);
    particles(report, quick);
    unused(report, quick);
}

}  // namespace rtsg::bench
