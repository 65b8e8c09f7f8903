// Updates the paths over edges when source and listener have moved since the trace: the shortest paths over the same
// edges, extended beyond their ends.
//
// Threading: pure functions.
#pragma once

#include <glm/glm.hpp>

#include <rtsg/audio/echogram.h>
#include "diffraction_wedge.h"

namespace rtsg {

struct EdgePath {
    double length = 0;
    /// Unit, from the first place towards the source, and from the last one towards the listener: so does its length
    /// grow.
    glm::dvec3 toSource{0}, toListener{0};
    glm::dvec3 last{0};  // place that it is heard from
};
EdgePath edgePath(const EdgeRoute& route, const glm::dvec3& source, const glm::dvec3& listener);

/// The path that wedgeField() takes. Angles outside the air are kept as they are, below 2 pi.
WedgePath pathAbout(const EdgeRoute& route, const BendingEdge& edge, const glm::dvec3& source,
                    const glm::dvec3& listener);

}  // namespace rtsg
