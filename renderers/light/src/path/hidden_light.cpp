// What shines, and rays from it that tell what its light meets first.
#include "hidden_light.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "lighting/emitters.h"
#include "lighting/probe.h"
#include "lighting/sample_points.h"
#include "lighting/sky_light.h"
#include "texture/bsdf.h"

namespace rtsg::trace {

namespace {

constexpr int kRays = 4096;

float numberOf(int ray, int which) {
    constexpr int kNumbers = 8;
    const std::uint64_t bits = mixBits(static_cast<std::uint64_t>(ray * kNumbers + which + 1));
    return static_cast<float>(bits >> 40) * 0x1p-24f;
}

/// A direction of all, as likely as any other.
Vec3f directionOf(int ray) {
    const float z = 1 - 2 * numberOf(ray, 4), phi = 2 * std::numbers::pi_v<float> * numberOf(ray, 5);
    const float across = std::sqrt(std::max(1 - z * z, 0.0f));
    return {across * std::cos(phi), across * std::sin(phi), z};
}

float glowOf(const Material& material) {
    const float own = largest(material.model == ShadingModel::unlit ? material.linear.base : material.linear.emissive);
    return material.back ? std::max(own, glowOf(*material.back)) : own;
}
/// Whether light goes on from it in ways that no other than a bounce takes.
bool rotationsLight(const Material& material) {
    return material.refractiveIndex > 0 || material.reflectivity != Vec3f(0) ||
           (material.back && rotationsLight(*material.back));
}

/// The largest radiance of the sky and of what else is infinitely far.
float brightestSky(const TraceScene& scene) {
    float maximum = 0;
    for (int ray = 0; ray < kRays; ++ray) {
        Vec3f direction = directionOf(ray);
        if (scene.skyLight) direction = scene.skyLight->sample(numberOf(ray, 6), numberOf(ray, 7)).direction;
        const std::size_t groups = scene.environments.lights.empty() ? 1 : scene.environments.groups.size();
        for (std::uint32_t group = 0; group < groups; ++group)
            maximum = std::max(maximum, largest(Vec3f(scene.fromFar(direction, group, true))));
        if (scene.evenSky && scene.environments.lights.empty()) break;
    }
    return maximum;
}

const Material& materialOf(const TraceScene& scene, std::uint32_t slot) {
    return scene.materials[scene.slots[slot].material].material;
}

/// The emitters, by what they send out.
class Rays {
  public:
    explicit Rays(const TraceScene& scene) : scene_(scene) {
        const Emitters& all = *scene.emitters;
        upTo_.reserve(all.size());
        double sum = 0;
        for (std::uint32_t i = 0; i < all.size(); ++i)
            upTo_.push_back(sum += double{all[i].area} * glowOf(materialOf(scene, all[i].instance)));
    }
    /// The slot that a ray of them meets first; kNoInstance: none. `from`: the slot that sends it.
    std::uint32_t follow(int ray, std::uint32_t& from) const {
        const double at = (ray + .5) / kRays * upTo_.back();
        const auto found = std::min(std::ranges::upper_bound(upTo_, at), upTo_.end() - 1);
        const Emitters::Emitter& e = (*scene_.emitters)[static_cast<std::uint32_t>(found - upTo_.begin())];
        from = e.instance;
        const float side = std::sqrt(numberOf(ray, 0));
        const Vec3f position = e.corner + e.ab * (1 - side) + e.ac * (numberOf(ray, 1) * side);
        const Vec3f normal = e.bothSides && (ray & 1) ? -e.normal : e.normal;
        // A point of a sphere that touches the surface: the cosine's distribution.
        const Vec3f direction = glm::normalize(normal * 1.00001f + directionOf(ray));
        const Vec3f start = RayView::leave(Probe{position, normal}.point(), direction);
        const Hit hit = scene_.world->intersect({start, kLeave, direction, std::numeric_limits<float>::infinity()});
        return hit.instance;
    }

  private:
    const TraceScene& scene_;
    std::vector<double> upTo_;
};

/// The share of the light of PointLights and SpotLights that meets clear or mirroring surfaces first.
double lostLight(const TraceScene& scene) {
    std::vector<const TraceLight*> lamps;
    std::vector<double> upTo;
    double sum = 0;
    for (const TraceLight& light : scene.lightGroups.lights) {
        if (light.kind != Light::Kind::point && light.kind != Light::Kind::spot) continue;
        const bool isSpot = light.kind == Light::Kind::spot;
        lamps.push_back(&light);
        upTo.push_back(sum += double{largest(light.color)} * (isSpot ? 1 - std::cos(double{light.cutOffAngle}) : 2));
    }
    if (!(sum > 0)) return 0;
    int lost = 0;
    for (int ray = 0; ray < kRays; ++ray) {
        const auto found = std::min(std::ranges::upper_bound(upTo, (ray + .5) / kRays * sum), upTo.end() - 1);
        const TraceLight& light = *lamps[static_cast<std::size_t>(found - upTo.begin())];
        Vec3f direction = directionOf(ray);
        if (light.kind == Light::Kind::spot) {
            const float along = 1 - numberOf(ray, 4) * (1 - std::cos(light.cutOffAngle));
            const Vec3f across = direction - light.direction * glm::dot(direction, light.direction);
            direction = light.direction * along + glm::normalize(across) * std::sqrt(std::max(1 - along * along, 0.0f));
        }
        const Hit hit =
            scene.world->intersect({light.position, kLeave, direction, std::numeric_limits<float>::infinity()});
        if (hit.instance < scene.slots.size() && rotationsLight(materialOf(scene, hit.instance))) ++lost;
    }
    return double{1} * lost / kRays;
}

}  // namespace

HiddenLight findHiddenLight(const TraceScene& scene) {
    HiddenLight result;
    bool rotations = false;
    const RayInstances& instances = scene.world->instances();
    for (std::uint32_t slot = 0; slot < instances.size() && slot < scene.slots.size(); ++slot) {
        const RayInstance& instance = instances[slot];
        if (!instance.mesh || !instance.info.seen || instance.info.clear) continue;
        const Material& material = materialOf(scene, slot);
        // The colours of vertices are at most 1.
        const bool coloured = instance.mesh->colors.present() && material.model == ShadingModel::unlit;
        const float glow = coloured ? std::max(glowOf(material), 1.0f) : glowOf(material);
        rotations = rotations || rotationsLight(material);
        result.brightest = std::max(result.brightest, glow);
        const bool sampled = scene.emitters && scene.emitters->find(slot, 0) != Emitters::kNone;
        if (!sampled) result.maximum = std::max(result.maximum, glow);
    }
    const float sky = brightestSky(scene);
    if (rotations) result.maximum = std::max(result.maximum, sky);
    result.brightest = std::max(result.brightest, sky);
    for (const TraceLight& light : scene.lightGroups.lights)
        result.brightest = std::max(result.brightest, largest(light.color));
    result.any = result.brightest > 0 || !scene.volumes.empty();
    if (!rotations) return result;
    result.lost = lostLight(scene);
    if (!scene.emitters) return result;
    const Rays rays(scene);
    int hidden = 0;
    for (int ray = 0; ray < kRays; ++ray) {
        std::uint32_t from = 0;
        const std::uint32_t met = rays.follow(ray, from);
        if (met >= scene.slots.size() || !rotationsLight(materialOf(scene, met))) continue;
        ++hidden, result.maximum = std::max(result.maximum, glowOf(materialOf(scene, from)));
    }
    result.fraction = double{1} * hidden / kRays;
    return result;
}

}  // namespace rtsg::trace
