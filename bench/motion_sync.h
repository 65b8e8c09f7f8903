// Motion: bodies that move in one of three ways, 60 frames a second, as change sets; what the codec's figures are
// measured on.
//
//   smooth   positions and orientations on Catmull-Rom splines through random knots: one a second, up to 2 m along each
//            axis and 60 degrees from the one before
//   chaotic  tumbling cubes: gravity, torque-free spin, bounces with friction, kicks when they come to rest
//   mixed    a third each of the two and of bodies that start, go a straight way and stop
//
// Threading: one thread an object.
#pragma once

#include <cstdint>
#include <random>
#include <string_view>
#include <vector>

#include <glm/gtc/quaternion.hpp>

#include <rtsg/core/change.h>

namespace rtsg::bench {

enum class Movement : std::uint8_t { smooth, chaotic, mixed };
constexpr std::string_view kMovementNames[] = {"smooth", "chaotic", "mixed"};

class Motion {
  public:
    Motion(Movement movement, std::size_t bodies, std::uint64_t seed = 1);
    /// Body i is node kFirstNode + 3 i. The set holds what moved: a Transform's translation and rotation.
    static constexpr std::uint32_t kFirstNode = 100;
    ChangeSet next();

  private:
    struct Body {
        Movement movement;
        glm::dvec3 position{}, velocity{}, spin{};
        glm::dquat rotation{1, 0, 0, 0};
        glm::dvec3 knots[4];
        glm::dquat rotations[4];
        double phase = 0, still = 0;
        Vec3f shownPosition{};
        Rotation shownRotation{};
    };
    glm::dvec3 somewhere(double size);
    glm::dquat someRotation();
    glm::dquat rotationFrom(const glm::dquat& before);
    void glide(Body& body);
    void tumble(Body& body);
    void travel(Body& body);

    std::mt19937_64 random_;
    std::vector<Body> bodies_;
    std::uint64_t frame_ = 0;
};

}  // namespace rtsg::bench
