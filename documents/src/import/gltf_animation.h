// Animations of glTF 2.0 as TimeSensors with interpolators, routed to the nodes, joints and points that they move.
//
// Threading: one thread an import. Source: glTF 2.0 (ISO/IEC 12113:2022) 3.11.
#pragma once

#include <functional>
#include <map>

#include "gltf_figure.h"

namespace rtsg::detail {

class GltfAnimations {
  public:
    /// `isGiven`: whether a node has come into the document; what moves others is left out.
    GltfAnimations(GltfFile& file, DocumentHandler& out, GltfMeshes& meshes, const std::vector<GltfFigure>& figures,
                   std::function<bool(std::size_t)> isGiven)
        : file_(file), out_(out), meshes_(meshes), figures_(figures), isGiven_(std::move(isGiven)) {}
    /// The `number`-th one of the file.
    void write(const nlohmann::json& animation, std::size_t number);

  private:
    void writeChannel(const nlohmann::json& sampler, const std::vector<float>& times, double length,
                      const std::string& path, const std::string& clock, const std::string& def,
                      const std::string& target, const GltfSkin::Joint* joint);
    /// Writes animated weights of morph targets as the points at each key; between keys, weights and points both change
    /// linearly.
    void writeWeights(const nlohmann::json& sampler, const std::vector<float>& times, double length,
                      const std::string& clock, const std::string& def, std::size_t nodeIndex);

    GltfFile& file_;
    DocumentHandler& out_;
    GltfMeshes& meshes_;
    const std::vector<GltfFigure>& figures_;
    std::function<bool(std::size_t)> isGiven_;
};

}  // namespace rtsg::detail
