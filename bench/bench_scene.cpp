// Scene and bus: what a frame costs, against a traversal of the scene and against the bare writes.
#include <bit>
#include <cmath>
#include <cstring>
#include <memory>

#include <fmt/format.h>

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>

#include "bench.h"

namespace rtsg::bench {

namespace {

/// Looks at every change: which node, and its value; the least that a subscriber does.
struct Reader final : Subscriber {
    std::uint64_t seen = 0;
    Result<> apply(const Scene&, const ChangeSet& changes) override {
        std::uint64_t sum = 0;
        for (const Change& c : changes.changes) {
            std::uint32_t first = 0;
            if (c.kind == ChangeKind::setField) std::memcpy(&first, c.value.storage(), sizeof(first));
            sum += c.node.value ^ first;
        }
        seen += sum;
        return {};
    }
};

/// What others do: told at each write, one by one.
struct Listener {
    virtual ~Listener() = default;
    virtual void changed(std::uint32_t node, const Vec3f& value) = 0;
};
struct Counter final : Listener {
    std::uint64_t seen = 0;
    void changed(std::uint32_t node, const Vec3f& value) override {
        seen += node ^ std::bit_cast<std::uint32_t>(value.x);
    }
};

NodeId addChild(Scene& scene, NodeId parent, TypeIndex type) {
    const NodeId id = scene.createNode(type);
    (void)scene.insertChild(parent, x3d::Group::children, id);
    return id;
}

/// Sensor, interpolator, Transform, two routes.
void addAnimated(Scene& scene, NodeId parent) {
    const NodeId transform = addChild(scene, parent, x3d::Transform::type);
    const NodeId clock = addChild(scene, parent, x3d::TimeSensor::type);
    const NodeId path = addChild(scene, parent, x3d::PositionInterpolator::type);
    (void)scene.set(clock, x3d::TimeSensor::loop, true);
    (void)scene.set(path, x3d::PositionInterpolator::key, Array<float>{0, .5f, 1});
    (void)scene.set(path, x3d::PositionInterpolator::keyValue, Array<Vec3f>{Vec3f(0), Vec3f(1, 2, 3), Vec3f(0)});
    (void)scene.addRoute(clock, x3d::TimeSensor::fraction_changed.index, path,
                         x3d::PositionInterpolator::set_fraction.index);
    (void)scene.addRoute(path, x3d::PositionInterpolator::value_changed.index, transform,
                         x3d::Transform::translation.index);
}

NodeId addGroup(Scene& scene) {
    const NodeId group = scene.createNode(x3d::Group::type);
    (void)scene.insertChild(scene.root(), x3d::RtsgScene::children, group);
    return group;
}

/// Median CPU time of `frames` frames, seconds.
double frameSeconds(Scene& scene, int frames) {
    std::vector<double> times;
    for (int i = 0; i < frames; ++i) {
        const double start = cpuSeconds();
        scene.newFrame(scene.now() + .001);
        times.push_back(cpuSeconds() - start);
    }
    return median(times);
}

/// The same of frames so short that reading the clock would be most of it: by the hundred.
double shortFrameSeconds(Scene& scene, int hundreds) {
    constexpr int kTogether = 100;
    std::vector<double> times;
    for (int i = 0; i < hundreds; ++i) {
        const double start = cpuSeconds();
        for (int k = 0; k < kTogether; ++k) scene.newFrame(scene.now() + .001);
        times.push_back((cpuSeconds() - start) / kTogether);
    }
    return median(times);
}

/// The least that such a frame does: a fraction of the time, the interpolation between two of three values, and three
/// that hear of it.
double bareFrameSeconds(int hundreds) {
    constexpr int kTogether = 100;
    const auto counters = std::make_unique<Counter[]>(3);
    std::vector<Listener*> listeners{&counters[0], &counters[1], &counters[2]};
    std::vector<double> times;
    double now = 0;
    for (int i = 0; i < hundreds; ++i) {
        const double start = cpuSeconds();
        for (int k = 0; k < kTogether; ++k) {
            now += .001;
            const auto fraction = static_cast<float>(now - std::floor(now));
            const float weight = fraction < .5f ? fraction * 2 : (1 - fraction) * 2;
            const Vec3f value = Vec3f(1, 2, 3) * weight;
            keep(listeners.data());
            for (Listener* listener : listeners) listener->changed(7, value);
        }
        times.push_back((cpuSeconds() - start) / kTogether);
    }
    return median(times);
}

/// What a frame costs that looks at every node for changes, as scene graphs without listeners do.
double traversalSeconds(const Scene& scene) {
    std::vector<double> times;
    for (int i = 0; i < 5; ++i) {
        const double start = cpuSeconds();
        std::size_t shapes = 0;
        scene.forEachNode(
            [&](const Node& node) { shapes += node.is(x3d::Shape::type) && node.get(x3d::Shape::visible); });
        keep(shapes);
        times.push_back(cpuSeconds() - start);
    }
    return median(times);
}

}  // namespace

void transform(const Report& report, bool quick) {
    for (const int shapes : {1000, 10'000, 100'000, 1'000'000}) {
        if (quick && shapes > 100'000) break;
        Scene scene;
        const NodeId group = addGroup(scene);
        for (int i = 0; i < shapes; ++i) addChild(scene, group, x3d::Shape::type);
        addAnimated(scene, group);
        Reader readers[3];
        Attachment attachments[3];
        for (int i = 0; i < 3; ++i) attachments[i] = scene.bus().attach(readers[i]);
        scene.newFrame(0);
        report({"transform", fmt::format("1 animated among {} shapes, 3 subscribers", shapes),
                "scene and bus work per frame", "us", shortFrameSeconds(scene, 100) * 1e6, "a look at every node",
                traversalSeconds(scene) * 1e6, "the interpolation and three calls alone", bareFrameSeconds(100) * 1e6});
    }
}

void animated(const Report& report, bool quick) {
    const int count = quick ? 1000 : 10'000;
    Scene scene;
    const NodeId group = addGroup(scene);
    for (int i = 0; i < count; ++i) addAnimated(scene, group);
    Reader reader;
    const Attachment attachment = scene.bus().attach(reader);
    scene.newFrame(0);
    const double frame = frameSeconds(scene, 100);
    // The limit: the same arithmetic on bare arrays, without nodes, routes, hash or change set.
    std::vector<Vec3f> values(static_cast<std::size_t>(count));
    std::vector<double> bare;
    for (int i = 0; i < 100; ++i) {
        const double start = cpuSeconds();
        for (std::size_t k = 0; k < values.size(); ++k) {
            const float fraction = static_cast<float>((i * 13 + static_cast<int>(k)) % 1000) / 1000;
            const float weight = fraction < .5f ? fraction * 2 : (1 - fraction) * 2;
            values[k] = Vec3f(1, 2, 3) * weight;
        }
        keep(values.data());
        bare.push_back(cpuSeconds() - start);
    }
    report({"animated", fmt::format("{} sensors, interpolators, transforms", count), "cascade and change set", "ms",
            frame * 1e3, "", 0, "the interpolation alone", median(bare) * 1e3});
}

// "Deliver" is what others' figures mean: the value is stored, now three subscribers hear of it; ours hashes it as
// well. "All in" begins with the application's call. In both, `writes` of the same field in a frame arrive as one
// change.
void changes(const Report& report, bool quick) {
    const std::size_t nodes = quick ? 100'000 : 1'000'000, perFrame = 10'000;
    Scene scene;
    std::vector<NodeId> transforms;
    for (std::size_t i = 0; i < nodes; ++i) transforms.push_back(scene.createNode(x3d::Transform::type));
    Reader readers[3];
    Attachment attachments[3];
    for (int i = 0; i < 3; ++i) attachments[i] = scene.bus().attach(readers[i]);
    scene.newFrame(0);
    std::vector<Vec3f> array(nodes);
    std::vector<std::unique_ptr<Listener>> listeners;
    for (int i = 0; i < 3; ++i) listeners.push_back(std::make_unique<Counter>());
    std::vector<std::size_t> indices(perFrame);
    std::vector<NodeId> ids(perFrame);
    std::vector<Vec3f> values(perFrame);
    int tick = 0;
    const auto measure = [&](const std::string& name, int writes, bool together, auto pick) {
        std::vector<double> all, deliver, bare, reported;
        for (int frame = 0; frame < 60; ++frame) {
            for (std::size_t i = 0; i < perFrame; ++i) {
                indices[i] = pick(i, ++tick);
                ids[i] = transforms[indices[i]];
            }
            const double start = cpuSeconds();
            for (int w = 0; w < writes; ++w) {
                const Vec3f value(static_cast<float>(tick + w), 2, 3);
                if (together) {
                    values.assign(perFrame, value);
                    (void)scene.setEach<Vec3f>(ids, x3d::Transform::translation, values);
                } else {
                    for (const NodeId id : ids) (void)scene.set(id, x3d::Transform::translation, value);
                }
            }
            const double stored = cpuSeconds();
            scene.newFrame(scene.now() + 1);
            const double end = cpuSeconds();
            all.push_back(end - start);
            deliver.push_back(end - stored);
            const Vec3f value(static_cast<float>(tick), 2, 3);
            double before = cpuSeconds();
            for (const std::size_t index : indices) array[index] = value;
            keep(array.data());
            bare.push_back(cpuSeconds() - before);
            before = cpuSeconds();
            for (const std::size_t index : indices) {
                array[index] = value;
                for (const auto& listener : listeners) listener->changed(static_cast<std::uint32_t>(index), value);
            }
            keep(array.data());
            reported.push_back(cpuSeconds() - before);
        }
        const auto nanoseconds = [&](const std::vector<double>& times, int each) {
            return median(times) / static_cast<double>(perFrame) / each * 1e9;
        };
        const std::string what = fmt::format("{}, {} of {} Transforms a frame", name, perFrame, nodes);
        const auto line = [&](const char* metric, double value) {
            report({"changes", what, metric, "ns", value, "an array, a virtual call to each of three listeners",
                    nanoseconds(reported, 1), "a write to an array", nanoseconds(bare, 1)});
        };
        if (writes == 1) line("deliver: hash, seal, three subscribers", nanoseconds(deliver, 1));
        line("all in: set, hash, seal, three subscribers", nanoseconds(all, writes));
    };
    const auto same = [](std::size_t i, int) { return i; };
    const auto random = [&](std::size_t, int t) {
        return static_cast<std::size_t>((static_cast<std::uint64_t>(t) * 0x9E3779B97F4A7C15ull >> 20) % nodes);
    };
    measure("the same ones", 1, false, same);
    measure("the same ones, four writes each, a write", 4, false, same);
    measure("in turn", 1, false, [&](std::size_t, int t) { return static_cast<std::size_t>(t) % nodes; });
    measure("at random", 1, false, random);
    measure("at random, setEach", 1, true, random);
}

}  // namespace rtsg::bench
