// Emitters: the emitting triangles, and a tree that chooses one by its possible contribution at a point.
//
// Contains triangles of materials that emit, are opaque and do not mirror, and that rest while the shutter is open;
// other emitters are found by bounces only.
// Invariant: an emitter that lights a point at all is chosen there with a probability above 0, and density() is the one
// that sample() chooses with. In ray space.
// Threading: const once built.
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

#include <rtsg/core/value.h>
#include <rtsg/renderers/mesh.h>

#include "light_tree.h"

namespace rtsg::trace {

struct TraceScene;

class Emitters {
  public:
    static constexpr std::uint32_t kNone = LightTree::kNone;
    struct Emitter {
        Vec3f corner{0}, ab{0}, ac{0};  // ray space
        Vec3f normal{0};                // unit, as Hit::normal
        float area = 0;                 // m^2
        std::uint32_t instance = 0, triangle = 0;
        bool bothSides = false;
        bool contested = false;     // lies in one plane with another, in part at least: a ray tells which is seen
        bool even = false;          // sends the same from everywhere:
        Vec3f front{0}, behind{0};  // radiance from the normal's side, and from the other one
    };
    struct Choice {
        std::uint32_t emitter = kNone;
        float probability = 0;
    };

    /// Something that shines, and all that the table depends on.
    struct Source {
        std::uint32_t slot = 0;
        std::shared_ptr<const Mesh> mesh;
        glm::mat4x3 rayFromLocal{1.0f};
        int sign = 1;
        float glow = 0;  // the most that it emits
        bool even = false;
        Vec3f front{0}, behind{0};  // as Emitter's
        friend bool operator==(const Source&, const Source&) = default;
    };
    static std::vector<Source> sourcesIn(const TraceScene& scene);

    Emitters() = default;
    explicit Emitters(const std::vector<Source>& sources);
    explicit Emitters(const TraceScene& scene) : Emitters(sourcesIn(scene)) {}

    bool empty() const { return emitters_.empty(); }
    /// Whether all send the same from everywhere, and none is contested.
    bool even() const { return even_; }
    std::size_t size() const { return emitters_.size(); }
    const Emitter& operator[](std::uint32_t emitter) const { return emitters_[emitter]; }

    /// One of them for a surface at `point` with this shading normal; none if nothing of them can be above its horizon.
    /// `u` in [0, 1).
    Choice sample(const Vec3f& point, const Vec3f& normal, float u) const;
    /// The same for eight surfaces at once; those not in `lanes` choose nothing.
    LightTree::Choices sample(const simd::V8& point, const simd::V8& normal, simd::F8 u, std::uint32_t lanes) const {
        return tree_.sample(point, normal, u, lanes);
    }
    /// Eight of them, side by side.
    struct Eight {
        simd::V8 corner, ab, ac, normal, front, behind;
        simd::F8 area;
        simd::I8 bothSides;
    };
    Eight eight(const std::uint32_t* numbers) const;
    /// The probability that sample() chooses this one.
    float density(std::uint32_t emitter, const Vec3f& point, const Vec3f& normal) const;
    /// By the hit of a ray; kNone: not in this list.
    std::uint32_t find(std::uint32_t instance, std::uint32_t triangle) const;

  private:
    void add(const Source& source, std::vector<LightTree::Cluster>& clusters);
    void findContested();

    /// The data that eight() returns, four numbers at a time.
    struct alignas(16) Packed {
        float numbers[20];
        explicit Packed(const Emitter& emitter);
    };

    std::vector<Emitter> emitters_;
    std::vector<Packed> packed_;  // the same
    /// And of up to eight of them column by column, which one register holds.
    struct alignas(32) Few {
        float columns[20][8]{};
    };
    Few few_;
    LightTree tree_;
    bool even_ = true;
    std::vector<std::uint32_t> firstOf_;  // by instance slot: its first emitter or kNone; triangles follow each other
};

/// The table of the last picture, for as long as the same things shine in the same places. Threading: any.
class EmitterTable {
  public:
    std::shared_ptr<const Emitters> of(const TraceScene& scene);

  private:
    std::mutex mutex_;
    std::vector<Emitters::Source> sources_;  // of `last_`
    bool withTree_ = true;
    std::shared_ptr<const Emitters> last_;
};

}  // namespace rtsg::trace
