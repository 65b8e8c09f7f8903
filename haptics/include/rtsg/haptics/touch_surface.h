// TouchSurface: the haptic properties of a surface, and how they are read from a scene.
//
// X3D has no fields for them. They are MetadataFloats in a MetadataSet named "RTSG" in the `metadata` of an Appearance,
// with the names of the fields of H3D API's SmoothSurface and FrictionalSurface. Threading: values; readTouchSurface()
// on the scene's thread.
#pragma once

#include <rtsg/core/scene.h>

namespace rtsg {

struct TouchSurface {
    double stiffness = 500;      // N/m
    double damping = 0;          // N s/m, against motion towards the surface and away from it
    double staticFriction = 0;   // coefficients of Coulomb friction, without unit
    double dynamicFriction = 0;  // at most the static one
    friend bool operator==(const TouchSurface&, const TouchSurface&) = default;
};

/// Reads the surface of an Appearance; properties that are missing are taken from `otherwise`. Values that are negative
/// or not finite are ignored and reported in `diagnostics`.
TouchSurface readTouchSurface(const Scene& scene, NodeId appearance, const TouchSurface& otherwise,
                              Diagnostics* diagnostics = nullptr);

}  // namespace rtsg
