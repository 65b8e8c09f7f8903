// Tessellator: makes the meshes of a scene's geometry nodes, and makes equal primitives once.
//
// Invariant: mesh(scene, node) equals tessellate(scene, node), but shares storage: boxes, cones, ... with the same
// fields are one Mesh, and spheres of any radius share all but their positions. If only the coordinates of a composed
// geometry have changed, it keeps its triangles and all data that follows from them. A mesh lives as long as somebody
// holds it; for geometries that change, the last mesh is held until forget(). Threading: one thread at a time; the
// meshes may go to any. Source: paper section 4.2; the sharing is not in the paper (a scene may hold 100,000 spheres
// without USE).
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <unordered_map>

#include <rtsg/renderers/tessellate.h>

namespace rtsg {

namespace detail {
class DeformingSurface;
class TextMaker;
}  // namespace detail

class Tessellator {
  public:
    explicit Tessellator(TessellationOptions options = {});
    ~Tessellator();
    Tessellator(Tessellator&&) noexcept;
    Tessellator& operator=(Tessellator&&) noexcept;

    /// Null if the node is missing or no geometry; an empty mesh if it has no triangles. It works as a Flattener's
    /// MeshSource by `[&](const Scene& scene, NodeId node) { return tessellator.mesh(scene, node); }`. `points`, if
    /// given, replace those of coordinate nodes, by NodeId; skins use this. `level` selects levelOptions(); without it
    /// the options of the constructor are used.
    std::shared_ptr<const Mesh> mesh(const Scene& scene, NodeId geometry,
                                     const std::unordered_map<std::uint32_t, Array<Vec3f>>* points = nullptr,
                                     std::optional<int> level = {});
    /// Levels of detail: level 0 has a chordError of 1/4, and each further level a fourth of it and twice the segments.
    /// There are kLevels; the last has 576 segments for a circle.
    static constexpr int kLevels = 8;
    static TessellationOptions levelOptions(int level);
    /// The mesh of a ParticleSystem, whose sprites face `eye` (in its own space); mesh() has no eye for them. Null if
    /// the node is no ParticleSystem.
    std::shared_ptr<const Mesh> particles(const Scene& scene, NodeId system, std::optional<Vec3d> eye);
    /// Forgets the data that is kept to follow a node's coordinates.
    void forget(NodeId geometry);

    /// Diagnostics of all meshes made so far, or since they were last taken. A mesh whose coordinates only move is not
    /// reported again.
    const Diagnostics& diagnostics() const { return diagnostics_; }
    Diagnostics takeDiagnostics();
    /// The number of primitives that are shared now, for statistics.
    std::size_t sharedCount() const { return shared_.size(); }

  private:
    /// Type, flags, and up to four numbers bit for bit.
    using Key = std::array<std::uint32_t, 6>;
    struct KeyHash {
        std::size_t operator()(const Key& key) const;
    };
    static bool keyOf(const Scene& scene, NodeId geometry, std::optional<int> level, Key& key);
    const TessellationOptions& optionsOf(std::optional<int> level) const;
    std::shared_ptr<const Mesh> deform(const Scene& scene, NodeId geometry,
                                       const std::unordered_map<std::uint32_t, Array<Vec3f>>* points);
    std::shared_ptr<const Mesh> make(const Scene& scene, NodeId geometry, bool isSphere, std::optional<int> level,
                                     const std::unordered_map<std::uint32_t, Array<Vec3f>>* points);
    void forgetUnused();

    TessellationOptions options_;
    std::array<TessellationOptions, kLevels> levels_;
    Diagnostics diagnostics_;
    std::unordered_map<Key, std::weak_ptr<const Mesh>, KeyHash> shared_;
    std::size_t forgetAt_ = 64;
    std::array<std::shared_ptr<const Mesh>, kLevels + 1> unitSpheres_;  // by level, and of the plain options
    std::unique_ptr<detail::TextMaker> text_;                           // made for the first Text
    /// Composed geometries by NodeId; null until they are requested a second time.
    std::unordered_map<std::uint32_t, std::unique_ptr<detail::DeformingSurface>> surfaces_;
};

}  // namespace rtsg
