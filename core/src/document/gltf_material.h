// Materials and textures of glTF 2.0 as Appearances with a PhysicalMaterial or an UnlitMaterial.
//
// Threading: one thread an import. Source: glTF 2.0 (ISO/IEC 12113:2022) 3.8, 3.9; KHR_materials_unlit,
// KHR_materials_emissive_strength.
#pragma once

#include <set>

#include "gltf_parts.h"

namespace rtsg::detail {

class GltfMaterials {
  public:
    GltfMaterials(GltfFile& file, DocumentHandler& out) : file_(file), out_(out) {}
    /// Of null the material that glTF has where none is named.
    void writeAppearance(const nlohmann::json* material);

  private:
    void writeTexture(const nlohmann::json& reference, const char* field);

    GltfFile& file_;
    DocumentHandler& out_;
    std::set<std::size_t> textureGiven_;  // those that have a name to be used by
};

}  // namespace rtsg::detail
