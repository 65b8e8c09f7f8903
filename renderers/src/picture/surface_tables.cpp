// Opens the light tracer's tables to renderers that trace no rays.
#include <rtsg/renderers/surface_tables.h>

#include <algorithm>
#include <utility>

#include "draw.h"
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
    for (std::uint32_t place = 0; place < all.size(); ++place) {
        Surroundings& found = all[place];
        found.fog = fogs.of(place).fog;
        for (std::uint32_t scope = place;; scope = state.scopes[scope].around) {
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
    impl_->tables.tellOfDamage();
    return impl_->tables.diagnostics();
}

}  // namespace rtsg
