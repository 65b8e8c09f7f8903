// Charts "scale": one change in scenes of 10^3 to 10^6 nodes, which must cost the same in all of them.
#include <fmt/format.h>

#include <rtsg/core/x3d.h>
#include <rtsg/renderers/shared_world.h>

#include "bench.h"
#include "chart.h"
#include "charts.h"
#include "world/full_traversal.h"

namespace rtsg::bench {

namespace {

/// `count` boxes on a square lattice: a Transform and a Shape each, one geometry and one appearance for all.
class Lattice {
  public:
    explicit Lattice(int count) : side_(1) {
        while (side_ * side_ < count) ++side_;
        const NodeId material = scene.createNode(x3d::Material::type);
        appearance_ = scene.createNode(x3d::Appearance::type), box_ = scene.createNode(x3d::Box::type);
        (void)scene.set(appearance_, x3d::Appearance::material, material);
        group_ = scene.createNode(x3d::Group::type);
        (void)scene.insertChild(scene.root(), x3d::RtsgScene::children, group_);
        for (int i = 0; i < count; ++i) (void)scene.insertChild(group_, x3d::Group::children, shapeAt(i));
    }

    /// A new shape under a Transform, nobody's child yet.
    NodeId shapeAt(int index) {
        const NodeId transform = scene.createNode(x3d::Transform::type), shape = scene.createNode(x3d::Shape::type);
        (void)scene.set(shape, x3d::Shape::geometry, box_);
        (void)scene.set(shape, x3d::Shape::appearance, appearance_);
        (void)scene.set(transform, x3d::Transform::translation, at(index, 0));
        (void)scene.insertChild(transform, x3d::Transform::children, shape);
        last = transform;
        return transform;
    }
    Vec3f at(int index, float height) const {
        return {static_cast<float>(3 * (index % side_)), height, static_cast<float>(3 * (index / side_))};
    }
    NodeId group() const { return group_; }

    Scene scene;
    NodeId last;  // Transform

  private:
    int side_;
    NodeId appearance_, box_, group_;
};

struct ScaleStages {
    std::vector<double> scene, flatten, world;
    /// Seals the edits made since `start` (CPU s) and books what each stage took.
    void frame(Scene& s, const SharedWorld& shared, double start) {
        s.newFrame(s.now() + .01);
        scene.push_back(threadSeconds() - start - shared.times().all() - cpuClockSeconds());
        flatten.push_back(std::max(0., shared.times().flattening - cpuClockSeconds()));
        world.push_back(std::max(0., shared.times().rays - cpuClockSeconds()));
    }
};

void add(Chart& chart, int nodes, const ScaleStages& stages) {
    const double us[] = {median(stages.scene) * 1e6, median(stages.flatten) * 1e6, median(stages.world) * 1e6};
    double sum = 0;
    for (std::size_t i = 0; i < 3; ++i)
        chart.series[i].points.push_back({static_cast<double>(nodes), sum += us[i], {}});
}

Chart scaleChartOf(const std::string& name, const std::string& title) {
    return {name,
            title,
            "Boxes under one Transform each, sharing geometry and appearance. CPU time, medians; sums from left to "
            "right: the upper lines contain the lower ones.",
            {"nodes in the scene", true},
            {"time per frame (µs)", true},
            {{"scene and bus", {}}, {"+ flattener", {}}, {"+ RayWorld (hybrid)", {}}, {"full traversal", {}, true}},
            {}};
}

}  // namespace

bool chartScale(const ChartSink& sink, bool quick) {
    Chart move = scaleChartOf("scale-move", "One moving Transform: what a frame costs as the scene grows");
    Chart insert = scaleChartOf("scale-add", "One Shape added: what a frame costs as the scene grows");
    insert.series.pop_back();
    for (const int shapes : {500, 5000, 50'000, 500'000}) {
        if (quick && shapes > 5000) break;
        Lattice lattice(shapes);
        Scene& scene = lattice.scene;
        SharedWorld shared(scene, {.flattening = {}, .rays = {.buildThreads = 1}, .timed = true});
        (void)shared.rays();
        scene.newFrame(0);
        const auto nodes = static_cast<int>(scene.nodeCount());
        const NodeId moving = lattice.last;
        ScaleStages moves, adds;
        for (int i = 0; i < 300; ++i) {
            const double start = threadSeconds();
            (void)scene.set(moving, x3d::Transform::translation, lattice.at(shapes - 1, static_cast<float>(i % 7) + 1));
            moves.frame(scene, shared, start);
        }
        add(move, nodes, moves);
        for (int i = 0; i < 200; ++i) {
            const double start = threadSeconds();
            (void)scene.insertChild(lattice.group(), x3d::Group::children, lattice.shapeAt(shapes + i));
            adds.frame(scene, shared, start);
        }
        add(insert, nodes, adds);
        FullTraversalRenderer full;
        if (!full.attachToScene(scene)) return false;
        std::vector<double> traversals;
        for (int i = 0; i < 5; ++i) {
            const double start = threadSeconds();
            if (!full.renderFrame()) return false;
            traversals.push_back(threadSeconds() - start);
        }
        move.series[3].points.push_back({static_cast<double>(nodes), median(traversals) * 1e6, {}});
    }
    sink(move);
    sink(insert);
    return true;
}

}  // namespace rtsg::bench
