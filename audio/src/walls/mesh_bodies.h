// Closed bodies of a mesh, by what they take up: volume, middle and moments.
//
// Surfaces that have corners in common are one body, if each of their edges is met as often one way as the other; so
// are bodies whose boxes meet.
// Threading: pure functions.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <unordered_map>
#include <vector>

#include <rtsg/audio/acoustic_geometry.h>
#include <rtsg/audio/walls.h>

namespace rtsg {

struct MeshBody {
    double volume = 0;
    glm::dvec3 center{0};
    glm::dmat3 moments{0.0};     // about that, over the volume
    glm::dvec3 low{0}, high{0};  // corners of the box around it
};

class MeshBodies {
  public:
    static constexpr std::uint32_t kNone = 0xFFFFFFFF;

    explicit MeshBodies(const Mesh& mesh);

    const std::vector<MeshBody>& all() const { return bodies_; }
    /// Of what has a corner there; kNone of what is open.
    std::uint32_t at(const Vec3f& corner) const;

  private:
    /// And the box around it.
    struct Part {
        MeshBody all;
        glm::dvec3 low{std::numeric_limits<double>::infinity()}, high{-std::numeric_limits<double>::infinity()};

        void extend(const glm::dvec3& place) {
            low = glm::min(low, place);
            high = glm::max(high, place);
        }
        bool reaches(double x) const;
        bool meets(const Part& other) const;
        void add(const Part& other);
        MeshBody body() const;
    };
    std::vector<std::uint32_t> join(const std::vector<Part>& parts);

    struct Hash {
        std::size_t operator()(const Vec3f& corner) const;
    };
    std::vector<MeshBody> bodies_;
    std::unordered_map<Vec3f, std::uint32_t, Hash> corners_;  // which body
};

/// In the world, as the box of the same volume and moments; nothing where that is none.
bool placedBody(const MeshBody& body, const WorldFromLocal& worldFromLocal, WallBody& result);

}  // namespace rtsg
