// Skinned meshes of glTF 2.0 as HAnimHumanoids, whose joints stand where those of the skin rest.
//
// Threading: one thread an import. Source: glTF 2.0 (ISO/IEC 12113:2022) 3.7.3; gltf_skin.h.
#pragma once

#include "gltf_mesh.h"
#include "gltf_skin.h"

namespace rtsg::detail {

/// A skin's joints, and what they are called.
struct GltfFigure {
    GltfFigure(const GltfSkin& itsSkin, std::string_view itsName, GltfNames& names)
        : skin(itsSkin), name(names.take(itsName)) {
        for (std::size_t i = 0; i < skin.joints().size(); ++i)
            joints.push_back(names.take(name + "_joint" + std::to_string(i)));
    }
    const GltfSkin& skin;
    std::string name;
    std::vector<std::string> joints;
};

/// One primitive, which has points of its own, named as `form` says.
void writeFigure(GltfFile& file, DocumentHandler& out, GltfMeshes& meshes, const GltfFigure& figure,
                 const nlohmann::json& primitive, const GltfForm& form);

}  // namespace rtsg::detail
