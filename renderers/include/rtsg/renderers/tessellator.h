// Tessellator: the meshes of a scene's geometry nodes, with equal primitives made once.
//
// Invariant: mesh(scene, node) equals tessellate(scene, node) but for storage: boxes, cones, ... with the same fields
// are one Mesh, and spheres of any radius share all but their positions. A composed geometry of which only the
// coordinates have changed keeps its triangles, and all that follows from them. A mesh lives as long as somebody holds
// it; of geometries that change, the last mesh is held until forget().
// Threading: one thread at a time; the meshes may go to any.
// Source: paper section 4.2; the sharing is ours (a scene may hold 100,000 spheres that are no USE of each other).
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

    /// Null when the node is missing or no geometry; empty when it has no triangles. Fits Flattener's MeshSource as
    /// `[&](const Scene& scene, NodeId node) { return tessellator.mesh(scene, node); }`.
    /// `points`, if any, stand for those of coordinate nodes, by NodeId: of skins, say.
    /// `level`: that of levelOptions(); else the options of the constructor.
    std::shared_ptr<const Mesh> mesh(const Scene& scene, NodeId geometry,
                                     const std::unordered_map<std::uint32_t, Array<Vec3f>>* points = nullptr,
                                     std::optional<int> level = {});
    /// Levels of detail: a chordError of 1/4 at level 0, a fourth of the one before at each that follows, with twice
    /// the segments; kLevels of them, the last with 576 segments a circle.
    static constexpr int kLevels = 8;
    static TessellationOptions levelOptions(int level);
    /// A ParticleSystem's, whose sprites face `eye` (in its own space); mesh() has them without one. Null: it is none.
    std::shared_ptr<const Mesh> particles(const Scene& scene, NodeId system, std::optional<Vec3d> eye);
    /// Forgets what is remembered about a node to follow its coordinates.
    void forget(NodeId geometry);

    /// Diagnostics of all meshes made so far, or since they were taken. A mesh that only moves its coordinates is not
    /// reported again.
    const Diagnostics& diagnostics() const { return diagnostics_; }
    Diagnostics takeDiagnostics();
    /// Primitives that are shared now, for statistics.
    std::size_t sharedCount() const { return shared_.size(); }

  private:
    /// Type, flags, up to four numbers bit for bit.
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
    /// Composed geometries by NodeId; null until they are asked for a second time.
    std::unordered_map<std::uint32_t, std::unique_ptr<detail::DeformingSurface>> surfaces_;
};

}  // namespace rtsg
