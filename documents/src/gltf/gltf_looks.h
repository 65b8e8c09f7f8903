// Reads the extensions of glTF's materials that PhysicalMaterial and its metadata "RTSG" can express: glass, thin
// panes, a clear coat. Other effects are reported, once for each extension.
//
// Threading: one thread an import. Source: KHR_materials_transmission, _volume, _ior, _clearcoat, _sheen, _specular,
// _iridescence, _anisotropy, _dispersion, _diffuse_transmission, _pbrSpecularGlossiness.
#pragma once

#include <span>

#include "gltf_parts.h"

namespace rtsg::detail {

/// Light that passes through a material or is reflected by a coat on it.
struct GltfOptics {
    double transmission = 0;     // the share of light that passes, of the light that is not reflected
    double refractiveIndex = 0;  // of a body; 0: it is none
    Vec3d absorption{0};         // in a body, 1/m; of a pane, in all of it
    double reflectivity = 0;     // mirrored at every angle

    bool passes() const { return transmission > 0; }
};
/// `depth`: the depth of the bodies of this material, which the thickness in the file may understate.
GltfOptics opticsOf(const nlohmann::json& material, double depth);
/// For each material of the file, the least extent of the boxes of the primitives that are made of it, and the largest
/// of these; 0 if there are none.
std::vector<double> depthsOf(const GltfFile& file);
/// Writes the optical values that are set as metadata of a PhysicalMaterial.
void writeOptics(DocumentHandler& out, const GltfOptics& optics);

/// KHR_materials_pbrSpecularGlossiness as the numbers of a PhysicalMaterial; nothing if the material has numbers of its
/// own or no such extension.
struct GltfGloss {
    Vec3d base{1};
    double opacity = 1, metallic = 0, roughness = 1;
};
std::optional<GltfGloss> glossOf(const nlohmann::json& material);

/// The names of the extensions that add to materials and are known here.
std::span<const std::string_view> lookExtensions();
/// Says what of a material's extensions is left out.
void reportLooks(GltfFile& file, const nlohmann::json& material);

}  // namespace rtsg::detail
