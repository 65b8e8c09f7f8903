// Scene and bus: what a frame costs, against a traversal of the scene and against the bare writes.
#include <fmt/format.h>

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>

#include "bench.h"

namespace rtsg::bench {

namespace {

/// Reads every change, as the least that a subscriber does.
struct Reader final : Subscriber {
    double sum = 0;
    Result<> apply(const Scene&, const ChangeSet& changes) override {
        for (const Change& c : changes.changes)
            if (c.value.holds<Vec3f>()) sum += static_cast<double>(c.value.as<Vec3f>().x);
        return {};
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

/// The clock's own cost, which every figure above contains once.
double clockSeconds() {
    std::vector<double> times;
    for (int i = 0; i < 200; ++i) {
        const double start = cpuSeconds();
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
        const double frame = frameSeconds(scene, 2000);
        report({"transform", fmt::format("1 animated among {} shapes, 3 subscribers", shapes),
                "scene and bus work per frame", "us", frame * 1e6, "a look at every node",
                traversalSeconds(scene) * 1e6, "reading the clock", clockSeconds() * 1e6});
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

void changes(const Report& report, bool quick) {
    const int nodes = quick ? 100'000 : 1'000'000, perFrame = 10'000;
    Scene scene;
    std::vector<NodeId> transforms;
    for (int i = 0; i < nodes; ++i) transforms.push_back(scene.createNode(x3d::Transform::type));
    Reader readers[3];
    Attachment attachments[3];
    for (int i = 0; i < 3; ++i) attachments[i] = scene.bus().attach(readers[i]);
    scene.newFrame(0);
    const auto measure = [&](const std::string& name, auto pick) {
        std::vector<double> ours, bare;
        std::vector<Vec3f> array(static_cast<std::size_t>(nodes));
        for (int frame = 1; frame <= 40; ++frame) {
            const Vec3f value(static_cast<float>(frame), 2, 3);
            double start = cpuSeconds();
            for (int i = 0; i < perFrame; ++i)
                (void)scene.set(transforms[pick(i, frame)], x3d::Transform::translation, value);
            scene.newFrame(scene.now() + 1);
            ours.push_back(cpuSeconds() - start);
            start = cpuSeconds();
            for (int i = 0; i < perFrame; ++i) array[pick(i, frame)] = value;
            keep(array.data());
            bare.push_back(cpuSeconds() - start);
        }
        report({"changes", fmt::format("{}, {} of {} Transforms a frame", name, perFrame, nodes),
                "a field to three subscribers", "ns", median(ours) / perFrame * 1e9, "", 0, "a write to an array",
                median(bare) / perFrame * 1e9});
    };
    const auto n = static_cast<std::uint64_t>(nodes);
    measure("the same ones", [](int i, int) { return static_cast<std::size_t>(i); });
    measure("in turn",
            [&](int i, int f) { return (static_cast<std::size_t>(i) + static_cast<std::size_t>(f) * 10'000) % n; });
    measure("at random",
            [&](int i, int f) { return (static_cast<std::uint64_t>(i * 1000 + f) * 0x9E3779B97F4A7C15ull >> 20) % n; });
}

}  // namespace rtsg::bench
