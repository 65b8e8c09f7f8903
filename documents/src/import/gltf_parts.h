// Shared by the parts of the import of glTF: a node of the output, and values in X3D's form.
//
// Threading: one thread an import. Source: glTF 2.0 (ISO/IEC 12113:2022) 3.5.3.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "gltf_file.h"

namespace rtsg::detail {

/// No node, no image, no accessor.
inline constexpr std::size_t kNoIndex = SIZE_MAX;

/// A node of the output; closes it.
class GltfNode {
  public:
    GltfNode(DocumentHandler& out, std::string_view type, std::string_view field, std::string_view def = {})
        : out_(out) {
        out_.beginNode(type, def, field, {});
    }
    ~GltfNode() { out_.endNode({}); }
    GltfNode(const GltfNode&) = delete;
    GltfNode& operator=(const GltfNode&) = delete;
    template <class T>
    GltfNode& set(std::string_view name, T value) {
        out_.setField(name, Value(std::move(value)), {});
        return *this;
    }

  private:
    DocumentHandler& out_;
};

/// A quaternion (x y z w) as a rotation of X3D.
Rotation rotationOf(const double* quaternion);
Vec3f vectorOf(const std::vector<double>& three);
/// The DEF of a node that something moves.
std::string defOfGltfNode(std::size_t node);
/// The DEF of the points of a primitive, the `part`-th of its mesh, at that node.
std::string defOfGltfPoints(std::size_t node, std::size_t part);

}  // namespace rtsg::detail
