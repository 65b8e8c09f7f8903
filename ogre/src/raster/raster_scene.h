// RasterScene: the instances of a scene in a rasteriser: what to draw, with which mesh and material, and where.
//
// Invariant: after bring() the rasteriser has the same content as if the scene had been handed over anew. The work
// depends on the deltas: follow() notes which slots changed, and bring() hands these over. A mesh, a texture or a
// material is handed over once, however many instances show it.
// Threading: one thread. Places are handed over relative to an origin near the eye, which moves only when the eye has
// gone far from it.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <set>
#include <tuple>
#include <unordered_map>
#include <vector>

#include <rtsg/ogre/ogre_renderer.h>
#include <rtsg/renderers/mesh.h>
#include <rtsg/renderers/surface_tables.h>

#include "raster_looks.h"
#include "raster_module.h"
#include "raster_shapes.h"

namespace rtsg {

class RasterScene {
  public:
    explicit RasterScene(const RasterTextures::Lack& lack) : lack_(lack), textures_(lack) {}
    ~RasterScene();
    RasterScene(const RasterScene&) = delete;
    RasterScene& operator=(const RasterScene&) = delete;

    /// The rasteriser to hand all to; it must outlive this. Nothing has been handed over before.
    void open(RasterModule* module);
    void follow(const InstanceDelta& delta);
    /// For a picture of these layers, seen from about there.
    void bring(const SurfaceState& state, const std::vector<LayerView>& layers, const Vec3d& eye);
    /// Around the visible things of a layer.
    WorldBox box(std::uint16_t layer) const;
    const Vec3d& origin() const { return origin_; }
    /// The sky of a layer of the last bring(), by its index in the list.
    const RasterSky& sky(std::size_t layer) const { return skies_[layer].sky; }
    const OgreRenderer::Counts& counts() const { return counts_; }
    RasterContent content() const;

  private:
    using MaterialKey = std::tuple<const Material*, LookKind>;
    using MeshKey = std::pair<std::uint32_t, std::size_t>;  // geometry and channel
    struct Slot {
        Instance instance;
        bool used = false;
        std::vector<std::uint32_t> materials;  // numbers that it uses, and its things, at most two
        std::uint32_t mesh = 0;                // number
    };
    /// The properties of a mesh on which the things of its instances depend, besides the numbers in it.
    struct MeshTraits {
        bool drawn = false, solid = true, fogged = false, colored = false, generated = false;
        LookKind kind;
        friend bool operator==(const MeshTraits&, const MeshTraits&) = default;
    };
    static MeshTraits traitsOf(const Mesh* mesh);
    struct Geometry {
        std::shared_ptr<const Mesh> mesh;
        MeshTraits traits;  // that bring() saw last
        std::set<std::uint32_t> slots;
        std::map<std::size_t, std::uint32_t> numbers;  // by channel
        std::map<std::size_t, RasterCorners> corners;  // of one that has deformed, by channel
    };
    struct MaterialEntry {
        std::shared_ptr<const Material> from;
        MaterialKey key;
        RasterMaterial created;
        std::size_t users = 0;
    };
    struct SkyEntry {
        std::optional<Sky> from;
        bool known = false;
        RasterSky sky;
    };

    void setInstance(const Instance& instance);
    void release(std::uint32_t slot);
    void handMeshes(Geometry& geometry);
    std::uint32_t takeMesh(NodeId geometry, std::size_t channel);
    void dropMesh(std::uint32_t number);
    std::uint32_t takeMaterial(const std::shared_ptr<const Material>& material, const LookKind& kind);
    void dropMaterial(std::uint32_t number);
    void moveOrigin(const Vec3d& eye);
    void bringTables(const SurfaceState& state, const std::vector<LayerView>& layers);
    void bringSkies(const SurfaceState& state, const std::vector<LayerView>& layers);
    void bringSlot(const SurfaceState& state, std::uint32_t slot);
    std::uint32_t locationOf(const SurfaceState::Look& look, std::uint16_t layer) const;

    RasterTextures::Lack lack_;
    RasterTextures textures_;
    RasterModule* module_ = nullptr;
    std::vector<Slot> slots_;
    std::unordered_map<std::uint32_t, Geometry> geometries_;
    std::unordered_map<std::uint32_t, std::set<std::uint32_t>> looking_;  // appearance -> slots
    std::set<std::uint32_t> dirtySlots_, movedSlots_, dirtyGeometries_;
    std::unordered_map<std::uint32_t, std::size_t> meshUsers_;
    std::unordered_map<std::uint32_t, MeshKey> meshOf_;
    std::map<MaterialKey, std::uint32_t> materialNumbers_;
    std::unordered_map<std::uint32_t, MaterialEntry> materials_;
    std::map<std::uint16_t, std::uint32_t> firstSurroundings_;  // by layer
    std::vector<SkyEntry> skies_;
    SurfaceState state_;
    std::vector<std::uint16_t> layers_;
    bool anyCuts_ = false, originMoved_ = true;
    Vec3d origin_{0};
    std::uint32_t nextMesh_ = 0, nextMaterial_ = 0;
    OgreRenderer::Counts counts_;
};

}  // namespace rtsg
