// Decides where rays would find nothing more than a rasteriser's colours.
#include "seen_first.h"

#include <algorithm>

namespace rtsg::trace {

namespace {

/// Whether a rasteriser shows a material as rays do, whatever lights it.
bool isPlain(const Material& material, const SlotShading& shading) {
    if (!material.stages.empty()) return false;
    std::uint8_t channel = 0;
    bool any = false;
    for (std::size_t role = 0; role < kTextureRoles; ++role) {
        const TextureUse& use = material.textures[role];
        if (use.space || use.generated || (use.texture && use.matrix3)) return false;
        if (!use.texture) continue;
        if (any && shading.channels[role] != channel) return false;
        channel = shading.channels[role], any = true;
    }
    return true;
}

/// Whether light comes that only rays can follow: it may be in a shadow, or it is a picture's or comes from all around.
bool isLitByRays(const TraceScene& scene, std::uint32_t group) {
    for (std::uint32_t at = scene.lightGroups.start(group); at != LightGroups::kEnd; at = scene.lightGroups.next(at))
        for (const TraceLight& light : scene.lightGroups.lightsOf(at))
            if (light.shadows || light.picture) return true;
    return !scene.environments.lights.empty();
}

bool isRasterised(const TraceScene& scene, const RayInstance& instance) {
    const SlotShading& shading = scene.slot(instance.info.id.slot);
    const MaterialEntry& entry = scene.materials[shading.material];
    const Mesh& mesh = *instance.mesh;
    if (entry.transmits || entry.mirrors || !entry.generated.empty()) return false;
    if (mesh.colors.present() && mesh.colors.components() == 4) return false;
    if (entry.textured && std::ranges::any_of(mesh.texCoords, [](const TexCoords& coordinates) {
            return coordinates.generator != TexCoords::Generator::none;
        }))
        return false;
    const Material* sides[] = {&entry.material, entry.material.back.get()};
    bool unlit = true;
    for (const Material* side : sides) {
        if (side && !isPlain(*side, shading)) return false;
        unlit = unlit && (!side || side->model == ShadingModel::unlit);
    }
    return unlit || !isLitByRays(scene, shading.lights);
}

}  // namespace

SeenFirst::SeenFirst(const TraceScene& scene, const PrimarySight& sight)
    : sight_(sight),
      slots_(scene.world->instances().size()),
      // A rasteriser's colours are of no other space, and it leaves volumes out, which are before anything.
      skyStays_(scene.space == ColorSpace::automatic && scene.volumes.empty()) {
    for (std::size_t i = 0; i < slots_.size(); ++i) {
        const RayInstance& instance = scene.world->instances()[i];
        if (!instance.info.id || !instance.mesh) continue;
        slots_[i].deep = instance.mesh->strokeCount == 0;
        slots_[i].stays = skyStays_ && isRasterised(scene, instance);
    }
}

}  // namespace rtsg::trace
