// Converts Collada and similar formats to GLB, by libassimp.
#include "models/assimp_module.h"

#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <nlohmann/json.hpp>

#include <assimp/DefaultLogger.hpp>
#include <assimp/Exporter.hpp>
#include <assimp/Importer.hpp>
#include <assimp/LogStream.hpp>

namespace rtsg::detail {

namespace {

constexpr const char* kNotMeant[] = {"KHR_materials_pbrSpecularGlossiness", "KHR_materials_volume", "FB_ngon_encoding"};

void put(std::string& out, std::uint32_t number) {
    out.append(reinterpret_cast<const char*>(&number), sizeof(number));
}

/// Removes extensions that libassimp writes although they say nothing of the file. Source: glTF 2.0 4.4 (GLB).
std::string withoutExtensions(std::string_view glb) {
    constexpr std::size_t kHead = 12, kChunkHead = 8;
    std::uint32_t length = 0;
    if (glb.size() < kHead + kChunkHead) return std::string(glb);
    std::memcpy(&length, glb.data() + kHead, sizeof(length));
    if (length > glb.size() - kHead - kChunkHead) return std::string(glb);
    nlohmann::json root = nlohmann::json::parse(glb.substr(kHead + kChunkHead, length));
    if (auto used = root.find("extensionsUsed"); used != root.end())
        for (std::size_t i = used->size(); i-- > 0;)
            if (std::ranges::find(kNotMeant, (*used)[i].get<std::string>()) != std::end(kNotMeant)) used->erase(i);
    if (auto materials = root.find("materials"); materials != root.end())
        for (nlohmann::json& material : *materials)
            if (auto extensions = material.find("extensions"); extensions != material.end())
                for (const char* name : kNotMeant) extensions->erase(name);
    std::string text = root.dump();
    text.resize((text.size() + 3) / 4 * 4, ' ');
    const std::string_view rest = glb.substr(kHead + kChunkHead + length);
    std::string result(glb.substr(0, 8));
    put(result, static_cast<std::uint32_t>(kHead + kChunkHead + text.size() + rest.size()));
    put(result, static_cast<std::uint32_t>(text.size()));
    result.append("JSON").append(text).append(rest);
    return result;
}

/// Keeps the errors that libassimp goes on after: it takes another point for one that is not there, say.
class Faults final : public Assimp::LogStream {
  public:
    explicit Faults(std::string& to) : to_(to) {}
    void write(const char* message) override {
        constexpr std::size_t maximum = 4096;  // bytes
        if (to_.size() < maximum) to_ += message;
    }

  private:
    std::string& to_;
};

/// Of all faces together, by their cross products. Source: Newell's formula.
double areaOf(const aiScene& scene) {
    double sum = 0;
    for (unsigned m = 0; m < scene.mNumMeshes; ++m) {
        const aiMesh& mesh = *scene.mMeshes[m];
        for (unsigned f = 0; f < mesh.mNumFaces; ++f) {
            const aiFace& face = mesh.mFaces[f];
            double x = 0, y = 0, z = 0;
            if (face.mNumIndices < 3) continue;
            const aiVector3D& first = mesh.mVertices[face.mIndices[0]];
            for (unsigned i = 1; i + 1 < face.mNumIndices; ++i) {
                const aiVector3D a = mesh.mVertices[face.mIndices[i]] - first;
                const aiVector3D b = mesh.mVertices[face.mIndices[i + 1]] - first;
                x += static_cast<double>(a.y) * b.z - static_cast<double>(a.z) * b.y;
                y += static_cast<double>(a.z) * b.x - static_cast<double>(a.x) * b.z;
                z += static_cast<double>(a.x) * b.y - static_cast<double>(a.y) * b.x;
            }
            sum += std::sqrt(x * x + y * y + z * z) / 2;
        }
    }
    return sum;
}

/// libassimp complains of each polygon that is not simple, and mostly gets it right: it is a fault if area is missing.
std::string judged(std::string_view faults, double before, double after) {
    constexpr double kRounding = 1e-5;
    std::string result;
    bool isOdd = false;
    while (!faults.empty()) {
        const std::string_view line = faults.substr(0, faults.find('\n'));
        faults.remove_prefix(std::min(line.size() + 1, faults.size()));
        const bool isOfPolygon = line.find("Failed to triangulate") != line.npos;
        const bool isRepeated = isOdd && line.find("lines with the same contents") != line.npos;
        isOdd = isOdd || isOfPolygon;
        if (!isOfPolygon && !isRepeated) result.append(line).append("\n");
    }
    if (!isOdd) return result;
    if (after >= before * (1 - kRounding))
        return result + "Warning: a polygon has edges that cross or touch: its triangles are a guess\n";
    return result + "a polygon has edges that cross or touch, and " +
           std::to_string(100 * (1 - after / before)).substr(0, 5) + " % of the area of all faces is missing\n";
}

bool makeGlb(std::string_view bytes, const char* extension, std::string& result, std::string& faults) {
    Assimp::DefaultLogger::create("", Assimp::Logger::NORMAL, 0);
    // The logger ends with this process.
    Assimp::DefaultLogger::get()->attachStream(new Faults(faults), Assimp::Logger::Err);
    Assimp::Importer importer;
    constexpr unsigned kSteps =
        aiProcess_Triangulate | aiProcess_SortByPType | aiProcess_JoinIdenticalVertices | aiProcess_LimitBoneWeights;
    const aiScene* read = importer.ReadFileFromMemory(bytes.data(), bytes.size(), 0, extension);
    if (read) {
        const double before = areaOf(*read);
        const std::size_t known = faults.size();
        read = importer.ApplyPostProcessing(kSteps);
        const std::string more = faults.substr(known);
        faults.resize(known);
        if (read) faults += judged(more, before, areaOf(*read));
    }
    if (!read) {
        result = importer.GetErrorString();
        if (result.find("bad_alloc") != result.npos) result = "what it counts takes more memory than may be had";
        return false;
    }
    if (read->mNumMeshes == 0) {
        result = "there are no meshes in it";
        return false;
    }
    Assimp::Exporter exporter;
    const aiExportDataBlob* glb = exporter.ExportToBlob(read, "glb2");
    if (!glb || glb->size == 0) {
        result = exporter.GetErrorString();
        return false;
    }
    result = withoutExtensions({static_cast<const char*>(glb->data), glb->size});
    return true;
}

}  // namespace

}  // namespace rtsg::detail

extern "C" __attribute__((visibility("default"))) rtsg::detail::MakeGlb rtsg_start_assimp_2() {
    return rtsg::detail::makeGlb;
}
