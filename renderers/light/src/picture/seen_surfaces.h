// SurfacesInPicture: the visible surfaces of a picture, one hit at a time: without the backs of solids, and without
// parts that hatches, masks and alpha make transparent.
//
// Differs from pictures in one thing: surfaces that are fully transparent only by a Material's `transparency` are
// included, so that authors can lay them over others to be pointed at. Threading: const.
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
    virtual TraceScene sceneFor(const RayView& view, const Ray& ray) const = 0;

  private:
    bool isThere(const RayView& view, const Ray& ray, const Hit& hit, bool behind) const;
};

}  // namespace rtsg::trace
