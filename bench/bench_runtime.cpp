// The run-time of X3D: scripts, levels of detail, routes, sensors and followers by the thousand.
#include <array>
#include <atomic>
#include <cmath>
#include <filesystem>
#include <thread>

#include <unistd.h>

#include <fmt/format.h>
#include <glm/gtc/quaternion.hpp>

#include <rtsg/core/device_input.h>
#include <rtsg/core/hash_terms.h>
#include <rtsg/core/listeners.h>
#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/scripts/run_scripts.h>

#include "bench.h"
#include "bench_bodies.h"
#include "scenes/scenes.h"

namespace rtsg::bench {

namespace {

/// Median CPU time of a frame, seconds; `before` edits the scene, outside of what is measured.
template <class Edit>
double runtimeFrameSeconds(Scene& scene, int frames, const Edit& before) {
    std::vector<double> times;
    for (int i = 0; i < frames; ++i) {
        before(i);
        const double start = cpuSeconds();
        scene.newFrame(scene.now() + 1 / 60.0);
        times.push_back(cpuSeconds() - start);
    }
    return median(times);
}

void load(Scene& scene, const std::string& body) {
    runScripts(scene);
    Diagnostics diagnostics("bench");
    (void)loadText(scene, "#X3D V4.0 utf8\nPROFILE Full\n" + body, diagnostics);
}

/// Seconds for the same arithmetic on bare arrays.
template <class F>
double bareRuntimeSeconds(std::size_t count, const F& value) {
    std::vector<Vec3f> out(count);
    std::vector<double> times;
    for (int i = 0; i < 100; ++i) {
        const double start = cpuSeconds();
        for (std::size_t k = 0; k < count; ++k) out[k] = value(static_cast<float>(i) / 100 + static_cast<float>(k));
        keep(out.data());
        times.push_back(cpuSeconds() - start);
    }
    return median(times);
}

/// The figures of the paper, without a picture of them: a sensor each, and an interpolator for each joint.
void marching(const Report& report, bool quick) {
    const auto folder = std::filesystem::temp_directory_path() / fmt::format("rtsg-bench-runtime-{}", getpid());
    std::filesystem::create_directories(folder);
    Scene scene;
    Diagnostics diagnostics("bench");
    const auto written = writeBenchScene("Troopers", quick ? .1 : 1, false, folder);
    const bool loaded = written && loadFile(scene, (folder / "Troopers.x3dv").string(), diagnostics);
    std::error_code ignored;
    std::filesystem::remove_all(folder, ignored);
    if (!loaded) return;
    std::size_t figures = 0, joints = 0;
    scene.forEachNode([&](const Node& node) {
        figures += node.is(x3d::TimeSensor::type);
        joints += node.is(x3d::OrientationInterpolator::type);
    });
    scene.newFrame(0);
    const auto rotation = [](float x) {
        const glm::dvec3 axis(1, 0, 0);
        const glm::dquat from = glm::angleAxis(.1, axis), to = glm::angleAxis(.4 + x * 1e-4, axis);
        const glm::dquat between = glm::slerp(from, to, .3);
        return Vec3f(glm::axis(between) * glm::angle(between));
    };
    report({"runtime", fmt::format("{} Troopers, {} joints", figures, joints), "a frame", "ms",
            1e3 * runtimeFrameSeconds(scene, 1000, [](int) {}), "", 0, "the turns between the keys alone",
            1e3 * bareRuntimeSeconds(joints, rotation)});
}

/// Seconds that the engine takes for a call of such a function, by one program that has `count` of them and no fields.
double bareCallSeconds(int count) {
    Scene scene;
    load(scene, fmt::format("DEF S Script {{ inputOnly SFInt32 go url \"ecmascript: function make(r) {{ var turns = r, "
                            "value; return function(f) {{ turns += f; value = new SFVec3f(r * Math.cos(turns), f, r * "
                            "Math.sin(turns)); }}; }} var all = []; for (var i = 0; i < {}; ++i) all.push(make(i)); "
                            "function go(n) {{ for (var k = 0; k < n; ++k) for (var i = 0; i < all.length; ++i) "
                            "all[i](k / 60); }}\" }}",
                            count));
    const Node& script = scene.node(scene.findName("S"));
    constexpr std::int32_t rounds = 100;
    return runtimeFrameSeconds(scene, 5,
                               [&](int) { (void)scene.sendEvent(script.id(), script.type().find("go"), rounds); }) /
           (rounds * count);
}

void scripts(const Report& report, bool quick) {
    const int count = quick ? 100 : 1000;
    std::string text = "DEF C TimeSensor { loop TRUE }\n";
    for (int i = 0; i < count; ++i)
        text += fmt::format(
            "DEF S{0} Script {{ inputOnly SFFloat set_fraction outputOnly SFVec3f value_changed initializeOnly SFFloat "
            "r {0} url \"ecmascript: var turns = 0; function initialize() {{ turns = r; }} function set_fraction(f) {{ "
            "turns += f; value_changed = new SFVec3f(r * Math.cos(turns), f, r * Math.sin(turns)); }}\" }}\nDEF T{0} "
            "Transform {{ }}\nROUTE C.fraction_changed TO S{0}.set_fraction\nROUTE S{0}.value_changed TO "
            "T{0}.translation\n",
            i);
    const double bytesBefore = residentBytes();
    Scene scene;
    load(scene, text);
    const double bytesLoaded = residentBytes(), start = cpuSeconds(), startWall = wallSeconds();
    scene.newFrame(.001);
    const double seconds = cpuSeconds() - start, wall = wallSeconds() - startWall;
    const double bytes = residentBytes() - bytesLoaded;
    const std::string what = fmt::format("{} Scripts, one event and one output each a frame", count);
    report({"runtime", what, "start, CPU", "s", seconds, "", 0, "", 0});
    report({"runtime", what, "start, by the clock", "s", wall, "", 0, "", 0});
    report({"runtime", what, "memory of the running programs", "MB", bytes / 1e6, "the scene itself",
            (bytesLoaded - bytesBefore) / 1e6, "", 0});
    const double frame = runtimeFrameSeconds(scene, 200, [](int) {});
    report({"runtime", what, "a frame", "ms", frame * 1e3, "", 0, "the arithmetic alone",
            1e3 * bareRuntimeSeconds(static_cast<std::size_t>(count),
                                     [](float x) { return Vec3f(std::cos(x), x, std::sin(x)); })});
    report({"runtime", what, "a call, with its event, its output and two routes", "us", 1e6 * frame / count, "", 0,
            "such functions called by one program", 1e6 * bareCallSeconds(count)});
}

void pushes(const Report& report, bool quick) {
    const int count = quick ? 100'000 : 1'000'000;
    const auto seconds = [&](std::string_view created, std::string_view element, std::string_view put) {
        Scene scene;
        const std::string_view field = element == "i" ? "MFFloat" : "MFVec3f";
        load(scene,
             fmt::format("Script {{ inputOutput {0} kept [] url \"ecmascript: function initialize() {{ var a = {1}; "
                         "for (var i = 0; i < {2}; ++i) {3}; kept = a; }}\" }}",
                         field, created, count,
                         fmt::format(fmt::runtime(put == "push" ? "a.push({})" : "a[i] = {}"), element)));
        const double start = cpuSeconds();
        scene.newFrame(0);
        return cpuSeconds() - start;
    };
    for (const std::string_view put : {"push", "a[i] ="})
        for (const std::string_view element : {"i", "new SFVec3f(i, 1, 2)"}) {
            const std::string_view type = element == "i" ? "new MFFloat()" : "new MFVec3f()";
            report({"runtime",
                    fmt::format("a script fills {} with {} values: {} {}", type.substr(4), count, put, element),
                    "the call, with the assignment to a field", "s", seconds(type, element, put),
                    "the same with an Array", seconds("[]", element, put), "", 0});
        }
}

void levels(const Report& report, bool quick) {
    const int count = quick ? 1000 : 10'000;
    std::string text = "DEF V Viewpoint { position 0 0 10 }\nDEF M Transform { }\n";
    for (int i = 0; i < count; ++i)
        text += fmt::format(
            "Transform {{ translation {} 0 0 children LOD {{ range [ 5 20 ] children [ Group {{ }} Group {{ }} "
            "Group {{ }} ] }} }}\n",
            i % 100);
    Scene scene;
    load(scene, text);
    scene.newFrame(0);
    const NodeId mover = scene.findName("M"), view = scene.findName("V");
    const double rest = runtimeFrameSeconds(scene, 100, [](int) {});
    const double moved = runtimeFrameSeconds(scene, 100, [&](int i) {
        (void)scene.set(mover, x3d::Transform::translation, Vec3f(static_cast<float>(i), 0, 0));
    });
    const double viewed = runtimeFrameSeconds(scene, 100, [&](int i) {
        (void)scene.set(view, x3d::Viewpoint::position, Vec3f(static_cast<float>(i), 0, 10));
    });
    const std::string what = fmt::format("{} LODs", count);
    const double clock = cpuClockSeconds() * 1e3;
    report({"runtime", what, "a frame at rest", "ms", rest * 1e3, "", 0, "reading the clock", clock});
    report({"runtime", what, "a frame, one Transform beside them moves", "ms", moved * 1e3, "", 0, "reading the clock",
            clock});
    report({"runtime", what, "a frame, the viewer moves", "ms", viewed * 1e3, "", 0, "reading the clock", clock});
}

void followers(const Report& report, bool quick) {
    const int count = quick ? 1000 : 10'000;
    for (const auto& [name, body] : {std::pair{"PositionDamper", "tau 100 tolerance 0"},
                                     {"PositionChaser", "duration 100"},
                                     {"OrientationDamper", "tau 100 tolerance 0"}}) {
        const bool rotations = std::string_view(name).starts_with("O");
        std::string text;
        for (int i = 0; i < count; ++i)
            text += fmt::format(
                "DEF F{0} {1} {{ {2} initialDestination {3} }} DEF T{0} Transform {{ }} ROUTE "
                "F{0}.value_changed TO T{0}.{4}\n",
                i, name, body, rotations ? "0 0 1 2" : "1 2 3", rotations ? "rotation" : "translation");
        Scene scene;
        load(scene, text);
        scene.newFrame(0);
        report({"runtime", fmt::format("{} of type {} on their way, each with a route to a Transform", count, name),
                "a frame", "ms", 1e3 * runtimeFrameSeconds(scene, 100, [](int) {}), "", 0,
                "the arithmetic of a damper of order 3 alone",
                1e3 * bareRuntimeSeconds(static_cast<std::size_t>(count), [](float x) {
                    const double s = x * .01, e = std::exp(-s);
                    return Vec3f(glm::dvec3(1, 2, 3) * (1 - e * (1 + s + s * s / 2)));
                })});
    }
}

/// Sensor, interpolator and Transform, each `count` times, or with one sensor for all.
std::string chains(int count, bool oneSensor) {
    std::string text = "DEF C TimeSensor { loop TRUE }\n";
    for (int i = 0; i < count; ++i)
        text += fmt::format(
            "{1} DEF P{0} PositionInterpolator {{ key [ 0 .5 1 ] keyValue [ 0 0 0, 1 {0} 0, 0 0 0 ] }} DEF T{0} "
            "Transform {{ }} ROUTE C{2}.fraction_changed TO P{0}.set_fraction ROUTE P{0}.value_changed TO "
            "T{0}.translation\n",
            i, oneSensor ? "" : fmt::format("DEF C{0} TimeSensor {{ loop TRUE cycleInterval {1} }}", i, 1 + .001 * i),
            oneSensor ? "" : std::to_string(i));
    return text;
}

/// Seconds by the clock for a bare loop over as much memory as so many chains take, which hashes as much as five
/// changes each cost: by one thread, and by two that meet as often as those of a frame. What two can save here.
std::array<double, 2> bareThreadSeconds(std::size_t count) {
    constexpr std::size_t kWords = 140, kChanges = 5, kHashes = 8, kMeetings = 4;
    std::vector<std::uint64_t> memory(count * kWords);
    const auto run = [&](std::size_t first, std::size_t last) {
        for (std::size_t i = first; i < last; ++i) {
            std::uint64_t* const own = memory.data() + i * kWords;
            for (std::size_t k = 0; k < kHashes * kChanges; ++k) own[k] = hashOfBytes(own + k, 12, i).low;
            for (std::size_t k = kHashes * kChanges; k < kWords; ++k) ++own[k];
        }
    };
    std::atomic<std::uint32_t> begun{0}, done{0};
    std::atomic<bool> stop{false};
    const std::size_t half = count / 2;
    std::jthread other([&] {
        for (std::uint32_t seen = 0; !stop;) {
            if (begun == seen) {
                std::this_thread::yield();
                continue;
            }
            const std::size_t part = seen++ % kMeetings;
            run(half + part * half / kMeetings, half + (part + 1) * half / kMeetings);
            done = seen;
        }
    });
    std::vector<double> times[2];
    for (int i = 0; i < 200; ++i) {
        double start = wallSeconds();
        run(0, 2 * half);
        times[0].push_back(wallSeconds() - start);
        start = wallSeconds();
        for (std::size_t part = 0; part < kMeetings; ++part) {
            const std::uint32_t round = ++begun;
            run(part * half / kMeetings, (part + 1) * half / kMeetings);
            while (done != round) std::this_thread::yield();
        }
        times[1].push_back(wallSeconds() - start);
    }
    stop = true;
    keep(memory.data());
    return {median(times[0]), median(times[1])};
}

/// By the clock on the wall: what several threads save. One scene, by turns with one thread and with two: two scenes
/// would lie differently in memory, the second one where loading the first has left holes.
void threads(const Report& report, bool quick) {
    for (const auto& [count, oneSensor] : {std::pair{10'000, false}, {10'000, true}, {1000, false}, {100, false}}) {
        Scene scene;
        std::vector<double> times[2];
        load(scene, chains(count, oneSensor));
        // Threads begin, and routes are divided, in the first frames of a turn.
        constexpr int kRotation = 30, kWarm = 10;
        for (int round = 0; round < (quick ? 4 : 40); ++round)
            for (std::size_t i = 0; i < 2; ++i) {
                scene.setThreads(i == 0 ? 1 : 2);
                for (int frame = 0; frame < kRotation; ++frame) {
                    const double start = wallSeconds();
                    scene.newFrame(scene.now() + 1 / 60.0);
                    if (frame >= kWarm) times[i].push_back(wallSeconds() - start);
                }
            }
        const std::string what = oneSensor ? fmt::format("1 sensor, {0} interpolators and Transforms", count)
                                           : fmt::format("{0} chains of sensor, interpolator and Transform", count);
        report({"runtime", what, "a frame by the clock, two threads", "ms", 1e3 * median(times[1]), "one thread",
                1e3 * median(times[0]), "", 0});
        if (oneSensor) continue;
        const auto [alone, both] = bareThreadSeconds(static_cast<std::size_t>(count));
        report({"runtime", what, "bare loops over as much memory, two threads", "ms", 1e3 * both, "one thread",
                1e3 * alone, "", 0});
    }
}

void proximity(const Report& report, bool quick) {
    const int count = quick ? 1000 : 10'000;
    std::string text = "DEF V Viewpoint { position 0 0 10 }\n";
    for (int i = 0; i < count; ++i)
        text += fmt::format("Transform {{ translation {} 0 {} children ProximitySensor {{ size 2 2 2 }} }}\n",
                            i % 100 * 3, i / 100 * 3);
    Scene scene;
    load(scene, text);
    scene.newFrame(0);
    const NodeId view = scene.findName("V");
    const std::string what = fmt::format("{} ProximitySensors", count);
    report({"runtime", what, "a frame at rest", "ms", 1e3 * runtimeFrameSeconds(scene, 100, [](int) {}), "", 0,
            "reading the clock", cpuClockSeconds() * 1e3});
    const double moved = runtimeFrameSeconds(scene, 100, [&](int i) {
        (void)scene.set(view, x3d::Viewpoint::position, Vec3f(static_cast<float>(i) * .1f, 0, 10));
    });
    report({"runtime", what, "a frame, the viewer moves", "ms", moved * 1e3, "", 0, "the test of the boxes alone",
            1e3 * bareRuntimeSeconds(static_cast<std::size_t>(count), [](float x) {
                const glm::vec3 d = glm::abs(glm::vec3(x, 0, 10) - glm::vec3(1, 2, 3));
                return Vec3f(d.x <= 1 && d.y <= 1 && d.z <= 1 ? 1 : 0);
            })});
}

/// A ray that always meets the same shape.
struct OneShape final : SpaceQueries {
    PointerHit hit;
    std::optional<PointerHit> firstHit(const Vec3d&, const Vec3d&) override { return hit; }
    std::vector<std::vector<NodeId>> within(const Vec3d&, double) override { return {}; }
    std::vector<Crossing> crossings(const Vec3d&, const Vec3d&, double) override { return {}; }
    std::vector<ShapeBox> boxes() override { return {}; }
    std::vector<Meeting> meetings(const Vec3d&, double, TriangleTest&) override { return {}; }
    std::vector<Vec3d> corners(const Node&) override { return {}; }
};

void touches(const Report& report, bool quick) {
    const int count = quick ? 1000 : 10'000;
    std::string text;
    for (int i = 0; i < count; ++i)
        text += fmt::format(
            "DEF T{0} Transform {{ translation {0} 0 0 children [ DEF S{0} TouchSensor {{ }} DEF B{0} Shape {{ }} ] "
            "}}\n",
            i);
    Scene scene;
    load(scene, text);
    scene.newFrame(0);
    OneShape space;
    space.hit.path = {scene.findName("T7"), scene.findName("B7")};
    scene.setSpaceQueries(&space);
    const std::string what = fmt::format("{} TouchSensors", count);
    const double clock = cpuClockSeconds() * 1e3;
    report({"runtime", what, "a frame at rest", "ms", 1e3 * runtimeFrameSeconds(scene, 100, [](int) {}), "", 0,
            "reading the clock", clock});
    const double over = runtimeFrameSeconds(scene, 100, [&](int i) {
        PointerInput input;
        input.origin = {i * .01, 0, 9};
        (void)sendPointer(scene, input);
    });
    report({"runtime", what, "a frame, a pointer moves over one of them", "ms", over * 1e3, "", 0, "reading the clock",
            clock});
}

void listening(const Report& report, bool quick) {
    const int count = quick ? 1000 : 10'000;
    std::string text = "DEF C TimeSensor { loop TRUE }\n";
    for (int i = 0; i < count; ++i)
        text += fmt::format(
            "DEF P{0} PositionInterpolator {{ key [ 0 1 ] keyValue [ 0 0 0, 1 {0} 0 ] }}\nROUTE "
            "C.fraction_changed TO P{0}.set_fraction\n",
            i);
    Scene scene;
    load(scene, text);
    const std::string what = fmt::format("{} interpolators", count);
    const auto frame = [&] { return 1e3 * runtimeFrameSeconds(scene, 100, [](int) {}); };
    const double alone = frame();
    double sum = 0;
    const auto add = [&](Listeners& listeners, int number) {
        (void)listeners.onField(scene.findName(fmt::format("P{}", number)), x3d::PositionInterpolator::value_changed,
                                [&](const Vec3f& value, double) { sum += double{value.y}; });
    };
    {
        Listeners listeners(scene);
        add(listeners, 1);
        report({"runtime", what, "a frame, one of them is listened to", "ms", frame(), "nobody listens", alone, "", 0});
        for (int i = 2; i < count; ++i) add(listeners, i);
        report(
            {"runtime", what, "a frame, all of them are listened to", "ms", frame(), "nobody listens", alone, "", 0});
    }
    scene.setEventListener([&](double, const Node&, FieldIndex, const Value&) { sum += 1; });
    report(
        {"runtime", what, "a frame, one function hears of every event", "ms", frame(), "nobody listens", alone, "", 0});
    keep(&sum);
}

/// A viewer whom nobody moves.
void navigation(const Report& report, bool) {
    for (const char* type : {"EXAMINE", "WALK"}) {
        Scene scene;
        load(scene, fmt::format("NavigationInfo {{ type \"{}\" }} Transform {{ children Viewpoint {{ }} }} Shape {{ }}",
                                type));
        const double off = 1e6 * runtimeFrameSeconds(scene, 1000, [](int) {});
        scene.setNavigation(true);
        report({"runtime", fmt::format("a scene at rest, {}", type), "a frame, with navigation", "us",
                1e6 * runtimeFrameSeconds(scene, 1000, [](int) {}), "without", off, "", 0});
    }
}

void dropped(const Report& report, bool quick) {
    const int count = quick ? 200 : 1000, frames = quick ? 10 : 40;
    const auto seconds = [&](std::string_view make, std::size_t& left) {
        Scene scene;
        load(scene, fmt::format("Script {{ url \"ecmascript: var scene = Browser.currentScene, made = "
                                "scene.createNode('Transform'); function "
                                "prepareEvents() {{ for (var i = 0; i < {}; ++i) {}; }}\" }}",
                                count, make));
        scene.newFrame(0);
        const double start = cpuSeconds();
        for (int i = 1; i <= frames; ++i) scene.newFrame(i);
        left = scene.nodeCount();
        return (cpuSeconds() - start) / frames;
    };
    std::size_t left = 0, unused = 0;
    const double making = seconds("scene.createNode('Transform')", left);
    const std::string what = fmt::format("a script makes {} nodes a frame and drops them", count);
    report({"runtime", what, "a frame, with finding and destroying them", "ms", making * 1e3,
            "reading a field as often", 1e3 * seconds("made.translation", unused), "", 0});
    report({"runtime", what, fmt::format("nodes there after {} frames", frames), "nodes", static_cast<double>(left), "",
            0, "made meanwhile", static_cast<double>(count) * frames});
}

void routes(const Report& report, bool quick) {
    const std::size_t count = quick ? 100'000 : 1'000'000;
    Scene scene;
    std::vector<NodeId> nodes;
    for (std::size_t i = 0; i < count; ++i) nodes.push_back(scene.createNode(x3d::Transform::type));
    const double start = cpuSeconds();
    for (std::size_t i = 0; i < count; ++i)
        (void)scene.addRoute(nodes[i], x3d::Transform::translation.index, nodes[(i + 1) % count],
                             x3d::Transform::translation.index);
    report({"runtime", fmt::format("{} routes", count), "set up", "s", cpuSeconds() - start, "", 0, "", 0});
}

}  // namespace

void runtime(const Report& report, bool quick) {
    marching(report, quick);
    scripts(report, quick);
    pushes(report, quick);
    levels(report, quick);
    followers(report, quick);
    threads(report, quick);
    proximity(report, quick);
    touches(report, quick);
    listening(report, quick);
    navigation(report, quick);
    dropped(report, quick);
    routes(report, quick);
    rigidBodies(report, quick);
}

}  // namespace rtsg::bench
