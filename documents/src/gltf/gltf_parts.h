// Shared by the parts of the import of glTF: a node of the output, and values in X3D's form.
//
// Threading: one thread an import. Source: glTF 2.0 (ISO/IEC 12113:2022) 3.5.3.
#pragma once

#include <array>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "gltf_file.h"
#include "import/imported_names.h"

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

/// Chooses the DEF names of the things in the file: the author's name, or else kind and number.
class GltfNames {
  public:
    enum class List : std::uint8_t { nodes, animations, meshes, materials, cameras, lights, textures };

    explicit GltfNames(const GltfFile& file);
    /// The DEF of a thing that the file has.
    const std::string& of(List list, std::size_t index) const { return of(list)[index].def; }
    /// The same, or nothing if its author gave it no name.
    std::string authored(List list, std::size_t index) const {
        return of(list)[index].isAuthored ? of(list)[index].def : std::string();
    }
    /// The same once, and nothing from then on: for things that stand in several places without being shared.
    std::string authoredOnce(List list, std::size_t index);
    /// The DEF of the points of a primitive, the `part`-th of its mesh, at that node.
    const std::string& points(std::size_t node, std::size_t part);
    /// For nodes that the file has no name for.
    std::string take(std::string_view wanted, std::string_view kind = {}) { return unique_.take(wanted, kind); }

  private:
    struct Name {
        std::string def;
        bool isAuthored = false, isGiven = false;
    };
    std::vector<Name>& of(List list) { return names_[static_cast<std::size_t>(list)]; }
    const std::vector<Name>& of(List list) const { return names_[static_cast<std::size_t>(list)]; }

    UniqueNames unique_;
    std::array<std::vector<Name>, 7> names_;
    std::map<std::pair<std::size_t, std::size_t>, std::string> points_;
};

}  // namespace rtsg::detail
