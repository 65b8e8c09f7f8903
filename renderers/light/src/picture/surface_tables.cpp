// Opens the light tracer's tables to renderers that trace no rays.
#include <rtsg/renderers/surface_tables.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "draw.h"
#include "lighting/environment.h"
#include "tables/active.h"
#include "tables/left_out.h"

namespace rtsg {

using namespace trace;

SurfaceState::Look SurfaceState::look(std::uint32_t slot) const {
    const SlotShading shading = slot < state_->slots.size() ? state_->slots[slot] : SlotShading();
    std::shared_ptr<const MaterialEntry> entry = state_->materials[shading.material];
    if (!entry) entry = state_->materials[0];
    const Material* material = &entry->material;
    return {std::shared_ptr<const Material>(std::move(entry), material), shading.lights, shading.channels};
}

std::vector<SurfaceState::Surroundings> SurfaceState::surroundings(const Camera& eye) const {
    const LightState& state = *state_;
    const Fogs fogs = fogsOf(state, eye.layer);
    std::vector<Surroundings> all(std::max<std::size_t>(state.scopes.size(), 1));
    std::vector<std::vector<CutPlane>> cuts(all.size());
    eachCut(state, &eye, [&](const ClipEntry& clip, const std::vector<CutPlane>& planes) {
        cuts[clip.scope].insert(cuts[clip.scope].end(), planes.begin(), planes.end());
    });
    for (std::uint32_t surroundings = 0; surroundings < all.size(); ++surroundings) {
        Surroundings& found = all[surroundings];
        found.fog = fogs.of(surroundings).fog;
        for (std::uint32_t scope = surroundings;; scope = state.scopes[scope].around) {
            eachLight(state, scope, eye.layer, [&](const Light& light) { found.lights.push_back(&light); });
            found.cuts.insert(found.cuts.end(), cuts[scope].begin(), cuts[scope].end());
            if (scope == 0) break;
        }
    }
    return all;
}

bool SurfaceState::headlight(std::uint16_t layer) const {
    return hasHeadlight(*state_, layer);
}

const Sky* SurfaceState::sky(std::uint16_t layer) const {
    return skyOf(*state_, layer);
}

Result<Camera> SurfaceState::camera(const BoxOfLayer& boxes, double aspect, std::string_view name) const {
    return findCamera(*state_, boxes, aspect, name);
}

std::vector<LayerView> SurfaceState::layers(const BoxOfLayer& boxes, const Camera& camera, int width,
                                            int height) const {
    return findLayers(*state_, boxes, camera, width, height);
}

std::array<Vec3f, 9> matteHarmonics(const Light& environment) {
    constexpr int kDirections = 2048;
    std::array<Vec3f, 9> sum{};
    for (int i = 0; i < kDirections; ++i) {
        // On a spiral from pole to pole, each for as much of the sphere.
        const float z = 1 - (2 * static_cast<float>(i) + 1) / kDirections, across = std::sqrt(1 - z * z);
        const float angle = std::numbers::pi_v<float> * (3 - std::sqrt(5.0f)) * static_cast<float>(i);
        const Vec3f d(across * std::cos(angle), across * std::sin(angle), z);
        const Vec3f light = environment.environment->matte(environment.localFromWorldRotation * d);
        const float y[] = {0.282095f,
                           0.488603f * d.y,
                           0.488603f * d.z,
                           0.488603f * d.x,
                           1.092548f * d.x * d.y,
                           1.092548f * d.y * d.z,
                           0.315392f * (3 * d.z * d.z - 1),
                           1.092548f * d.x * d.z,
                           0.546274f * (d.x * d.x - d.y * d.y)};
        for (std::size_t k = 0; k < sum.size(); ++k) sum[k] += y[k] * light;
    }
    for (Vec3f& one : sum) one *= 4 * std::numbers::pi_v<float> / kDirections;
    return sum;
}

struct SurfaceTables::Impl {
    explicit Impl(std::shared_ptr<TextureStore> textures) : tables(std::move(textures)) {}
    LightTables tables;
};

SurfaceTables::SurfaceTables(Resources resources)
    : impl_(std::make_unique<Impl>(std::make_shared<TextureStore>(std::move(resources)))) {}
SurfaceTables::SurfaceTables(SharedWorld& world, const Resources& resources)
    : impl_(std::make_unique<Impl>(sharedTextures(world, resources))) {}
SurfaceTables::~SurfaceTables() = default;

Result<> SurfaceTables::apply(const Scene& scene, const ChangeSet& changes, const InstanceDelta& delta) {
    impl_->tables.apply(scene, changes, delta);
    return {};
}

SurfaceState SurfaceTables::latest() {
    return SurfaceState(impl_->tables.latest());
}

std::shared_ptr<const void> SurfaceTables::freeze() {
    return impl_->tables.latest();
}

LightCounts SurfaceTables::counts() const {
    return impl_->tables.counts();
}

const Diagnostics& SurfaceTables::diagnostics() const {
    impl_->tables.reportOfDamage();
    return impl_->tables.diagnostics();
}

}  // namespace rtsg
