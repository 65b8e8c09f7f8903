// Writes the visible content of a scene as a GLB file: meshes, materials, viewpoints, lights and clips.
//
// A Transform that a clip moves becomes a node of its own, once for each path to it; everything else is placed by a
// matrix below the nearest such node. The bytes of meshes are made when they are written, so that they are never all in
// memory. Invariant: each node is where the flattener has it. Threading: the scene's thread.
// Source: glTF 2.0 (ISO/IEC 12113:2022); KHR_lights_punctual, KHR_materials_unlit, _emissive_strength, _transmission,
// _ior and _volume.
#pragma once

#include <functional>
#include <map>
#include <set>
#include <tuple>

#include <rtsg/core/resource.h>
#include <rtsg/renderers/material.h>

#include "glb_clips.h"
#include "shown_shapes.h"
#include "texture/texture_store.h"

namespace rtsg::mesh_files {

class GlbWriter {
  public:
    /// `pictures`: what urls of textures may open. `diagnostics` hears of what cannot be written as it is.
    GlbWriter(const Scene& scene, const Shapes& shapes, const Resources& pictures, Diagnostics& diagnostics);
    void write(Output& out);
    /// Lengths are numbers of 32 bits.
    bool fits() const;

  private:
    struct GlbNode {
        std::string members;  // without children
        std::vector<std::size_t> children;
    };
    /// A list of JSON, and how many are in it.
    struct List {
        std::string text;
        std::size_t count = 0;
        /// Returns the number of the added item.
        std::size_t add(const std::string& item) {
            text += (count != 0 ? "," : "") + item;
            return count++;
        }
    };
    static constexpr std::size_t kRoot = SIZE_MAX;

    void findMovers(Diagnostics& diagnostics);
    void addShape(const Instance& instance);
    void addPlaced(const Placed& placed);
    void addCamera(const Placed& placed, const Node& node);
    void addLight(const Placed& placed, const Node& node);
    void addClips();

    /// The node below which something is that stands at the end of a path, with its matrix there.
    std::size_t nodeFor(const std::vector<NodeId>& path, const WorldFromLocal& worldFromLocal, glm::dmat4& matrix);
    std::size_t moverNode(std::size_t parent, const Node& transform, const std::vector<NodeId>& path);
    std::size_t addNode(std::size_t parent, std::string members);
    void addPlacedNode(const Placed& placed, const glm::dmat4& local, const std::string& members);

    static void pad(std::string& bytes, char with) { bytes.resize((bytes.size() + 3) / 4 * 4, with); }
    /// Adds a view of the next `bytes`, which `write` makes once the file is written.
    std::size_t view(std::size_t bytes, std::function<void(Output&)> write);
    std::size_t accessor(std::size_t bytes, std::size_t count, const char* type, std::size_t component,
                         const std::string& more, std::function<void(Output&)> write);
    std::size_t accessor(const std::vector<float>& values, std::size_t count, const char* type,
                         const std::string& more = {});
    std::string primitiveOf(const Mesh& mesh, NodeId geometry, const Material& look);
    std::size_t meshNumber(const Mesh& mesh, const Instance& instance);
    /// What the renderer reads of an Appearance.
    const Material& lookOf(NodeId appearance);
    std::size_t materialNumber(NodeId appearance, const Mesh& mesh);
    /// The member of that name; nothing if the texture has no picture that glTF knows, which is told.
    std::string texture(const Node* node, const TextureUse& use, const char* name);
    std::string image(const Node& node);
    std::string sampler(const TextureAccess& access);
    void reportLeftOut();
    void leaveOut(const std::string& what) { ++leftOut_[what]; }
    const Node* childOf(const Node* node, std::string_view name) const;
    std::string nameOf(NodeId node) const;

    const Scene& scene_;
    const Shapes& shapes_;
    const Resources& pictures_;
    Diagnostics& diagnostics_;
    TextureStore textureStore_;
    std::map<std::uint32_t, Material> looks_;
    std::map<std::string, std::size_t> leftOut_;         // of materials: what, and how often
    std::map<std::uint32_t, std::string> imageNumbers_;  // by the textures' nodes; empty: it has none
    std::map<std::string, std::size_t> samplerNumbers_;
    std::vector<GlbClip> clips_;
    std::set<NodeId> movers_;
    std::map<std::vector<NodeId>, std::size_t> moverNodes_;  // by the path to each
    std::multimap<NodeId, std::size_t> nodesOfMover_;
    std::vector<GlbNode> nodes_;
    std::vector<std::size_t> roots_;
    List meshes_, accessors_, views_, materials_, images_, textures_, samplers_, cameras_, lights_, animations_;
    std::set<std::string> extensions_;
    struct Piece {
        std::size_t bytes;
        std::function<void(Output&)> write;
    };
    std::vector<Piece> binary_;  // each begins at a multiple of 4
    std::size_t binaryBytes_ = 0;
    std::map<std::pair<std::uint32_t, std::string>, std::string> primitives_;  // by geometry and texture transform
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::size_t> meshNumbers_;
    std::map<std::tuple<std::uint32_t, bool, int>, std::size_t> materialNumbers_;
};

}  // namespace rtsg::mesh_files
