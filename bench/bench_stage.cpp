// Bench "stage": one world and those who start from it. Here: one of many boxes moves; what following it costs sound,
// beside all walls anew and beside the BVH.
#include <cmath>
#include <memory>
#include <vector>

#include <fmt/format.h>

#include <rtsg/renderers/mesh.h>

#include "bench_stage.h"
#include "geometry/world_geometry.h"

namespace rtsg::bench {
namespace {

std::shared_ptr<Mesh> unitBox() {
    auto mesh = std::make_shared<Mesh>();
    for (int i = 0; i < 8; ++i) mesh->positions.push_back({i & 1 ? 1.f : 0.f, i & 2 ? 1.f : 0.f, i & 4 ? 1.f : 0.f});
    mesh->triangles = {0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4,
                       2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5};
    mesh->triangleCount = 12;
    for (const Vec3f& p : mesh->positions) mesh->bounds.extend(p);
    return mesh;
}

/// In rows, floors and columns, so that thousands of boxes share a plane.
class Boxes {
  public:
    explicit Boxes(std::uint32_t count) {
        while (side_ * side_ * side_ < count) ++side_;
        delta_.geometries.push_back({NodeId{1}, unitBox()});
        for (std::uint32_t i = 0; i < count; ++i) {
            Instance instance;
            instance.id = {i, 0};
            instance.shape = NodeId{100 + i};
            instance.geometry = NodeId{1};
            instance.worldFromLocal = transformOf(i);
            delta_.added.push_back(instance);
        }
        world_.apply(delta_);
        walls_.apply(delta_);
        const WallsVersion all = walls_.freeze();
        const double start = threadSeconds();
        geometry_.follow(all, world_);
        scratch_ = threadSeconds() - start;
    }

    void move(std::uint32_t box, double by) {
        delta_.clear();
        WorldFromLocal m = transformOf(box);
        m[3] += glm::dvec3(by, .7 * by, .4 * by);
        delta_.moved.push_back({InstanceId{box, 0}, m});
        const double start = threadSeconds();
        world_.apply(delta_);
        const double traced = threadSeconds();
        walls_.apply(delta_);
        const WallsVersion version = walls_.freeze();
        const double reported = threadSeconds();
        geometry_.follow(version, world_);
        world.push_back(traced - start);
        tables.push_back(reported - traced);
        planes.push_back(threadSeconds() - reported);
    }
    /// Seconds to find all planes.
    double scratch() const { return scratch_; }

    std::vector<double> world, tables, planes;  // seconds, by move

  private:
    WorldFromLocal transformOf(std::uint32_t i) const {
        WorldFromLocal m = identityTransform();
        m[3] = 2.0 * glm::dvec3(i % side_, i / side_ % side_, i / side_ / side_);
        return m;
    }

    std::uint32_t side_ = 1;
    RayWorld world_;
    Walls walls_{world_};
    WorldGeometry geometry_;
    InstanceDelta delta_;
    double scratch_ = 0;
};

}  // namespace

void stage(const Report& report, bool quick) {
    stageLights(report, quick);
    stageReaders(report, quick);
    stageBus(report, quick);
    stageMemory(report, quick);
    const double clock = cpuClockSeconds();
    for (const std::uint32_t count : quick ? std::vector{1000u} : std::vector{1000u, 10'000u, 100'000u}) {
        Boxes boxes(count);
        const std::uint32_t moves = quick ? 50 : 400;
        for (std::uint32_t i = 0; i < moves; ++i) boxes.move(i * (count / moves), .1 + .001 * i);
        const std::string which = fmt::format("one box of {} moves", count);
        const double light = (median(boxes.world) - clock) * 1e6;
        report({"stage", which, "sound's tables, on the scene's thread", "us", (median(boxes.tables) - clock) * 1e6,
                "all walls anew", boxes.scratch() * 1e6, "the BVH", light});
        report({"stage", which, "sound's planes, on sound's thread", "us", (median(boxes.planes) - clock) * 1e6,
                "all walls anew", boxes.scratch() * 1e6, "the BVH", light});
    }
}

}  // namespace rtsg::bench
