// Reads glass, panes and coats from the extensions of materials, and reports effects that are left out.
#include "gltf_looks.h"

#include <algorithm>
#include <cmath>

#include <rtsg/core/never_destroyed.h>
#include <rtsg/core/portable_math.h>

namespace rtsg::detail {

using nlohmann::json;

namespace {

constexpr double kIor = 1.5;         // of glTF's dielectrics unless a material says otherwise
constexpr double kCoatsMirror = .3;  // a clear coat of more roughness mirrors no pictures

double mirrored(double ior) {
    const double root = (ior - 1) / (ior + 1);
    return root * root;
}

Vec3d colorOf(const json& object, const char* key, Vec3d otherwise = Vec3d(1)) {
    const auto three = GltfFile::numbers(object, key, 3);
    return three ? Vec3d((*three)[0], (*three)[1], (*three)[2]) : otherwise;
}

/// The absorption per metre of light of which `left` remains after `distance`.
Vec3d absorptionOf(const Vec3d& left, double distance) {
    constexpr double darkest = 1e-4, maximum = 1e5;  // an exponent that is as good as opaque; 1/m
    Vec3d result(0);
    if (!(distance > 0) || !std::isfinite(distance)) return result;
    for (int i = 0; i < 3; ++i)
        result[i] = std::min((0 - portable::log(std::clamp(left[i], darkest, 1.0))) / distance, maximum);
    return result;
}

Vec3d baseFactor(const json& material) {
    const auto four = GltfFile::numbers(GltfFile::object(material, "pbrMetallicRoughness"), "baseColorFactor", 4);
    return four ? Vec3d((*four)[0], (*four)[1], (*four)[2]) : Vec3d(1);
}

}  // namespace

GltfOptics opticsOf(const json& material, double depth) {
    GltfOptics result;
    const auto extension = [&](const char* name) -> const json& { return GltfFile::extension(material, name); };
    const json& metal = GltfFile::object(material, "pbrMetallicRoughness");
    // A texture says where the material is metal; glass is no metal.
    const double metallic =
        metal.contains("metallicRoughnessTexture") ? 0 : GltfFile::number(metal, "metallicFactor", 1);
    const double factor = GltfFile::number(extension("KHR_materials_transmission"), "transmissionFactor", 0);
    result.transmission = std::clamp(factor * (1 - std::clamp(metallic, 0.0, 1.0)), 0.0, 1.0);
    const double ior = GltfFile::number(extension("KHR_materials_ior"), "ior", kIor);
    if (result.passes()) {
        const json& volume = extension("KHR_materials_volume");
        const double thickness = GltfFile::number(volume, "thicknessFactor", 0);
        if (thickness > 0) {
            constexpr double maximum = 1e3;
            result.refractiveIndex = std::clamp(ior, 1.0, maximum);
            result.absorption = absorptionOf(colorOf(volume, "attenuationColor"),
                                             GltfFile::number(volume, "attenuationDistance", HUGE_VAL)) +
                                absorptionOf(baseFactor(material), std::max(thickness, depth));
        } else {
            result.reflectivity = mirrored(ior);
            result.absorption = absorptionOf(baseFactor(material), 1);
        }
    }
    const json& coat = extension("KHR_materials_clearcoat");
    if (GltfFile::number(coat, "clearcoatRoughnessFactor", 0) <= kCoatsMirror && result.refractiveIndex == 0) {
        const double fraction = mirrored(kIor) * std::clamp(GltfFile::number(coat, "clearcoatFactor", 0), 0.0, 1.0);
        result.reflectivity = 1 - (1 - result.reflectivity) * (1 - fraction);
    }
    return result;
}

std::vector<double> depthsOf(const GltfFile& file) {
    std::vector<double> depths(GltfFile::list(file.root(), "materials").size(), 0);
    const json& accessors = GltfFile::list(file.root(), "accessors");
    for (const json& mesh : GltfFile::list(file.root(), "meshes"))
        for (const json& primitive : GltfFile::list(mesh, "primitives")) {
            const std::size_t material = GltfFile::index(primitive, "material").value_or(kNoIndex);
            const std::size_t points =
                GltfFile::index(GltfFile::object(primitive, "attributes"), "POSITION").value_or(kNoIndex);
            if (material >= depths.size() || points >= accessors.size()) continue;
            const auto low = GltfFile::numbers(accessors[points], "min", 3);
            const auto high = GltfFile::numbers(accessors[points], "max", 3);
            if (!low || !high) continue;
            const double minimum = std::min({(*high)[0] - (*low)[0], (*high)[1] - (*low)[1], (*high)[2] - (*low)[2]});
            if (std::isfinite(minimum)) depths[material] = std::max(depths[material], minimum);
        }
    return depths;
}

void writeOptics(DocumentHandler& out, const GltfOptics& optics) {
    if (optics.refractiveIndex == 0 && optics.reflectivity == 0 && optics.absorption == Vec3d(0)) return;
    const GltfNode set(out, "MetadataSet", "metadata");
    out.setField("name", Value(String("RTSG")), {});
    const auto number = [&](const char* name, Array<float> value) {
        GltfNode(out, "MetadataFloat", "value").set("name", String(name)).set("value", std::move(value));
    };
    const auto f = [](double x) { return static_cast<float>(x); };
    if (optics.refractiveIndex > 0) number("refractiveIndex", {f(optics.refractiveIndex)});
    if (optics.absorption != Vec3d(0))
        number("absorption", {f(optics.absorption.x), f(optics.absorption.y), f(optics.absorption.z)});
    if (optics.reflectivity > 0) number("reflectivity", {f(optics.reflectivity)});
}

/// The extension's own way from one model to the other: of the metals and dielectrics with a diffuse part and a
/// highlight as bright as these, the one that mirrors as much in front.
std::optional<GltfGloss> glossOf(const json& material) {
    const json& gloss = GltfFile::extension(material, "KHR_materials_pbrSpecularGlossiness");
    if (gloss.empty() || material.contains("pbrMetallicRoughness")) return std::nullopt;
    GltfGloss result;
    Vec3d diffuse(1);
    if (const auto four = GltfFile::numbers(gloss, "diffuseFactor", 4)) {
        diffuse = Vec3d((*four)[0], (*four)[1], (*four)[2]);
        result.opacity = (*four)[3];
    }
    result.base = diffuse;
    result.roughness = 1 - std::clamp(GltfFile::number(gloss, "glossinessFactor", 1), 0.0, 1.0);
    if (gloss.contains("specularGlossinessTexture")) {
        constexpr double between = .5;  // its pixels are not read
        result.roughness = between;
        return result;
    }
    const Vec3d specular = glm::clamp(colorOf(gloss, "specularFactor"), Vec3d(0), Vec3d(1));
    const auto brightness = [](const Vec3d& c) {
        return std::sqrt(.299 * c.x * c.x + .587 * c.y * c.y + .114 * c.z * c.z);
    };
    const double minimum = mirrored(kIor), bright = brightness(specular);
    const double rest = 1 - std::max({specular.x, specular.y, specular.z});
    if (bright > minimum) {
        const double b = brightness(diffuse) * rest / (1 - minimum) + bright - 2 * minimum, c = minimum - bright;
        result.metallic = std::clamp((-b + std::sqrt(b * b - 4 * minimum * c)) / (2 * minimum), 0.0, 1.0);
    }
    constexpr double tiny = 1e-6;
    const double m = result.metallic;
    const Vec3d ofDiffuse = diffuse * (rest / (1 - minimum) / std::max(1 - m, tiny));
    const Vec3d ofSpecular = (specular - Vec3d(minimum * (1 - m))) / std::max(m, tiny);
    result.base = glm::clamp(glm::mix(ofDiffuse, ofSpecular, m * m), Vec3d(0), Vec3d(1));
    return result;
}

namespace {

/// Whether a material uses an extension of which something is lost, and what that is.
struct Look {
    std::string_view extension;
    bool (*isUsed)(const json& material, const json& its);
    std::string_view without;
};

bool has(const json& its, const char* key) {
    return GltfFile::number(its, key, 0) > 0;
}
bool always(const json&, const json&) {
    return true;
}
bool isTransmissive(const json& material) {
    return has(GltfFile::extension(material, "KHR_materials_transmission"), "transmissionFactor");
}

constexpr Look kLooks[] = {
    {"KHR_materials_transmission",
     [](const json& m, const json& its) {
         const json& metal = GltfFile::object(m, "pbrMetallicRoughness");
         return has(its, "transmissionFactor") &&
                (its.contains("transmissionTexture") || metal.contains("baseColorTexture") ||
                 GltfFile::number(metal, "roughnessFactor", 1) > .1 || metal.contains("metallicRoughnessTexture"));
     },
     "what passes is neither blurred by roughness nor changed by textures"},
    {"KHR_materials_volume",
     [](const json& m, const json& its) { return isTransmissive(m) && its.contains("thicknessTexture"); },
     "a body is as thick as its mesh, whatever its thicknessTexture says"},
    {"KHR_materials_ior",
     [](const json& m, const json& its) { return !isTransmissive(m) && GltfFile::number(its, "ior", kIor) != kIor; },
     "what lets no light through mirrors as with an index of 1.5"},
    {"KHR_materials_clearcoat", [](const json&, const json& its) { return has(its, "clearcoatFactor"); },
     "a coat is a sharp mirror of 4 % at every angle if its roughness is at most .3, else there is none; its textures "
     "are left out"},
    {"KHR_materials_specular", always, "highlights are as strong as without it"},
    {"KHR_materials_sheen", always, "the shine of cloth is left out"},
    {"KHR_materials_iridescence", [](const json&, const json& its) { return has(its, "iridescenceFactor"); },
     "colours of thin films are left out"},
    {"KHR_materials_anisotropy", [](const json&, const json& its) { return has(its, "anisotropyStrength"); },
     "highlights are round"},
    {"KHR_materials_dispersion", [](const json&, const json& its) { return has(its, "dispersion"); },
     "all colours are bent alike"},
    {"KHR_materials_diffuse_transmission",
     [](const json&, const json& its) { return has(its, "diffuseTransmissionFactor"); },
     "light that is scattered to the other side is left out"},
    {"KHR_materials_volume_scatter", always, "bodies do not scatter light"},
    {"KHR_materials_pbrSpecularGlossiness",
     [](const json& m, const json& its) {
         return !m.contains("pbrMetallicRoughness") && its.contains("specularGlossinessTexture");
     },
     "its specularGlossinessTexture is left out"},
};

}  // namespace

std::span<const std::string_view> lookExtensions() {
    static const auto& all = neverDestroyed([] {
        std::vector<std::string_view> names;
        for (const Look& look : kLooks) names.push_back(look.extension);
        return names;
    });
    return all;
}

void reportLooks(GltfFile& file, const json& material) {
    for (const Look& look : kLooks) {
        const std::string name(look.extension);
        const json& extensions = GltfFile::object(material, "extensions");
        if (extensions.contains(name) && look.isUsed(material, GltfFile::object(extensions, name.c_str())))
            file.warn("the glTF file uses " + name + ": " + std::string(look.without));
    }
}

}  // namespace rtsg::detail
