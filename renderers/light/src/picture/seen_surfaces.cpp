// Evaluates hits of single rays in the way that pictures evaluate those of packets.
#include "seen_surfaces.h"

#include <algorithm>
#include <cmath>

#include "surface/surface_detail.h"

namespace rtsg::trace {

namespace {

bool hasAlphaColors(const Mesh& mesh) {
    return mesh.colors.present() && mesh.colors.components() == 4;
}

/// Whether a hatch tells that something, or nothing, is there.
std::optional<bool> sayOf(const Hatching& hatching, const TraceScene& scene, const Vec3f& at) {
    if (!hatching.present) return std::nullopt;
    const bool known = scene.pixelSpread > 0 || scene.pixelSize > 0;
    if (known && hatching.isLine(pixelOf(scene, at))) return true;
    if (hatching.filled) return std::nullopt;
    return !known && hatching.style != 0;  // there may be a line anywhere
}

/// Metres, of a pixel on the surface.
float footprintOf(const TraceScene& scene, const Ray& ray, const Hit& hit, const Vec3f& at) {
    const float cosine = std::max(std::abs(glm::dot(ray.direction, hit.normal)), 0.05f);
    return scene.sampleWidth(glm::distance(at, scene.eye)) / std::sqrt(cosine);
}

}  // namespace

Hit SurfacesInPicture::seen(const RayView& view, const Ray& ray, const Hit& met) const {
    if (met.isCap()) return met;
    Hit hit = met;
    const auto isBehind = [&] {
        return glm::dot(ray.direction, hit.normal) > 0 && view.instance(hit.instance).mesh->strokeCount == 0;
    };
    bool behind = isBehind();
    if (behind) [[unlikely]] {
        const RayInstance& instance = view.instance(hit.instance);
        // The backs of glass are there, so that light finds its way out.
        if (instance.mesh->solid && drawn(instance).material->refractiveIndex == 0) {
            hit = view.frontOfCoincident(ray, met);
            if (!hit) return {};
            behind = isBehind();
        }
    }
    return isThere(view, ray, hit, behind) ? hit : Hit();
}

bool SurfacesInPicture::isThere(const RayView& view, const Ray& ray, const Hit& hit, bool behind) const {
    const RayInstance& instance = view.instance(hit.instance);
    const Mesh& mesh = *instance.mesh;
    const bool colored = hasAlphaColors(mesh);
    if (!colored && (mesh.strokeCount > 0 || !mayBeClear(instance))) return true;
    const auto [entry, slot] = drawn(instance);
    const Material& material = behind && entry->back ? *entry->back : *entry;
    float alpha = 1, opacity = material.opacity > 0 ? material.opacity : 1;
    if (mesh.strokeCount > 0) {
        opacity = mesh.color(hit.triangle, hit.u, 0).a;
        return coverageOf(material, 1, opacity) * opacityOf(material, opacity) > 0;
    }
    if (colored) opacity = mesh.color(hit.triangle, hit.u, hit.v).a;
    if (material.hatching.present || material.texture(TextureRole::base) || !material.stages.empty()) {
        const TraceScene inPicture = sceneFor(view, ray);
        const Vec3f at = view.point(hit, ray).position;
        if (const auto said = sayOf(material.hatching, inPicture, at)) return *said;
        findAlpha(
            {instance, slot, hit, footprintOf(inPicture, ray, hit, at), ColorSpace::linear, &inPicture, at, hit.normal},
            material, alpha, opacity);
    }
    return coverageOf(material, alpha, opacity) * opacityOf(material, opacity) > 0;
}

}  // namespace rtsg::trace
