// Emitters: the triangles that shine, and a tree to choose from by what they can do for a point.
//
// Holds those of materials that emit, are opaque and do not mirror; what else shines is found by bounces alone.
// Invariant: an emitter that lights a point at all is chosen there with a probability above 0, and density() is the one
// that sample() chooses with. Built for one picture, in ray space; it reads the scene's meshes, which must outlive it.
// Threading: const once built. Source: Conty Estevez & Kulla 2018, Proc. ACM Comput. Graph. Interact. Tech. 1, 2
// (importance of a cluster: power, distance, cones).
#pragma once

#include <cstdint>
#include <vector>

#include <rtsg/core/value.h>
#include <rtsg/renderers/mesh.h>

namespace rtsg::trace {

struct TraceScene;

class Emitters {
  public:
    static constexpr std::uint32_t kNone = 0xFFFFFFFF;
    struct Emitter {
        Vec3f corner{0}, ab{0}, ac{0};  // ray space
        Vec3f normal{0};                // unit, as Hit::normal
        float area = 0;                 // m^2
        std::uint32_t instance = 0, triangle = 0;
        bool bothSides = false;
    };
    struct Choice {
        std::uint32_t emitter = kNone;
        float probability = 0;
    };

    Emitters() = default;
    explicit Emitters(const TraceScene& scene);

    bool empty() const { return emitters_.empty(); }
    std::size_t size() const { return emitters_.size(); }
    const Emitter& operator[](std::uint32_t emitter) const { return emitters_[emitter]; }

    /// One of them for a surface at `point` with this shading normal; none if nothing of them can be above its horizon.
    /// `u` in [0, 1).
    Choice sample(const Vec3f& point, const Vec3f& normal, float u) const;
    /// The probability that sample() chooses this one.
    float density(std::uint32_t emitter, const Vec3f& point, const Vec3f& normal) const;
    /// By what a ray hit; kNone: not in here.
    std::uint32_t find(std::uint32_t instance, std::uint32_t triangle) const;

  private:
    /// Emitters below a node: their box, their power, and a cone that holds the normals of their shining sides.
    struct Cluster {
        Bounds bounds;
        Vec3f axis{0, 0, 1};
        float cosCone = 1, power = 0;  // cosCone -1: all directions
    };
    static constexpr std::size_t kWide = 8;
    /// Up to eight clusters side by side; those that are not there have no power.
    struct alignas(32) Node {
        float centerX[kWide]{}, centerY[kWide]{}, centerZ[kWide]{}, radiusSquared[kWide]{};
        float axisX[kWide]{}, axisY[kWide]{}, axisZ[kWide]{};
        float cosCone[kWide]{}, sinCone[kWide]{}, power[kWide]{};
        std::uint32_t next[kWide]{};  // a node, or an emitter
        std::uint8_t leaves = 0;      // which are emitters, a bit each
        void set(std::size_t child, const Cluster& cluster);
    };
    void add(const TraceScene& scene, std::uint32_t slot);
    Cluster clusterOf(std::uint32_t emitter) const;
    static Cluster join(const Cluster& a, const Cluster& b);
    std::size_t halve(std::size_t first, std::size_t last);
    Cluster build(std::size_t first, std::size_t last, std::uint32_t node, std::uint32_t depth, std::uint64_t way);
    /// Of all eight; returns their sum.
    static float importance(const Node& node, const Vec3f& point, const Vec3f& normal, float* each);

    std::vector<Emitter> emitters_;
    std::vector<float> power_;
    std::vector<std::uint64_t> ways_;   // by emitter: three bits a node, from the root on: which child
    std::vector<std::uint32_t> order_;  // while building
    std::vector<Node> nodes_;
    std::vector<std::uint32_t> firstOf_;  // by instance slot: its first emitter or kNone; triangles follow each other
};

}  // namespace rtsg::trace
