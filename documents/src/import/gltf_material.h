// Materials and textures of glTF 2.0 as Appearances with a PhysicalMaterial or an UnlitMaterial.
//
// Where its textures take another set of coordinates than the first, or move it, each way to look one up has a name
// (`mapping` of ISO/IEC 19775-1 V4.0), which the coordinates of the primitives have too.
//
// Threading: one thread an import. Source: glTF 2.0 (ISO/IEC 12113:2022) 3.8, 3.9; KHR_materials_unlit,
// KHR_materials_emissive_strength, KHR_texture_transform.
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
    GltfMaterials(GltfFile& file, DocumentHandler& out) : file_(file), out_(out) {}
    /// Writes the Appearance of a material; for null, of the default material of glTF.
    void writeAppearance(const nlohmann::json* material);
    /// Those of a material, or of null; none where all textures take the first set as it is.
    static std::vector<GltfMapping> mappingsOf(const nlohmann::json* material);

  private:
    void writeTexture(const nlohmann::json& reference, const std::string& field,
                      const std::vector<GltfMapping>& mappings, GltfNode& material);
    static void writePhysical(const nlohmann::json& material, GltfNode& out);
    void writeTransforms(const std::vector<GltfMapping>& mappings);

    GltfFile& file_;
    DocumentHandler& out_;
    std::set<std::size_t> textureGiven_;  // those that have a name to be used by
};

}  // namespace rtsg::detail
