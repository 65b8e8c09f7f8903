// Finds the places of a system's particles: emitters, forces, winds and bounds, for any time in closed form.
//
// Invariant: a pure function of the scene's fields (positions in double precision); nothing is remembered from frame to
// frame, so pictures of a replica, of a late joiner and after a seek agree. Emitters' numbers and particles' sizes are
// those of when a particle was born; physics models and the shapes of emitters act as they are now, as if they had been
// so since its birth. Threading: one thread. Source: ISO/IEC 19775-1 V4.0 40.2.2, 40.3, 40.4.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include <rtsg/core/emission.h>
#include <rtsg/renderers/mesh.h>

#include "mesh/particle_bounds.h"
#include "shapes/tessellate_text.h"

namespace rtsg {
class Node;
class Scene;
}  // namespace rtsg

namespace rtsg::detail {

/// The mesh of a geometry node, or null.
using MeshOf = std::function<std::shared_ptr<const Mesh>(NodeId geometry)>;

struct MovedParticle {
    Vec3d position{0}, velocity{0};
    Vec2f size{0};
    double age = 0;  // seconds
};

/// The particles of a ParticleSystem at the time that it shows, by span and place. Impossible values are reported in
/// `problems`.
std::vector<MovedParticle> moveParticles(const Scene& scene, const Node& system, const MeshOf& meshOf, Mesh& problems);

/// Their picture: points, lines, triangles, or copies of the system's geometry, coloured by their ages. Sprites face
/// `eye`, which is in the system's own space; without one they lie in its x-y plane.
Mesh tessellateParticles(const Scene& scene, const Node& system, const MeshOf& meshOf, std::optional<Vec3d> eye);
/// The same with the meshes of its geometry nodes, and their problems; `text` as in tessellateNode().
std::shared_ptr<const Mesh> particlesNode(const Scene& scene, const Node& system, const TessellationOptions& options,
                                          TextMaker* text, std::optional<Vec3d> eye);
/// Whether that depends on the eye.
bool facesTheEye(const Scene& scene, const Node& system);

}  // namespace rtsg::detail
