// Writes each material as an Appearance, and each texture once.
#include "gltf_material.h"

namespace rtsg::detail {

using nlohmann::json;

void GltfMaterials::writeAppearance(const json* material) {
    GltfNode appearance(out_, "Appearance", "appearance");
    static const json kEmpty = json::object();
    const json& it = material ? *material : kEmpty;
    const std::string mode = GltfFile::text(it, "alphaMode");
    appearance.set("alphaMode", String(mode.empty() ? "OPAQUE" : mode));
    if (mode == "MASK") appearance.set("alphaCutoff", static_cast<float>(GltfFile::number(it, "alphaCutoff", .5)));
    const json& metal = GltfFile::object(it, "pbrMetallicRoughness");
    const auto base = GltfFile::numbers(metal, "baseColorFactor", 4).value_or(std::vector<double>{1, 1, 1, 1});
    const Color color{static_cast<float>(base[0]), static_cast<float>(base[1]), static_cast<float>(base[2])};
    const auto transparency = static_cast<float>(1 - base[3]);
    const bool unlit = GltfFile::object(it, "extensions").contains("KHR_materials_unlit");
    GltfNode out(out_, unlit ? "UnlitMaterial" : "PhysicalMaterial", "material");
    out.set(unlit ? "emissiveColor" : "baseColor", color);
    if (transparency > 0) out.set("transparency", transparency);
    if (unlit) return writeTexture(GltfFile::object(metal, "baseColorTexture"), "emissiveTexture");
    out.set("metallic", static_cast<float>(GltfFile::number(metal, "metallicFactor", 1)));
    out.set("roughness", static_cast<float>(GltfFile::number(metal, "roughnessFactor", 1)));
    if (const auto e = GltfFile::numbers(it, "emissiveFactor", 3)) {
        const double strength =
            GltfFile::number(GltfFile::object(GltfFile::object(it, "extensions"), "KHR_materials_emissive_strength"),
                             "emissiveStrength", 1);
        const Vec3f c = vectorOf({(*e)[0] * strength, (*e)[1] * strength, (*e)[2] * strength});
        out.set("emissiveColor", Color{c.x, c.y, c.z});
    }
    const json& normal = GltfFile::object(it, "normalTexture");
    const json& occlusion = GltfFile::object(it, "occlusionTexture");
    if (normal.contains("scale")) out.set("normalScale", static_cast<float>(GltfFile::number(normal, "scale", 1)));
    if (occlusion.contains("strength"))
        out.set("occlusionStrength", static_cast<float>(GltfFile::number(occlusion, "strength", 1)));
    writeTexture(GltfFile::object(metal, "baseColorTexture"), "baseTexture");
    writeTexture(GltfFile::object(metal, "metallicRoughnessTexture"), "metallicRoughnessTexture");
    writeTexture(GltfFile::object(it, "emissiveTexture"), "emissiveTexture");
    writeTexture(normal, "normalTexture");
    writeTexture(occlusion, "occlusionTexture");
}
void GltfMaterials::writeTexture(const json& reference, const char* field) {
    const auto index = GltfFile::index(reference, "index");
    if (!index) return;
    if (GltfFile::index(reference, "texCoord").value_or(0) != 0)
        file_.warn("a texture of the glTF file asks for a second set of coordinates; the first is taken");
    if (GltfFile::object(reference, "extensions").contains("KHR_texture_transform"))
        file_.warn("transforms of textures of the glTF file are not imported");
    const std::string def = "texture" + std::to_string(*index);
    if (textureGiven_.contains(*index)) return out_.useNode(def, field, {});
    const json* texture = file_.item("textures", *index);
    auto source = texture ? GltfFile::index(*texture, "source") : std::nullopt;
    // A KTX2 file alone: whoever shows it says whether its pixels are read.
    if (texture && !source)
        source =
            GltfFile::index(GltfFile::object(GltfFile::object(*texture, "extensions"), "KHR_texture_basisu"), "source");
    const json* image = texture ? file_.item("images", source.value_or(kNoIndex)) : nullptr;
    if (!image) return file_.warn("a texture of the glTF file has no picture; it is left out");
    std::string url = GltfFile::text(*image, "uri");
    if (url.empty()) {
        const std::string_view bytes = file_.bufferView(GltfFile::index(*image, "bufferView").value_or(kNoIndex));
        const std::string type = GltfFile::text(*image, "mimeType");
        url = "data:" + (type.empty() ? std::string("image/png") : type) + ";base64," + toBase64(bytes);
    }
    textureGiven_.insert(*index);
    GltfNode out(out_, "ImageTexture", field, def);
    const json* sampler = file_.item("samplers", GltfFile::index(*texture, "sampler").value_or(kNoIndex));
    constexpr std::size_t clamp = 33071;
    if (sampler && GltfFile::index(*sampler, "wrapS") == clamp) out.set("repeatS", false);
    if (sampler && GltfFile::index(*sampler, "wrapT") == clamp) out.set("repeatT", false);
    out.set("url", Array<String>{String(url)});
}

}  // namespace rtsg::detail
