// SurfaceTables: the data that a rasteriser needs besides instances: materials, lights, fogs, clip planes, sky and
// cameras. It needs rays only for hybrid pictures.
//
// Invariant: after apply() the tables are the same as if read from the scene anew. They are LightTracer's own tables,
// so that both show the same. Objects in a version (materials, textures, lights) are replaced when they change, never
// written to: the same object means that nothing has changed. Threading: apply() and latest() on the scene's thread; a
// SurfaceState on any thread at any time. Source: ISO/IEC 19775-1 V4.0 17.2.2 (scope of lights), 7.2.2 (bindable
// nodes), 11.4.1 (ClipPlane), 24.4 (fogs), 35.2 (layers).
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
#include <rtsg/renderers/sky.h>

namespace rtsg {

/// A box in the world, in metres.
struct WorldBox {
    Vec3d lower{std::numeric_limits<double>::infinity()}, upper{-std::numeric_limits<double>::infinity()};
    bool empty() const { return !glm::all(glm::lessThanEqual(lower, upper)); }
    void extend(const Vec3d& point) { lower = glm::min(lower, point), upper = glm::max(upper, point); }
};
/// The box around the visible parts of a layer; without a LayerSet there is only layer 0. It is needed for viewpoints
/// that show everything, and for scenes without a viewpoint.
using BoxOfLayer = std::function<WorldBox(std::uint16_t layer)>;

/// One version of the tables.
class SurfaceState {
  public:
    SurfaceState() = default;
    /// `state` is the result of LightTracer::latest() or SurfaceTables::freeze().
    explicit SurfaceState(std::shared_ptr<const LightState> state) : state_(std::move(state)) {}
    explicit operator bool() const { return state_ != nullptr; }
    /// Whether they are the same version.
    friend bool operator==(const SurfaceState&, const SurfaceState&) = default;

    struct Look {
        std::shared_ptr<const Material> material;  // never null
        std::uint32_t surroundings = 0;            // index into surroundings()
        /// Which of the mesh's texture coordinates each texture uses.
        std::array<std::uint8_t, kTextureRoles> channels{};
    };
    /// The look of an instance, by the slot of its id; X3D's default if it is unknown.
    Look look(std::uint32_t slot) const;

    /// The lights, fog and cuts for surfaces at one place in the hierarchy.
    struct Surroundings {
        std::vector<const Light*> lights;  // only those that are on, nearest scope first; without the headlight
        Fog fog;
        std::vector<CutPlane> cuts;  // of ClipPlanes and Viewports
    };
    /// The surroundings by Look::place, for a picture through this eye and of its layer. They refer to this version.
    std::vector<Surroundings> surroundings(const Camera& eye) const;
    /// Whether a light of colour 1 1 1 shines along the view of this layer (23.4.4).
    bool headlight(std::uint16_t layer) const;
    /// The bound background; null: there is none.
    const Sky* sky(std::uint16_t layer) const;

    /// See LightTracer::camera() and LightTracer::layers().
    Result<Camera> camera(const BoxOfLayer& boxes, double aspect, std::string_view name = {}) const;
    std::vector<LayerView> layers(const BoxOfLayer& boxes, const Camera& camera, int width, int height) const;

    /// Makes a hybrid picture: the picture by `whitted` of this state, with one sample a pixel, whose primary rays
    /// start from the surfaces that a rasteriser has found. RenderStats::primaryRays counts the pixels that rays have
    /// changed. `world` has the rays of the same state; `seen` has one sight for each of layers(), in their order,
    /// through the same eye. Errors: those of LightTracer::render(); sights of another size or number; settings that
    /// sights do not support: several samples, error targets, data layers, caps, lenses, panoramas, shutters, paths.
    Result<Picture> trace(const RayView& world, const Camera& camera, const RenderSettings& settings,
                          std::span<const PrimarySight> seen, RenderStats* stats = nullptr) const;

  private:
    std::shared_ptr<const LightState> state_;
};

/// Nine coefficients of real spherical harmonics, by degree and order: (0,0), (1,-1), (1,0), (1,1), (2,-2) ... (2,2).
/// Their sum in the direction of a surface's normal (world space) is the linear light that a white matte surface
/// reflects of an EnvironmentLight, before the light's colour is applied. Precondition: `environment` is an
/// EnvironmentLight.
std::array<Vec3f, 9> matteHarmonics(const Light& environment);

class SurfaceTables final : public InstanceSubscriber {
  public:
    /// `resources` says what urls of textures may open.
    explicit SurfaceTables(Resources resources = {});
    /// Shares textures with other subscribers of this world that have the same resources.
    SurfaceTables(SharedWorld& world, const Resources& resources);
    ~SurfaceTables() override;

    Result<> apply(const Scene& scene, const ChangeSet& changes, const InstanceDelta& delta) override;
    /// The state after the last apply(); the same version as before if nothing in it has changed.
    SurfaceState latest();
    /// Returns a LightState.
    std::shared_ptr<const void> freeze() override;

    LightCounts counts() const;
    /// Diagnostics of materials, lights and textures since the start, each once.
    const Diagnostics& diagnostics() const;
    std::string subscriberName() const override { return "surface tables"; }

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
