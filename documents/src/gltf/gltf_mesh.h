// Meshes of glTF 2.0 as Shapes: triangles, lines and points, formed by as much of their targets as these weigh.
//
// A primitive with variants of its material is a Switch: its first choice is the material of its own, and one follows
// for each variant of the file. All of them go by the DEF "variants", and there is a trigger of each variant's name.
//
// Threading: one thread an import. Source: glTF 2.0 (ISO/IEC 12113:2022) 3.7.2; KHR_materials_variants.
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
        : file_(file), out_(out), names_(names), materials_(file, out, names) {}

    /// One Shape; `skinned`: as the skin of a figure whose points are there already.
    void writePrimitive(const nlohmann::json& primitive, const GltfForm& form, bool skinned = false);
    /// Writes the Script that chooses among material variants, if there are any.
    void writeVariants();
    /// Whether a primitive wrote points of that name.
    bool hasPoints(const std::string& name) const { return points_.contains(name); }
    /// Whether a primitive has tangents that are used, for which the document has to be of X3D 4.1.
    bool hasTangents();
    /// `points`: how many there have to be, else none are given; 0: any number.
    Array<Vec3f> vectors(const nlohmann::json& attributes, const char* name, std::size_t points) {
        return attribute<Vec3f>(attributes, name, points);
    }
    /// Adds the targets' displacements, as much as they weigh.
    void morph(const nlohmann::json& primitive, const char* name, const std::vector<double>& weights,
               Array<Vec3f>& values);

    /// Of points that cannot be had that has been told.
    void reportWithoutPoints(const nlohmann::json& attributes);

  private:
    /// Writes a Shape of a primitive, whose material may differ from the primitive's own.
    void writeShape(const nlohmann::json& primitive, const GltfForm& form, bool skinned, std::size_t material,
                    const std::string& def);
    /// The material for each variant of the file; empty if the primitive has none of its own for any.
    std::vector<std::size_t> variantsOf(const nlohmann::json& primitive, std::size_t material);
    bool mayCopy(const nlohmann::json& primitive, const std::vector<std::size_t>& choices);
    bool usesTangents(const nlohmann::json& primitive, std::size_t material);
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
    GltfNames& names_;
    GltfMaterials materials_;
    std::set<std::string> points_;       // names of Coordinates
    std::vector<std::string> switches_;  // of primitives with variants
    std::size_t copied_ = 0;             // points and choices of these
};

}  // namespace rtsg::detail
