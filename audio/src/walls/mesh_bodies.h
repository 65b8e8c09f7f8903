// Closed bodies of a mesh: their volumes, and the boxes around them.
//
// Surfaces that share corners are one body if each edge is used as often in one direction as in the other. Bodies whose
// boxes overlap are one, too.
// Threading: pure functions.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <unordered_map>
#include <vector>

#include <rtsg/audio/acoustic_geometry.h>

#include "walls.h"

namespace rtsg {

/// In the mesh's frame.
struct MeshBody {
    glm::dvec3 low{std::numeric_limits<double>::infinity()}, high{-std::numeric_limits<double>::infinity()};
    double volume = 0;
};

class MeshBodies {
  public:
    static constexpr std::uint32_t kNone = 0xFFFFFFFF;

    explicit MeshBodies(const Mesh& mesh);

    const std::vector<MeshBody>& all() const { return bodies_; }
    /// The body that has a corner there; kNone if that surface is open.
    std::uint32_t at(const Vec3f& corner) const;

  private:
    struct Hash {
        std::size_t operator()(const Vec3f& corner) const;
    };
    std::vector<MeshBody> bodies_;
    std::unordered_map<Vec3f, std::uint32_t, Hash> corners_;  // which body
};

/// In the world; false where nothing is left of it.
bool placedBody(const MeshBody& body, const WorldFromLocal& worldFromLocal, WallBody& result);

}  // namespace rtsg
