// Fetches and interpolates what sixteen hits need for shading, lane by lane.
#include "surface_packet.h"

#include <bit>
#include <cmath>
#include <cstring>

#include "bsdf.h"
#include "bsdf8.h"
#include "coincident.h"
#include "generated_coordinates.h"
#include "lanes.h"
#include "packet_kernels.h"

namespace rtsg::trace {

using namespace simd;

namespace {

/// How much larger a triangle of an instance is in a picture than in space, by length: found last, as the lanes of a
/// packet often meet the same one.
struct LastStretch {
    std::uint32_t triangle = 0;
    std::size_t channel = SIZE_MAX;
    bool flat = false;  // in two dimensions of the picture
    float value = 0;    // 0: none
};

/// A lane's way to its textures.
struct TextureLookup {
    const RayInstance& instance;
    const SlotShading& slot;
    const Hit& hit;
    float footprint;  // metres, of a pixel on the surface
    ColorSpace space = ColorSpace::linear;
    const TraceScene* scene = nullptr;
    Vec3f position{0}, normal{0};  // ray space
    LastStretch* last = nullptr;   // of this instance

    std::size_t channelOf(TextureRole role) const { return slot.channels[static_cast<std::size_t>(role)]; }
    const TexCoords* coordsOf(std::size_t channel) const {
        return channel < instance.mesh->texCoords.size() ? &instance.mesh->texCoords[channel] : nullptr;
    }
    Vec3f generated(const TexCoords& channel) const {
        const auto camera = [&](const Vec3f& v) {
            return Vec3f(glm::dot(v, scene->right), glm::dot(v, scene->up), -glm::dot(v, scene->forward));
        };
        GeneratorInput in;
        in.position = camera(position - scene->eye);
        in.normal = camera(normal);
        const Mesh& mesh = *instance.mesh;
        in.localPosition = mesh.position(hit.triangle, hit.u, hit.v);
        in.localNormal = mesh.shadingNormal(hit.triangle, hit.u, hit.v);
        const Vec3f made = generatedCoordinates(channel, in);
        return isInWorld(channel.generator) ? fromCamera(made) : made;
    }
    static bool isInWorld(TexCoords::Generator generator) {
        return generator == TexCoords::Generator::worldSpaceNormal ||
               generator == TexCoords::Generator::worldSpaceReflection;
    }
    Vec3f fromCamera(const Vec3f& v) const { return v.x * scene->right + v.y * scene->up - v.z * scene->forward; }
    /// Where authors gave no coordinates: of a cube the direction from the shape's middle, of a block the place in the
    /// box around the shape, r from its front to its back.
    Vec4f solid(const TextureUse& use) const {
        const Mesh& mesh = *instance.mesh;
        const Vec3f place = mesh.position(hit.triangle, hit.u, hit.v);
        if (use.generated || use.space->isCube()) return {place, 1};
        const Vec3f size = mesh.bounds.size(), within = place - mesh.bounds.min;
        const auto share = [](float x, float of) { return of > 0 ? x / of : 0.0f; };
        return {share(within.x, size.x), share(within.y, size.y), 1 - share(within.z, size.z), 1};
    }
    /// What a GeneratedCubeMapTexture is looked up by: a direction in the world, whatever frame it was found in.
    Vec3f inWorld(const TexCoords* own, const Vec3f& v) const {
        using G = TexCoords::Generator;
        const G generator = own ? own->generator : G::none;
        const bool ofCamera = generator == G::cameraSpaceNormal || generator == G::cameraSpacePosition ||
                              generator == G::cameraSpaceReflection || generator == G::coordEye ||
                              generator == G::sphereReflect;
        if (ofCamera) return fromCamera(v);
        if (isInWorld(generator)) return v;
        return glm::mat3(instance.rayFromLocal) * v;
    }
    /// A RenderedTexture lies on a surface as other pictures do.
    static bool isFlat(const TextureUse& use) { return use.generated && use.generated->isFlat(); }
    Vec3f coordinates(std::size_t channel, const TextureUse& use) const {
        const TexCoords* own = coordsOf(channel);
        Vec4f str;
        if (own && own->generator != TexCoords::Generator::none)
            str = {generated(*own), 1};
        else if (!use.texture && !isFlat(use) && !(own && own->authored))
            str = solid(use);
        else
            str = instance.mesh->texCoord(hit.triangle, hit.u, hit.v, channel);
        if (use.generated && !isFlat(use)) str = {inWorld(own, Vec3f(str)), str.w};
        if (use.matrix3) [[unlikely]]
            str = *use.matrix3 * str;
        else
            str = {use.matrix.apply({str.x, str.y}), str.z, str.w};
        return str.w == 1 || str.w == 0 ? Vec3f(str) : Vec3f(str) / str.w;
    }
    /// Side of the pixel on the texture, as a share of the texture's side.
    float spread(std::size_t channel, const TextureUse& use) const {
        if (footprint <= 0) return 0;
        // What is generated, and directions, have no stretch that the corners could tell.
        const TexCoords* own = coordsOf(channel);
        if (own && own->generator != TexCoords::Generator::none) return 0;
        if (!use.texture && !isFlat(use) && (!own || !own->authored || use.generated || use.space->isCube())) return 0;
        const float size = sizeInPicture(channel, use.texture != nullptr);
        if (!(size > 0)) return 0;
        const float stretch =
            use.matrix3 ? std::cbrt(std::abs(glm::determinant(glm::mat3(*use.matrix3)))) : use.matrix.stretch();
        return footprint * size * stretch;
    }
    /// LastStretch::value of the triangle that was hit.
    float sizeInPicture(std::size_t channel, bool flat) const {
        if (last && last->triangle == hit.triangle && last->channel == channel && last->flat == flat)
            return last->value;
        const Mesh& mesh = *instance.mesh;
        const MeshAttribute* values = channel < mesh.texCoords.size() && mesh.texCoords[channel].values.present()
                                          ? &mesh.texCoords[channel].values
                                          : nullptr;
        Vec3f st[3], p[3];
        const float corners[3][2] = {{0, 0}, {1, 0}, {0, 1}};
        const glm::mat3 rayFromLocal(instance.rayFromLocal);
        for (std::uint32_t c = 0; c < 3; ++c) {
            const Vec4f value = values ? values->value(hit.triangle, c)
                                       : mesh.texCoord(hit.triangle, corners[c][0], corners[c][1], channel);
            st[c] = {value.x, value.y, flat ? 0 : value.z};
            p[c] = rayFromLocal * mesh.vertex(hit.triangle, c);
        }
        const float textureArea = glm::length(glm::cross(st[1] - st[0], st[2] - st[0]));
        const float worldArea = glm::length(glm::cross(p[1] - p[0], p[2] - p[0]));
        const float size = worldArea > 0 && textureArea > 0 ? std::sqrt(textureArea / worldArea) : 0;
        if (last) *last = {hit.triangle, channel, flat, size};
        return size;
    }
    Vec4f sample(const TextureUse& use, std::size_t channel, float width) const {
        const Vec3f str = coordinates(channel, use);
        if (use.texture) [[likely]]
            return use.texture->sample(str.x, str.y, width, use.access, space);
        const SpaceTexture* solid = use.space ? use.space.get() : scene->generatedCube(use.generated->node);
        return solid ? solid->sample(str, width, use.access, space) : Vec4f(1);
    }
    Vec4f sample(const Material& material, TextureRole role) const {
        const TextureUse& use = material.texture(role);
        const std::size_t channel = channelOf(role);
        return sample(use, channel, spread(channel, use));
    }
};

/// What a file's number does as a share: the colours of a mesh and what stages of textures make of them may be any.
/// More than one, or less than nothing, would let rays multiply without end; what is no number is opaque.
float share(float number) {
    return number < 1 ? std::max(number, 0.0f) : 1;
}

/// What a MultiTexture makes of a colour and of the material's alpha, `opacity`, with which its first stage begins
/// (18.4.3).
Vec4f applyStages(const TextureLookup& look, const Material& material, const Vec3f& base, const Vec3f& specular,
                  float opacity) {
    using S = TextureStage::Source;
    const Vec4f diffuse(base, opacity);
    Vec4f current = diffuse, factor = material.factor;
    if (look.space == ColorSpace::linear) factor = Vec4f(linearFromSrgb(Vec3f(factor)), factor.a);
    const std::vector<TexCoords>& channels = look.instance.mesh->texCoords;
    for (std::size_t i = 0; i < material.stages.size(); ++i) {
        const TextureStage& stage = material.stages[i];
        const std::size_t channel = channels.empty() ? i : std::min(i, channels.size() - 1);
        const Vec4f texel = look.sample(stage.use, channel, 0);
        const Vec4f with = stage.source == S::diffuse    ? diffuse
                           : stage.source == S::specular ? Vec4f(specular, opacity)
                           : stage.source == S::factor   ? factor
                                                         : current;
        current = combine(stage, texel, with, current, opacity, material.factor.a);
    }
    return current;
}

/// Where (s, t) of a normal texture run, in ray space and across `normal`, by the mesh's Tangent. False where that has
/// no direction.
bool tangentFrame(const TextureLookup& look, const Vec3f& normal, bool isBack, Vec3f& s, Vec3f& t) {
    const Vec4f given = look.instance.mesh->tangents.interpolate(look.hit.triangle, look.hit.u, look.hit.v);
    s = glm::mat3(look.instance.rayFromLocal) * Vec3f(given);
    s -= glm::dot(s, normal) * normal;
    const float length = glm::length(s);
    if (!(length > 0) || !std::isfinite(length)) return false;
    s /= length;
    // Their cross product belongs to the front and to the mesh's own frame: what mirrors the mesh mirrors it, and seen
    // from behind, where the normal is turned about, it lies where it did.
    t = glm::cross(normal, s);
    if ((given.w < 0) != ((look.instance.sign < 0) != isBack)) t = -t;
    return true;
}

Vec3f mappedNormal(const TextureLookup& look, const Material& material, const Vec3f& normal, bool isBack) {
    const Vec4f texel = look.sample(material, TextureRole::normal);
    const Vec3f local((2 * texel.r - 1) * material.normalScale, (2 * texel.g - 1) * material.normalScale,
                      2 * texel.b - 1);
    const auto mapped = [&](const Vec3f& s, const Vec3f& t) {
        const Vec3f to = s * local.x + t * local.y + normal * local.z;
        const float length = glm::length(to);
        return length > 0 ? to / length : normal;
    };
    Vec3f dPds, dPdt;
    if (look.instance.mesh->tangents.present() && tangentFrame(look, normal, isBack, dPds, dPdt))
        return mapped(dPds, dPdt);
    const std::uint8_t channel = look.slot.channels[static_cast<std::size_t>(TextureRole::normal)];
    if (!textureTangents(*look.instance.mesh, look.hit.triangle, channel, dPds, dPdt)) return normal;
    Vec3f t = glm::mat3(look.instance.rayFromLocal) * dPds;
    Vec3f b = glm::mat3(look.instance.rayFromLocal) * dPdt;
    t -= glm::dot(t, normal) * normal;
    b -= glm::dot(b, normal) * normal;
    const float tl = glm::length(t), bl = glm::length(b);
    if (!(tl > 0) || !(bl > 0)) return normal;
    return mapped(t / tl, b / bl);
}

/// The whole alpha that a MultiTexture made, as a share that the textures cover of the material's opacity: what is less
/// than that was cut out by textures, what is more is the opacity itself. Where nothing has an alpha its formulas make
/// none, as browsers have it: SUBTRACT of two opaque textures would be clear.
void splitAlpha(const Material& material, float made, float& coverage, float& opacity) {
    if (opacity >= 1 && !material.stagesHaveAlpha()) return;
    if (made < opacity) {
        coverage = made / opacity;
    } else {
        coverage = 1;
        opacity = made;
    }
}

/// `opacity`: the material's, or what the colours of a mesh have in its place (11.2.2).
float coverageOf(const Material& material, float textureAlpha, float opacity) {
    switch (material.alphaMode) {
        case AlphaMode::opaque:
            return 1;
        case AlphaMode::mask:
            return textureAlpha * opacity < material.alphaCutoff ? 0.0f : 1.0f;
        case AlphaMode::automatic:
        case AlphaMode::blend:
            break;
    }
    return share(textureAlpha);
}

float opacityOf(const Material& material, float opacity) {
    return material.alphaMode == AlphaMode::opaque || material.alphaMode == AlphaMode::mask ? 1.0f : share(opacity);
}

/// Where in the picture a place is seen, in pixels from its middle.
Vec2f pixelOf(const TraceScene& scene, const Vec3f& place) {
    const Vec3f from = place - scene.eye;
    const float depth = glm::dot(from, scene.forward);
    const float size = scene.pixelSize > 0 ? scene.pixelSize : scene.pixelSpread * std::max(std::abs(depth), 1e-20f);
    return Vec2f(glm::dot(from, scene.right), glm::dot(from, scene.up)) / size;
}

void hatch(const TextureLookup& look, const Material& material, SurfacePacket& out, int lane) {
    if (!material.hatching.isLine(pixelOf(*look.scene, look.position))) {
        if (!material.hatching.filled) out.coverage[lane] = 0, out.special |= 1u << lane;
        return;
    }
    const bool linear = look.space == ColorSpace::linear;
    const Vec3f color = linear ? linearFromSrgb(material.hatching.color) : material.hatching.color;
    out.base.set(lane, material.model == ShadingModel::unlit ? color : Vec3f(0));
    out.specular.set(lane, Vec3f(0)), out.ambient.set(lane, Vec3f(0));
    out.emissive.set(lane, color);
    out.coverage[lane] = out.opacity[lane] = 1;
}

/// Colour, textures and maps of one lane whose material is more than plain numbers.
void applyDetail(const TextureLookup& look, const Material& material, SurfacePacket& out, int lane) {
    const Mesh& mesh = *look.instance.mesh;
    Vec3f base = out.base.get(lane), specular = out.specular.get(lane), emissive = out.emissive.get(lane);
    Vec3f ambientBase = base;
    float opacity = material.opacity, alpha = 1, ambient = material.ambient;
    if (mesh.colors.present()) {
        // 11.2.2: the colour stands in for the main colour, its alpha (if it has one) for the transparency.
        const ColorRGBA color = mesh.color(look.hit.triangle, look.hit.u, look.hit.v);
        base = {color.r, color.g, color.b};
        // As the colour of the material that it stands in for.
        if (look.space == ColorSpace::linear && material.model != ShadingModel::physical) base = linearFromSrgb(base);
        ambientBase = base;
        if (mesh.colors.components() == 4) opacity = color.a;
    }
    if (material.texture(TextureRole::base)) {
        const Vec4f texel = look.sample(material, TextureRole::base);
        base *= Vec3f(texel);
        alpha = texel.a;
        ambientBase = base;
    }
    if (!material.stages.empty()) {
        opacity = share(opacity);
        const Vec4f made = applyStages(look, material, base, specular, opacity);
        base = ambientBase = Vec3f(made);
        splitAlpha(material, made.a, alpha, opacity);
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
    if (material.texture(TextureRole::occlusion)) {
        out.occlusion[lane] = 1 + material.occlusionStrength * (look.sample(material, TextureRole::occlusion).r - 1);
        ambient *= out.occlusion[lane];
    }
    if (material.texture(TextureRole::normal))
        out.normal.set(lane, mappedNormal(look, material, out.normal.get(lane), (out.back >> lane & 1u) != 0));
    out.base.set(lane, base);
    out.specular.set(lane, specular);
    out.emissive.set(lane, emissive);
    out.ambient.set(lane, ambientBase * ambient);
    out.coverage[lane] = coverageOf(material, alpha, opacity);
    out.opacity[lane] = opacityOf(material, opacity);
    if (material.hatching.present) hatch(look, material, out, lane);
}

const SlotShading& slotOf(const TraceScene& scene, std::uint32_t id) {
    static const SlotShading unknown;
    return id < scene.slots.size() ? scene.slots[id] : unknown;
}

/// What the lanes of one instance have in common.
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
        slot = &slotOf(scene, which);
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
    for (int lane = 0; lane < 16; ++lane) lanes |= static_cast<std::uint32_t>(s.hits.instance[lane] == id) << lane;
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

/// Lines and points have the colour that their material shines with, or their own, and nothing else of it (12.2.4,
/// 17.2.2.3). `lanes` are all of one instance.
void fetchStrokes(const TraceScene& scene, const Common& common, std::uint32_t lanes, SurfacePacket& out) {
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

/// `lanes` are all of one instance.
void fetchMaterial(const TraceScene& scene, const Common& common, std::uint32_t lanes, const PathTask* tasks,
                   SurfacePacket& out) {
    const MaterialEntry& entry = *common.entry;
    const Material& front = entry.material;
    if (lanes == out.mask && !front.back) {
        fillAll(front, scene.space, out);
    } else {
        for (std::uint32_t rest = lanes; rest; rest &= rest - 1) {
            const int lane = std::countr_zero(rest);
            fillLane((out.back >> lane & 1u) && front.back ? *front.back : front, scene.space, lane, out);
        }
    }
    if (lanes == out.mask)
        std::fill(std::begin(out.lights), std::end(out.lights), common.slot->lights);
    else
        for (std::uint32_t rest = lanes; rest; rest &= rest - 1)
            out.lights[std::countr_zero(rest)] = common.slot->lights;
    if (entry.mirrors || entry.transmits || common.alphaColored) out.special |= lanes;
    if (entry.textured || common.colored) {
        out.filled = nullptr;
        LastStretch last;
        for (std::uint32_t rest = lanes; rest; rest &= rest - 1) {
            const int lane = std::countr_zero(rest);
            const Hit hit = out.hit(lane);
            if (out.caps >> lane & 1u) continue;  // the inside has the material's own colours
            const float run = (tasks ? tasks[lane].travelled : 0) + hit.t;
            const float cosine = std::max(std::abs(glm::dot(out.view.get(lane), hit.normal)), 0.05f);
            const float footprint = scene.sampleWidth(run) / std::sqrt(cosine);
            const ColorSpace space = out.linear >> lane & 1u ? ColorSpace::linear : ColorSpace::display;
            applyDetail({*common.instance, *common.slot, hit, footprint, space, &scene, out.position.get(lane),
                         out.normal.get(lane), &last},
                        *out.material[lane], out, lane);
        }
    }
    // As isBackOfSolid().
    if (common.mesh->solid && front.refractiveIndex == 0) {
        const std::uint32_t culled = lanes & out.back;
        out.special |= culled;
        if (culled) out.filled = nullptr;
        for (std::uint32_t rest = culled; rest; rest &= rest - 1) out.coverage[std::countr_zero(rest)] = 0;
    }
}

/// Fronts of solids in the place of backs that rays met.
void turnToFronts(const TraceScene& scene, const RayPacket16& rays, SurfacePacket& out) {
    std::uint32_t behind = 0;
    for (int at = 0; at < 16; at += 8) {
        const PacketHits16& hits = out.hits;
        const F8 along = load(rays.directionX + at) * load(hits.normalX + at) +
                         load(rays.directionY + at) * load(hits.normalY + at) +
                         load(rays.directionZ + at) * load(hits.normalZ + at);
        behind |= laneBits(along > 0.0f) << at;
    }
    for (std::uint32_t rest = behind & out.mask & ~out.caps; rest; rest &= rest - 1) {
        const int lane = std::countr_zero(rest);
        const Hit met = scene.world->hit(rays, lane);
        const Hit front = frontOf(scene, *scene.world, rays.ray(lane), met);
        if (front.instance == met.instance && front.triangle == met.triangle) continue;
        out.oneInstance &= front.instance == met.instance;
        out.hits.instance[lane] = front.instance, out.hits.triangle[lane] = front.triangle;
        out.hits.u[lane] = front.u, out.hits.v[lane] = front.v;
        out.hits.normalX[lane] = front.normal.x, out.hits.normalY[lane] = front.normal.y;
        out.hits.normalZ[lane] = front.normal.z;
    }
}

}  // namespace

bool isBackOfSolid(const TraceScene& scene, const Hit& hit, const Vec3f& direction) {
    return scene.world->instance(hit.instance).mesh->solid && !hit.isCap() && glm::dot(direction, hit.normal) > 0 &&
           scene.materials[slotOf(scene, hit.instance).material].material.refractiveIndex == 0;
}

Hit frontOf(const TraceScene& scene, const RayView& world, const Ray& ray, const Hit& hit, RayKind kind) {
    if (!isBackOfSolid(scene, hit, ray.direction)) return hit;
    if (scene.coincident && !scene.coincident->mayHide(*scene.world, hit)) return hit;
    const Hit front = world.frontInPlace(ray, hit, kind);
    return front ? front : hit;
}

void fetchSurfaces(const TraceScene& scene, const RayPacket16& rays, std::uint32_t mask, const PathTask* tasks,
                   SurfacePacket& out) {
    out.oneInstance = scene.world->hits(rays, mask, out.hits);
    out.mask = mask;
    out.fromEye = !tasks;
    out.special = out.unlit = out.physical = out.shiny = out.linear = out.caps = 0;
    if (scene.filter && scene.filter->makesCaps()) [[unlikely]]
        for (int lane = 0; lane < 16; ++lane)
            if ((mask >> lane & 1u) && out.hits.triangle[lane] == kCap) out.caps |= 1u << lane;
    out.pointsFound = false;
    turnToFronts(scene, rays, out);
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
            fetchStrokes(scene, common, lanes, out);
        else
            fetchMaterial(scene, common, lanes, tasks, out);
        rest &= ~lanes;
    }
    if (!scene.energyLimited) return;
    out.filled = nullptr;
    for (int at = 0; at < 16; at += 8) {
        const V8 base = loadV(out.base, at), most{min(base.x, all(1)), min(base.y, all(1)), min(base.z, all(1))};
        storeV(out.base, at, select(lanesFrom(out.unlit, at), base, most));
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
        const Vec3f back = s.view.get(lane);
        const Ray ray{s.position.get(lane) + s.distance[lane] * back, 0, -back};
        const HitPoint point = scene.world->point(s.hit(lane), ray);
        s.exact.set(lane, point.position);
        s.error.set(lane, point.error);
    }
}

bool letsThrough(const TraceScene& scene, std::uint32_t instance) {
    if (scene.materials[slotOf(scene, instance).material].transmits) return true;
    const Mesh& mesh = *scene.world->instance(instance).mesh;
    return mesh.colors.present() && mesh.colors.components() == 4;
}

namespace {

/// `alpha`: of textures.
Vec3f throughPlain(const Material& material, float alpha, float opacity) {
    const float coverage = coverageOf(material, alpha, opacity);
    Vec3f through = coverage * (1 - opacityOf(material, opacity)) * (Vec3f(1) - material.reflectivity);
    // Two boundaries of a dielectric reflect some of what passes; the bending is not followed.
    if (material.refractiveIndex > 0) through *= 1 - fresnelDielectric(1, material.refractiveIndex).mean();
    return Vec3f(1 - coverage) + through;
}

}  // namespace

Vec3f straightTransmittance(const TraceScene& scene, const Hit& hit, const Vec3f& direction) {
    const SlotShading& slot = slotOf(scene, hit.instance);
    const MaterialEntry& entry = scene.materials[slot.material];
    const RayInstance& instance = scene.world->instance(hit.instance);
    const Mesh& mesh = *instance.mesh;
    const bool colored = mesh.colors.present() && mesh.colors.components() == 4;
    if (!letsThrough(scene, hit.instance)) return Vec3f(0);
    if (hit.isCap()) return throughPlain(entry.material, 1, entry.material.opacity);
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
    if (material.texture(TextureRole::base))
        alpha = TextureLookup{instance,  slot, hit, 0, ColorSpace::linear, &scene, scene.world->point(hit).position,
                              hit.normal}
                    .sample(material, TextureRole::base)
                    .a;
    if (!material.stages.empty()) {
        opacity = share(opacity);
        const TextureLookup look{instance,  slot, hit, 0, ColorSpace::linear, &scene, scene.world->point(hit).position,
                                 hit.normal};
        const float made = applyStages(look, material, material.linear.base, material.linear.specular, opacity).a;
        splitAlpha(material, made, alpha, opacity);
    }
    return throughPlain(material, alpha, opacity);
}

Vec3f emitted(const TraceScene& scene, const Hit& hit, bool behind, float footprint) {
    const SlotShading& slot = slotOf(scene, hit.instance);
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
