// The benefit of each mechanism of diffraction: levels behind things with and without it, beside boundary elements and
// series where there are any, and the time that it takes.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "audio/trace/rigid_body.h"
#include "audio/trace/rigid_outline.h"
#include "audio/trace/rigid_round.h"
#include "audio/trace/round_shapes.h"
#include "audio/trace/walled.h"
#include "bench.h"
#include "charts.h"
#include "geometry/diffraction_parts.h"

namespace rtsg::bench {

namespace {

constexpr std::size_t kFirstBand = 2, kLastBand = 7;  // 125 Hz to 4 kHz
constexpr double kPartsSpeed = 343.2, kFar = 60;
using PartLevels = std::vector<std::array<double, kBandCount>>;  // energies by place

/// Things of one mesh, and who listens where.
struct ListenedScene {
    std::string name;
    test::RoundMesh mesh;
    glm::dvec3 source{0};
    std::vector<glm::dvec3> listeners;
    /// Energy at a tone re that of the source at 1 m, with the number of the tone, for all listeners; as far as the
    /// highest band. None: nothing is known of it.
    std::function<std::vector<double>(std::size_t tone)> reference = {};
    std::size_t lastBand = 0;
    bool line = false;  // the reference is of a source that is a line along z

    void box(const glm::dvec3& low, const glm::dvec3& high) {
        const auto first = static_cast<std::uint32_t>(mesh.corners.size());
        for (int i = 0; i < 8; ++i)
            mesh.corners.emplace_back(i & 1 ? high.x : low.x, i & 2 ? high.y : low.y, i & 4 ? high.z : low.z);
        for (const std::uint32_t corner : {0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4,
                                           2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5})
            mesh.triangles.push_back(first + corner);
    }
    void quad(const std::array<glm::dvec3, 4>& corners) {
        const auto first = static_cast<std::uint32_t>(mesh.corners.size());
        mesh.corners.insert(mesh.corners.end(), corners.begin(), corners.end());
        mesh.addQuad(first, first + 1, first + 2, first + 3);
    }
    void level(double z) { quad({{{-kFar, -kFar, z}, {kFar, -kFar, z}, {kFar, kFar, z}, {-kFar, kFar, z}}}); }
    void add(const test::RoundMesh& other, const glm::dvec3& at) {
        const auto first = static_cast<std::uint32_t>(mesh.corners.size());
        for (const glm::dvec3& corner : other.corners) mesh.corners.push_back(corner + at);
        for (const std::uint32_t one : other.triangles) mesh.triangles.push_back(first + one);
    }
};

using Closed = test::RigidOutline::Closed;
Closed rectangleOf(double x, double y, double toX, double toY) {
    return {{x, y}, {toX, y}, {toX, toY}, {x, toY}};
}
std::vector<glm::dvec2> insideOf(const std::vector<Closed>& outlines) {
    std::vector<glm::dvec2> inside;
    for (const Closed& one : outlines)
        for (const glm::dvec2& part : {glm::dvec2(.17, .41), glm::dvec2(.43, .23), glm::dvec2(.67, .79),
                                       glm::dvec2(.83, .59), glm::dvec2(.29, .87), glm::dvec2(.57, .53)})
            inside.push_back(glm::mix(glm::mix(one[0], one[1], part.x), glm::mix(one[3], one[2], part.x), part.y));
    return inside;
}

/// In a plane: energies of a line source, and of images of it each with bodies of its own, as of a point.
struct LineImage {
    glm::dvec2 source;
    std::vector<Closed> outlines;
};
std::function<std::vector<double>(std::size_t)> linesReference(const std::vector<LineImage>& images,
                                                               const std::vector<glm::dvec2>& positions) {
    return [=](std::size_t tone) {
        const double k = 2 * M_PI * edgeToneHz(static_cast<double>(tone)) / kPartsSpeed;
        std::vector<double> energies(positions.size());
        for (const LineImage& image : images) {
            const test::RigidOutline outline(image.outlines, insideOf(image.outlines), k,
                                             std::min(.12, 2 * M_PI / k / 7));
            for (std::size_t p = 0; p < positions.size(); ++p)
                // A way of w metres counts as one of a point source, times w / d.
                energies[p] +=
                    std::norm(outline.beside(image.source, positions[p])) /
                    (glm::distance(image.source, positions[p]) * glm::distance(images[0].source, positions[p]));
        }
        return energies;
    };
}

/// A screen along x, before a floor at z = 0 and below a ceiling if there is one; in the plane of y and z.
ListenedScene screenScene(double ceiling) {
    ListenedScene scene{ceiling > 0 ? "screen below a ceiling" : "thick screen on a floor", {}, {0, -2, 1.2}, {}};
    constexpr double kHalf = .05, kHigh = 1.7;
    scene.level(0);
    if (ceiling > 0) scene.level(ceiling);
    scene.box({-kFar + 1, -kHalf, 0}, {kFar - 1, kHalf, kHigh});
    std::vector<glm::dvec2> positions;
    for (const double y : {.7, 2.0, 4.0})
        for (const double z : {1.1, 1.3, 1.6, 1.75, 2.0}) {
            scene.listeners.emplace_back(0, y, z);
            positions.emplace_back(y, z);
        }
    const auto both = [&](double middle) { return rectangleOf(-kHalf, middle - kHigh, kHalf, middle + kHigh); };
    std::vector<LineImage> images{{{-2, 1.2}, {both(0)}}, {{-2, -1.2}, {both(0)}}};
    if (ceiling > 0) images.push_back({{-2, 2 * ceiling - 1.2}, {both(0), both(2 * ceiling)}});
    scene.reference = linesReference(images, positions);
    scene.lastBand = 5;
    scene.line = true;
    return scene;
}

/// The corner of a building of 5 m.
ListenedScene cornerScene() {
    ListenedScene scene{"corner of a building", {}, {-1.5, .8, 0}, {}};
    scene.box({-5, -5, -kFar}, {0, 0, kFar});
    std::vector<glm::dvec2> positions;
    for (const double x : {.4, 1.2, 3.0})
        for (const double y : {.5, -.5, -1.5, -3.0}) {
            scene.listeners.emplace_back(x, y, 0);
            positions.emplace_back(x, y);
        }
    scene.reference = linesReference({{{-1.5, .8}, {rectangleOf(-5, -5, 0, 0)}}}, positions);
    scene.lastBand = 4;
    scene.line = true;
    return scene;
}

/// A doorway in a wall of .2 m along y = 0, and a door that is open by so many degrees; below 0: none.
ListenedScene doorScene(double degrees) {
    ListenedScene scene{degrees < 0 ? "opening" : "door ajar", {}, {.1, -2, 0}, {}};
    std::vector<Closed> outlines{rectangleOf(-2, -.1, -.45, .1), rectangleOf(.45, -.1, 2, .1)};
    if (degrees >= 0) {
        const double cosine = std::cos(degrees * M_PI / 180), sine = std::sin(degrees * M_PI / 180);
        Closed door = rectangleOf(0, -.02, .88, .02);
        for (glm::dvec2& p : door) p = glm::dvec2(p.x * cosine - p.y * sine - .45, p.x * sine + p.y * cosine + .14);
        outlines.push_back(door);
    }
    for (const Closed& one : outlines) {
        std::vector<glm::dvec3> corners;
        for (const glm::dvec2& p : one) corners.emplace_back(p.x, p.y, 0);
        test::RoundMesh wall = test::drawn(corners, 2 * kFar);
        const auto n = static_cast<std::uint32_t>(one.size());
        wall.addQuad(3, 2, 1, 0);
        wall.addQuad(n, n + 1, n + 2, n + 3);
        scene.add(wall, {0, 0, -kFar});
    }
    std::vector<glm::dvec2> positions;
    for (const double y : {1.2, 2.0, 3.0})
        for (const double x : {-1.6, -.8, -.2, .5, 1.3}) {
            scene.listeners.emplace_back(x, y, 0);
            positions.emplace_back(x, y);
        }
    scene.reference = linesReference({{{.1, -2}, outlines}}, positions);
    scene.lastBand = 5;
    scene.line = true;
    return scene;
}

/// Tables in a row along y, with legs, or one that is round.
ListenedScene tableScene(int count, bool round) {
    ListenedScene scene{round ? "round table" : count > 1 ? "tables in a row" : "table", {}, {.1, -1.0, 1.2}, {}};
    scene.level(0);
    const double last = 1.6 * (count - 1);
    for (int i = 0; i < count; ++i) {
        const double y = 1.6 * i;
        if (round) {
            scene.add(test::cylinderMesh(.6, .70, .74, 32), {0, y, 0});
            scene.add(test::cylinderMesh(.05, 0, .70, 16), {0, y, 0});
            continue;
        }
        scene.box({-.8, y - .4, .7}, {.8, y + .4, .74});
        for (const double legX : {-.77, .72})
            for (const double legY : {-.37, .32}) scene.box({legX, y + legY, 0}, {legX + .05, y + legY + .05, .7});
    }
    for (const double y : {.7, 1.2, 2.0})
        for (const double z : {1.1, 1.3, 1.6}) scene.listeners.emplace_back(-.1, last + y, z);
    return scene;
}

/// A table top or a box above a floor, without legs, by boundary elements.
ListenedScene boxScene(const std::string& name, const glm::dvec3& low, const glm::dvec3& high, const glm::dvec3& source,
                       const std::vector<glm::dvec3>& listeners) {
    ListenedScene scene{name, {}, source, listeners};
    scene.level(0);
    scene.box(low, high);
    scene.reference = [=](std::size_t tone) {
        const double hz = edgeToneHz(static_cast<double>(tone));
        test::RigidBox body(low, high, 8);
        if (low.z > 0)
            body.add(test::RigidBox({low.x, low.y, -high.z}, {high.x, high.y, -low.z}, 8));
        else
            body = test::RigidBox({low.x, low.y, -high.z}, high, 9);
        body.light(source, 2 * M_PI * hz / kPartsSpeed);
        std::vector<double> energies;
        for (const glm::dvec3& here : listeners)
            energies.push_back(std::norm(body.pressure(here)) + std::norm(body.pressure({here.x, here.y, -here.z})));
        return energies;
    };
    scene.lastBand = 3;
    return scene;
}

/// The top of a round table above a floor.
ListenedScene discScene(const std::vector<glm::dvec3>& listeners) {
    ListenedScene scene{"round top, boundary elements", {}, {.1, -1, 1.2}, listeners};
    scene.level(0);
    scene.add(test::cylinderMesh(.6, .7, .74, 32), {0, 0, 0});
    scene.reference = [source = scene.source, listeners](std::size_t tone) {
        test::RigidFrustum body(.6, .6, .7, .74), image(.6, .6, -.74, -.7);
        body.add(image);
        body.light(source, 2 * M_PI * edgeToneHz(static_cast<double>(tone)) / kPartsSpeed);
        std::vector<double> energies;
        for (const glm::dvec3& here : listeners)
            energies.push_back(std::norm(body.pressure(here)) + std::norm(body.pressure({here.x, here.y, -here.z})));
        return energies;
    };
    scene.lastBand = 3;
    return scene;
}
/// Three table tops in a row, without ends.
ListenedScene slabsScene() {
    ListenedScene scene{"three slabs in a row", {}, {0, -1, 1.2}, {}};
    scene.level(0);
    std::vector<Closed> outlines;
    for (const double y : {0.0, 1.6, 3.2}) {
        scene.box({-kFar + 1, y - .4, .7}, {kFar - 1, y + .4, .74});
        outlines.push_back(rectangleOf(y - .4, .7, y + .4, .74));
        outlines.push_back(rectangleOf(y - .4, -.74, y + .4, -.7));
    }
    std::vector<glm::dvec2> positions;
    for (const double y : {3.9, 4.4, 5.2})
        for (const double z : {1.1, 1.3, 1.6}) {
            scene.listeners.emplace_back(0, y, z);
            positions.emplace_back(y, z);
        }
    scene.reference = linesReference({{{-1, 1.2}, outlines}, {{-1, -1.2}, outlines}}, positions);
    scene.lastBand = 4;
    scene.line = true;
    return scene;
}

/// Columns of .6 m in a row.
ListenedScene columnScene(int count) {
    ListenedScene scene{count > 1 ? "two columns" : "column", {}, {-3, .1, 0}, {}};
    for (int i = 0; i < count; ++i) scene.add(test::cylinderMesh(.3, -kFar, kFar, 24), {1.5 * i, .05 * i, 0});
    const double last = 1.5 * (count - 1);
    for (const double x : {.6, 1.5, 3.0})
        for (const double y : {-.6, -.2, 0.0, .15, .45}) scene.listeners.emplace_back(last + x, y, 0);
    scene.reference = [=, source = scene.source, listeners = scene.listeners](std::size_t tone) {
        const double k = 2 * M_PI * edgeToneHz(static_cast<double>(tone)) / kPartsSpeed;
        std::vector<double> energies;
        for (const glm::dvec3& here : listeners) {
            if (count > 1) {
                test::BesideTwo at{{{0, 0}, {1.5, .05}}, {.3, .3}, {source.x, source.y}, {here.x, here.y}};
                energies.push_back(std::norm(test::besideTwoCylinders(at, k)));
                continue;
            }
            test::BesideRound at;
            at.radius = .3;
            at.source = glm::length(source);
            at.listener = glm::length(here);
            at.angle = std::acos(glm::dot(source, here) / at.source / at.listener);
            energies.push_back(std::norm(test::besideRigidCylinder(at, k)));
        }
        return energies;
    };
    scene.lastBand = count > 1 ? 4 : 7;
    return scene;
}

/// The floor of the stalls, a pit of 2 m below it, and a stage 1 m above that reaches over the pit.
ListenedScene pitScene() {
    ListenedScene scene{"orchestra pit", {}, {.3, 2, -1.2}, {}};
    constexpr double kWide = 8;
    scene.quad({{{-kWide, -20, 0}, {kWide, -20, 0}, {kWide, -.1, 0}, {-kWide, -.1, 0}}});
    scene.box({-kWide, -.1, -2}, {kWide, 0, .8});
    scene.quad({{{-kWide, 0, -2}, {kWide, 0, -2}, {kWide, 5, -2}, {-kWide, 5, -2}}});
    scene.quad({{{-kWide, 5, -2}, {kWide, 5, -2}, {kWide, 5, 1}, {-kWide, 5, 1}}});
    scene.box({-kWide, 3.5, .8}, {kWide, 12, 1});
    for (const double y : {-2.0, -6.0, -12.0})
        for (const double z : {1.2, 2.5, 4.0}) scene.listeners.emplace_back(-.4, y, z);
    return scene;
}

/// A car of two boxes and six wheels.
ListenedScene carScene() {
    ListenedScene scene{"car between", {}, {.4, -3, 1.2}, {}};
    scene.level(0);
    scene.box({-2.1, -.9, .25}, {2.1, .9, .9});
    scene.box({-1.1, -.8, .9}, {.9, .8, 1.45});
    for (const double x : {-1.4, -.7, .7})
        for (const double y : {-.75, .75}) scene.add(test::cylinderMesh(.3, 0, .2, 24), {x, y, 0});
    for (const double y : {1.4, 3.0, 6.0})
        for (const double z : {1.1, 1.3, 1.6}) scene.listeners.emplace_back(-.3, y, z);
    return scene;
}

/// Screens one behind the other, with ends or without.
ListenedScene screensScene(bool ends) {
    ListenedScene scene{ends ? "two short screens" : "two screens", {}, {0, -1.2, 1.2}, {}};
    scene.level(0);
    const double half = ends ? 1.6 : kFar - 1;
    std::vector<Closed> outlines;
    for (const double y : {0.0, 1.6}) {
        scene.box({-half, y - .03, 0}, {half, y + .03, 1.5});
        outlines.push_back(rectangleOf(y - .03, -1.5, y + .03, 1.5));
    }
    std::vector<glm::dvec2> positions;
    for (const double y : {2.4, 4.0})
        for (const double z : {1.1, 1.3, 1.48, 1.6, 1.8}) {
            scene.listeners.emplace_back(ends ? -.2 : 0, y, z);
            positions.emplace_back(y, z);
        }
    if (ends) return scene;
    scene.reference = linesReference({{{-1.2, 1.2}, outlines}, {{-1.2, -1.2}, outlines}}, positions);
    scene.lastBand = 4;
    scene.line = true;
    return scene;
}

/// Plates on rods.
ListenedScene standScene() {
    ListenedScene scene{"music stands", {}, {0, -1.2, 1.3}, {}};
    scene.level(0);
    for (const double x : {-.6, 0.0, .6}) {
        scene.box({x - .25, -.01, 1.0}, {x + .25, .01, 1.35});
        scene.box({x - .015, -.015, 0}, {x + .015, .015, 1.0});
    }
    for (const double y : {.8, 1.5, 3.0})
        for (const double z : {1.1, 1.3, 1.6}) scene.listeners.emplace_back(.1, y, z);
    return scene;
}

std::vector<ListenedScene> listenedScenes(bool quick) {
    std::vector<ListenedScene> scenes{screenScene(0), columnScene(1)};
    if (quick) return scenes;
    std::vector<glm::dvec3> behind;
    for (const double y : {.9, 1.5, 3.0})
        for (const double z : {.6, 1.1, 1.6}) behind.emplace_back(-.2, y, z);
    scenes.push_back(screenScene(2.8));
    scenes.push_back(cornerScene());
    scenes.push_back(doorScene(30));
    scenes.push_back(doorScene(-1));
    scenes.push_back(tableScene(1, false));
    scenes.push_back(tableScene(3, false));
    scenes.push_back(tableScene(1, true));
    scenes.push_back(boxScene("table top, boundary elements", {-.8, -.4, .7}, {.8, .4, .74}, {.1, -1, 1.2}, behind));
    scenes.push_back(boxScene("cupboard, boundary elements", {-.6, -.3, 0}, {.6, .3, 1.2}, {.1, -1.5, 1.0}, behind));
    scenes.push_back(columnScene(2));
    scenes.push_back(pitScene());
    scenes.push_back(carScene());
    scenes.push_back(screensScene(false));
    scenes.push_back(screensScene(true));
    scenes.push_back(discScene(behind));
    scenes.push_back(slabsScene());
    scenes.push_back(standScene());
    return scenes;
}

/// A mechanism left out.
struct PartLeftOut {
    std::string name = {};
    DiffractionParts parts{};
    int order = 2;
};
std::vector<PartLeftOut> partsLeftOut() {
    return {{"all"},
            {"no diffraction", {}, 0},
            {"no pairs", {}, 1},
            {"no bent images", {.images = false}},
            {"facets in place of round bodies", {.roundBodies = false}},
            {"small bodies as large ones", {.smallBodies = false}},
            {"edges hidden in part as whole", {.hiddenParts = false}}};
}

struct PartsHeard {
    PartLevels levels;
    double seconds = 0;  // CPU time a listener
};
PartsHeard heardWith(const ListenedScene& scene, const PartLeftOut& part) {
    diffractionParts() = part.parts;
    const test::Walled walls = scene.mesh.walled();
    PartsHeard heard;
    const double start = cpuSeconds();
    for (const glm::dvec3& listener : scene.listeners) {
        const TraceResult traced = walls.traced(scene.source, listener, part.order);
        auto& levels = heard.levels.emplace_back();
        for (const Arrival& arrival : traced.arrivals) {
            const double length = arrival.seconds * kPartsSpeed, distance = glm::distance(scene.source, listener);
            if (scene.line && length > 6 * distance) continue;
            for (std::size_t b = 0; b < kBandCount; ++b)
                levels[b] += 4 * M_PI * arrival.energy[b] * (scene.line ? length / distance : 1);
        }
    }
    heard.seconds = (cpuSeconds() - start) / static_cast<double>(scene.listeners.size());
    diffractionParts() = {};
    return heard;
}

/// The true levels, by boundary elements or series; empty if they are unknown.
PartLevels truthOf(const ListenedScene& scene) {
    PartLevels truth;
    if (!scene.reference) return truth;
    truth.resize(scene.listeners.size());
    // Bodies by boundary elements take long: one tone stands for an octave.
    const bool oneTone = !scene.line && scene.lastBand < 4;
    for (std::size_t b = kFirstBand; b <= scene.lastBand; ++b)
        for (std::size_t tone = 5 * b; tone < 5 * b + 5; ++tone) {
            if (oneTone && tone % 5 != 2) continue;
            const std::vector<double> at = scene.reference(tone);
            for (std::size_t p = 0; p < at.size(); ++p) truth[p][b] += (oneTone ? 1 : .2) * at[p];
        }
    return truth;
}

struct PartsOff {
    double maximum = 0, rms = 0, worst = 0;  // dB; `most` beside all mechanisms, the others beside the truth
};
PartsOff offOf(const ListenedScene& scene, const PartLevels& heard, const PartLevels& all, const PartLevels& truth) {
    PartsOff off;
    int count = 0;
    for (std::size_t p = 0; p < heard.size(); ++p)
        for (std::size_t b = kFirstBand; b <= kLastBand; ++b) {
            off.maximum = std::max(off.maximum, std::abs(10 * std::log10(heard[p][b] / all[p][b])));
            if (truth.empty() || b > scene.lastBand) continue;
            const double one = 10 * std::log10(heard[p][b] / truth[p][b]);
            off.rms += one * one;
            off.worst = std::max(off.worst, std::abs(one));
            ++count;
        }
    off.rms = std::sqrt(off.rms / std::max(1, count));
    return off;
}

}  // namespace

bool chartSoundParts(const ChartSink& sink, bool quick) {
    constexpr double kNothing = 40;  // dB; drawn where nothing is heard
    Chart changes{"sound-parts-change",
                  "Diffraction: levels without each mechanism",
                  "Largest change of an octave from 125 Hz to 4 kHz at any listener's place, from direct sound, mirror "
                  "images of first order and what bends of both. 40 dB: nothing is heard at some place. The CSV has "
                  "the CPU time a place.",
                  {"change (dB)"},
                  {""},
                  {},
                  {}};
    Chart errors{"sound-parts-error",
                 "Diffraction: how far levels are off",
                 "Root mean square over octaves and places, from boundary elements (screens, corner, doors, tables, "
                 "cupboard) up to 250 Hz to 1 kHz, and exact series (columns) up to 4 kHz. The CSV has the worst.",
                 {"error (dB)"},
                 {""},
                 {},
                 {}};
    const std::vector<PartLeftOut> parts = partsLeftOut();
    for (Chart* chart : {&changes, &errors})
        for (const PartLeftOut& part : parts) chart->series.push_back({part.name, {}, false, true});
    for (const ListenedScene& scene : listenedScenes(quick)) {
        const auto row = static_cast<double>(changes.rows.size()), known = static_cast<double>(errors.rows.size());
        const PartLevels truth = truthOf(scene);
        changes.rows.push_back(scene.name);
        if (!truth.empty()) errors.rows.push_back(scene.name);
        const PartsHeard all = heardWith(scene, parts.front());
        for (std::size_t i = 0; i < parts.size(); ++i) {
            const PartsHeard heard = i == 0 ? all : heardWith(scene, parts[i]);
            const PartsOff off = offOf(scene, heard.levels, all.levels, truth);
            changes.series[i].points.push_back(
                {std::min(off.maximum, kNothing), row, fmt::format("{:.2g} ms", 1e3 * heard.seconds)});
            if (!truth.empty())
                errors.series[i].points.push_back({std::min(off.rms, kNothing), known,
                                                   fmt::format("at worst {:.1f}", std::min(off.worst, kNothing))});
        }
    }
    sink(changes);
    sink(errors);
    return true;
}

}  // namespace rtsg::bench
