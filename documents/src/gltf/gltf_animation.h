// Animations of glTF 2.0 as TimeSensors with interpolators, routed to the nodes, joints and points that they move.
//
// They are clips, of which one plays: it begins when the scene does, or when its Inline is loaded. The others wait for
// a set_startTime, which stops what moves the same nodes. Threading: one thread an import. Source: glTF 2.0 (ISO/IEC
// 12113:2022) 3.11.
#pragma once

#include <functional>
#include <map>

#include "gltf_curve.h"
#include "gltf_figure.h"

namespace rtsg::detail {

class GltfAnimations {
  public:
    /// `isGiven`: whether a node has come into the document; what moves others is left out.
    GltfAnimations(GltfFile& file, DocumentHandler& out, GltfNames& names, GltfMeshes& meshes,
                   const std::vector<GltfFigure>& figures, std::function<bool(std::size_t)> isGiven)
        : file_(file), out_(out), names_(names), meshes_(meshes), figures_(figures), isGiven_(std::move(isGiven)) {}
    /// All of the file. `clip`: the name of the one that plays, an error if there is none; empty: the first.
    void write(std::string_view clip);
    /// Whether a channel of this path changes a node's transform.
    static bool moves(std::string_view path) { return path == "translation" || path == "rotation" || path == "scale"; }

  private:
    struct Clip {
        double length = 0;                                  // seconds
        std::string clock;                                  // DEF
        std::map<std::size_t, std::vector<float>> times{};  // by sampler
    };
    Clip readTimes(const nlohmann::json& animation, std::size_t number);
    void writeClip(const nlohmann::json& animation, Clip& clip);
    void startWithScene(const std::string& clock);
    /// `clocks` are names with the numbers of their animations.
    void stopEachOther(const std::vector<std::pair<std::string, std::size_t>>& clocks);
    void writeChannel(const GltfCurve& curve, double length, const std::string& path, const std::string& clock,
                      const std::string& wanted, const std::string& target, const GltfSkin::Joint* joint);
    /// Writes animated weights of morph targets as the points at each key; between keys, weights and points both change
    /// linearly.
    void writeWeights(const nlohmann::json& sampler, const Clip& clip, const std::vector<float>& times,
                      const std::string& def, std::size_t nodeIndex);

    GltfFile& file_;
    DocumentHandler& out_;
    GltfNames& names_;
    GltfMeshes& meshes_;
    const std::vector<GltfFigure>& figures_;
    std::function<bool(std::size_t)> isGiven_;
    std::multimap<std::size_t, std::pair<const GltfFigure*, std::size_t>> joints_{};  // by their nodes
};

}  // namespace rtsg::detail
