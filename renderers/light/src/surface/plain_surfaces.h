// PlainSurfaces: tells which instances have only one even colour, and gives what eight hits on them need for shading.
//
// Plain: opaque, of one material without textures, vertex colours, mirroring or refraction; most instances of most
// scenes are. Built for one picture of paths; it reads the scene's meshes, which must outlive it.
// Threading: const once built.
#pragma once

#include <cstdint>
#include <vector>

#include "lighting/trace_scene.h"
#include "texture/bsdf8.h"
#include "world/large_rays.h"

namespace rtsg::trace {

class PlainSurfaces {
  public:
    /// The kind of a hit, by its instance.
    enum Kind : std::uint8_t {
        other = 0,   // none of this
        matte = 1,   // scatters evenly
        glossy = 2,  // Phong's with a highlight, or physical
    };
    static constexpr std::uint8_t kShines = 4, kSolid = 8,  // solid: plain from its front only
        kBlack = 16;                                        // sends nothing on

    explicit PlainSurfaces(const TraceScene& scene);

    /// Whether most triangles are.
    bool maximum() const { return maximum_; }
    /// A Kind with additional flags.
    std::uint8_t kindOf(std::uint32_t instance) const { return instance < kinds_.size() ? kinds_[instance] : 0; }
    /// Added to a label's kind: a matte surface without normals of its own, which fetchFaces() can read.
    static constexpr std::int32_t kFlat = 1 << 8;
    /// The answer for LargeRays; the label is kindOf().
    LargeRays::About about(std::uint32_t instance) const {
        const std::uint8_t kind = kindOf(instance);
        const std::uint32_t back = kind & kSolid ? 0 : LargeRays::kBack;
        if (!(kind & (matte | glossy))) return {};
        const bool isFlat = (kind & matte) && !world_->instance(instance).mesh->normals.present();
        return {LargeRays::kFront | back, false, isFlat ? kind | kFlat : kind, baseOf(instance)};
    }
    /// The radiance of an instance that shines.
    Vec3f emissive(std::uint32_t instance) const {
        const Colors& c = colors_[numbers_[instance]];
        return {c.emissive[0], c.emissive[1], c.emissive[2]};
    }

    /// Eight hits: slots, triangles, weights of the second and third corners, true normals.
    struct Hits {
        std::uint32_t instance[8], triangle[8];
        simd::F8 u, v;
        simd::V8 outside;
        simd::V8 direction;  // of the rays
    };
    struct Surfaces {
        simd::V8 normal, outside, facing;  // shading normal and true one on the viewer's side
        simd::V8 exact, error;             // as HitPoint has them
        simd::V8 base;
        /// The starts of rays that leave the surfaces, as RayView::leave() has them.
        simd::V8 leave(const simd::V8& towards) const;
    };
    /// All of the hits are on plain ones.
    void fetch(const Hits& hits, Surfaces& out) const;
    /// The same of LargeHits::faces that are kFlat.
    static void fetchFaces(const bvh::LargeTable& table, const Hits& hits, Surfaces& out);
    /// The rest of what glossy ones reflect; `back`: unit, towards the viewer.
    Bsdf8 bsdf(const Hits& hits, const Surfaces& surfaces, const simd::V8& back, simd::F8 cosView) const;

  private:
    /// Laid out as gather4() reads it.
    struct alignas(16) Colors {
        float base[3], exponent;
        float specular[3], metallic;
        float emissive[3], roughness;
        float physical, unused[3];
        explicit Colors(const Material& material);
    };
    Vec3f baseOf(std::uint32_t instance) const {
        const Colors& c = colors_[numbers_[instance]];
        return {c.base[0], c.base[1], c.base[2]};
    }
    static void normals(const Hits& hits, const RayInstance* const* each, bool same, Surfaces& out);

    const RayView* world_;
    std::vector<std::uint8_t> kinds_;     // by slot
    std::vector<std::uint32_t> numbers_;  // by slot: of its colours
    std::vector<Colors> colors_;
    bool maximum_ = false;
};

}  // namespace rtsg::trace
