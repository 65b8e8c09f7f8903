// LightTree: chooses one of many light sources by its possible contribution at a point.
//
// Invariant: a source that lights a point at all is chosen there with a probability above 0, and probability() is the
// one that sample() uses. Threading: const once built. Source: Conty Estevez & Kulla 2018, Proc. ACM Comput. Graph.
// Interact. Tech. 1, 2 (importance of a cluster: power, distance, cones).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <rtsg/core/value.h>
#include <rtsg/renderers/mesh.h>

#include "mesh/simd8.h"

namespace rtsg::trace {

class LightTree {
  public:
    static constexpr std::uint32_t kNone = 0xFFFFFFFF;
    /// One emitter or several together: their box, their power, and a cone that holds the normals of their shining
    /// sides. Light falls off by 1 / max(x + y d + z d^2, least).
    struct Cluster {
        Bounds bounds;
        Vec3f axis{0, 0, 1};
        float cosCone = 1, power = 0;  // cosCone -1: all directions
        Vec3f falloff{0, 0, 1};
    };
    struct Choice {
        std::uint32_t emitter = kNone;
        float probability = 0;
    };

    LightTree() = default;
    /// One Cluster a thing; those without power are never chosen. `least`: of the falloff, above 0.
    LightTree(std::span<const Cluster> emitters, float minimum);

    bool empty() const { return nodes_.empty(); }
    /// One of them for a surface at `point` with this shading normal; none if nothing of them can be above its horizon.
    /// `u` in [0, 1).
    Choice sample(const Vec3f& point, const Vec3f& normal, float u) const;
    struct alignas(32) Choices {
        std::uint32_t emitter[8];
        float probability[8];
    };
    /// The same for eight surfaces at once; those not in `lanes` choose nothing.
    Choices sample(const simd::V8& point, const simd::V8& normal, simd::F8 u, std::uint32_t lanes) const;
    /// That sample() chooses this one.
    float probability(std::uint32_t emitter, const Vec3f& point, const Vec3f& normal) const;

  private:
    static constexpr std::size_t kWide = 8;
    /// Up to eight clusters side by side; those that are not there have no power.
    struct alignas(32) Node {
        float centerX[kWide]{}, centerY[kWide]{}, centerZ[kWide]{}, radius[kWide]{}, radiusSquared[kWide]{};
        float axisX[kWide]{}, axisY[kWide]{}, axisZ[kWide]{};
        float cosCone[kWide]{}, sinCone[kWide]{}, power[kWide]{};
        float constant[kWide]{}, linear[kWide]{}, square[kWide]{};
        std::uint32_t next[kWide]{};  // a node, or a thing
        std::uint8_t leaves = 0;      // which are things, a bit each
        std::uint8_t count = 0;       // those that are there come first
        void set(std::size_t child, const Cluster& cluster);
    };
    static Cluster join(const Cluster& a, const Cluster& b);
    std::size_t halve(std::size_t first, std::size_t last);
    Cluster build(std::span<const Cluster> emitters, std::size_t first, std::size_t last, std::uint32_t node,
                  std::uint32_t depth, std::uint64_t branches);
    struct Fractions;
    Fractions fractions(const Node& node, const Vec3f& point, const Vec3f& normal) const;

    /// For one surface at each of the eight clusters, or for eight at one of them, whose numbers are given eight times.
    struct Clusters {
        simd::V8 center, axis;
        simd::F8 radius, radiusSquared, cosCone, sinCone, power, constant, linear, square;
    };
    simd::F8 importance(const Clusters& clusters, const simd::V8& point, const simd::V8& normal) const;
    static Clusters allOf(const Node& node);
    static Clusters oneOf(const Node& node, std::size_t child);
    /// A step on the way down: the node that it has reached, or the emitter at its end, and the rest of the random
    /// number.
    struct Step {
        std::uint32_t next = kNone;
        float u = 0, probability = 0;
    };
    bool descend(Step& step, const Vec3f& point, const Vec3f& normal) const;

    std::vector<std::uint64_t> branches_;  // by thing: three bits a node, from the root on: which child
    struct Placed {
        Vec3f middle;
        std::uint32_t emitter;
    };
    std::vector<Placed> order_;  // during construction; with the sort key, which is read some twenty times
    std::vector<Node> nodes_;
    float minimum_ = 1e-12f;
    bool squaresOnly_ = true;  // the light of each falls off with the square of the distance and nothing else
};

}  // namespace rtsg::trace
