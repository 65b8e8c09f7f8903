#include "surface_packet.h"

#include <bit>
#include <cmath>

namespace rtsg::trace {

namespace {

/// A lane's way to its textures.
struct TextureLookup {
    const RayInstance& instance;
    const SlotShading& slot;
    const Hit& hit;
    float footprint;  // metres, of a pixel on the surface

    Vec2f coordinates(TextureRole role, const TextureUse& use) const {
        const std::uint8_t channel = slot.channels[static_cast<std::size_t>(role)];
        const Vec4f st = instance.mesh->texCoord(hit.triangle, hit.u, hit.v, channel);
        return use.matrix.apply({st.x, st.y});
    }
    /// Side of the pixel on the texture, as a share of the texture's side.
    float spread(TextureRole role, const TextureUse& use) const {
        if (footprint <= 0) return 0;
        const Mesh& mesh = *instance.mesh;
        const std::uint8_t channel = slot.channels[static_cast<std::size_t>(role)];
        Vec2f st[3];
        Vec3f p[3];
        const float corners[3][2] = {{0, 0}, {1, 0}, {0, 1}};
        for (std::uint32_t c = 0; c < 3; ++c) {
            const Vec4f value = mesh.texCoord(hit.triangle, corners[c][0], corners[c][1], channel);
            st[c] = {value.x, value.y};
            p[c] = glm::mat3(instance.rayFromLocal) * mesh.vertex(hit.triangle, c);
        }
        const Vec2f a = st[1] - st[0], b = st[2] - st[0];
        const float textureArea = std::abs(a.x * b.y - a.y * b.x);
        const float worldArea = glm::length(glm::cross(p[1] - p[0], p[2] - p[0]));
        if (!(worldArea > 0) || !(textureArea > 0)) return 0;
        return footprint * std::sqrt(textureArea / worldArea) * use.matrix.stretch();
    }
    Vec4f sample(const Material& material, TextureRole role) const {
        const TextureUse& use = material.texture(role);
        const Vec2f st = coordinates(role, use);
        return use.texture->sample(st.x, st.y, spread(role, use), use.access);
    }
};

Vec3f mappedNormal(const TextureLookup& look, const Material& material, const Vec3f& normal) {
    const Vec4f texel = look.sample(material, TextureRole::normal);
    Vec3f dPds, dPdt;
    const std::uint8_t channel = look.slot.channels[static_cast<std::size_t>(TextureRole::normal)];
    if (!textureTangents(*look.instance.mesh, look.hit.triangle, channel, dPds, dPdt)) return normal;
    Vec3f t = glm::mat3(look.instance.rayFromLocal) * dPds;
    Vec3f b = glm::mat3(look.instance.rayFromLocal) * dPdt;
    t -= glm::dot(t, normal) * normal;
    b -= glm::dot(b, normal) * normal;
    const float tl = glm::length(t), bl = glm::length(b);
    if (!(tl > 0) || !(bl > 0)) return normal;
    const Vec3f local((2 * texel.r - 1) * material.normalScale, (2 * texel.g - 1) * material.normalScale,
                      2 * texel.b - 1);
    const Vec3f mapped = t / tl * local.x + b / bl * local.y + normal * local.z;
    const float length = glm::length(mapped);
    return length > 0 ? mapped / length : normal;
}

float coverageOf(const Material& material, float textureAlpha) {
    switch (material.alphaMode) {
        case AlphaMode::opaque:
            return 1;
        case AlphaMode::mask:
            return textureAlpha * material.opacity < material.alphaCutoff ? 0.0f : 1.0f;
        case AlphaMode::automatic:
        case AlphaMode::blend:
            break;
    }
    return textureAlpha;
}

float opacityOf(const Material& material, float opacity) {
    return material.alphaMode == AlphaMode::opaque || material.alphaMode == AlphaMode::mask ? 1.0f : opacity;
}

/// Colour, textures and maps of one lane whose material is more than plain numbers.
void applyDetail(const TextureLookup& look, const Material& material, SurfacePacket& out, int lane) {
    const Mesh& mesh = *look.instance.mesh;
    Vec3f base = material.base, specular = material.specular, emissive = material.emissive;
    Vec3f ambientBase = material.base;
    float opacity = material.opacity, alpha = 1, ambient = material.ambient;
    if (mesh.colors.present()) {
        // 11.2.2: the colour stands in for the main colour, its alpha (if it has one) for the transparency.
        const ColorRGBA color = mesh.color(look.hit.triangle, look.hit.u, look.hit.v);
        base = ambientBase = {color.r, color.g, color.b};
        if (mesh.colors.components() == 4) opacity = color.a;
    }
    if (material.texture(TextureRole::base)) {
        const Vec4f texel = look.sample(material, TextureRole::base);
        base *= Vec3f(texel);
        alpha = texel.a;
        ambientBase = base;
    }
    if (material.texture(TextureRole::emissive)) emissive *= Vec3f(look.sample(material, TextureRole::emissive));
    if (material.texture(TextureRole::specular)) specular *= Vec3f(look.sample(material, TextureRole::specular));
    if (material.texture(TextureRole::ambient)) ambientBase *= Vec3f(look.sample(material, TextureRole::ambient));
    if (material.texture(TextureRole::shininess)) out.exponent[lane] *= look.sample(material, TextureRole::shininess).a;
    if (material.texture(TextureRole::metallicRoughness)) {
        const Vec4f texel = look.sample(material, TextureRole::metallicRoughness);
        out.roughness[lane] *= texel.g;
        out.metallic[lane] *= texel.b;
    }
    if (material.texture(TextureRole::occlusion))
        ambient *= 1 + material.occlusionStrength * (look.sample(material, TextureRole::occlusion).r - 1);
    if (material.texture(TextureRole::normal)) out.normal.set(lane, mappedNormal(look, material, out.normal.get(lane)));
    out.base.set(lane, base);
    out.specular.set(lane, specular);
    out.emissive.set(lane, emissive);
    out.ambient.set(lane, ambientBase * ambient);
    out.coverage[lane] = coverageOf(material, alpha);
    out.opacity[lane] = opacityOf(material, opacity);
}

void fetchLane(const TraceScene& scene, const RayPacket16& rays, int lane, const PathTask* tasks, SurfacePacket& out) {
    const Hit hit = scene.world->hit(rays, lane);
    out.hit[lane] = hit;
    const RayInstance& instance = scene.world->instance(hit.instance);
    const SlotShading& slot = scene.slots[hit.instance];
    const MaterialEntry& entry = scene.materials[slot.material];
    const Mesh& mesh = *instance.mesh;
    const Vec3f direction(rays.directionX[lane], rays.directionY[lane], rays.directionZ[lane]);
    const bool back = glm::dot(direction, hit.normal) > 0;
    const Material& material = back && entry.material.back ? *entry.material.back : entry.material;

    Vec3f normal = hit.normal;
    if (mesh.normals.present()) {
        const Vec3f local(mesh.normals.interpolate(hit.triangle, hit.u, hit.v));
        const Vec3f smooth = instance.normalFromLocal * local;
        const float squared = glm::dot(smooth, smooth);
        // Negated comparisons also catch NaN.
        if (squared > 1e-24f && squared < 1e30f) normal = smooth / std::sqrt(squared);
    }
    if (back) normal = -normal;
    out.position.set(lane, Vec3f(rays.originX[lane], rays.originY[lane], rays.originZ[lane]) + hit.t * direction);
    out.view.set(lane, -direction);
    out.normal.set(lane, normal);
    out.lights[lane] = slot.lights;
    out.model[lane] = material.model;
    out.material[lane] = &material;
    out.back[lane] = back;
    out.exponent[lane] = material.exponent;
    out.metallic[lane] = material.metallic;
    out.roughness[lane] = material.roughness;
    // The back of a solid is not there, unless light is to find its way out of glass.
    const bool culled = back && mesh.solid && material.refractiveIndex == 0;
    out.special[lane] =
        entry.mirrors || entry.transmits || culled || (mesh.colors.present() && mesh.colors.components() == 4);
    if (entry.textured || mesh.colors.present()) {
        const float run = (tasks ? tasks[lane].travelled : 0) + hit.t;
        const float cosine = std::max(std::abs(glm::dot(direction, hit.normal)), 0.05f);
        const float footprint = (scene.pixelSpread * run + scene.pixelSize) / std::sqrt(cosine);
        applyDetail({instance, slot, hit, footprint}, material, out, lane);
    } else {
        out.base.set(lane, material.base);
        out.specular.set(lane, material.specular);
        out.emissive.set(lane, material.emissive);
        out.ambient.set(lane, material.base * material.ambient);
        out.coverage[lane] = coverageOf(material, 1);
        out.opacity[lane] = opacityOf(material, material.opacity);
    }
    if (culled) out.coverage[lane] = 0;
}

}  // namespace

void fetchSurfaces(const TraceScene& scene, const RayPacket16& rays, std::uint32_t mask, const PathTask* tasks,
                   SurfacePacket& out) {
    out.mask = mask;
    for (std::uint32_t rest = mask; rest; rest &= rest - 1) fetchLane(scene, rays, std::countr_zero(rest), tasks, out);
}

Vec3f straightTransmittance(const TraceScene& scene, const Hit& hit) {
    const SlotShading& slot = scene.slots[hit.instance];
    const MaterialEntry& entry = scene.materials[slot.material];
    const RayInstance& instance = scene.world->instance(hit.instance);
    const Mesh& mesh = *instance.mesh;
    const bool colored = mesh.colors.present() && mesh.colors.components() == 4;
    if (!entry.transmits && !colored) return Vec3f(0);
    const Material& material = entry.material;
    float opacity = colored ? mesh.color(hit.triangle, hit.u, hit.v).a : material.opacity, alpha = 1;
    if (material.texture(TextureRole::base))
        alpha = TextureLookup{instance, slot, hit, 0}.sample(material, TextureRole::base).a;
    float through = 1 - coverageOf(material, alpha) * opacityOf(material, opacity);
    // Two boundaries of a dielectric reflect some of what passes; the bending is not followed.
    if (material.refractiveIndex > 0) through *= 1 - fresnelDielectric(1, material.refractiveIndex).mean();
    return Vec3f(through) * (Vec3f(1) - material.reflectivity);
}

}  // namespace rtsg::trace
