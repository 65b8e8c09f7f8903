// A cascade on several threads is, bit for bit, the one on one thread: change sets in their order, hashes, what
// listeners hear, diagnostics, inputs, and what waits for the next frame.
#include <atomic>
#include <functional>
#include <random>
#include <stdexcept>
#include <thread>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <rtsg/core/behaviour.h>
#include <rtsg/core/frame_input.h>
#include <rtsg/core/listeners.h>
#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/scripts/run_scripts.h>

#include "storage/division.h"

namespace rtsg {
namespace {

/// Events enough that a frame is divided; so much a CoordinateInterpolator with a hundred thousand points adds, too.
constexpr int kPlenty = 6000;
constexpr int kManyPoints = 100'000;

/// A random scene, as text: clocks, what interpolates, follows, filters and stores, and routes of all shapes.
class RandomCascade {
  public:
    RandomCascade(std::uint32_t seed, bool small) : random_(seed), small_(small) {
        nodes();
        routes();
        if (small_) heavy();
    }
    const std::string& text() const { return text_; }

  private:
    int below(int n) { return static_cast<int>(random_() % static_cast<unsigned>(n)); }
    template <class... Arguments>
    void add(fmt::format_string<Arguments...> format, Arguments&&... arguments) {
        text_ += fmt::format(format, std::forward<Arguments>(arguments)...);
    }
    void nodes() {
        count_ = small_ ? 10 + below(30) : kPlenty / 3;
        clocks_ = 1 + below(small_ ? 4 : count_);
        for (int i = 0; i < clocks_; ++i)
            add("DEF C{} TimeSensor {{ loop {} cycleInterval {} stopTime {} }}\n", i, below(9) ? "TRUE" : "FALSE",
                .1 + .01 * below(100), below(9) ? 0 : 1 + .1 * below(10));
        for (int i = 0; i < count_; ++i) {
            // Some have a key too many, of which they warn.
            add("DEF P{} PositionInterpolator {{ key [ 0 {} 1 ] keyValue [ 0 0 0, {} 1 0{} ] }}\n", i, .1 * below(9), i,
                below(50) ? ", 0 1 2" : "");
            add("DEF S{} ScalarInterpolator {{ key [ 0 1 ] keyValue [ 0 {} ] }}\n", i, .5 + .5 * below(2));
            // Some come to rest between two events, which must wake them.
            add("DEF D{} {} {} }}\n", i, below(2) ? "PositionDamper { tau" : "PositionChaser { duration",
                below(2) ? .03 : .3);
            add("DEF T{} Transform {{ children {} }}\n", i,
                below(20) ? "[]" : "LOD { range 3 children [ Group {} Group {} ] }");
        }
        add("DEF V Viewpoint {{ }} Transform {{ children ProximitySensor {{ size 4 4 4 }} }}\n");
    }
    void route(const std::string& from, const std::string& to) { add("ROUTE {} TO {}\n", from, to); }
    /// Mostly of the same number, so that there are many components; `wild` makes some of them one.
    int other(int i) { return below(100) < wild_ ? below(count_) : i; }
    void routes() {
        wild_ = below(3) ? below(3) : below(100);
        const bool oneClock = below(2);
        for (int i = 0; i < count_; ++i) {
            const int clock = oneClock ? 0 : i * clocks_ / count_;
            const char* fraction = "fraction_changed";
            if (below(3)) route(fmt::format("C{}.{}", clock, fraction), fmt::format("P{}.set_fraction", other(i)));
            if (below(2)) route(fmt::format("C{}.{}", clock, fraction), fmt::format("S{}.set_fraction", other(i)));
            if (below(3)) route(fmt::format("S{}.value_changed", i), fmt::format("P{}.set_fraction", other(i)));
            if (below(5) == 0) route(fmt::format("S{}.value_changed", i), fmt::format("S{}.set_fraction", other(i)));
            if (below(2)) route(fmt::format("P{}.value_changed", i), fmt::format("T{}.translation", other(i)));
            if (below(3) == 0) route(fmt::format("P{}.value_changed", i), fmt::format("D{}.set_destination", other(i)));
            if (below(2)) route(fmt::format("D{}.value_changed", i), fmt::format("T{}.translation", other(i)));
            if (below(4) == 0) route(fmt::format("T{}.translation", i), fmt::format("T{}.scale", other(i)));
            if (below(9) == 0) route(fmt::format("T{}.scale", i), fmt::format("T{}.translation", other(i)));
        }
        if (below(2)) route(fmt::format("P{}.value_changed", below(count_)), "V.position");
        if (below(6) == 0) {
            add("DEF J Script {{ inputOnly SFVec3f at outputOnly SFVec3f out url \"ecmascript: function at(v) {{ out = "
                "new SFVec3f(v.y, v.x, 0); }}\" }}\n");
            route(fmt::format("P{}.value_changed", below(count_)), "J.at");
            route("J.out", fmt::format("T{}.center", below(count_)));
        }
    }
    void heavy() {
        add("DEF K CoordinateInterpolator {{ key [ 0 1 ] }} DEF Q Coordinate {{ }}\nROUTE C0.fraction_changed TO "
            "K.set_fraction ROUTE K.value_changed TO Q.point\n");
    }

    std::mt19937 random_;
    bool small_;
    int count_ = 0, clocks_ = 0, wild_ = 0;
    std::string text_ = "#X3D V4.0 utf8\nPROFILE Full\n";
};

/// A scene that is run, and all that can be told of it.
struct Reported {
    Reported(const std::string& text, unsigned threads) {
        runScripts(scene);
        Diagnostics diagnostics;
        EXPECT_TRUE(loadText(scene, text, diagnostics));
        EXPECT_EQ(diagnostics.errors(), 0U) << (diagnostics.all().empty() ? "" : diagnostics.all()[0].format());
        scene.setThreads(threads);
        scene.setInputRecording(true);
        if (const NodeId heavy = scene.findName("K")) {
            auto points = Array<Vec3f>::ofSize(2 * kManyPoints);
            for (int i = 0; i < 2 * kManyPoints; ++i) points.mutableData()[i] = Vec3f(static_cast<float>(i));
            EXPECT_TRUE(scene.set(heavy, x3d::CoordinateInterpolator::keyValue, points));
        }
        scene.forEachNode([&](const Node& node) {
            if (node.id().value % 17 != 0 || !node.is(x3d::PositionInterpolator::type)) return;
            EXPECT_TRUE(scene.listenTo(node.id(), x3d::PositionInterpolator::value_changed.index));
        });
    }
    std::string complaints() {
        std::string all;
        for (const Diagnostic& one : scene.diagnostics().all()) all += one.format() + '\n';
        return all;
    }
    Scene scene;
};

void expectSameFrame(Reported& one, Reported& several, double time) {
    const auto a = one.scene.newFrame(time), b = several.scene.newFrame(time);
    ASSERT_EQ(a->changes.size(), b->changes.size());
    for (std::size_t i = 0; i < a->changes.size(); ++i) ASSERT_EQ(a->changes[i], b->changes[i]) << "change " << i;
    ASSERT_EQ(a->hash, b->hash);
    ASSERT_EQ(a->heard != nullptr, b->heard != nullptr);
    for (std::size_t i = 0; a->heard && i < a->heard->size(); ++i) {
        ASSERT_EQ((*a->heard)[i].node, (*b->heard)[i].node);
        ASSERT_EQ((*a->heard)[i].value, (*b->heard)[i].value);
    }
    ASSERT_EQ(a->input->woken, b->input->woken);
    ASSERT_EQ(a->input->complete, b->input->complete);
    const RunState x = one.scene.runState(), y = several.scene.runState();
    ASSERT_EQ(x.active, y.active);
    ASSERT_EQ(x.sleepers, y.sleepers);
}

void expectSameThroughout(std::uint32_t seed, bool small, unsigned threads) {
    SCOPED_TRACE(fmt::format("seed {}, {}, {} threads", seed, small ? "small" : "large", threads));
    const RandomCascade random(seed, small);
    Reported one(random.text(), 1), several(random.text(), threads);
    std::mt19937 draw(seed);
    for (int frame = 0; frame < 16; ++frame) {
        // Now and then the application interferes: a field, a new node, a route less.
        const unsigned what = draw() % 8, which = draw();
        for (Reported* reported : {&one, &several}) {
            Scene& scene = reported->scene;
            const NodeId target = scene.findName(fmt::format("T{}", which % 10));
            Result<> done;
            if (what == 0) done = scene.set(target, x3d::Transform::center, Vec3f(static_cast<float>(frame)));
            if (what == 1) done = scene.sendEvent(target, x3d::Transform::translation.index, Vec3f(1));
            if (what == 2) (void)scene.createNode(x3d::TimeSensor::type);
            // A division by the old routes must be made again.
            NodeId far = scene.findName(fmt::format("T{}", kPlenty / 3 - 1 - which % 10));
            if (!far) far = scene.findName(fmt::format("T{}", 9 - which % 10));
            if (what >= 5 && frame > 8)
                done = scene.addRoute(scene.findName(fmt::format("P{}", which % 10)),
                                      x3d::PositionInterpolator::value_changed.index, far,
                                      x3d::Transform::translation.index);
            // Now it has a warning that it did not have.
            if (what == 4)
                done = scene.set(scene.findName(fmt::format("P{}", which % 10)), x3d::PositionInterpolator::key,
                                 Array<float>{0, .1f, .2f, .3f, 1 + .1f * static_cast<float>(frame)});
            const auto routes = scene.routesTo(target);
            if (what == 3 && !routes.empty())
                done = scene.removeRoute(routes[0].fromNode, routes[0].fromField, routes[0].toNode, routes[0].toField);
            EXPECT_TRUE(done);
        }
        ASSERT_NO_FATAL_FAILURE(expectSameFrame(one, several, .04 * frame)) << "frame " << frame;
    }
    EXPECT_EQ(one.complaints(), several.complaints());
    EXPECT_EQ(one.scene.dump(), several.scene.dump());
}

TEST(SideBySide, ManyEventsGiveTheSameOnSeveralThreads) {
    for (std::uint32_t seed = 1; seed <= 6; ++seed) expectSameThroughout(seed, false, 2 + seed % 3);
}
TEST(SideBySide, FewEventsBesideALongOneGiveTheSameOnSeveralThreads) {
    for (std::uint32_t seed = 1; seed <= 16; ++seed) expectSameThroughout(seed, true, 2 + seed % 3);
}

/// Frames that send what the one before sent are divided as that one was; others, and other numbers of threads, anew.
TEST(SideBySide, FramesThatSendTheSameAndOthersGiveTheSameOnSeveralThreads) {
    std::string text = "#X3D V4.0 utf8\nPROFILE Full\n";
    for (int i = 0; i < kPlenty; ++i)
        text += fmt::format(
            "DEF C{0} TimeSensor {{ loop TRUE }} DEF P{0} PositionInterpolator {{ key [ 0 1 ] keyValue [ 0 0 0, {0} 1 "
            "0 ] }} DEF T{0} Transform {{ }} ROUTE C{0}.fraction_changed TO P{0}.set_fraction ROUTE P{0}.value_changed "
            "TO T{0}.translation\n",
            i);
    Reported one(text, 1), several(text, 2);
    std::mt19937 draw(5);
    for (int frame = 0; frame < 24; ++frame) {
        constexpr unsigned kThreads[] = {2, 4, 2, 3};
        if (frame % 3 == 2) several.scene.setThreads(kThreads[frame / 3 % 4]);
        if (frame % 4 == 3)
            for (int i = 0; i < 1 + static_cast<int>(draw() % 500); ++i) {
                const std::string clock = fmt::format("C{}", draw() % kPlenty);
                for (Reported* reported : {&one, &several}) {
                    const NodeId id = reported->scene.findName(clock);
                    const bool enabled = reported->scene.node(id).get(x3d::TimeSensor::enabled);
                    EXPECT_TRUE(reported->scene.set(id, x3d::TimeSensor::enabled, !enabled));
                }
            }
        ASSERT_NO_FATAL_FAILURE(expectSameFrame(one, several, .03 * frame)) << "frame " << frame;
    }
    EXPECT_EQ(one.scene.dump(), several.scene.dump());
}

// ---- what runs where ---------------------------------------------------------------------------------------------

std::atomic<int> elsewhere{0};
std::thread::id sceneThread;

/// Now and then, for the other threads to get to their part.
void yieldToOthers() {
    static thread_local unsigned calls = 0;
    if (++calls % 64 == 0) std::this_thread::yield();
}

void noteWhere(Cascade& cascade, const Node& node, FieldIndex, EventValue) {
    if (std::this_thread::get_id() != sceneThread) ++elsewhere;
    yieldToOthers();
    cascade.emit(node, x3d::PositionInterpolator::value_changed, Vec3f(1));
}

/// One clock and `kPlenty` interpolators whose behaviour notes on which threads it is called.
void loadFan(Scene& scene, const Behaviour& behaviour) {
    std::string text = "#X3D V4.0 utf8\nPROFILE Full\nDEF C TimeSensor { loop TRUE }\n";
    for (int i = 0; i < kPlenty; ++i)
        text += fmt::format(
            "DEF P{0} PositionInterpolator {{ }} DEF T{0} Transform {{ }} ROUTE C.fraction_changed TO "
            "P{0}.set_fraction ROUTE P{0}.value_changed TO T{0}.translation\n",
            i);
    Diagnostics diagnostics;
    EXPECT_TRUE(loadText(scene, text, diagnostics));
    scene.registerBehaviour(x3d::PositionInterpolator::type, behaviour);
    scene.setThreads(2);
}

/// Until it was on another thread than the scene's, or for so many frames.
int runUntilElsewhere(Scene& scene, int frames) {
    sceneThread = std::this_thread::get_id();
    elsewhere = 0;
    for (int frame = 0; frame < frames && elsewhere == 0; ++frame) scene.newFrame(scene.now() + .1);
    return elsewhere;
}

int timesElsewhere(const Behaviour& behaviour, const std::function<void(Scene&)>& meddle = {}, int frames = 12) {
    Scene scene;
    loadFan(scene, behaviour);
    if (meddle) meddle(scene);
    return runUntilElsewhere(scene, frames);
}

/// All that the interpolators write becomes one field.
void joinFan(Scene& scene) {
    for (int i = 1; i < kPlenty; ++i)
        EXPECT_TRUE(scene.addRoute(scene.findName(fmt::format("P{}", i)),
                                   x3d::PositionInterpolator::value_changed.index, scene.findName("T0"),
                                   x3d::Transform::translation.index));
}

TEST(SideBySide, WhatPromisesToBeLocalIsCalledOnOtherThreads) {
    const Behaviour local{.onEvent = noteWhere, .deterministic = true, .local = true};
    EXPECT_GT(timesElsewhere(local, {}, 1000), 0);
}
TEST(SideBySide, WhatPromisesNothingIsCalledOnTheScenesThreadAlone) {
    EXPECT_EQ(timesElsewhere({.onEvent = noteWhere, .deterministic = true}), 0);
    EXPECT_EQ(timesElsewhere({.onEvent = noteWhere, .local = true}), 0);
    const FieldIndex fraction = x3d::PositionInterpolator::set_fraction.index;
    EXPECT_EQ(timesElsewhere({.onEvent = noteWhere, .deterministic = true, .local = true, .beyond = fraction}), 0);
}
double noteTime(Cascade& cascade, const Node&) {
    if (std::this_thread::get_id() != sceneThread) ++elsewhere;
    yieldToOthers();
    return cascade.now();
}
int timesReportedElsewhere(const Behaviour& behaviour, int frames) {
    Scene scene;
    for (int i = 0; i < kPlenty; ++i) scene.createNode(x3d::TimeSensor::type);
    scene.registerBehaviour(x3d::TimeSensor::type, behaviour);
    scene.setThreads(2);
    return runUntilElsewhere(scene, frames);
}
TEST(SideBySide, TimeIsToldOnOtherThreadsToWhatPromisesToBeLocal) {
    EXPECT_GT(timesReportedElsewhere({.onTime = noteTime, .deterministic = true, .local = true}, 1000), 0);
    EXPECT_EQ(timesReportedElsewhere({.onTime = noteTime, .deterministic = true}, 12), 0);
    EXPECT_EQ(timesReportedElsewhere({.onTime = noteTime, .local = true}, 12), 0);
    EXPECT_EQ(timesReportedElsewhere({.onTime = noteTime, .deterministic = true, .local = true, .beyond = 0}, 12), 0);
}
TEST(SideBySide, OneThreadIsOne) {
    const Behaviour local{.onEvent = noteWhere, .deterministic = true, .local = true};
    EXPECT_EQ(timesElsewhere(local, [](Scene& scene) { scene.setThreads(1); }), 0);
}
TEST(SideBySide, WhoListensInOnEveryEventIsCalledOnTheScenesThread) {
    const Behaviour local{.onEvent = noteWhere, .deterministic = true, .local = true};
    EXPECT_EQ(timesElsewhere(local,
                             [](Scene& scene) {
                                 scene.setEventListener([](double, const Node&, FieldIndex, const Value&) {
                                     EXPECT_EQ(std::this_thread::get_id(), sceneThread);
                                 });
                             }),
              0);
}
TEST(SideBySide, WhatMeetsInOneNodeStaysTogether) {
    const Behaviour local{.onEvent = noteWhere, .deterministic = true, .local = true};
    EXPECT_EQ(timesElsewhere(local, joinFan), 0);
}
TEST(SideBySide, WhatNewRoutesJoinIsTogetherFromThenOn) {
    Scene scene;
    loadFan(scene, {.onEvent = noteWhere, .deterministic = true, .local = true});
    EXPECT_GT(runUntilElsewhere(scene, 1000), 0);
    joinFan(scene);
    EXPECT_EQ(runUntilElsewhere(scene, 12), 0);
}

void throwsElsewhere(Cascade&, const Node&, FieldIndex, EventValue) {
    if (std::this_thread::get_id() != sceneThread) throw std::runtime_error("thrown");
    yieldToOthers();
}
TEST(SideBySide, WhatIsThrownElsewhereComesOutOfTheFrame) {
    const Behaviour throwing{.onEvent = throwsElsewhere, .deterministic = true, .local = true};
    EXPECT_THROW(timesElsewhere(throwing, {}, 1000), std::runtime_error);
}

// ---- components --------------------------------------------------------------------------------------------------

std::vector<int> partsOf(std::span<const Division::Edge> edges, std::span<const NodeId> sources, unsigned parts,
                         unsigned nodes) {
    Division division;
    std::vector<int> result;
    if (!division.divide(sources, edges, parts)) return result;
    for (unsigned id = 1; id <= nodes; ++id) result.push_back(division.partOf(NodeId{id}));
    return result;
}

TEST(Division, AFanOutIsDividedAndAChainIsNot) {
    using E = Division::Edge;
    const auto id = [](unsigned n) { return NodeId{n}; };
    constexpr int kAll = Division::kSeveral;
    const std::vector<NodeId> one{id(1)};
    const std::vector<E> fan{{id(1), id(2)}, {id(1), id(3)}, {id(1), id(4)}, {id(1), id(5)}};
    EXPECT_EQ(partsOf(fan, one, 2, 5), (std::vector<int>{kAll, 0, 0, 1, 1}));
    const std::vector<E> chain{{id(1), id(2)}, {id(2), id(3)}, {id(3), id(4)}, {id(4), id(5)}};
    EXPECT_EQ(partsOf(chain, one, 2, 5), std::vector<int>());
    // The nodes that are connected behind the fan, two and five by four, go together.
    std::vector<E> joined = fan;
    joined.insert(joined.end(), {{id(2), id(6)}, {id(5), id(6)}, {id(3), id(7)}, {id(4), id(7)}});
    EXPECT_EQ(partsOf(joined, one, 2, 7), (std::vector<int>{kAll, 0, 1, 1, 0, 0, 1}));
    // One that is reached itself hands on what it gets to all that it sends to.
    std::vector<E> back = fan;
    back.push_back({id(2), id(1)});
    EXPECT_EQ(partsOf(back, one, 2, 5), std::vector<int>());
}

TEST(Division, NumbersFarApartAreLeftAlone) {
    const std::vector<NodeId> one{NodeId{1}};
    const std::vector<Division::Edge> edges{{NodeId{1}, NodeId{4'000'000'000}}, {NodeId{1}, NodeId{3}}};
    EXPECT_EQ(partsOf(edges, one, 2, 3), std::vector<int>());
}

}  // namespace
}  // namespace rtsg
