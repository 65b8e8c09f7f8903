// Writes each material as an Appearance, and each texture once.
#include "gltf_material.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include <rtsg/core/never_destroyed.h>
#include <rtsg/core/portable_math.h>
#include <rtsg/core/web_address.h>

#include "gltf_looks.h"

namespace rtsg::detail {

using nlohmann::json;

namespace {

const json& glossTexture(const json& material) {
    return GltfFile::object(GltfFile::extension(material, "KHR_materials_pbrSpecularGlossiness"), "diffuseTexture");
}

struct TextureReference {
    const json& reference;
    const char* field;  // of the material
};
std::vector<TextureReference> texturesOf(const json& material) {
    const json& metal = GltfFile::object(material, "pbrMetallicRoughness");
    const json& base = glossOf(material) ? glossTexture(material) : GltfFile::object(metal, "baseColorTexture");
    if (GltfMaterials::isUnlit(material)) return {{base, "emissiveTexture"}};
    return {{base, "baseTexture"},
            {GltfFile::object(metal, "metallicRoughnessTexture"), "metallicRoughnessTexture"},
            {GltfFile::object(material, "emissiveTexture"), "emissiveTexture"},
            {GltfFile::object(material, "normalTexture"), "normalTexture"},
            {GltfFile::object(material, "occlusionTexture"), "occlusionTexture"}};
}

GltfLookup lookupOf(const json& reference) {
    const json& moved = GltfFile::extension(reference, "KHR_texture_transform");
    GltfLookup result;
    result.set = GltfFile::index(moved, "texCoord").value_or(GltfFile::index(reference, "texCoord").value_or(0));
    result.rotation = GltfFile::number(moved, "rotation", 0);
    if (const auto offset = GltfFile::numbers(moved, "offset", 2)) result.offset = {(*offset)[0], (*offset)[1]};
    if (const auto scale = GltfFile::numbers(moved, "scale", 2)) result.scale = {(*scale)[0], (*scale)[1]};
    return result;
}

/// The map of a texture lookup on (s, t) = (u, 1 - v): the images of (1, 0) and (0, 1), and of the origin.
struct Moved {
    Vec2d s, t, origin;
    explicit Moved(const GltfLookup& by) {
        const double c = portable::cos(by.rotation), n = portable::sin(by.rotation);
        s = {c * by.scale.x, n * by.scale.x};
        t = {-n * by.scale.y, c * by.scale.y};
        origin = {by.offset.x + n * by.scale.y, 1 - by.offset.y - c * by.scale.y};
    }
};

void writeTransform(DocumentHandler& out, const GltfMapping& mapping, const char* field) {
    const GltfLookup& by = mapping.lookup;
    const Moved moved(by);
    const bool rotatesFirst = by.rotation == 0 || by.scale.x == by.scale.y;
    if (!rotatesFirst || by.scale.x == 0 || by.scale.y == 0) {
        // A TextureTransform scales last.
        GltfNode node(out, "TextureTransformMatrix3D", field);
        Matrix4f matrix{};
        const Vec2d rows[] = {moved.s, moved.t, {0, 0}, moved.origin};
        for (std::size_t r = 0; r < 4; ++r) {
            matrix.elements[4 * r] = static_cast<float>(rows[r].x);
            matrix.elements[4 * r + 1] = static_cast<float>(rows[r].y);
        }
        matrix.elements[10] = matrix.elements[15] = 1;
        node.set("mapping", String(mapping.name)).set("matrix", matrix);
        return;
    }
    // It moves first: the origin goes to where the rest takes it.
    const double c = portable::cos(by.rotation), n = portable::sin(by.rotation);
    const Vec2d translation{(c * moved.origin.x + n * moved.origin.y) / by.scale.x,
                            (-n * moved.origin.x + c * moved.origin.y) / by.scale.y};
    GltfNode node(out, "TextureTransform", field);
    node.set("mapping", String(mapping.name));
    if (by.rotation != 0) node.set("rotation", static_cast<float>(by.rotation));
    if (by.scale != Vec2d(1)) node.set("scale", Vec2f(by.scale));
    if (translation != Vec2d(0)) node.set("translation", Vec2f(translation));
}

/// Repetition that mirrors, and pixels that are seen as squares, take TextureProperties.
void writeSampler(DocumentHandler& out, const json& sampler, GltfNode& texture) {
    constexpr std::size_t clamp = 33071, mirror = 33648, nearest = 9728, nearestOfNearest = 9984, nearestOfTwo = 9986;
    const std::size_t s = GltfFile::index(sampler, "wrapS").value_or(0),
                      t = GltfFile::index(sampler, "wrapT").value_or(0);
    const std::size_t close = GltfFile::index(sampler, "magFilter").value_or(0);
    const std::size_t far = GltfFile::index(sampler, "minFilter").value_or(0);
    const char* small = far == nearest            ? "NEAREST_PIXEL"
                        : far == nearestOfNearest ? "NEAREST_PIXEL_NEAREST_MIPMAP"
                        : far == nearestOfTwo     ? "NEAREST_PIXEL_AVG_MIPMAP"
                                                  : nullptr;
    if (s == clamp) texture.set("repeatS", false);
    if (t == clamp) texture.set("repeatT", false);
    if (s != mirror && t != mirror && close != nearest && !small) return;
    GltfNode properties(out, "TextureProperties", "textureProperties");
    const auto wrap = [](std::size_t how) {
        return String(how == clamp ? "CLAMP_TO_EDGE" : how == mirror ? "MIRRORED_REPEAT" : "REPEAT");
    };
    properties.set("boundaryModeS", wrap(s)).set("boundaryModeT", wrap(t));
    if (close == nearest) properties.set("magnificationFilter", String("NEAREST_PIXEL"));
    if (small) properties.set("minificationFilter", String(small)).set("generateMipMaps", far != nearest);
}

}  // namespace

GltfMaterials::GltfMaterials(GltfFile& file, DocumentHandler& out, GltfNames& names)
    : file_(file), out_(out), names_(names), depths_(depthsOf(file)) {}

bool GltfMaterials::isUnlit(const json& material) {
    return GltfFile::object(material, "extensions").contains("KHR_materials_unlit");
}

std::vector<GltfMapping> GltfMaterials::mappingsOf(const json* material) {
    std::vector<GltfMapping> result;
    if (!material) return result;
    for (const TextureReference& texture : texturesOf(*material)) {
        if (!GltfFile::index(texture.reference, "index")) continue;
        const GltfLookup lookup = lookupOf(texture.reference);
        if (std::ranges::find(result, lookup, &GltfMapping::lookup) != result.end()) continue;
        std::string name = "TEXCOORD_" + std::to_string(lookup.set);
        if (lookup.moves()) name += "_moved" + std::to_string(result.size());
        result.push_back({lookup, std::move(name)});
    }
    if (result.size() == 1 && result.front().lookup == GltfLookup()) result.clear();
    return result;
}

void GltfMaterials::writeTransforms(const std::vector<GltfMapping>& mappings) {
    if (std::ranges::none_of(mappings, [](const GltfMapping& m) { return m.lookup.moves(); })) return;
    if (mappings.size() == 1) return writeTransform(out_, mappings.front(), "textureTransform");
    const GltfNode all(out_, "MultiTextureTransform", "textureTransform");
    // Writes transforms that do not move anything as well: a texture without a transform of its name would take the
    // first one.
    for (const GltfMapping& mapping : mappings) writeTransform(out_, mapping, "textureTransform");
}

ColorRGBA GltfMaterials::baseColor(const json* material) {
    if (const auto gloss = material ? glossOf(*material) : std::nullopt) {
        const Vec3f color(gloss->base);
        return {color.x, color.y, color.z, static_cast<float>(gloss->opacity)};
    }
    const json& metal = material ? GltfFile::object(*material, "pbrMetallicRoughness") : json::object();
    const auto base = GltfFile::numbers(metal, "baseColorFactor", 4).value_or(std::vector<double>{1, 1, 1, 1});
    const Vec3f color = vectorOf(base);
    return {color.x, color.y, color.z, static_cast<float>(base[3])};
}

Vec3f GltfMaterials::emission(const json* material) {
    if (!material) return Vec3f(0);
    const auto e = GltfFile::numbers(*material, "emissiveFactor", 3);
    if (!e) return Vec3f(0);
    const double strength =
        GltfFile::number(GltfFile::extension(*material, "KHR_materials_emissive_strength"), "emissiveStrength", 1);
    return vectorOf({(*e)[0] * strength, (*e)[1] * strength, (*e)[2] * strength});
}

void GltfMaterials::writeAppearance(std::size_t number, const json* material, bool strokes) {
    GltfNode appearance(out_, "Appearance", "appearance");
    static const json& kEmpty = neverDestroyed([] { return json::object(); });
    const json& it = material ? *material : kEmpty;
    const bool unlit = isUnlit(it);
    const GltfOptics optics =
        unlit || strokes ? GltfOptics() : opticsOf(it, number < depths_.size() ? depths_[number] : 0);
    // Glass is there wholly, and lets light through; X3D's OPAQUE would let none.
    const std::string mode = optics.passes() ? "BLEND" : GltfFile::text(it, "alphaMode");
    appearance.set("alphaMode", String(mode.empty() ? "OPAQUE" : mode));
    if (mode == "MASK") appearance.set("alphaCutoff", static_cast<float>(GltfFile::number(it, "alphaCutoff", .5)));
    std::string def = material ? names_.authored(GltfNames::List::materials, number) : std::string();
    if (strokes) {
        // The same material may be lit elsewhere: there it has its name.
        if (!def.empty() && strokeMaterials_.contains(number))
            return out_.useNode(strokeMaterials_[number], "material", {});
        if (!def.empty()) def = strokeMaterials_[number] = names_.take(def + "_unlit");
        GltfNode out(out_, "UnlitMaterial", "material", def);
        return writeStrokes(material, out);
    }
    const std::vector<GltfMapping> mappings = mappingsOf(material);
    writeTransforms(mappings);
    if (!def.empty() && !materialGiven_.insert(number).second) return out_.useNode(def, "material", {});
    const ColorRGBA base = baseColor(material);
    GltfNode out(out_, unlit ? "UnlitMaterial" : "PhysicalMaterial", "material", def);
    const Vec3f color = unlit ? file_.shown({base.r, base.g, base.b}) : Vec3f(base.r, base.g, base.b);
    out.set(unlit ? "emissiveColor" : "baseColor", Color{color.x, color.y, color.z});
    const auto passing = static_cast<float>(optics.transmission);
    if (base.a < 1 || optics.passes()) out.set("transparency", std::max(1 - base.a, passing));
    if (!unlit) {
        writePhysical(it, out);
        writeOptics(out_, optics);
        if (!file_.isCreatedHere()) reportLooks(file_, it);
    }
    for (const TextureReference& texture : texturesOf(it))
        writeTexture(texture.reference, texture.field, mappings, out);
}

/// glTF 2.0, 3.9.6 (Point and Line Materials): the sum of base colour and emission.
void GltfMaterials::writeStrokes(const json* material, GltfNode& out) const {
    const ColorRGBA base = baseColor(material);
    const Vec3f sum =
        file_.shown(Vec3f(base.r, base.g, base.b) + (material && isUnlit(*material) ? Vec3f(0) : emission(material)));
    out.set("emissiveColor", Color{sum.x, sum.y, sum.z});
    if (base.a < 1) out.set("transparency", 1 - base.a);
}

void GltfMaterials::writePhysical(const json& material, GltfNode& out) {
    const json& metal = GltfFile::object(material, "pbrMetallicRoughness");
    const auto gloss = glossOf(material);
    const double metallic = gloss ? gloss->metallic : GltfFile::number(metal, "metallicFactor", 1);
    const double roughness = gloss ? gloss->roughness : GltfFile::number(metal, "roughnessFactor", 1);
    out.set("metallic", static_cast<float>(metallic)).set("roughness", static_cast<float>(roughness));
    if (material.contains("emissiveFactor")) {
        const Vec3f c = emission(&material);
        out.set("emissiveColor", Color{c.x, c.y, c.z});
    }
    const json& normal = GltfFile::object(material, "normalTexture");
    const json& occlusion = GltfFile::object(material, "occlusionTexture");
    if (normal.contains("scale")) out.set("normalScale", static_cast<float>(GltfFile::number(normal, "scale", 1)));
    if (occlusion.contains("strength"))
        out.set("occlusionStrength", static_cast<float>(GltfFile::number(occlusion, "strength", 1)));
}

void GltfMaterials::writeTexture(const json& reference, const std::string& field,
                                 const std::vector<GltfMapping>& mappings, GltfNode& material) {
    const auto index = GltfFile::index(reference, "index");
    if (!index) return;
    const auto mapping = std::ranges::find(mappings, lookupOf(reference), &GltfMapping::lookup);
    if (mapping != mappings.end()) material.set(field + "Mapping", String(mapping->name));
    const json* texture = file_.item("textures", *index);
    if (!texture) return;  // which has been told
    const std::string& def = names_.of(GltfNames::List::textures, *index);
    if (textureGiven_.contains(*index)) return out_.useNode(def, field, {});
    auto source = GltfFile::index(*texture, "source");
    // There is only a file of another format: the renderer reports if it cannot read its pixels.
    for (const char* other : {"EXT_texture_webp", "KHR_texture_basisu"})
        if (!source)
            source = GltfFile::index(GltfFile::object(GltfFile::object(*texture, "extensions"), other), "source");
    const json* image = file_.item("images", source.value_or(kNoIndex));
    if (!image) {
        if (!source) file_.warn("a texture of the glTF file has no picture; it is left out");
        return;
    }
    std::string url = GltfFile::text(*image, "uri");
    if (url.empty()) {
        const auto view = GltfFile::index(*image, "bufferView");
        if (!view) return file_.fault(fmt::format("image {} of the glTF file has neither uri nor bufferView", *source));
        const std::string_view bytes = file_.bufferView(*view);
        if (bytes.empty()) return;  // which has been told
        const std::string type = GltfFile::text(*image, "mimeType");
        if (!file_.mayMake(bytes.size() / 3 * 4)) return;
        url = "data:" + (type.empty() ? std::string("image/png") : type) + ";base64," +
              base64(std::as_bytes(std::span(bytes)));
    }
    textureGiven_.insert(*index);
    GltfNode out(out_, "ImageTexture", field, def);
    const json* sampler = file_.item("samplers", GltfFile::index(*texture, "sampler").value_or(kNoIndex));
    out.set("url", Array<String>{String(url)});
    if (sampler) writeSampler(out_, *sampler, out);  // values come before nodes
}

}  // namespace rtsg::detail
