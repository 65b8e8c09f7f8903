// Fetches and interpolates the data for shading sixteen hits.
#include "surface_packet.h"

#include <array>
#include <bit>
#include <cmath>
#include <cstring>

#include "coincident.h"
#include "lanes.h"
#include "packet_kernels.h"
#include "surface_detail.h"
#include "texture/bsdf.h"
#include "texture/bsdf8.h"

namespace rtsg::trace {

using namespace simd;

namespace {

/// The data that the lanes of one instance share.
struct Common {
    std::uint32_t id = kNoInstance;
    const RayInstance* instance = nullptr;
    const SlotShading* slot = nullptr;
    const MaterialEntry* entry = nullptr;
    const Mesh* mesh = nullptr;
    bool colored = false, alphaColored = false;

    void find(const TraceScene& scene, std::uint32_t which) {
        if (which == id) return;
        id = which;
        instance = &scene.world->instance(which);
        slot = &scene.slot(which);
        entry = &scene.materials[slot->material];
        mesh = instance->mesh.get();
        colored = mesh->colors.present();
        alphaColored = colored && mesh->colors.components() == 4;
    }
};

/// The lanes of `among` that met the same instance as the first of them.
std::uint32_t sameInstance(const SurfacePacket& s, std::uint32_t among) {
    if (s.oneInstance) return among;
    const std::uint32_t id = s.hits.instance[std::countr_zero(among)];
    std::uint32_t lanes = 0;
    for (int at = 0; at < 16; at += 8) {
        I8 ids;
        std::memcpy(&ids, s.hits.instance + at, sizeof ids);
        lanes |= laneBits(ids == std::bit_cast<std::int32_t>(id)) << at;
    }
    return lanes & among;
}

/// The authored normal of a corner of a hit, where corners differ; interpolated, not normalised.
Vec3f smoothNormal(const MeshAttribute& normals, std::uint32_t triangle, float u, float v) {
    const float* data = normals.data();
    const auto corner = [&](std::uint32_t c) {
        const float* p = data + std::size_t{normals.valueIndex(triangle, c)} * 3;
        return Vec3f(p[0], p[1], p[2]);
    };
    const Vec3f a = corner(0);
    if (normals.binding() == MeshAttribute::Binding::face) return a;
    return a * (1 - u - v) + corner(1) * u + corner(2) * v;
}

constexpr int kFewLanes = 3;  // lanes that are as soon done one by one

/// Into `normal`: the mesh's normals in ray space, of any length, or the geometric ones. `lanes` are all of one
/// instance.
void gatherNormals(const Common& common, std::uint32_t lanes, SurfacePacket& out) {
    const MeshAttribute& normals = common.mesh->normals;
    lanes &= ~out.caps;
    if (!normals.present() || !lanes) return;
    if (std::popcount(lanes) <= kFewLanes) {
        for (std::uint32_t rest = lanes; rest; rest &= rest - 1) {
            const int lane = std::countr_zero(rest);
            out.normal.set(lane, common.instance->normalFromLocal * smoothNormal(normals, out.hits.triangle[lane],
                                                                                 out.hits.u[lane], out.hits.v[lane]));
        }
        return;
    }
    packetKernels().fetchNormals(
        {normals.data(), normals.indices().empty() ? nullptr : normals.indices().data(), normals.triangleStep(),
         normals.binding() == MeshAttribute::Binding::face ? 0u : 1u, common.instance->normalFromLocal},
        lanes, out);
}

/// Whether the material is computed in linear light.
bool isLinear(ColorSpace space, const Material& material) {
    return space == ColorSpace::linear || (space == ColorSpace::automatic && material.model == ShadingModel::physical);
}

/// The colours that shading starts from.
Material::Linear colorsOf(const Material& material, bool linear) {
    return linear ? material.linear : Material::Linear{material.base, material.specular, material.emissive};
}

void addLanes(const Material& material, bool linear, std::uint32_t lanes, SurfacePacket& out) {
    if (material.model == ShadingModel::unlit) out.unlit |= lanes;
    if (material.model == ShadingModel::physical) out.physical |= lanes;
    if (linear) out.linear |= lanes;
    const bool shiny = material.specular != Vec3f(0);
    if (material.model == ShadingModel::phong && shiny) out.shiny |= lanes;
}

/// Sixteen times the same, as neighbouring packets often are.
void fillAll(const Material& material, ColorSpace space, SurfacePacket& out) {
    const bool linear = isLinear(space, material);
    if (out.filled != &material || out.filledLinear != linear)
        packetKernels().fillAll(material, colorsOf(material, linear), coverageOf(material, 1, material.opacity),
                                opacityOf(material, material.opacity), out);
    out.filled = &material, out.filledLinear = linear;
    addLanes(material, linear, out.mask, out);
}

/// Without normals, lines and points have the colour that their material shines with, or their own, and nothing else of
/// it (12.2.4, 17.2.2.3). `lanes` are all of one instance.
void fetchUnlitStrokes(const TraceScene& scene, const Common& common, std::uint32_t lanes, SurfacePacket& out) {
    static const Material plain = defaultMaterial();
    const Material& material = common.entry->material;
    const bool linear = isLinear(scene.space, material);
    const Material::Linear colors = colorsOf(material, linear);
    const bool unlit = material.model == ShadingModel::unlit;
    if (linear) out.linear |= lanes;
    out.unlit |= lanes;
    out.filled = nullptr;
    for (std::uint32_t rest = lanes; rest; rest &= rest - 1) {
        const int lane = std::countr_zero(rest);
        Vec3f base = unlit ? colors.base : colors.emissive;
        float opacity = material.opacity;
        if (common.colored) {
            const ColorRGBA color = common.mesh->color(out.hits.triangle[lane], out.hits.u[lane], 0);
            base = {color.r, color.g, color.b};
            if (linear && material.model != ShadingModel::physical) base = linearFromSrgb(base);
            if (common.alphaColored) opacity = color.a;
        }
        out.base.set(lane, base);
        out.specular.set(lane, Vec3f(0)), out.emissive.set(lane, Vec3f(0)), out.ambient.set(lane, Vec3f(0));
        out.exponent[lane] = 0, out.metallic[lane] = 0, out.roughness[lane] = 1;
        out.coverage[lane] = coverageOf(material, 1, opacity);
        out.opacity[lane] = opacityOf(material, opacity);
        out.material[lane] = &plain;
        out.lights[lane] = common.slot->lights;
        if (out.opacity[lane] < 1 || out.coverage[lane] < 1) out.special |= 1u << lane;
    }
}

void fillLane(const Material& material, ColorSpace space, int lane, SurfacePacket& out) {
    out.filled = nullptr;
    const bool linear = isLinear(space, material);
    const Material::Linear colors = colorsOf(material, linear);
    out.base.set(lane, colors.base);
    out.specular.set(lane, colors.specular);
    out.emissive.set(lane, colors.emissive);
    out.ambient.set(lane, colors.base * material.ambient);
    out.exponent[lane] = material.exponent;
    out.metallic[lane] = material.metallic;
    out.roughness[lane] = material.roughness;
    out.coverage[lane] = coverageOf(material, 1, material.opacity);
    out.opacity[lane] = opacityOf(material, material.opacity);
    out.occlusion[lane] = 1;
    out.material[lane] = &material;
    addLanes(material, linear, 1u << lane, out);
}

/// fillLane() of all lanes of `lanes`.
void fillLanes(const Material& material, ColorSpace space, std::uint32_t lanes, SurfacePacket& out) {
    if (std::popcount(lanes) <= kFewLanes) {
        for (std::uint32_t rest = lanes; rest; rest &= rest - 1) fillLane(material, space, std::countr_zero(rest), out);
        return;
    }
    out.filled = nullptr;
    const bool linear = isLinear(space, material);
    const Material::Linear colors = colorsOf(material, linear);
    const float coverage = coverageOf(material, 1, material.opacity), opacity = opacityOf(material, material.opacity);
    for (int at = 0; at < 16; at += 8) {
        const I8 use = lanesFrom(lanes, at);
        const auto put = [&](float* to, float number) { store(to + at, select(use, all(number), load(to + at))); };
        const auto putColor = [&](Lanes3& to, const Vec3f& color) {
            put(to.x, color.x), put(to.y, color.y), put(to.z, color.z);
        };
        putColor(out.base, colors.base), putColor(out.specular, colors.specular);
        putColor(out.emissive, colors.emissive), putColor(out.ambient, colors.base * material.ambient);
        put(out.exponent, material.exponent), put(out.metallic, material.metallic);
        put(out.roughness, material.roughness), put(out.occlusion, 1);
        put(out.coverage, coverage), put(out.opacity, opacity);
    }
    for (std::uint32_t rest = lanes; rest; rest &= rest - 1) out.material[std::countr_zero(rest)] = &material;
    addLanes(material, linear, lanes, out);
}

bool isLitStroke(const Common& common) {
    return common.mesh->normals.present() && common.entry->material.model != ShadingModel::unlit;
}

/// A material with nothing but the numbers of a packet.
const Material& plainMaterial(ShadingModel model) {
    const auto make = [](ShadingModel which) {
        Material material = defaultMaterial();
        material.model = which;
        return material;
    };
    static const Material phong = make(ShadingModel::phong), physical = make(ShadingModel::physical);
    return model == ShadingModel::physical ? physical : phong;
}

/// The part of a unit normal that is perpendicular to a line, as a unit vector; the whole normal for a point, and if
/// the normal runs along the line.
Vec3f squareTo(const Common& common, std::uint32_t stroke, const Vec3f& normal) {
    if (common.mesh->strokes == Mesh::Strokes::points) return normal;
    const Vec3f local = common.mesh->vertex(stroke, 1) - common.mesh->vertex(stroke, 0);
    const Vec3f along = glm::mat3(common.instance->rayFromLocal) * local;
    const float squared = glm::dot(along, along);
    if (!(squared > 0)) return normal;
    const Vec3f across = normal - along * (glm::dot(along, normal) / squared);
    const float length = glm::length(across);
    return length > 1e-3f ? across / length : normal;
}

/// With normals they are lit (11.4.5, 11.4.11, 11.4.13), without what rays find: they mirror and bend nothing.
void fetchLitStrokes(const TraceScene& scene, const Common& common, std::uint32_t lanes, SurfacePacket& out) {
    const Material& material = common.entry->material;
    fillLanes(material, scene.space, lanes, out);
    out.thin |= lanes;
    const bool light = isLinear(scene.space, material) && material.model != ShadingModel::physical;
    for (std::uint32_t rest = lanes; rest; rest &= rest - 1) {
        const int lane = std::countr_zero(rest);
        if (common.colored) {
            const ColorRGBA color = common.mesh->color(out.hits.triangle[lane], out.hits.u[lane], 0);
            const Vec3f own(color.r, color.g, color.b), base = light ? linearFromSrgb(own) : own;
            out.base.set(lane, base), out.ambient.set(lane, base * material.ambient);
            if (common.alphaColored) {
                out.coverage[lane] = coverageOf(material, 1, color.a);
                out.opacity[lane] = opacityOf(material, color.a);
            }
        }
        const Vec3f normal = squareTo(common, out.hits.triangle[lane], out.normal.get(lane));
        out.hits.normalX[lane] = normal.x, out.hits.normalY[lane] = normal.y, out.hits.normalZ[lane] = normal.z;
        out.material[lane] = &plainMaterial(material.model);
        out.lights[lane] = common.slot->lights;
        if (out.opacity[lane] < 1 || out.coverage[lane] < 1) out.special |= 1u << lane;
    }
}

/// `lanes` are all of one instance.
void fetchMaterial(const TraceScene& scene, const Common& common, std::uint32_t lanes, const PathTask* tasks,
                   SurfacePacket& out) {
    const MaterialEntry& entry = *common.entry;
    const Material& front = entry.material;
    if (lanes == out.mask && !front.back) {
        fillAll(front, scene.space, out);
    } else {
        const std::uint32_t behind = front.back ? lanes & out.back : 0;
        fillLanes(front, scene.space, lanes & ~behind, out);
        if (behind) fillLanes(*front.back, scene.space, behind, out);
    }
    if (lanes == out.mask)
        std::fill(std::begin(out.lights), std::end(out.lights), common.slot->lights);
    else
        for (std::uint32_t rest = lanes; rest; rest &= rest - 1)
            out.lights[std::countr_zero(rest)] = common.slot->lights;
    if (entry.mirrors || entry.transmits || common.alphaColored) out.special |= lanes;
    if (entry.textured || common.colored) addDetail(scene, *common.instance, *common.slot, tasks, lanes, out);
    if (hidesBacks(scene, common.id)) {
        const std::uint32_t culled = lanes & out.back;
        out.special |= culled;
        if (culled) out.filled = nullptr;
        for (std::uint32_t rest = culled; rest; rest &= rest - 1) out.coverage[std::countr_zero(rest)] = 0;
    }
}

}  // namespace

void fetchSurfaces(const TraceScene& scene, const RayPacket16& rays, std::uint32_t mask, const PathTask* tasks,
                   SurfacePacket& out) {
    out.oneInstance = scene.world->hits(rays, mask, out.hits);
    out.mask = mask;
    out.fromEye = !tasks;
    out.special = out.unlit = out.physical = out.shiny = out.linear = out.caps = out.thin = 0;
    if (scene.filter && scene.filter->makesCaps()) [[unlikely]]
        for (int lane = 0; lane < 16; ++lane)
            if ((mask >> lane & 1u) && out.hits.triangle[lane] == kCap) out.caps |= 1u << lane;
    out.pointsFound = false;
    flipToFronts(scene, rays, out);
    Common common;
    common.find(scene, out.hits.instance[std::countr_zero(mask)]);
    if (!out.oneInstance || out.caps || !common.mesh->normals.present() || std::popcount(mask) <= kFewLanes)
        packetKernels().useOutside(out);
    for (std::uint32_t rest = mask; rest;) {
        const std::uint32_t lanes = sameInstance(out, rest);
        common.find(scene, out.hits.instance[std::countr_zero(rest)]);
        gatherNormals(common, lanes, out);
        rest &= ~lanes;
    }
    packetKernels().finishGeometry(rays, out);
    for (std::uint32_t rest = mask; rest;) {
        const std::uint32_t lanes = sameInstance(out, rest);
        common.find(scene, out.hits.instance[std::countr_zero(rest)]);
        if (common.mesh->strokeCount > 0) [[unlikely]]
            (isLitStroke(common) ? fetchLitStrokes : fetchUnlitStrokes)(scene, common, lanes, out);
        else
            fetchMaterial(scene, common, lanes, tasks, out);
        rest &= ~lanes;
    }
    if (scene.materials.bends()) findInterfaces(scene, rays, tasks, out);
    if (!scene.energyLimited) return;
    out.filled = nullptr;
    for (int at = 0; at < 16; at += 8) {
        const V8 base = loadV(out.base, at), maximum{min(base.x, all(1)), min(base.y, all(1)), min(base.z, all(1))};
        storeV(out.base, at, select(lanesFrom(out.unlit, at), base, maximum));
    }
    for (int at = 0; at < 16; at += 8) {
        if (!(mask & out.physical & 0xFFu << at)) continue;
        const V8 base = loadV(out.base, at);
        const F8 cosine = dot(loadV(out.normal, at), loadV(out.view, at));
        const V8 less = energyLimited(base, load(out.metallic + at), load(out.roughness + at), cosine);
        storeV(out.base, at, select(lanesFrom(out.physical, at), less, base));
    }
    for (std::uint32_t rest = mask & out.shiny; rest; rest &= rest - 1) {
        const int lane = std::countr_zero(rest);
        out.specular.set(lane, energyLimited(out.base.get(lane), out.specular.get(lane), out.exponent[lane]));
    }
}

namespace {

/// The ray of a lane's hit.
Ray rayTo(const SurfacePacket& s, int lane) {
    const Vec3f back = s.view.get(lane);
    return {s.position.get(lane) + s.distance[lane] * back, 0, -back};
}

}  // namespace

void findPoints(const TraceScene& scene, SurfacePacket& s) {
    if (s.pointsFound) return;
    s.pointsFound = true;
    const auto isStroke = [&](int lane) { return scene.world->instance(s.hits.instance[lane]).mesh->strokeCount > 0; };
    std::uint32_t alone = s.caps;
    for (std::uint32_t rest = s.mask & ~s.caps; rest;) {
        const int first = std::countr_zero(rest);
        const std::uint32_t lanes = sameInstance(s, rest);
        rest &= ~lanes;
        if (isStroke(first) || std::popcount(lanes) <= kFewLanes) {
            alone |= lanes;
            continue;
        }
        const RayInstance& instance = scene.world->instance(s.hits.instance[first]);
        const Mesh& mesh = *instance.mesh;
        packetKernels().findPoints(instance, mesh.positions.data(), mesh.triangles.data(), mesh.triangleStride, lanes,
                                   s);
    }
    for (std::uint32_t rest = alone; rest; rest &= rest - 1) {
        const int lane = std::countr_zero(rest);
        const Ray ray = rayTo(s, lane);
        const HitPoint point = s.thin >> lane & 1u ? scene.world->strokePoint(s.hit(lane), s.outside(lane))
                                                   : scene.world->point(s.hit(lane), ray);
        s.exact.set(lane, point.position);
        s.error.set(lane, point.error);
    }
}

HitPoint pointBehind(const TraceScene& scene, const SurfacePacket& s, int lane) {
    if (!(s.thin >> lane & 1u)) return s.point(lane);
    Hit hit = s.hit(lane);
    hit.normal = s.view.get(lane);
    return scene.world->point(hit, rayTo(s, lane));
}

std::optional<Vec3f> pointOnCurve(const TraceScene& scene, const SurfacePacket& s, int lane) {
    const std::uint32_t triangle = s.hits.triangle[lane];
    if ((s.thin | s.caps) >> lane & 1u) return std::nullopt;
    const RayInstance& instance = scene.world->instance(s.hits.instance[lane]);
    const MeshAttribute& normals = instance.mesh->normals;
    if (!normals.present() || normals.binding() == MeshAttribute::Binding::face) return std::nullopt;
    const Vec3f position = s.exact.get(lane), facing = (s.back >> lane & 1u ? -1.0f : 1.0f) * s.outside(lane);
    const float u = s.hits.u[lane], v = s.hits.v[lane], weights[] = {1 - u - v, u, v};
    std::array<Vec3f, 3> at;
    Vec3f mean(0), off(0);
    for (std::uint32_t corner = 0; corner < 3; ++corner) {
        const float* const numbers = normals.data() + std::size_t{normals.valueIndex(triangle, corner)} * 3;
        Vec3f normal = instance.normalFromLocal * Vec3f(numbers[0], numbers[1], numbers[2]);
        const float length = glm::length(normal);
        if (!(length > 0)) return std::nullopt;
        at[corner] = normal * ((glm::dot(normal, facing) < 0 ? -1 : 1) / length);
        mean += at[corner] / 3.0f;
    }
    for (std::uint32_t corner = 0; corner < 3; ++corner) {
        // Normals that all lean the same way bend no surface: their common part is the triangle's own.
        const Vec3f normal = glm::normalize(at[corner] - mean + facing);
        const Vec3f from = instance.rayFromLocal * Vec4f(instance.mesh->vertex(triangle, corner), 1);
        off -= weights[corner] * std::min(glm::dot(position - from, normal), 0.0f) * normal;
    }
    // A ray that leaves the triangle itself may start as far as this from it; within that distance the curve does not
    // matter.
    const float error = glm::dot(glm::abs(facing), s.error.get(lane));
    if (!(glm::dot(off, facing) > 2 * error)) return std::nullopt;
    return position + off;
}

bool letsThrough(const TraceScene& scene, std::uint32_t instance) {
    if (scene.materials[scene.slot(instance).material].transmits) return true;
    const Mesh& mesh = *scene.world->instance(instance).mesh;
    return mesh.colors.present() && mesh.colors.components() == 4;
}

namespace {

/// `alpha`: of textures. `eta`: of what bends light.
Vec3f throughPlain(const Material& material, float alpha, float opacity, float eta) {
    const float coverage = coverageOf(material, alpha, opacity);
    Vec3f through =
        coverage * (1 - opacityOf(material, opacity)) * (Vec3f(1) - material.reflectivity) * leftBySheet(material);
    // Two boundaries of a dielectric reflect some of what passes; the bending is not followed.
    if (material.refractiveIndex > 0) through *= 1 - fresnelDielectric(1, eta).mean();
    return Vec3f(1 - coverage) + through;
}

}  // namespace

Vec3f straightTransmittance(const TraceScene& scene, const Hit& hit, const Vec3f& direction, std::optional<float> eta) {
    if (eta && *eta == 0) return Vec3f(1);
    const SlotShading& slot = scene.slot(hit.instance);
    const MaterialEntry& entry = scene.materials[slot.material];
    const RayInstance& instance = scene.world->instance(hit.instance);
    const Mesh& mesh = *instance.mesh;
    const bool colored = mesh.colors.present() && mesh.colors.components() == 4;
    if (!letsThrough(scene, hit.instance)) return Vec3f(0);
    if (hit.isCap())
        return throughPlain(entry.material, 1, entry.material.opacity, eta.value_or(entry.material.refractiveIndex));
    const bool behind = mesh.strokeCount == 0 && glm::dot(direction, hit.normal) > 0;
    const Material& material = behind && entry.material.back ? *entry.material.back : entry.material;
    if (mesh.strokeCount > 0) {
        const float opacity = colored ? mesh.color(hit.triangle, hit.u, 0).a : material.opacity;
        return Vec3f(1 - coverageOf(material, 1, opacity) * opacityOf(material, opacity));
    }
    float opacity = colored ? mesh.color(hit.triangle, hit.u, hit.v).a : material.opacity, alpha = 1;
    if (material.hatching.present) {
        if (material.hatching.isLine(pixelOf(scene, scene.world->point(hit).position))) return Vec3f(0);
        if (!material.hatching.filled) return Vec3f(1);
    }
    if (material.texture(TextureRole::base) || !material.stages.empty())
        findAlpha({instance, slot, hit, 0, ColorSpace::linear, &scene, scene.world->point(hit).position, hit.normal},
                  material, alpha, opacity);
    return throughPlain(material, alpha, opacity, eta.value_or(material.refractiveIndex));
}

Vec3f emitted(const TraceScene& scene, const Hit& hit, bool behind, float footprint) {
    const SlotShading& slot = scene.slot(hit.instance);
    const RayInstance& instance = scene.world->instance(hit.instance);
    const Material& front = scene.materials[slot.material].material;
    const Material& material = behind && front.back ? *front.back : front;
    const Material::Linear colors = colorsOf(material, true);
    if (hit.isCap()) return material.model == ShadingModel::unlit ? colors.base : colors.emissive;
    const TextureLookup look{
        instance, slot, hit, footprint, ColorSpace::linear, &scene, scene.world->point(hit).position, hit.normal};
    if (material.model != ShadingModel::unlit) {
        if (!material.texture(TextureRole::emissive)) return colors.emissive;
        return colors.emissive * Vec3f(look.sample(material, TextureRole::emissive));
    }
    Vec3f base = colors.base;
    if (instance.mesh->colors.present()) {
        const ColorRGBA color = instance.mesh->color(hit.triangle, hit.u, hit.v);
        base = linearFromSrgb(Vec3f(color.r, color.g, color.b));
    }
    if (material.texture(TextureRole::base)) base *= Vec3f(look.sample(material, TextureRole::base));
    return base;
}

}  // namespace rtsg::trace
