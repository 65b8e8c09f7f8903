// Boxes around instances, and sixteen rays against one.
#pragma once

#include <cstdint>

#include <rtsg/renderers/ray_view.h>

namespace rtsg {

/// A bit for each of the rays that meets the box somewhere between its ends, and maybe for others that pass close by.
std::uint32_t meetBox(const RayPacket16& rays, const Bounds& box);
/// The same of rays with other ends.
std::uint32_t meetBox(const RayPacket16& rays, const float* tMax, const Bounds& box);
bool meetsBox(const Ray& ray, const Bounds& box);
/// Whether the line of any lane, in use or not, comes into a ball from there on.
bool comeNear(const RayPacket16& rays, const Vec3f& middle, float radiusSquared);

/// Around an instance, in ray space; its lines and points are wider. Precondition: it has a mesh.
Bounds boxAround(const RayInstance& instance);

}  // namespace rtsg
