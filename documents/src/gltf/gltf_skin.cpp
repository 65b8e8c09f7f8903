// Joints of glTF's skins.
#include "gltf_skin.h"

#include <cmath>
#include <string>
#include <unordered_map>

#include <glm/gtc/matrix_transform.hpp>
#include <glm/gtc/type_ptr.hpp>

#include <rtsg/core/portable_math.h>

namespace rtsg::detail {

using nlohmann::json;

glm::dmat4 GltfTransform::matrix() const {
    return glm::translate(glm::dmat4(1), translation) * glm::mat4_cast(rotation) * glm::scale(glm::dmat4(1), scale);
}

namespace {

/// A matrix without shear, taken apart.
GltfTransform transformOfMatrix(const glm::dmat4& m) {
    GltfTransform transform;
    transform.translation = glm::dvec3(m[3]);
    glm::dmat3 axes(m);
    for (int i = 0; i < 3; ++i) {
        transform.scale[i] = glm::length(axes[i]);
        if (!(transform.scale[i] > 0)) return transform;
        axes[i] /= transform.scale[i];
    }
    if (glm::determinant(axes) < 0) {
        transform.scale = -transform.scale;
        axes = -axes;
    }
    transform.rotation = glm::normalize(glm::quat_cast(axes));
    return transform;
}

}  // namespace

GltfTransform transformOf(const json& node) {
    if (const auto m = GltfFile::numbers(node, "matrix", 16)) return transformOfMatrix(glm::make_mat4(m->data()));
    GltfTransform transform;
    if (const auto t = GltfFile::numbers(node, "translation", 3)) transform.translation = glm::make_vec3(t->data());
    if (const auto s = GltfFile::numbers(node, "scale", 3)) transform.scale = glm::make_vec3(s->data());
    if (const auto r = GltfFile::numbers(node, "rotation", 4)) {
        const glm::dquat rotation((*r)[3], (*r)[0], (*r)[1], (*r)[2]);
        if (glm::length(rotation) > 0) transform.rotation = glm::normalize(rotation);
    }
    return transform;
}

Rotation rotationOf(const glm::dquat& rotation) {
    const double sine = std::sqrt(rotation.x * rotation.x + rotation.y * rotation.y + rotation.z * rotation.z);
    if (sine == 0) return {};
    return {static_cast<float>(rotation.x / sine), static_cast<float>(rotation.y / sine),
            static_cast<float>(rotation.z / sine), static_cast<float>(2 * portable::atan2(sine, rotation.w))};
}

Rotation GltfSkin::Joint::rotation(const glm::dquat& rotation) const {
    glm::dquat all = left * rotation * right;
    if (all.w < 0) all = -all;  // the shorter way
    return rotationOf(all);
}

Vec3f GltfSkin::Joint::translation(const glm::dvec3& translation) const {
    return Vec3f(glm::dvec3(outside * glm::dvec4(translation, 1)) - glm::dvec3(bound[3]));
}

Vec3f GltfSkin::Joint::scale(const glm::dvec3& scale) const {
    return Vec3f(scale * factor);
}

GltfSkin::GltfSkin(GltfFile& file, std::size_t skin, const std::vector<std::size_t>& above) {
    const json* it = file.item("skins", skin);
    if (!it) return;
    std::vector<float> inverse;
    std::size_t components = 0;
    if (const auto accessor = GltfFile::index(*it, "inverseBindMatrices")) inverse = file.floats(*accessor, components);
    const json& list = GltfFile::list(*it, "joints");
    if (list.empty()) {
        file.fault("skin " + std::to_string(skin) + " of the glTF file has no joints");
        return;
    }
    if (!inverse.empty() && (components != 16 || inverse.size() < 16 * list.size())) {
        file.fault("skin " + std::to_string(skin) +
                   " of the glTF file has matrices of another kind or number than joints; it is left out");
        return;
    }
    for (const json& one : list) {
        const std::size_t node = one.is_number_unsigned() ? one.get<std::size_t>() : kNone;
        if (node >= above.size()) {
            joints_.clear();
            return;  // which has been told
        }
        Joint joint;
        joint.node = node;
        if (!inverse.empty()) {
            const glm::dmat4 m(glm::make_mat4(inverse.data() + 16 * joints_.size()));
            const double size = std::abs(glm::determinant(m));
            if (size > 0 && std::isfinite(size))
                joint.bound = glm::inverse(m);
            else
                file.fault("skin " + std::to_string(skin) + " of the glTF file has a matrix that has no inverse");
        }
        joints_.push_back(joint);
    }
    if (!findAbove(file, above)) {
        joints_.clear();
        file.fault("skin " + std::to_string(skin) +
                   " of the glTF file names a joint twice, or joints that are below each other; it is left out");
    }
}

bool GltfSkin::findAbove(GltfFile& file, const std::vector<std::size_t>& above) {
    std::unordered_map<std::size_t, std::size_t> byNode;
    for (std::size_t i = 0; i < joints_.size(); ++i) byNode.emplace(joints_[i].node, i);
    if (byNode.size() != joints_.size()) return false;
    // Nodes between two joints, and above the first, keep the places that they have in the file. Each is passed once,
    // however many joints are below it.
    struct Between {
        glm::dmat4 outside{1};  // from here to the joint above
        std::size_t joint = kNone;
    };
    std::unordered_map<std::size_t, Between> passed;
    std::vector<std::size_t> path;
    for (Joint& joint : joints_) {
        path.clear();
        std::size_t node = above[joint.node];
        for (; node != kNone && !byNode.contains(node) && !passed.contains(node); node = above[node]) {
            path.push_back(node);
            if (path.size() > above.size()) return false;
        }
        Between end;
        if (const auto known = passed.find(node); known != passed.end())
            end = known->second;
        else if (node != kNone)
            end.joint = byNode.at(node);
        for (; !path.empty(); path.pop_back()) {
            if (const json* between = file.item("nodes", path.back()))
                end.outside = end.outside * transformOf(*between).matrix();
            passed.emplace(path.back(), end);
        }
        joint.above = end.joint;
        joint.outside = end.outside;
        if (joint.above != kNone) joint.outside = joints_[joint.above].bound * joint.outside;
    }
    for (std::size_t i = 0; i < joints_.size(); ++i) {
        Joint& joint = joints_[i];
        if (joint.above != kNone) joints_[joint.above].below.push_back(i);
        const GltfTransform outside = transformOfMatrix(joint.outside), bound = transformOfMatrix(joint.bound);
        joint.left = outside.rotation;
        joint.right = glm::inverse(bound.rotation);
        joint.factor = bound.scale.x == 0 ? 1 : outside.scale.x / bound.scale.x;
        joint.center = Vec3f(bound.translation);
        joint.scaleOrientation = rotationOf(bound.rotation);
    }
    return areBelowRoots();
}

bool GltfSkin::areBelowRoots() const {
    std::vector<std::size_t> open;
    for (std::size_t i = 0; i < joints_.size(); ++i)
        if (joints_[i].above == kNone) open.push_back(i);
    std::size_t count = 0;
    for (; !open.empty(); ++count) {
        const Joint& joint = joints_[open.back()];
        open.pop_back();
        open.insert(open.end(), joint.below.begin(), joint.below.end());
    }
    return count == joints_.size();
}

std::vector<GltfSkin::Influence> GltfSkin::influences(GltfFile& file, const json& attributes,
                                                      std::size_t points) const {
    std::vector<Influence> result(joints_.size());
    for (int set = 0; set < 4; ++set) {
        const auto j = GltfFile::index(attributes, ("JOINTS_" + std::to_string(set)).c_str());
        const auto w = GltfFile::index(attributes, ("WEIGHTS_" + std::to_string(set)).c_str());
        if (!j && !w && set > 0) break;
        if (!j || !w) {
            file.fault("a primitive of the glTF file has joints without weights, or weights without joints");
            break;
        }
        std::size_t jointsEach = 0, weightsEach = 0;
        const std::vector<float> joints = file.floats(*j, jointsEach), weights = file.floats(*w, weightsEach);
        if (jointsEach != 4 || weightsEach != 4 || joints.size() != 4 * points || weights.size() != joints.size()) {
            file.fault("a primitive of the glTF file has another number of joints and weights than points");
            break;
        }
        for (std::size_t i = 0; i < joints.size(); ++i) {
            if (!(weights[i] > 0) || joints_.empty()) continue;
            if (!(joints[i] >= 0) || static_cast<std::size_t>(joints[i]) >= joints_.size()) {
                file.fault("a primitive of the glTF file has weights of joints that its skin does not have");
                continue;
            }
            Influence& one = result[static_cast<std::size_t>(joints[i])];
            one.points.push_back(static_cast<std::int32_t>(i / 4));
            one.weights.push_back(weights[i]);
        }
    }
    return result;
}

}  // namespace rtsg::detail
