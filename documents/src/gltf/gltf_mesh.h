// Meshes of glTF 2.0 as Shapes: triangles, lines and points, formed by as much of their targets as these weigh.
//
// Threading: one thread an import. Source: glTF 2.0 (ISO/IEC 12113:2022) 3.7.2.
#pragma once

#include "gltf_material.h"

namespace rtsg::detail {

/// How a primitive is formed: the weights of its targets, and the name of its points where they are animated.
struct GltfForm {
    std::vector<double> weights;
    std::string points;
};

class GltfMeshes {
  public:
    GltfMeshes(GltfFile& file, DocumentHandler& out, GltfNames& names)
        : file_(file), out_(out), materials_(file, out, names) {}

    /// One Shape; `skinned`: as the skin of a figure whose points are there already.
    void writePrimitive(const nlohmann::json& primitive, const GltfForm& form, bool skinned = false);
    /// Whether a primitive has tangents that are used, for which the document has to be of X3D 4.1.
    bool hasTangents();
    /// `points`: how many there have to be, else none are given; 0: any number.
    Array<Vec3f> vectors(const nlohmann::json& attributes, const char* name, std::size_t points) {
        return attribute<Vec3f>(attributes, name, points);
    }
    /// Adds the targets' displacements, as much as they weigh.
    void morph(const nlohmann::json& primitive, const char* name, const std::vector<double>& weights,
               Array<Vec3f>& values);

  private:
    bool usesTangents(const nlohmann::json& primitive);
    void morphTangents(const nlohmann::json& primitive, const std::vector<double>& weights, Array<Vec4f>& tangents);
    template <class T>
    Array<T> attribute(const nlohmann::json& attributes, const char* name, std::size_t points);
    Array<Vec2f> texCoords(const nlohmann::json& attributes, std::size_t set, std::size_t points);
    /// Reads the sets of texture coordinates that the material's textures use.
    void takeTexCoords(const nlohmann::json& attributes, const nlohmann::json* material, ImportedMesh& mesh);
    /// glTF multiplies the colours of points with those of the material, and X3D puts them in their place.
    void takeColors(const nlohmann::json& attributes, const nlohmann::json* material, bool strokes, ImportedMesh& mesh);
    void warnOfTextures(const nlohmann::json* material);
    void writeLines(ImportedMesh& mesh, const Array<std::int32_t>& indices, std::size_t mode);

    GltfFile& file_;
    DocumentHandler& out_;
    GltfMaterials materials_;
};

}  // namespace rtsg::detail
