// Media: the transparent bodies (glass, water) that the rays of a tile are in, and the media on both sides of each
// surface.
//
// A body is an instance whose material has a refractive index. Where bodies overlap, one of them counts: the one with
// the highest priority, then the smallest (by the diagonal of its box), then the last. So a ball in water, a drop on a
// pane and two blocks that share a face look right. A surface inside a single body does not count.
// Invariant: several surfaces at one point count as one, in whatever order they are reported.
// Threading: one tile's. Source: Schmidt & Budge 2002 (Simple Nested Dielectrics in Ray Traced Images).
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <unordered_map>
#include <vector>

#include "lighting/trace_scene.h"

namespace rtsg::trace {

struct SurfacePacket;

class Media {
  public:
    /// The bodies around a place, by number; 0: none. One may be in it more than once, where it overlaps itself.
    using Set = std::uint32_t;
    explicit Media(const TraceScene& scene);

    static bool isBody(const TraceScene& scene, std::uint32_t instance) {
        return scene.materials[scene.slot(instance).material].material.refractiveIndex > 0;
    }
    Set aroundEye() const { return aroundEye_; }
    /// The absorption of the bodies in a set, in 1/m.
    const Vec3f& absorption(Set set) const;

    struct Interface {
        Set beyond = 0;
        float eta = 1;    // the index there over that on this side; 0: there is no surface
        float apart = 0;  // how far other surfaces in the same place may be from the one that was met, in metres
    };
    /// The interface that a ray in these bodies crosses at a hit. If it leaves a body that it never entered, that body
    /// surrounded it before.
    Interface cross(Set from, const Ray& ray, const Hit& hit);
    /// The same where the other surfaces in that place are known.
    Interface cross(Set from, const Vec3f& direction, const Hit& hit, std::span<const Hit> others);

  private:
    struct Node {
        std::uint32_t slot = 0;
        Set rest = 0;
        std::uint32_t count = 1;
        std::uint32_t shown = 0;  // the slot of the body that is there
        float index = 1, priority = 0, size = 0;
        Vec3f absorption{0};
    };
    const Node& node(Set set) const { return nodes_[set - 1]; }
    Set with(Set set, std::uint32_t slot);
    Set without(Set set, std::uint32_t slot);
    bool has(Set set, std::uint32_t slot) const;
    std::vector<Hit> inPlace(const Ray& ray, const Hit& hit, float& apart) const;

    const TraceScene& scene_;
    std::vector<Node> nodes_;
    std::unordered_map<std::uint64_t, Set> known_;  // with(), by both
    Set aroundEye_ = 0;
};

/// The closed bodies that a place lies in.
std::vector<std::uint32_t> bodiesAround(const TraceScene& scene, const Vec3f& position);

/// The bodies around a ray that passes straight through several surfaces.
struct RunsIn {
    Media* media = nullptr;  // null: nobody knows
    Media::Set set = 0;
    /// Goes through a hit; returns eta as Interface has it, nothing if it is none of a body.
    std::optional<float> pass(const TraceScene& scene, const Ray& ray, const Hit& hit);
    std::optional<float> pass(const TraceScene& scene, const Vec3f& direction, const Hit& hit,
                              std::span<const Hit> others);
};

/// Finds the media on both sides of the surfaces in a packet. `tasks`: null for rays from the eye.
void findInterfaces(const TraceScene& scene, const RayPacket16& rays, const PathTask* tasks, SurfacePacket& surfaces);

}  // namespace rtsg::trace
