// SurfacesInPicture: what of surfaces a picture shows, one hit at a time: not the backs of solids, nor what hatches,
// masks and the alpha of textures and colours leave clear.
//
// Differs from pictures in one thing: what a Material's `transparency` alone makes wholly clear is there, so that
// authors can lay it over others to be pointed at. Threading: const.
#pragma once

#include <memory>
#include <optional>

#include <rtsg/renderers/picking.h>

#include "lighting/trace_scene.h"

namespace rtsg::trace {

class SurfacesInPicture : public SeenSurfaces {
  public:
    Hit seen(const RayView& view, const Ray& ray, const Hit& met) const final;

  protected:
    /// The material and the rest with which an instance is drawn.
    struct Drawn {
        std::shared_ptr<const Material> material;
        SlotShading slot;
    };
    virtual Drawn drawn(const RayInstance& instance) const = 0;
    /// False: nothing of its front is clear, unless the mesh's own colours say so.
    virtual bool mayBeClear(const RayInstance& instance) const = 0;
    /// All that says where in a picture something is; pixels of no size: that is not known.
    virtual TraceScene place(const RayView& view, const Ray& ray) const = 0;

  private:
    bool isThere(const RayView& view, const Ray& ray, const Hit& hit, bool behind) const;
};

}  // namespace rtsg::trace
