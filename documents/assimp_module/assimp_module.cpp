// Makes GLB of Collada and the like, by libassimp.
#include "models/assimp_module.h"

#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <assimp/Exporter.hpp>
#include <assimp/Importer.hpp>

namespace rtsg::detail {

namespace {

bool makeGlb(std::string_view bytes, const char* extension, std::string& result) {
    Assimp::Importer importer;
    constexpr unsigned kSteps = aiProcess_ValidateDataStructure | aiProcess_Triangulate | aiProcess_SortByPType |
                                aiProcess_JoinIdenticalVertices | aiProcess_LimitBoneWeights;
    const aiScene* read = importer.ReadFileFromMemory(bytes.data(), bytes.size(), kSteps, extension);
    if (!read) {
        result = importer.GetErrorString();
        return false;
    }
    if (read->mNumMeshes == 0) {
        result = "there are no meshes in it";
        return false;
    }
    // An extension that only says how triangles were polygons once.
    for (unsigned i = 0; i < read->mNumMeshes; ++i)
        read->mMeshes[i]->mPrimitiveTypes &= ~static_cast<unsigned>(aiPrimitiveType_NGONEncodingFlag);
    Assimp::Exporter exporter;
    const aiExportDataBlob* glb = exporter.ExportToBlob(read, "glb2");
    if (!glb || glb->size == 0) {
        result = exporter.GetErrorString();
        return false;
    }
    result.assign(static_cast<const char*>(glb->data), glb->size);
    return true;
}

}  // namespace

}  // namespace rtsg::detail

extern "C" __attribute__((visibility("default"))) rtsg::detail::MakeGlb rtsg_assimp_1() {
    return rtsg::detail::makeGlb;
}
