// Skins of glTF as skeletons of HAnimJoints, whose transforms are the identity while the figure rests.
//
// A point moves by the sum of w G B^-1, where G is where a joint's node is now and B where it was when the skin was
// bound. Along the skeleton that is a product of P L B^-1, with L the node's own transform and P the B of the joint
// above; and that is what an HAnimJoint does whose center is where B puts the origin. Its rotation, translation and
// scale each follow from those of the node alone, so animations of nodes carry over, key by key.
// Threading: values. Source: glTF 2.0 (ISO/IEC 12113:2022) 3.7.3; ISO/IEC 19775-1 V4.0 26.3.2.
#pragma once

#include <vector>

#include <glm/glm.hpp>
#include <glm/gtc/quaternion.hpp>

#include "gltf_file.h"

namespace rtsg::detail {

/// The transform of a node of the file without its parents', as a matrix and in parts.
struct GltfTransform {
    glm::dvec3 translation{0}, scale{1};
    glm::dquat rotation{1, 0, 0, 0};
    glm::dmat4 matrix() const;
};
GltfTransform transformOf(const nlohmann::json& node);
Rotation rotationOf(const glm::dquat& rotation);

class GltfSkin {
  public:
    static constexpr std::size_t kNone = SIZE_MAX;
    struct Joint {
        std::size_t node = 0;
        std::size_t above = kNone;  // index in joints()
        std::vector<std::size_t> below{};
        Vec3f center{0};
        Rotation scaleOrientation{};

        Rotation rotation(const glm::dquat& rotated) const;
        Vec3f translation(const glm::dvec3& translation) const;
        Vec3f scale(const glm::dvec3& scale) const;

        glm::dmat4 outside{1}, bound{1};  // P and B
        glm::dquat left{1, 0, 0, 0}, right{1, 0, 0, 0};
        double factor = 1;
    };

    /// `above` has the parent of each node, or kNone. There are no joints, and a report, if the skin cannot be read.
    GltfSkin(GltfFile& file, std::size_t skin, const std::vector<std::size_t>& above);
    const std::vector<Joint>& joints() const { return joints_; }

    /// Which points each joint moves, and how much: by the attributes JOINTS_n and WEIGHTS_n of a primitive.
    struct Influence {
        Array<std::int32_t> points;
        Array<float> weights;
    };
    std::vector<Influence> influences(GltfFile& file, const nlohmann::json& attributes, std::size_t points) const;

  private:
    /// False: a joint is there twice, or below itself.
    bool findAbove(GltfFile& file, const std::vector<std::size_t>& above);
    bool areBelowRoots() const;
    std::vector<Joint> joints_;
};

}  // namespace rtsg::detail
