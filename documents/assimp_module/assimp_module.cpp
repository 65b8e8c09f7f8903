// Converts Collada and similar formats to GLB, by libassimp.
#include "models/assimp_module.h"

#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <algorithm>
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

bool makeGlb(std::string_view bytes, const char* extension, std::string& result, std::string& faults) {
    Assimp::DefaultLogger::create("", Assimp::Logger::NORMAL, 0);
    // The logger ends with this process.
    Assimp::DefaultLogger::get()->attachStream(new Faults(faults), Assimp::Logger::Err);
    Assimp::Importer importer;
    constexpr unsigned kSteps =
        aiProcess_Triangulate | aiProcess_SortByPType | aiProcess_JoinIdenticalVertices | aiProcess_LimitBoneWeights;
    const aiScene* read = importer.ReadFileFromMemory(bytes.data(), bytes.size(), kSteps, extension);
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
