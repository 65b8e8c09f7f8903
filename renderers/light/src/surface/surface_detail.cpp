// Colours, textures and maps: lane by lane, or for all lanes of a material where only textures are looked up.
#include "surface_detail.h"

#include <array>
#include <bit>
#include <cmath>

#include "lanes.h"
#include "mesh/texture_tangents.h"
#include "texture_lanes.h"

namespace rtsg::trace {

using namespace simd;

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

void splitAlpha(const Material& material, float created, float& coverage, float& opacity) {
    if (opacity >= 1 && !material.stagesHaveAlpha()) return;
    if (created < opacity) {
        coverage = created / opacity;
    } else {
        coverage = 1;
        opacity = created;
    }
}

void findAlpha(const TextureLookup& look, const Material& material, float& alpha, float& opacity) {
    if (material.texture(TextureRole::base)) alpha = look.sample(material, TextureRole::base).a;
    if (material.stages.empty()) return;
    opacity = fraction(opacity);
    const float created = applyStages(look, material, material.linear.base, material.linear.specular, opacity).a;
    splitAlpha(material, created, alpha, opacity);
}

Vec2f pixelOf(const TraceScene& scene, const Vec3f& position) {
    const Vec3f from = position - scene.eye;
    const float depth = glm::dot(from, scene.forward);
    const float size = scene.pixelSize > 0 ? scene.pixelSize : scene.pixelSpread * std::max(std::abs(depth), 1e-20f);
    return Vec2f(glm::dot(from, scene.right), glm::dot(from, scene.up)) / size;
}

namespace {

/// Two directions in a surface and how (s, t) before the texture's transform (r and q too) change along them.
struct Axes {
    std::array<Vec3f, 2> along;  // ray space
    std::array<Vec4f, 2> change;
};

/// The directions of the mesh's Tangent, which are those of its own coordinates, perpendicular to `normal`. False if
/// they have no direction.
bool givenAxes(const TextureLookup& look, const Vec3f& normal, bool isBack, Axes& axes) {
    const Vec4f given = look.instance.mesh->tangents.interpolate(look.hit.triangle, look.hit.u, look.hit.v);
    Vec3f s = glm::mat3(look.instance.rayFromLocal) * Vec3f(given);
    s -= glm::dot(s, normal) * normal;
    const float length = glm::length(s);
    if (!(length > 0) || !std::isfinite(length)) return false;
    s /= length;
    // Their cross product belongs to the front and to the mesh's own frame: what mirrors the mesh mirrors it, and seen
    // from behind, where the normal is turned about, it lies where it did.
    Vec3f t = glm::cross(normal, s);
    if ((given.w < 0) != ((look.instance.sign < 0) != isBack)) t = -t;
    axes = {{s, t}, {Vec4f(1, 0, 0, 0), Vec4f(0, 1, 0, 0)}};
    return true;
}

/// Along the edges of the triangle that was hit.
Axes triangleAxes(const TextureLookup& look, std::size_t channel, const TextureUse& use) {
    const Mesh& mesh = *look.instance.mesh;
    const glm::mat3 rayFromLocal(look.instance.rayFromLocal);
    const Vec3f from = mesh.vertex(look.hit.triangle, 0);
    Axes axes;
    for (std::uint32_t i = 0; i < 2; ++i) axes.along[i] = rayFromLocal * (mesh.vertex(look.hit.triangle, i + 1) - from);
    const TexCoords* own = look.coordsOf(channel);
    if (own && own->generator != TexCoords::Generator::none) {
        // Coordinates that are generated from normals and views are not linear, so their directions come from
        // differences over a part of the triangle. Differences as small as rounding are no direction.
        constexpr float kPart = 1 / 32.0f, kRounding = 1e-6f;
        const float u = look.hit.u, v = look.hit.v;
        const auto across = [&](float du, float dv) {
            const Vec4f difference = look.at(u + du, v + dv).untransformed(channel, use) -
                                     look.at(u - du, v - dv).untransformed(channel, use);
            return glm::length(difference) > kRounding ? difference / (2 * kPart) : Vec4f(0);
        };
        axes.change = {across(kPart, 0), across(0, kPart)};
        return axes;
    }
    TextureLookup corner = look;
    const auto there = [&](float u, float v) {
        corner.hit.u = u, corner.hit.v = v;
        return corner.untransformed(channel, use);
    };
    const Vec4f first = there(0, 0);
    axes.change = {there(1, 0) - first, there(0, 1) - first};
    return axes;
}

/// How the (s, t) that look a texture up change where its coordinates change by `change`, from `here` on.
Vec2f transformedChange(const TextureUse& use, const Vec4f& here, const Vec4f& change) {
    const Vec4f by = use.matrix3 ? *use.matrix3 * change
                                 : Vec4f(use.matrix.s.x * change.x + use.matrix.s.y * change.y,
                                         use.matrix.t.x * change.x + use.matrix.t.y * change.y, change.z, change.w);
    const Vec4f to = TextureLookup::transformed(use, here);
    if (to.w == 0) return Vec2f(by);
    return (Vec2f(by) - Vec2f(to) * (by.w / to.w)) / to.w;
}

/// The unit normal on the viewer's side, as the texel of the normal texture changes it in the tangent space of the (s,
/// t) that look the texture up. `isBack` says whether that side is the back. The normal stays if (s, t) have no
/// direction.
Vec3f mappedNormal(const TextureLookup& look, const Material& material, const Vec4f& texel, const Vec3f& normal,
                   bool isBack) {
    const TextureUse& use = material.texture(TextureRole::normal);
    const std::size_t channel = look.channelOf(TextureRole::normal);
    Axes axes;
    if (!look.instance.mesh->tangents.present() || !givenAxes(look, normal, isBack, axes))
        axes = triangleAxes(look, channel, use);
    const Vec4f here = look.untransformed(channel, use);
    std::array<Vec2f, 2> st;
    for (std::size_t i = 0; i < 2; ++i) st[i] = transformedChange(use, here, axes.change[i]);
    Vec3f s, t;
    if (!textureTangents(axes.along, st, s, t)) return normal;
    s -= glm::dot(s, normal) * normal;
    t -= glm::dot(t, normal) * normal;
    const float sLength = glm::length(s), tLength = glm::length(t);
    if (!(sLength > 0) || !(tLength > 0)) return normal;
    const Vec3f to = s * ((2 * texel.r - 1) * material.normalScale / sLength) +
                     t * ((2 * texel.g - 1) * material.normalScale / tLength) + normal * (2 * texel.b - 1);
    const float length = glm::length(to);
    return length > 0 ? to / length : normal;
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
        // The colour is decoded like that of the material for which it stands.
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
        opacity = fraction(opacity);
        const Vec4f created = applyStages(look, material, base, specular, opacity);
        base = ambientBase = Vec3f(created);
        splitAlpha(material, created.a, alpha, opacity);
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
        out.normal.set(lane, mappedNormal(look, material, look.sample(material, TextureRole::normal),
                                          out.normal.get(lane), (out.back >> lane & 1u) != 0));
    out.base.set(lane, base);
    out.specular.set(lane, specular);
    out.emissive.set(lane, emissive);
    out.ambient.set(lane, ambientBase * ambient);
    out.coverage[lane] = coverageOf(material, alpha, opacity);
    out.opacity[lane] = opacityOf(material, opacity);
    if (material.hatching.present) hatch(look, material, out, lane);
}

/// Whether textures alone are more than the material's plain numbers.
bool hasTexturesOnly(const Material& material, const Mesh& mesh) {
    return material.stages.empty() && !material.hatching.present && !mesh.colors.present();
}

/// Does what applyDetail() does, eight lanes at a time, for a material that has textures only. All of `lanes` have it.
class TexturedLanes {
  public:
    TexturedLanes(TextureLanes& textures, const Material& material, std::uint32_t lanes, SurfacePacket& out)
        : textures_(textures), material_(material), lanes_(lanes), out_(out) {}

    void add() {
        std::copy_n(&out_.base, 1, &ambient_);
        if (look(TextureRole::base)) {
            eachEight([&](int at, I8 use) {
                const V8 base = loadV(out_.base, at) * texels(at);
                put(out_.base, at, use, base), storeV(ambient_, at, base);
            });
            for (std::uint32_t rest = lanes_; rest; rest &= rest - 1) {
                const int lane = std::countr_zero(rest);
                out_.coverage[lane] = coverageOf(material_, texels_.a[lane], material_.opacity);
            }
        }
        if (look(TextureRole::emissive)) multiply(out_.emissive);
        if (look(TextureRole::specular)) multiply(out_.specular);
        if (look(TextureRole::ambient))
            eachEight([&](int at, I8) { storeV(ambient_, at, loadV(ambient_, at) * texels(at)); });
        if (look(TextureRole::shininess)) multiply(out_.exponent, texels_.a);
        if (look(TextureRole::metallicRoughness))
            multiply(out_.roughness, texels_.g), multiply(out_.metallic, texels_.b);
        F8 ambient[2] = {all(material_.ambient), all(material_.ambient)};
        if (look(TextureRole::occlusion))
            eachEight([&](int at, I8 use) {
                const F8 left = 1.0f + material_.occlusionStrength * (load(texels_.r + at) - 1.0f);
                put(out_.occlusion, at, use, left);
                ambient[at / 8] *= left;
            });
        eachEight([&](int at, I8 use) { put(out_.ambient, at, use, loadV(ambient_, at) * ambient[at / 8]); });
    }
    /// Looks up the normal texture; false if there is none.
    bool lookForNormals() { return look(TextureRole::normal); }
    Vec4f texel(int lane) const { return {texels_.r[lane], texels_.g[lane], texels_.b[lane], texels_.a[lane]}; }

  private:
    bool look(TextureRole role) {
        if (!material_.texture(role)) return false;
        textures_.look(material_, role, texels_);
        return true;
    }
    V8 texels(int at) const { return {load(texels_.r + at), load(texels_.g + at), load(texels_.b + at)}; }
    template <class Do>
    void eachEight(const Do& act) const {
        for (int at = 0; at < 16; at += 8)
            if (lanes_ >> at & 0xFFu) act(at, lanesFrom(lanes_, at));
    }
    static void put(float* to, int at, I8 use, F8 v) { store(to + at, select(use, v, load(to + at))); }
    static void put(Lanes3& to, int at, I8 use, const V8& v) { storeV(to, at, select(use, v, loadV(to, at))); }
    void multiply(float* numbers, const float* by) const {
        eachEight([&](int at, I8 use) { put(numbers, at, use, load(numbers + at) * load(by + at)); });
    }
    void multiply(Lanes3& colors) const {
        eachEight([&](int at, I8 use) { put(colors, at, use, loadV(colors, at) * texels(at)); });
    }

    TextureLanes& textures_;
    const Material& material_;
    const std::uint32_t lanes_;
    SurfacePacket& out_;
    TextureLanes::Colors texels_{};
    Lanes3 ambient_;  // what ambient light is multiplied with, but for how much of it there is
};

}  // namespace

void addDetail(const TraceScene& scene, const RayInstance& instance, const SlotShading& slot, const PathTask* tasks,
               std::uint32_t lanes, SurfacePacket& out) {
    lanes &= ~out.caps;  // the inside has the material's own colours
    out.filled = nullptr;
    LastStretch last;
    while (lanes) {
        const int first = std::countr_zero(lanes);
        const Material& material = *out.material[first];
        std::uint32_t alike = 0;
        for (std::uint32_t rest = lanes; rest; rest &= rest - 1) {
            const int lane = std::countr_zero(rest);
            alike |= static_cast<std::uint32_t>(out.material[lane] == &material) << lane;
        }
        lanes &= ~alike;
        const ColorSpace space = out.linear >> first & 1u ? ColorSpace::linear : ColorSpace::display;
        TextureLanes textures(scene, instance, slot, space, tasks, alike, out);
        const auto lookup = [&](int lane) { return textures.lookup(lane, &last); };
        if (!hasTexturesOnly(material, *instance.mesh)) {
            for (std::uint32_t rest = alike; rest; rest &= rest - 1) {
                const int lane = std::countr_zero(rest);
                applyDetail(lookup(lane), material, out, lane);
            }
            continue;
        }
        TexturedLanes lanesOfOne(textures, material, alike, out);
        lanesOfOne.add();
        if (!lanesOfOne.lookForNormals()) continue;
        for (std::uint32_t rest = alike; rest; rest &= rest - 1) {
            const int lane = std::countr_zero(rest);
            out.normal.set(lane, mappedNormal(lookup(lane), material, lanesOfOne.texel(lane), out.normal.get(lane),
                                              (out.back >> lane & 1u) != 0));
        }
    }
}

}  // namespace rtsg::trace
