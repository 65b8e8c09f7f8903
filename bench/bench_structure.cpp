// Structure: what adding, removing and re-parenting one node costs among a thousand and among a million, and what a
// node weighs.
#include <algorithm>

#include <fmt/format.h>

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>

#include "bench.h"

namespace rtsg::bench {

namespace {

using G = x3d::Group;

struct StructureReader final : Subscriber {
    std::size_t changes = 0;
    Result<> apply(const Scene&, const ChangeSet& set) override {
        changes += set.changes.size();
        return {};
    }
};

constexpr int kEdits = 200;

/// Median CPU seconds of an edit and the frame that publishes it.
double editSeconds(Scene& scene, auto edit) {
    std::vector<double> times;
    for (int i = 0; i < kEdits; ++i) {
        const double start = cpuSeconds();
        edit(i);
        scene.newFrame(scene.now() + 1);
        times.push_back(cpuSeconds() - start);
    }
    return median(times);
}

/// `count`: children at the start; two series of edits take away more than they add, and must not run out.
void edits(const Report& report, std::size_t count) {
    count = std::max(count, std::size_t{5} * kEdits);
    Scene scene;
    const auto group = [&] {
        const NodeId id = scene.createNode(G::type);
        (void)scene.insertChild(scene.root(), x3d::RtsgScene::children, id);
        return id;
    };
    const NodeId big = group(), other = group();
    std::vector<NodeId> shapes;
    for (std::size_t i = 0; i < count; ++i) {
        shapes.push_back(scene.createNode(x3d::Shape::type));
        (void)scene.insertChild(big, G::children, shapes.back());
    }
    StructureReader reader;
    const Attachment attachment = scene.bus().attach(reader);
    scene.newFrame(0);
    const auto children = [&] { return scene.node(big).get(G::children).size(); };
    // The time of the same edit of a bare vector, without any order or parents.
    std::vector<NodeId> bare(shapes);
    const auto line = [&](const char* what, double seconds, auto bareEdit) {
        std::vector<double> times;
        for (int i = 0; i < kEdits; ++i) {
            const double start = cpuSeconds();
            bareEdit(i);
            keep(bare.data());
            times.push_back(cpuSeconds() - start);
        }
        report({"structure", fmt::format("{} among {} children", what, count), "edit, hash, seal, a subscriber", "us",
                seconds * 1e6, "the same edit of a std::vector", median(times) * 1e6, "reading the clock",
                cpuClockSeconds() * 1e6});
    };
    line(
        "a Shape added",
        editSeconds(scene, [&](int) { (void)scene.insertChild(big, G::children, scene.createNode(x3d::Shape::type)); }),
        [&](int) { bare.push_back({}); });
    const auto indexOf = [&](int i) { return (static_cast<std::size_t>(i) * 7919 + count / 2) % (count / 2); };
    line("one removed from the middle",
         editSeconds(scene, [&](int i) { (void)scene.removeChild(big, G::children.index, indexOf(i)); }),
         [&](int i) { bare.erase(bare.begin() + static_cast<std::ptrdiff_t>(indexOf(i))); });
    line("the last one moved to another parent",
         editSeconds(scene,
                     [&](int) {
                         const NodeId child = scene.node(big).get(G::children).back();
                         (void)scene.removeChild(big, G::children.index, children() - 1);
                         (void)scene.insertChild(other, G::children, child);
                     }),
         [&](int) { bare.pop_back(); });
    line("one destroyed",
         editSeconds(scene,
                     [&](int i) {
                         const auto& all = scene.node(big).get(G::children);
                         (void)scene.destroyNode(all[indexOf(i) % all.size()]);
                     }),
         [&](int i) { bare.erase(bare.begin() + static_cast<std::ptrdiff_t>(indexOf(i))); });
    // One node below so many parents (DEF/USE).
    const NodeId used = scene.createNode(x3d::Shape::type);
    for (std::size_t i = 0; i < count / 10; ++i) {
        const NodeId parent = scene.createNode(G::type);
        (void)scene.insertChild(parent, G::children, used);
    }
    scene.newFrame(scene.now() + 1);
    const double sharing = editSeconds(scene, [&](int i) {
        if (i % 2)
            (void)scene.removeChild(other, G::children.index, scene.node(other).get(G::children).size() - 1);
        else
            (void)scene.insertChild(other, G::children, used);
    });
    report({"structure", fmt::format("a USE added or removed, {} parents", count / 10),
            "edit, hash, seal, a subscriber", "us", sharing * 1e6, "", 0, "reading the clock",
            cpuClockSeconds() * 1e6});
}

}  // namespace

void structure(const Report& report, bool quick) {
    for (const std::size_t count : {1000u, quick ? 100'000u : 1'000'000u}) edits(report, count);
    const std::size_t nodes = quick ? 100'000 : 1'000'000;
    for (const TypeIndex type : {x3d::Transform::type, x3d::Shape::type, x3d::Material::type, x3d::TimeSensor::type}) {
        const double before = residentBytes();
        Scene scene;
        const NodeId group = scene.createNode(G::type);
        for (std::size_t i = 0; i < nodes; ++i) (void)scene.insertChild(group, G::children, scene.createNode(type));
        // At rest: clocks have stopped, and what the large frames took has been given back.
        for (int i = 0; i < 40; ++i) {
            (void)scene.set(group, G::bboxDisplay, i % 2 == 0);
            scene.newFrame(10.0 * i);
        }
        const double each = (residentBytes() - before) / static_cast<double>(nodes);
        std::size_t own = 0;
        for (const FieldDef& field : scene.type(type).fields)
            if (field.readable()) own += info(field.type).size;
        report({"structure", fmt::format("{} {} nodes", nodes, scene.type(type).name), "memory of a node in its parent",
                "bytes", each, "", 0, "its fields", static_cast<double>(own)});
    }
}

}  // namespace rtsg::bench
