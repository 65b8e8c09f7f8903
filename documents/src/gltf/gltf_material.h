// Materials and textures of glTF 2.0 as Appearances with a PhysicalMaterial or an UnlitMaterial.
//
// Where its textures take another set of coordinates than the first, or move it, each way to look one up has a name
// (`mapping` of ISO/IEC 19775-1 V4.0), which the coordinates of the primitives have too.
//
// Threading: one thread an import. Source: glTF 2.0 (ISO/IEC 12113:2022) 3.8, 3.9; KHR_materials_unlit,
// KHR_materials_emissive_strength, KHR_texture_transform, EXT_texture_webp.
#pragma once

#include <set>

#include "gltf_parts.h"

namespace rtsg::detail {

/// A way in which textures of a material are looked up.
struct GltfLookup {
    std::size_t set = 0;  // TEXCOORD_n
    double rotation = 0;  // of (u, v) before the offset and after the scale; positive from v to u
    Vec2d offset{0}, scale{1};

    bool moves() const { return rotation != 0 || offset != Vec2d(0) || scale != Vec2d(1); }
    bool operator==(const GltfLookup&) const = default;
};
struct GltfMapping {
    GltfLookup lookup;
    std::string name;
};

class GltfMaterials {
  public:
    GltfMaterials(GltfFile& file, DocumentHandler& out, GltfNames& names);
    /// Writes the Appearance of a material; for null, of the default material of glTF. `strokes`: of lines or points
    /// without normals, which are not lit and have no textures.
    void writeAppearance(std::size_t number, const nlohmann::json* material, bool strokes = false);
    /// The base colour, which colours of points are multiplied by, and what shines beside it (red, green, blue).
    static ColorRGBA baseColor(const nlohmann::json* material);
    static Vec3f emission(const nlohmann::json* material);
    static bool isUnlit(const nlohmann::json& material);
    /// Those of a material, or of null; none where all textures take the first set as it is.
    static std::vector<GltfMapping> mappingsOf(const nlohmann::json* material);

  private:
    void writeTexture(const nlohmann::json& reference, const std::string& field,
                      const std::vector<GltfMapping>& mappings, GltfNode& material);
    static void writePhysical(const nlohmann::json& material, GltfNode& out);
    void writeStrokes(const nlohmann::json* material, GltfNode& out) const;
    void writeTransforms(const std::vector<GltfMapping>& mappings);

    GltfFile& file_;
    DocumentHandler& out_;
    GltfNames& names_;
    std::set<std::size_t> textureGiven_, materialGiven_;  // those that have a name to be used by
    std::map<std::size_t, std::string> strokeMaterials_;  // their names
    std::vector<double> depths_;                          // of the bodies of each material
};

}  // namespace rtsg::detail
