// SurfaceTables: what a rasteriser must know of a scene besides its instances: how each surface looks, what lights,
// fogs and cuts it, what the sky shows, and where all is seen from. No rays are needed, but for hybrid pictures.
//
// Invariant: after apply() they are those that reading the scene anew would give; they are LightTracer's own tables, so
// that both show the same. What a version refers to (materials, textures, lights) is replaced when it changes, never
// written to: the same object means that nothing has changed.
// Threading: apply() and latest() on the scene's thread; a SurfaceState from any, at any time.
// Source: ISO/IEC 19775-1 V4.0 17.2.2 (scope of lights), 7.2.2 (bindable nodes), 11.4.1 (ClipPlane), 24.4 (fogs), 35.2
// (layers).
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include <rtsg/core/resource.h>
#include <rtsg/renderers/camera.h>
#include <rtsg/renderers/flattener.h>
#include <rtsg/renderers/light_tracer.h>
#include <rtsg/renderers/material.h>
#include <rtsg/renderers/primary_sight.h>
#include <rtsg/renderers/render_settings.h>

namespace rtsg {

/// A box in the world, in metres.
struct WorldBox {
    Vec3d lower{std::numeric_limits<double>::infinity()}, upper{-std::numeric_limits<double>::infinity()};
    bool empty() const { return !glm::all(glm::lessThanEqual(lower, upper)); }
    void extend(const Vec3d& point) { lower = glm::min(lower, point), upper = glm::max(upper, point); }
};
/// The box around what is seen of a layer; without a LayerSet there is layer 0 alone. Only viewpoints that show all,
/// and scenes without any viewpoint, ask for it.
using BoxOfLayer = std::function<WorldBox(std::uint16_t layer)>;

/// One version of the tables.
class SurfaceState {
  public:
    SurfaceState() = default;
    /// `state`: of LightTracer::latest() or SurfaceTables::freeze().
    explicit SurfaceState(std::shared_ptr<const LightState> state) : state_(std::move(state)) {}
    explicit operator bool() const { return state_ != nullptr; }
    /// Whether they are the same version.
    friend bool operator==(const SurfaceState&, const SurfaceState&) = default;

    struct Look {
        std::shared_ptr<const Material> material;  // never null
        std::uint32_t place = 0;                   // among surroundings()
        /// Which of the mesh's texture coordinates each texture uses.
        std::array<std::uint8_t, kTextureRoles> channels{};
    };
    /// Of an instance, by the slot of its id; X3D's default for one that is unknown.
    Look look(std::uint32_t slot) const;

    /// What reaches surfaces at one place in the hierarchy.
    struct Surroundings {
        std::vector<const Light*> lights;  // that are on, nearest scope first; without the headlight
        Fog fog;
        std::vector<CutPlane> cuts;  // of ClipPlanes and Viewports
    };
    /// By place, for a picture through this eye and of its layer. They refer to this version.
    std::vector<Surroundings> surroundings(const Camera& eye) const;
    /// Whether a light of colour 1 1 1 shines along the view of this layer (23.4.4).
    bool headlight(std::uint16_t layer) const;
    /// The bound background; null: there is none.
    const Sky* sky(std::uint16_t layer) const;

    /// As LightTracer::camera() and LightTracer::layers().
    Result<Camera> camera(const BoxOfLayer& boxes, double aspect, std::string_view name = {}) const;
    std::vector<LayerView> layers(const BoxOfLayer& boxes, const Camera& camera, int width, int height) const;

    /// A hybrid picture: that by `whitted` of this state, of one sample a pixel, whose primary rays start from what a
    /// rasteriser has seen. RenderStats::primaryRays counts the pixels that do not stay as they were seen. `world`: the
    /// rays of the same state; `seen`: of each of layers(), in their order, through the same eye. Errors: those of
    /// LightTracer::render(); sights of another size or number; what a sight says nothing of: several samples, errors
    /// to reach, layers of data, caps, lenses, panoramas, shutters, paths.
    Result<Picture> trace(const RayView& world, const Camera& camera, const RenderSettings& settings,
                          std::span<const PrimarySight> seen, RenderStats* stats = nullptr) const;

  private:
    std::shared_ptr<const LightState> state_;
};

/// Nine coefficients of real spherical harmonics, by degree and order: (0,0), (1,-1), (1,0), (1,1), (2,-2) ... (2,2).
/// Their sum towards a surface's normal (world space) is the linear light of 1 that a white matte surface reflects of
/// an EnvironmentLight, before the light's colour. Precondition: it is one.
std::array<Vec3f, 9> matteHarmonics(const Light& environment);

class SurfaceTables final : public InstanceSubscriber {
  public:
    /// `resources`: what urls of textures may open.
    explicit SurfaceTables(Resources resources = {});
    /// Shares textures with others of this world that have the same resources.
    SurfaceTables(SharedWorld& world, const Resources& resources);
    ~SurfaceTables() override;

    Result<> apply(const Scene& scene, const ChangeSet& changes, const InstanceDelta& delta) override;
    /// The state after the last apply(); the same version until something changes that it holds.
    SurfaceState latest();
    /// A LightState.
    std::shared_ptr<const void> freeze() override;

    LightCounts counts() const;
    /// Of materials, lights and textures, since the start, each once.
    const Diagnostics& diagnostics() const;
    std::string subscriberName() const override { return "surface tables"; }

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
