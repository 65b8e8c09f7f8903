// The visible shapes of a scene, and a file that they are written to piece by piece, for all writers of mesh files.
//
// Threading: one thread a file.
#pragma once

#include <memory>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include <rtsg/core/output_file.h>
#include <rtsg/renderers/flattener.h>
#include <rtsg/renderers/mesh.h>
#include <rtsg/renderers/mesh_file.h>

namespace rtsg::mesh_files {

/// The shapes that are seen, with their meshes.
struct Shapes {
    Flattener flattener;
    std::unordered_map<std::uint32_t, std::shared_ptr<const Mesh>> meshes;
    std::vector<const Instance*> instances;
    MeshFileContent content;

    Shapes(const Scene& scene, Flattener own) : flattener(std::move(own)) {
        const InstanceDelta& delta = flattener.apply(scene, scene.snapshot());
        for (const auto& geometry : delta.geometries) meshes[geometry.node.value] = geometry.mesh;
        for (const Instance& instance : flattener.instances()) {
            if (!instance.id || !instance.seen || instance.volume || instance.boundingBox) continue;
            const auto found = meshes.find(instance.geometry.value);
            if (found == meshes.end() || !found->second || found->second->empty()) continue;
            instances.push_back(&instance);
            ++content.shapes;
            content.triangles += found->second->triangleCount;
        }
    }
    const Mesh& meshOf(const Instance& instance) const { return *meshes.at(instance.geometry.value); }
};

class Output {
  public:
    explicit Output(OutputFile& file) : file_(file) {}
    ~Output() = default;
    template <class T>
    void put(T value) {
        text_.append(reinterpret_cast<const char*>(&value), sizeof(value));
        flushIfFull();
    }
    template <class... Parts>
    void print(fmt::format_string<Parts...> format, Parts&&... parts) {
        fmt::format_to(std::back_inserter(text_), format, std::forward<Parts>(parts)...);
        flushIfFull();
    }
    void write(std::string_view text) {
        text_ += text;
        flushIfFull();
    }
    Result<> finish() {
        flush();
        return result_;
    }

  private:
    void flush() {
        if (result_) result_ = file_.write(text_);
        text_.clear();
    }
    void flushIfFull() {
        constexpr std::size_t full = 1 << 16;
        if (text_.size() >= full) flush();
    }
    OutputFile& file_;
    std::string text_;
    Result<> result_;
};

}  // namespace rtsg::mesh_files
