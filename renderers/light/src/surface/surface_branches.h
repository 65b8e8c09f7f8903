// SurfaceBranches: the rays that surfaces reflect, refract or let through, and the share of light in each.
//
// Invariant: the result of a lane does not depend on other lanes. Threading: a packet's. Source: Fresnel's equations
// and Snell's law, as in shading.h.
#pragma once

#include <cstdint>

#include "surface_packet.h"

namespace rtsg::trace {

struct SurfaceBranches {
    std::uint32_t glass = 0;     // lanes that refract the light that they let through, and of these
    std::uint32_t refracts = 0;  // those that do not reflect all of it
    /// Shares of the light that a surface sends along a ray: of the mirror direction; of the surface's own colours if
    /// it is opaque; of transmitted light if it is transparent; of light that does not pass straight; and of the
    /// coverage by which an opaque surface hides things behind it. The first and the third together never exceed 1,
    /// since rays would otherwise multiply.
    Lanes3 mirror, body, passing, whole, covering;
    Lanes3 mirrored, bent;  // directions; bent only of glass
    Lanes3 before, behind;  // where rays start on the side that is seen, and on the other

    /// Finds the shares of `lanes`. Precondition: findPoints().
    void find(const SurfacePacket& surfaces, std::uint32_t lanes);
};

}  // namespace rtsg::trace
