// Converts materials, textures, lights and skies for a rasteriser.
//
// Threading: one thread.
#pragma once

#include <compare>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include <rtsg/renderers/surface_tables.h>

#include "raster_module.h"

namespace rtsg {

/// Hands textures to a rasteriser, once each, as long as anybody uses them.
class RasterTextures {
  public:
    using Lack = std::function<void(const char*)>;
    /// `lack` is told of what cannot be shown.
    explicit RasterTextures(Lack lack) : lack_(std::move(lack)) {}
    void open(RasterModule* module) { module_ = module; }
    /// Its number, with one more user; 0 for none. `linear`: look-ups are to give light.
    std::uint32_t take(const std::shared_ptr<const Texture>& texture, bool linear);
    void drop(std::uint32_t number);
    std::uint64_t created() const { return created_; }

  private:
    struct Entry {
        std::shared_ptr<const Texture> texture;
        bool linear = false;
        std::size_t users = 0;
    };
    void hand(std::uint32_t number, const Texture& texture, bool linear);
    Lack lack_;
    RasterModule* module_ = nullptr;
    std::map<std::pair<const Texture*, bool>, std::uint32_t> numbers_;
    std::map<std::uint32_t, Entry> entries_;
    std::uint32_t next_ = 0;
    std::uint64_t created_ = 0;
};

/// The properties of a mesh on which the drawing of a material depends.
struct LookKind {
    bool strokes = false, points = false, normals = false, alphaColored = false;
    friend auto operator<=>(const LookKind&, const LookKind&) = default;
};

/// The material in a rasteriser's numbers; takes its textures. `lack` is told which features are left out.
RasterMaterial rasterMaterial(const Material& material, const LookKind& kind, RasterTextures& textures,
                              const RasterTextures::Lack& lack);
/// Gives the textures back.
void dropTextures(const RasterMaterial& material, RasterTextures& textures);

/// The tables of several views' layers, one after the other. `origin`: of the rasteriser's places.
RasterTables rasterTables(std::span<const std::vector<SurfaceState::Surroundings>> views, const Vec3d& origin,
                          const RasterTextures::Lack& lack);

/// A background; takes its pictures. Null: none, which over other layers is clear and else black.
RasterSky rasterSky(const Sky* sky, bool over, RasterTextures& textures);

}  // namespace rtsg
