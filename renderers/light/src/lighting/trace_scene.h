// TraceScene: what an integrator sees of a scene at one moment; everything by index, nothing by name or node.
//
// It reads a LightState and rays of the same state, both of which must outlive it.
// Threading: const while a picture is made. Built by LightTracer::render, read by every tile.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include <rtsg/renderers/camera.h>
#include <rtsg/renderers/material.h>
#include <rtsg/renderers/paged_array.h>
#include <rtsg/renderers/ray_world.h>
#include <rtsg/renderers/render_settings.h>
#include <rtsg/renderers/sky.h>

#include "world/primary_rays.h"

namespace rtsg {
class LargeRays;
}

namespace rtsg::trace {

class CoincidentFaces;
class Environment;
class ScopeFilter;
struct Volume;

/// The material and the rest with which an instance slot is drawn.
struct SlotShading {
    std::uint32_t material = 0;
    std::uint32_t lights = 0;                            // LightGroups: what reaches it
    std::array<std::uint8_t, kTextureRoles> channels{};  // of the mesh's texture coordinates, per role
};
constexpr unsigned kSlotBits = 6;  // of the number of slots to a page

/// By slot, in pages.
class SlotPages {
  public:
    SlotPages() = default;
    explicit SlotPages(const PagedArray<SlotShading, kSlotBits>& slots);
    std::size_t size() const { return size_; }
    const SlotShading& operator[](std::size_t slot) const {
        return pages_[slot >> kSlotBits][slot & ((std::size_t{1} << kSlotBits) - 1)];
    }

  private:
    std::vector<const SlotShading*> pages_;
    std::size_t size_ = 0;
};

/// A material and the decisions about it that are made beforehand.
struct MaterialEntry {
    Material material = defaultMaterial();
    std::shared_ptr<const Volume> volume;  // if it is no surface but the box around one of these
    bool textured = false, transmits = false, mirrors = false;
    std::vector<std::shared_ptr<const GeneratedCube>> generated;  // that it shows
    void finish() {
        for (const TextureUse& use : material.textures)
            if (use.generated) generated.push_back(use.generated);
        for (const TextureStage& stage : material.stages)
            if (stage.use.generated) generated.push_back(stage.use.generated);
        textured = material.textured() || material.hatching.present || (material.back && material.back->textured());
        transmits = material.transmits();
        mirrors = material.mirrors();
    }
};

/// A light in ray space.
struct TraceLight {
    Light::Kind kind = Light::Kind::directional;
    bool shadows = false;
    float shadowIntensity = 1;
    Vec3f color{0}, ambient{0};
    Vec3f position{0}, direction{0, 0, -1};
    Vec3f attenuation{1, 0, 0};
    float radius = 0, localFromWorld = 1;
    float beamWidth = 0, cutOffAngle = 0;
    Vec3f right{0}, up{0};  // of projectors, as the next four
    Vec4f extent{0};
    float nearDistance = 0, farDistance = 0;
    const Texture* picture = nullptr;
    /// Leaves out what casts no shadow in this light because it is outside its scope; null: nothing.
    const ScopeFilter* scope = nullptr;
};

/// An EnvironmentLight.
struct TraceEnvironment {
    const Environment* from = nullptr;
    Vec3f color{1}, ambient{0};
    glm::mat3 localFromWorld{1.0f};
    /// The radiance from a unit direction, in linear light or as a display value, averaged over `width` radians.
    Vec3f radiance(const Vec3f& direction, bool linear, float width = 0) const;
};

/// A volume where a picture has it.
struct TraceVolume {
    const Volume* volume = nullptr;
    glm::mat4x3 positionFromRay{1.0f};  // to shares of its box
    glm::mat3 normalFromLocal{1.0f};    // directions only
    std::uint32_t lights = 0, slot = 0;
    const RayFilter* filter = nullptr;  // that cuts it; null: none
};

/// The materials by number.
class MaterialList {
  public:
    MaterialList() = default;
    explicit MaterialList(const PagedArray<std::shared_ptr<const MaterialEntry>>& materials);
    const MaterialEntry& operator[](std::size_t material) const { return *entries_[material]; }
    /// Whether any shows a GeneratedCubeMapTexture.
    bool generates() const { return generates_; }
    /// Whether any material is glossy: reflects other light more than a matte surface does.
    bool glossy() const { return glossy_; }
    /// Whether any has a refractive index.
    bool bends() const { return bends_; }

  private:
    std::vector<const MaterialEntry*> entries_;
    bool generates_ = false, glossy_ = false, bends_ = false;
};

/// Lights by the scope that they shine in: an instance sees those of its own scope and of all around it.
template <class L>
class GroupsOf {
  public:
    static constexpr std::uint32_t kEnd = 0xFFFFFFFF;
    /// One group a scope, numbered as these are; 0 is the whole scene.
    struct Group {
        std::uint32_t start = 0;      // itself, or the next one outwards that has lights
        std::uint32_t around = kEnd;  // the one with lights outside of `start`
        std::uint32_t first = 0, count = 0;
    };

    /// The group to begin with for an instance of this one; next() leads outwards, up to kEnd.
    std::uint32_t start(std::uint32_t group) const { return groups[group].start; }
    std::uint32_t next(std::uint32_t group) const { return groups[group].around; }
    std::span<const L> lightsOf(std::uint32_t group) const {
        return std::span(lights).subspan(groups[group].first, groups[group].count);
    }

    std::vector<Group> groups{1};
    std::vector<L> lights;
};
using LightGroups = GroupsOf<TraceLight>;
using EnvironmentGroups = GroupsOf<TraceEnvironment>;

/// Fogs the colour of a place by its distance and scope.
class Fogs {
  public:
    struct Entry {
        Fog fog;          // its colour as display value
        Vec3f linear{0};  // the same, decoded
        const Vec3f& color(bool asLight) const { return asLight ? linear : fog.color; }
        /// The share of its own colour that is left of a hit at a place, after `run`.
        float left(const Mesh& mesh, std::uint32_t triangle, float u, float v, const Vec3f& position, float run) const {
            if (fog.type == FogType::none) return 1;
            if (mesh.fogDepths.present() && triangle != kCap) [[unlikely]]  // 24.4.3: in place of the distance
                return 1 - std::clamp(mesh.fogDepths.interpolate(triangle, u, v).x, 0.0f, 1.0f);
            return left(position, run);
        }
        float left(const Vec3f& position, float run) const {
            return fogFactor(fog.type, fog.visibilityRange, fog.depth(position, run));
        }
    };
    bool any() const { return any_; }
    const Entry& of(std::uint32_t scope) const { return entries_[scope < byScope_.size() ? byScope_[scope] : 0]; }
    void setGlobal(const Fog& fog) { entries_[0] = {fog, linearFromSrgb(fog.color)}, any_ = fog.type != FogType::none; }
    /// `around`: of each scope the next one outwards; that counts where nothing nearer does.
    void setLocal(const std::vector<std::pair<std::uint32_t, Fog>>& fogs, std::span<const std::uint32_t> around);

  private:
    std::vector<Entry> entries_ = std::vector<Entry>(1);
    std::vector<std::uint32_t> byScope_;  // empty: all are the first
    bool any_ = false;
};

class Emitters;
class EmitterTable;
class Lamps;
class PlainSurfaces;
class SeenFirst;
class SkyLight;
class SkyTable;
class Shutter;

/// From the world to the space of an eye that is scaled unevenly, in which its pixels are square; directions only, to
/// be normalised.
struct UnevenEye {
    glm::mat3 toSquare{1.0f}, normalToSquare{1.0f};
};

/// How lines and points are seen in a picture of that many rows.
PixelLens lensOf(const RayView& world, const Camera& camera, int rows);

struct TraceScene {
    const RayView* world = nullptr;  // through the lens
    std::shared_ptr<const LensedView> lensed;
    std::shared_ptr<const RayFilter> filter;  // null: nothing is left out
    std::vector<TraceVolume> volumes;         // whose boxes no ray meets
    Bounds volumeBounds;                      // around them, ray space
    std::shared_ptr<const RayFilter> volumeFilter;
    Vec3f eye{0}, forward{0, 0, -1};
    Vec3f right{1, 0, 0}, up{0, 1, 0};  // times an offset from the eye: pixels' heights for 1 ahead
    std::optional<UnevenEye> uneven;    // lights fall on surfaces as in that space; nothing of paths
    /// All that says where in the picture something is, and how wide a pixel is there.
    void pixelOf(const RayView& view, const Camera& camera, int height);
    EmitterTable* emitterTable = nullptr;         // that of the scene's last picture
    SkyTable* skyTable = nullptr;                 // the same
    const Emitters* emitters = nullptr;           // of paths, where anything shines
    const Lamps* lamps = nullptr;                 // of paths, where there are many
    const SkyLight* skyLight = nullptr;           // of paths, where the sky is so uneven that it must be looked for
    const PlainSurfaces* plain = nullptr;         // of paths
    const LargeRays* large = nullptr;             // of paths in stages, where they pay
    const Shutter* shutter = nullptr;             // where something moves while it is open
    std::shared_ptr<CoincidentFaces> coincident;  // null: something moves, or nobody keeps the result
    std::vector<std::uint32_t> aroundEye;         // slots of what bends light, where all rays start in one place
    const PrimaryRays* primary = nullptr;         // of the picture, if they are traced together
    const SeenFirst* seen = nullptr;              // what primary rays start from, where a rasteriser has looked before
    MaterialList materials;
    SlotPages slots;
    LightGroups lightGroups;
    std::vector<std::shared_ptr<const ScopeFilter>> scopeFilters;  // that lights name
    EnvironmentGroups environments;  // bounces find their light; what shades without these adds it by addEnvironments()
    /// The space in which light is computed; automatic: linear for PhysicalMaterials, display for all others.
    ColorSpace space = ColorSpace::linear;
    const Sky* sky = nullptr;
    bool evenSky = false;  // the same in all directions: skyLinear, skyDisplay
    Vec4f skyLinear{0}, skyDisplay{0};
    Fogs fogs;
    /// Of light that nothing but bounces finds, finds from this radiance on are counted (HiddenLight).
    float countsFrom = std::numeric_limits<float>::infinity();
    bool energyLimited = false;  // colours that would create light are made smaller
    bool anyTransmits = false;   // some instance lets light through: shadow rays must look closer,
    bool clearAnywhere = true;   // wherever they run; or only
    std::vector<Bounds> clear;   // those that meet one of these (ray space), and
    Bounds allClear;             // so this, around them all
    /// The content of GeneratedCubeMapTextures in this picture, by node.
    std::vector<std::pair<NodeId, SpaceTexture>> generated;
    float pixelSpread = 0;  // radians a pixel is wide in the middle of the picture, or
    float pixelSize = 0;    // metres, for an orthographic camera
    /// The share of a pixel's width for which one of its samples stands. If each sample read textures as wide as the
    /// pixel, they would be blurred twice.
    float sampleFraction = 1;
    /// How wide that is (metres) where rays have come `run` metres far.
    float sampleWidth(float run) const { return sampleFraction * (pixelSpread * run + pixelSize); }

    /// The material and the rest with which an instance is drawn.
    const SlotShading& slot(std::uint32_t instance) const {
        static const SlotShading unknown;
        return instance < slots.size() ? slots[instance] : unknown;
    }
    Vec4f skyColor(const Vec3f& direction, bool linear) const {
        if (evenSky) return linear ? skyLinear : skyDisplay;
        return sky->color(direction, linear ? ColorSpace::linear : ColorSpace::display);
    }
    /// The light from infinitely far that reaches a surface of this group of lights: that of its EnvironmentLights if
    /// there are any, else that of the sky.
    Vec4f fromFar(const Vec3f& direction, std::uint32_t group, bool linear) const {
        if (!environments.lights.empty()) [[unlikely]]
            return fromEnvironments(direction, group, linear);
        return skyColor(direction, linear);
    }
    Vec4f fromEnvironments(const Vec3f& direction, std::uint32_t group, bool linear) const;
    /// Null: it shows nothing, as within the pictures of such a cube.
    const SpaceTexture* generatedCube(NodeId node) const {
        for (const auto& [id, cube] : generated)
            if (id == node) return &cube;
        return nullptr;
    }
};

/// One ray of the recursion, unrolled: it adds `weight` times its radiance to a pixel.
struct PathTask {
    Vec3f origin{0}, direction{0, 0, -1};
    Vec3f weight{1};
    float travelled = 0;       // metres from the eye to the origin; for the size of a pixel at its hit
    float line = 0;            // of them along this straight line; for fog
    std::uint32_t media = 0;   // the bodies that it runs in, as the tile's Media has them
    std::uint16_t pixel = 0;   // of its tile; of group g those from g * kTilePixels on
    std::uint16_t depth = 0;   // mirrorings, refractions and bounces before
    std::uint16_t passes = 0;  // clear surfaces passed straight
    std::uint32_t lights = 0;  // the group of lights of the surface that sent it, where depth > 0
    bool linear = false;       // its radiance is linear light; otherwise display values
    std::uint64_t random = 0;  // PathRandom's state; paths only
    /// The normal of the surface that sampled this direction, and its probability density per steradian; 0 if no other
    /// strategy could have found the hit (for rays from the eye, mirrors, glass). Only paths use these.
    Vec3f normal{0};
    float density = 0;
    float first = 1;  // what roulette counts as a full weight; paths only
    float odds = 0;   // of having come so far since `fate` was drawn; 0: it has not been; paths only
    float fate = 0;   // in [0, 1): the path ends where its odds are not above this; paths only
};

/// tMin of rays that leave a surface. Their start is off it by its error bound, which is 0 where a plane holds a
/// coordinate exactly; this leaves out the hit at exactly 0 that then remains.
constexpr float kLeave = 1e-30f;

constexpr int kTileSide = 16;
constexpr int kTilePixels = kTileSide * kTileSide;

struct TileReach;

/// The sums of a tile's samples, or of one group of them.
struct TileResult {
    std::uint64_t seed = 0;         // in: of its random numbers
    std::uint32_t blocks = 0xFFFF;  // in: which of its blocks of four by four pixels are sampled, a bit each
    int firstSample = 0, lastSample = 1 << 20;  // in: which of a pixel's samples, the last one not included
    std::array<Vec4f, kTilePixels> sum{};       // colour and coverage, not yet divided by the samples
    /// ColorSpace::automatic: what PhysicalMaterials add to a pixel, as light, and which share of the pixel it is. It
    /// is encoded when it is complete, and then joins `sum`, which holds display values. Empty: nothing.
    std::vector<Vec3f> light, weight;
    std::vector<float> missing;  // weight of rays that were cut off, however bright they might have been; or empty
    TileReach* reach = nullptr;  // in: where whittedTile() notes its rays, of the first group; null: nobody asks
    std::uint64_t primaryRays = 0, shadowRays = 0, secondaryRays = 0;
    std::uint64_t chanceFinds = 0;  // as TraceScene::countsFrom has it, by paths that a surface has scattered

    void addLight(std::uint16_t pixel, const Vec3f& amount, const Vec3f& ofFraction) {
        if (light.empty()) light.resize(kTilePixels, Vec3f(0)), weight.resize(kTilePixels, Vec3f(0));
        light[pixel] += amount, weight[pixel] += ofFraction;
    }
    void addMissing(std::uint16_t pixel, float weight) {
        if (missing.empty()) missing.resize(kTilePixels);
        missing[pixel] += weight;
    }
};

/// Traces one tile whose top left pixel is (x0, y0), by the chosen integrator, and through the shutter if there is one.
/// Deterministic. `groups`: groups of samples that differ in their seeds; each gets the same result as alone. Rays of
/// all groups go together, so that few packets are nearly empty; all rays are counted in the first group.
void traceTile(const TraceScene& scene, const Camera& camera, const RenderSettings& settings, int x0, int y0,
               std::span<TileResult> groups);
/// Traces a tile at one instant, by Whitted's recursion.
void whittedTile(const TraceScene& scene, const Camera& camera, const RenderSettings& settings, int x0, int y0,
                 std::span<TileResult> groups);
/// The same by path tracing: light that comes from surfaces and sky is gathered too.
void pathTile(const TraceScene& scene, const Camera& camera, const RenderSettings& settings, int x0, int y0,
              std::span<TileResult> groups);

}  // namespace rtsg::trace
