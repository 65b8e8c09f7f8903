// Reads Appearance, materials and textures into the flat numbers that shading uses.
#include <rtsg/renderers/material.h>

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <glm/gtc/matrix_transform.hpp>

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>

#include "texture_store.h"

namespace rtsg {

namespace {

/// Pixels a side, of the longer one. Authors of a PixelTexture of a few pixels mean these pixels, and browsers show
/// them. Without TextureProperties the standard leaves interpolation open (18.4.6).
constexpr int kMinSmoothed = 16;

Vec3f rgb(const Color& c) {
    return {c.r, c.g, c.b};
}
float unit(float x) {
    return std::isfinite(x) ? std::clamp(x, 0.0f, 1.0f) : 0.0f;
}
float atLeastZero(float x) {
    return std::isfinite(x) ? std::max(x, 0.0f) : 0.0f;
}
Vec3f atLeastZero(const Vec3f& v) {
    return {atLeastZero(v.x), atLeastZero(v.y), atLeastZero(v.z)};
}

struct Reader {
    const Scene& scene;
    TextureStore& store;
    Diagnostics& diagnostics;
    const Node* transform = nullptr;  // Appearance.textureTransform

    /// 1 or 3 numbers.
    static bool numbers(const Node& node, Vec3f& out) {
        float values[3];
        std::size_t count = 0;
        const auto take = [&](const auto& array) {
            count = array.size();
            for (std::size_t i = 0; i < std::min<std::size_t>(count, 3); ++i) values[i] = static_cast<float>(array[i]);
        };
        if (node.is(x3d::MetadataFloat::type))
            take(node.get(x3d::MetadataFloat::value));
        else if (node.is(x3d::MetadataDouble::type))
            take(node.get(x3d::MetadataDouble::value));
        else
            return false;
        if (count != 1 && count != 3) return false;
        out = count == 1 ? Vec3f(values[0]) : Vec3f(values[0], values[1], values[2]);
        return glm::all(glm::greaterThanEqual(out, Vec3f(0))) && glm::all(glm::lessThan(out, Vec3f(1e6f)));
    }

    void optics(const Node& node, Material& material) {
        const std::string_view name = node.is(x3d::MetadataFloat::type) ? node.get(x3d::MetadataFloat::name).view()
                                                                        : node.get(x3d::MetadataDouble::name).view();
        Vec3f value;
        if (name != "reflectivity" && name != "refractiveIndex" && name != "absorption" && name != "priority") return;
        if (!numbers(node, value)) {
            diagnostics.warning(
                {}, "RTSG metadata \"" + std::string(name) + "\" wants one or three numbers from 0 on; ignored");
            return;
        }
        if (name == "reflectivity")
            material.reflectivity = glm::min(value, Vec3f(1));
        else if (name == "absorption")
            material.absorption = value;
        else if (name == "priority")
            material.priority = value.x;
        else
            material.refractiveIndex = value.x;  // 1 as well: a bubble in glass
    }

    void metadata(NodeId id, Material& material) {
        const Node* node = scene.find(id);
        if (!node) return;
        if (node->is(x3d::MetadataSet::type)) {
            const bool ours = node->get(x3d::MetadataSet::name) == String("RTSG");
            for (const NodeId entry : node->get(x3d::MetadataSet::value)) {
                const Node* inner = scene.find(entry);
                if (!inner) continue;
                const bool number = inner->is(x3d::MetadataFloat::type) || inner->is(x3d::MetadataDouble::type);
                if (ours && number)
                    optics(*inner, material);
                else if (!ours && inner->is(x3d::MetadataSet::type) &&
                         inner->get(x3d::MetadataSet::name) == String("RTSG"))
                    metadata(entry, material);
            }
        } else if ((node->is(x3d::MetadataFloat::type) && node->get(x3d::MetadataFloat::reference) == String("RTSG")) ||
                   (node->is(x3d::MetadataDouble::type) &&
                    node->get(x3d::MetadataDouble::reference) == String("RTSG"))) {
            optics(*node, material);
        }
    }

    static TextureWrap wrapOf(std::string_view mode) {
        if (mode == "MIRRORED_REPEAT") return TextureWrap::mirror;
        if (mode == "CLAMP_TO_BOUNDARY") return TextureWrap::border;
        return mode == "CLAMP" || mode == "CLAMP_TO_EDGE" ? TextureWrap::clamp : TextureWrap::repeat;
    }

    /// 18.4.10, and TextureTransform3D's in 33.4: Tc' = -C * S * R * C * T * Tc.
    static glm::mat4 matrixOf(const Node& node) {
        using T = x3d::TextureTransform3D;
        if (node.is(x3d::TextureTransformMatrix3D::type)) {
            // Rows of the file are columns here: the last one moves, as browsers have it.
            glm::mat4 m;
            const Matrix4f& rows = node.get(x3d::TextureTransformMatrix3D::matrix);
            for (int r = 0; r < 4; ++r)
                for (int c = 0; c < 4; ++c)
                    m[r][c] = rows.elements[4 * static_cast<std::size_t>(r) + static_cast<std::size_t>(c)];
            return m;
        }
        const Vec3f center = node.get(T::center), scale = node.get(T::scale), moved = node.get(T::translation) + center;
        const Rotation& rotation = node.get(T::rotation);
        glm::mat4 m(1);
        m = glm::translate(m, -center);
        m = glm::scale(m, scale);
        const Vec3f axis(rotation.x, rotation.y, rotation.z);
        if (glm::length(axis) > 0) m = glm::rotate(m, rotation.angle, glm::normalize(axis));
        return glm::translate(m, moved);
    }
    static bool isTransform(const Node& node) { return node.is(x3d::TextureTransform::type) || is3d(node); }
    static bool is3d(const Node& node) {
        return node.is(x3d::TextureTransform3D::type) || node.is(x3d::TextureTransformMatrix3D::type);
    }
    static const String& mappingOf(const Node& node) {
        if (node.is(x3d::TextureTransform3D::type)) return node.get(x3d::TextureTransform3D::mapping);
        if (node.is(x3d::TextureTransformMatrix3D::type)) return node.get(x3d::TextureTransformMatrix3D::mapping);
        return node.get(x3d::TextureTransform::mapping);
    }

    /// The texture transform meant for texture coordinates called `mapping`; null: none.
    const Node* transformFor(const String& mapping) const {
        const Node* node = transform;
        if (node && node->is(x3d::MultiTextureTransform::type)) {
            const Node* chosen = nullptr;
            for (const NodeId id : node->get(x3d::MultiTextureTransform::textureTransform)) {
                const Node* candidate = scene.effectiveNode(id);
                if (!candidate || !isTransform(*candidate)) continue;
                if (!chosen || mappingOf(*candidate) == mapping) chosen = candidate;
                if (mappingOf(*candidate) == mapping) break;
            }
            return chosen;
        }
        if (!node || !isTransform(*node)) return nullptr;
        const String& own = mappingOf(*node);
        return !own.empty() && !mapping.empty() && !(own == mapping) ? nullptr : node;
    }
    static void setMatrix(TextureUse& use, const Node* node) {
        use.matrix = {};
        use.matrix3 = nullptr;
        if (!node) return;
        if (is3d(*node)) {
            use.matrix3 = std::make_shared<const glm::mat4>(matrixOf(*node));
            return;
        }
        use.matrix = TextureMatrix::fromTransform(
            node->get(x3d::TextureTransform::center), node->get(x3d::TextureTransform::rotation),
            node->get(x3d::TextureTransform::scale), node->get(x3d::TextureTransform::translation));
    }

    /// The access that a texture's fields ask for.
    struct Access {
        bool s = true, t = true, r = true;
        NodeId properties;
    };
    template <class T>
    static Access accessOf(const Node& node) {
        Access access;
        if constexpr (requires { T::repeatS; }) access.s = node.get(T::repeatS), access.t = node.get(T::repeatT);
        if constexpr (requires { T::repeatR; }) access.r = node.get(T::repeatR);
        access.properties = node.get(T::textureProperties);
        return access;
    }
    static Access accessOf(const Node& node) {
        if (node.is(x3d::ImageTexture::type)) return accessOf<x3d::ImageTexture>(node);
        if (node.is(x3d::PixelTexture::type)) return accessOf<x3d::PixelTexture>(node);
        if (node.is(x3d::MovieTexture::type)) return accessOf<x3d::MovieTexture>(node);
        if (node.is(x3d::ComposedTexture3D::type)) return accessOf<x3d::ComposedTexture3D>(node);
        if (node.is(x3d::ImageTexture3D::type)) return accessOf<x3d::ImageTexture3D>(node);
        if (node.is(x3d::PixelTexture3D::type)) return accessOf<x3d::PixelTexture3D>(node);
        if (node.is(x3d::ComposedCubeMapTexture::type)) return accessOf<x3d::ComposedCubeMapTexture>(node);
        if (node.is(x3d::ImageCubeMapTexture::type)) return accessOf<x3d::ImageCubeMapTexture>(node);
        if (node.is(x3d::GeneratedCubeMapTexture::type)) return accessOf<x3d::GeneratedCubeMapTexture>(node);
        if (node.is(x3d::RenderedTexture::type)) return accessOf<x3d::RenderedTexture>(node);
        return {};
    }
    TextureAccess readAccess(const Node& node) const {
        const Access own = accessOf(node);
        TextureAccess result;
        result.wrapS = own.s ? TextureWrap::repeat : TextureWrap::clamp;
        result.wrapT = own.t ? TextureWrap::repeat : TextureWrap::clamp;
        result.wrapR = own.r ? TextureWrap::repeat : TextureWrap::clamp;
        const Node* p = scene.effectiveNode(own.properties);
        if (!p || !p->is(x3d::TextureProperties::type)) return result;
        // 18.4.9: the properties override repeatS and repeatT.
        using P = x3d::TextureProperties;
        result.wrapS = wrapOf(p->get(P::boundaryModeS).view());
        result.wrapT = wrapOf(p->get(P::boundaryModeT).view());
        result.wrapR = wrapOf(p->get(P::boundaryModeR).view());
        const ColorRGBA& border = p->get(P::borderColor);
        result.border = glm::clamp(Vec4f(border.r, border.g, border.b, border.a), Vec4f(0), Vec4f(1));
        result.smooth = p->get(P::magnificationFilter).view() != "NEAREST_PIXEL";
        const std::string_view far = p->get(P::minificationFilter).view();
        result.smoothFar = !far.starts_with("NEAREST_PIXEL");
        // For FASTEST, NICEST and DEFAULT, where the choice is ours, levels are mixed. A filter that names coarser
        // copies gets them only if the texture asks for these.
        if (far == "AVG_PIXEL" || far == "NEAREST_PIXEL" || (far.ends_with("_MIPMAP") && !p->get(P::generateMipMaps)))
            result.levels = TextureLevels::finest;
        else if (far.ends_with("_NEAREST_MIPMAP"))
            result.levels = TextureLevels::nearest;
        return result;
    }

    /// The texture that is drawn for this picture; null if `update` asks for none.
    template <class N>
    std::shared_ptr<const GeneratedCube> drawnFor(const Node& node) {
        const std::string_view update = node.get(N::update).view();
        if (update != "ALWAYS" && update != "NEXT_FRAME_ONLY") return nullptr;
        constexpr int kMaxPixels = 4096;
        GeneratedCube cube{node.id()};
        if constexpr (requires { N::size; }) {
            cube.size = std::clamp(node.get(N::size), 1, kMaxPixels);
        } else {
            if (!node.get(N::url).empty())
                diagnostics.warningAt(scene.locationOf(node.id()),
                                      "RenderedTexture.url: a scene writes no files: it is shown, and not saved");
            if (node.get(N::depthMap))
                diagnostics.warningAt(scene.locationOf(node.id()),
                                      "RenderedTexture.depthMap: its depths are not shown, but its colours");
            cube.size = std::clamp(node.get(N::width), 1, kMaxPixels);
            cube.height = std::clamp(node.get(N::height), 1, kMaxPixels);
        }
        std::string why;
        auto drawn = store.drawn(cube, why);
        if (!drawn)
            diagnostics.warningAt(scene.locationOf(node.id()),
                                  fmt::format("{} shows nothing: {}", node.type().name, why));
        return drawn;
    }

    TextureUse use(NodeId id, const String& mapping, Texture::Content content) {
        const Node* node = scene.effectiveNode(id);
        if (!node) return {};
        TextureUse result;
        if (node->is(x3d::MultiTexture::type))
            for (const NodeId inner : node->get(x3d::MultiTexture::texture))
                if (const Node* first = scene.effectiveNode(inner)) {
                    node = first;
                    break;
                }
        if (node->is(x3d::GeneratedCubeMapTexture::type)) {
            result.generated = drawnFor<x3d::GeneratedCubeMapTexture>(*node);
        } else if (node->is(x3d::RenderedTexture::type)) {
            result.generated = drawnFor<x3d::RenderedTexture>(*node);
        } else if (TextureStore::isSpace(*node)) {
            result.space = store.spaceOfNode(scene, *node, content, diagnostics);
        } else {
            result.texture = store.ofNode(scene, *node, content, diagnostics);
        }
        if (!result) return result;
        result.access = readAccess(*node);
        if (result.generated && result.generated->isFlat()) result.access.wrapR = TextureWrap::clamp;
        if (node->is(x3d::PixelTexture::type) && result.texture && !node->get(x3d::PixelTexture::textureProperties))
            result.access.smooth = std::max(result.texture->width(), result.texture->height()) >= kMinSmoothed;
        result.mapping = mapping;
        const Node* moved = transformFor(mapping);
        result.namesTransform = moved && mappingOf(*moved) == mapping;
        setMatrix(result, moved);
        return result;
    }

    void readStages(Material& material, const Node& multi) {
        using M = x3d::MultiTexture;
        const Color& color = multi.get(M::color);
        material.factor = {color.r, color.g, color.b, unit(multi.get(M::alpha))};
        material.stages.clear();
        const auto word = [](const Array<String>& words, std::size_t i) {
            return i < words.size() ? words[i].view() : std::string_view();
        };
        for (std::size_t i = 0; i < multi.get(M::texture).size(); ++i) {
            TextureStage stage;
            stage.use = use(multi.get(M::texture)[i], String(), Texture::Content::color);
            setMatrix(stage.use, transformAt(i));
            readModes(stage, multi, word(multi.get(M::mode), i));
            const std::string_view source = word(multi.get(M::source), i), function = word(multi.get(M::function), i);
            using S = TextureStage::Source;
            using F = TextureStage::Function;
            stage.source = source == "DIFFUSE"    ? S::diffuse
                           : source == "SPECULAR" ? S::specular
                           : source == "FACTOR"   ? S::factor
                                                  : S::previous;
            stage.function = function == "COMPLEMENT"       ? F::complement
                             : function == "ALPHAREPLICATE" ? F::alphaReplicate
                                                            : F::none;
            if (stage.use) material.stages.push_back(std::move(stage));
        }
    }

    void readModes(TextureStage& stage, const Node& multi, std::string_view words) {
        using M = TextureStage::Mode;
        constexpr std::pair<std::string_view, M> kModes[] = {
            {"MODULATE", M::modulate},
            {"REPLACE", M::replace},
            {"SELECTARG1", M::replace},
            {"MODULATE2X", M::modulate2x},
            {"MODULATE4X", M::modulate4x},
            {"ADD", M::add},
            {"ADDSIGNED", M::addSigned},
            {"ADDSIGNED2X", M::addSigned2x},
            {"SUBTRACT", M::subtract},
            {"ADDSMOOTH", M::addSmooth},
            {"BLENDDIFFUSEALPHA", M::blendDiffuseAlpha},
            {"BLENDTEXTUREALPHA", M::blendTextureAlpha},
            {"BLENDFACTORALPHA", M::blendFactorAlpha},
            {"BLENDCURRENTALPHA", M::blendCurrentAlpha},
            {"MODULATEALPHA_ADDCOLOR", M::modulateAlphaAddColor},
            {"MODULATEINVALPHA_ADDCOLOR", M::modulateInvAlphaAddColor},
            {"MODULATEINVCOLOR_ADDALPHA", M::modulateInvColorAddAlpha},
            {"OFF", M::off},
            {"SELECTARG2", M::selectArg2},
            {"DOTPRODUCT3", M::dotProduct3},
        };
        const auto modeOf = [&](std::string_view name) {
            while (!name.empty() && name.front() == ' ') name.remove_prefix(1);
            while (!name.empty() && name.back() == ' ') name.remove_suffix(1);
            for (const auto& [known, mode] : kModes)
                if (name == known) return mode;
            if (!name.empty())
                diagnostics.warningAt(
                    scene.locationOf(multi.id()),  // in the words of who read the file
                    fmt::format("MultiTexture.mode: '{}' is no mode of a MultiTexture: taken as MODULATE", name));
            return M::modulate;
        };
        // "colours, alpha", or one for both.
        const std::size_t comma = words.find(',');
        stage.color = modeOf(words.substr(0, comma));
        stage.alpha = comma == std::string_view::npos ? stage.color : modeOf(words.substr(comma + 1));
    }

    /// The transform for the texture at this place of a MultiTexture.
    const Node* transformAt(std::size_t i) const {
        const Node* node = transform;
        if (node && node->is(x3d::MultiTextureTransform::type)) {
            const auto& all = node->get(x3d::MultiTextureTransform::textureTransform);
            node = i < all.size() ? scene.effectiveNode(all[i]) : nullptr;
        }
        return node && isTransform(*node) ? node : nullptr;
    }

    void set(Material& material, TextureRole role, NodeId id, const String& mapping,
             Texture::Content content = Texture::Content::color) {
        if (const Node* node = scene.effectiveNode(id);
            role == TextureRole::base && node && node->is(x3d::MultiTexture::type)) {
            readStages(material, *node);
            return;
        }
        material.textures[static_cast<std::size_t>(role)] = use(id, mapping, content);
    }

    bool read(const Node& node, Material& material) {
        constexpr auto data = Texture::Content::data;
        if (node.is(x3d::Material::type)) {
            using M = x3d::Material;
            material.model = ShadingModel::phong;
            material.base = rgb(node.get(M::diffuseColor));
            material.specular = rgb(node.get(M::specularColor));
            material.emissive = rgb(node.get(M::emissiveColor));
            material.ambient = node.get(M::ambientIntensity);
            material.exponent = 128 * unit(node.get(M::shininess));
            material.opacity = 1 - unit(node.get(M::transparency));
            material.normalScale = node.get(M::normalScale);
            material.occlusionStrength = unit(node.get(M::occlusionStrength));
            set(material, TextureRole::base, node.get(M::diffuseTexture), node.get(M::diffuseTextureMapping));
            set(material, TextureRole::emissive, node.get(M::emissiveTexture), node.get(M::emissiveTextureMapping));
            set(material, TextureRole::specular, node.get(M::specularTexture), node.get(M::specularTextureMapping));
            set(material, TextureRole::normal, node.get(M::normalTexture), node.get(M::normalTextureMapping), data);
            set(material, TextureRole::occlusion, node.get(M::occlusionTexture), node.get(M::occlusionTextureMapping),
                data);
            set(material, TextureRole::ambient, node.get(M::ambientTexture), node.get(M::ambientTextureMapping));
            set(material, TextureRole::shininess, node.get(M::shininessTexture), node.get(M::shininessTextureMapping),
                data);
            metadata(node.get(M::metadata), material);
        } else if (node.is(x3d::PhysicalMaterial::type)) {
            using M = x3d::PhysicalMaterial;
            material.model = ShadingModel::physical;
            material.base = rgb(node.get(M::baseColor));
            material.emissive = rgb(node.get(M::emissiveColor));
            material.metallic = unit(node.get(M::metallic));
            material.roughness = unit(node.get(M::roughness));
            material.opacity = 1 - unit(node.get(M::transparency));
            material.normalScale = node.get(M::normalScale);
            material.occlusionStrength = unit(node.get(M::occlusionStrength));
            set(material, TextureRole::base, node.get(M::baseTexture), node.get(M::baseTextureMapping));
            set(material, TextureRole::emissive, node.get(M::emissiveTexture), node.get(M::emissiveTextureMapping));
            set(material, TextureRole::normal, node.get(M::normalTexture), node.get(M::normalTextureMapping), data);
            set(material, TextureRole::metallicRoughness, node.get(M::metallicRoughnessTexture),
                node.get(M::metallicRoughnessTextureMapping), data);
            set(material, TextureRole::occlusion, node.get(M::occlusionTexture), node.get(M::occlusionTextureMapping),
                data);
            metadata(node.get(M::metadata), material);
        } else if (node.is(x3d::UnlitMaterial::type)) {
            using M = x3d::UnlitMaterial;
            material.model = ShadingModel::unlit;
            material.base = rgb(node.get(M::emissiveColor));
            material.opacity = 1 - unit(node.get(M::transparency));
            set(material, TextureRole::base, node.get(M::emissiveTexture), node.get(M::emissiveTextureMapping));
            metadata(node.get(M::metadata), material);
        } else if (node.is(x3d::TwoSidedMaterial::type)) {
            using M = x3d::TwoSidedMaterial;
            material.model = ShadingModel::phong;
            material.base = rgb(node.get(M::diffuseColor));
            material.specular = rgb(node.get(M::specularColor));
            material.emissive = rgb(node.get(M::emissiveColor));
            material.ambient = node.get(M::ambientIntensity);
            material.exponent = 128 * unit(node.get(M::shininess));
            material.opacity = 1 - unit(node.get(M::transparency));
            metadata(node.get(M::metadata), material);
        } else {
            return false;
        }
        material.base = atLeastZero(material.base);
        material.specular = atLeastZero(material.specular);
        material.emissive = atLeastZero(material.emissive);
        material.ambient = atLeastZero(material.ambient);
        material.decodeColors();
        return true;
    }

    /// The back of a TwoSidedMaterial that has one of its own.
    static Material backOf(const Node& node, const Material& front) {
        using M = x3d::TwoSidedMaterial;
        Material back = front;
        back.base = atLeastZero(rgb(node.get(M::backDiffuseColor)));
        back.specular = atLeastZero(rgb(node.get(M::backSpecularColor)));
        back.emissive = atLeastZero(rgb(node.get(M::backEmissiveColor)));
        back.ambient = atLeastZero(node.get(M::backAmbientIntensity));
        back.exponent = 128 * unit(node.get(M::backShininess));
        back.opacity = 1 - unit(node.get(M::backTransparency));
        back.decodeColors();
        return back;
    }
};

}  // namespace

bool Material::textured() const {
    return !stages.empty() ||
           std::ranges::any_of(textures, [](const TextureUse& use) { return static_cast<bool>(use); });
}

void Material::decodeColors() {
    linear = {base, specular, emissive};
    if (model != ShadingModel::physical)
        linear = {linearFromSrgb(base), linearFromSrgb(specular), linearFromSrgb(emissive)};
}

bool Hatching::isLine(const Vec2f& pixel) const {
    const auto on = [](float x) { return x - kApart * std::floor(x / kApart) < 1; };
    // Along a slope the same width is sqrt 2 of a row's.
    const auto slanted = [](float x) {
        const float apart = kApart * std::numbers::sqrt2_v<float>;
        return x - apart * std::floor(x / apart) < std::numbers::sqrt2_v<float>;
    };
    switch (style) {
        case 1:
            return on(pixel.y);
        case 2:
            return on(pixel.x);
        case 3:
            return slanted(pixel.y - pixel.x);
        case 4:
            return slanted(pixel.y + pixel.x);
        case 5:
            return on(pixel.x) || on(pixel.y);
        case 6:
            return slanted(pixel.y - pixel.x) || slanted(pixel.y + pixel.x);
        default:
            return false;
    }
}

bool Material::stagesHaveAlpha() const {
    return std::ranges::any_of(stages, [](const TextureStage& s) { return s.use.hasAlpha(); }) ||
           (!stages.empty() && factor.a < 1);
}

bool Material::transmits() const {
    if (!hatching.filled) return true;
    if (alphaMode == AlphaMode::opaque) return false;
    if (opacity < 1) return true;
    if (stagesHaveAlpha()) return true;
    const TextureUse& main = texture(TextureRole::base);
    return main.hasAlpha() || (back && back->transmits());
}

bool Material::mirrors() const {
    return reflectivity != Vec3f(0) || refractiveIndex > 0 || (model == ShadingModel::physical && roughness < 1) ||
           (back && back->mirrors());
}

namespace {

using Mode = TextureStage::Mode;

/// One channel, or (DOTPRODUCT3 apart) each of several. `a`, `b`: both colours' own alpha; `blend`: for the modes that
/// blend.
float combineChannel(Mode mode, float x, float y, float a, float blend) {
    switch (mode) {
        case Mode::modulate:
            return x * y;
        case Mode::replace:
            return x;
        case Mode::modulate2x:
            return 2 * x * y;
        case Mode::modulate4x:
            return 4 * x * y;
        case Mode::add:
            return x + y;
        case Mode::addSigned:
            return x + y - .5f;
        case Mode::addSigned2x:
            return 2 * (x + y - .5f);
        case Mode::subtract:
            return x - y;
        case Mode::addSmooth:
            return x + (1 - x) * y;
        case Mode::blendDiffuseAlpha:
        case Mode::blendTextureAlpha:
        case Mode::blendFactorAlpha:
        case Mode::blendCurrentAlpha:
            return x * blend + y * (1 - blend);
        case Mode::modulateAlphaAddColor:
            return x + a * y;
        case Mode::modulateInvAlphaAddColor:
            return x + (1 - a) * y;
        case Mode::modulateInvColorAddAlpha:
            return (1 - x) * y + a;
        case Mode::off:
        case Mode::selectArg2:
        case Mode::dotProduct3:
            break;
    }
    return y;
}

}  // namespace

Vec4f combine(const TextureStage& stage, const Vec4f& texel, const Vec4f& with, const Vec4f& current,
              float diffuseAlpha, float factorAlpha) {
    const auto blendOf = [&](Mode mode) {
        return mode == Mode::blendDiffuseAlpha   ? diffuseAlpha
               : mode == Mode::blendTextureAlpha ? texel.a
               : mode == Mode::blendFactorAlpha  ? factorAlpha
                                                 : current.a;
    };
    if (stage.color == Mode::off) return current;
    Vec4f result;
    for (int c = 0; c < 3; ++c)
        result[c] = combineChannel(stage.color, texel[c], with[c], texel.a, blendOf(stage.color));
    result.a = combineChannel(stage.alpha, texel.a, with.a, texel.a, blendOf(stage.alpha));
    if (stage.alpha == Mode::off) result.a = current.a;
    if (stage.color == Mode::dotProduct3) {
        const Vec3f x = 2.0f * Vec3f(texel) - Vec3f(1), y = 2.0f * Vec3f(with) - Vec3f(1);
        result = Vec4f(glm::dot(x, y));
    }
    result = glm::clamp(result, Vec4f(0), Vec4f(1));
    if (stage.function == TextureStage::Function::complement) result = Vec4f(Vec3f(1) - Vec3f(result), result.a);
    if (stage.function == TextureStage::Function::alphaReplicate) result = Vec4f(result.a);
    return result;
}

Material defaultMaterial() {
    Material material;
    material.base = material.linear.base = Vec3f(1);
    return material;
}

Material readMaterial(const Scene& scene, NodeId appearance, TextureStore& textures, Diagnostics& diagnostics) {
    Material material = defaultMaterial();
    const Node* node = scene.effectiveNode(appearance);
    if (!node || !node->is(x3d::Appearance::type)) return material;
    using A = x3d::Appearance;
    Reader reader{scene, textures, diagnostics, scene.effectiveNode(node->get(A::textureTransform))};

    const Node* front = scene.effectiveNode(node->get(A::material));
    if (front && !reader.read(*front, material)) {
        diagnostics.warningAt(scene.locationOf(front->id()),
                              "the light tracer has no " + front->type().name + "; drawn unlit");
        material = defaultMaterial();
    }
    const std::string_view mode = node->get(A::alphaMode).view();
    material.alphaMode = mode == "OPAQUE"  ? AlphaMode::opaque
                         : mode == "MASK"  ? AlphaMode::mask
                         : mode == "BLEND" ? AlphaMode::blend
                                           : AlphaMode::automatic;
    material.alphaCutoff = unit(node->get(A::alphaCutoff));
    // 12.2.3: Appearance.texture stands in for the material's main texture where that is not given.
    if (!material.texture(TextureRole::base) && material.stages.empty())
        reader.set(material, TextureRole::base, node->get(A::texture), String());

    if (const Node* line = scene.effectiveNode(node->get(A::lineProperties));
        line && line->is(x3d::LineProperties::type) && line->get(x3d::LineProperties::applied)) {
        const std::int32_t type = line->get(x3d::LineProperties::linetype);
        if (type < 1 || type > 5)
            diagnostics.warningAt(scene.locationOf(line->id()),
                                  "linetype " + std::to_string(type) + " is none of 1 to 5: drawn as a solid line");
    }
    if (const Node* fill = scene.effectiveNode(node->get(A::fillProperties));
        fill && fill->is(x3d::FillProperties::type)) {
        using F = x3d::FillProperties;
        Hatching& hatching = material.hatching;
        hatching.filled = fill->get(F::filled);
        if (fill->get(F::hatched)) hatching.style = fill->get(F::hatchStyle);
        hatching.color = rgb(fill->get(F::hatchColor));
        if (hatching.style < 0 || hatching.style > 6) {
            diagnostics.warningAt(scene.locationOf(fill->id()),
                                  "hatchStyle " + std::to_string(hatching.style) + " is none of 1 to 6: taken as 1");
            hatching.style = 1;
        }
        hatching.present = hatching.style != 0 || !hatching.filled;
    }
    if (const Node* behind = scene.effectiveNode(node->get(A::backMaterial))) {
        Material back;
        back.alphaMode = material.alphaMode, back.alphaCutoff = material.alphaCutoff;
        if (reader.read(*behind, back)) {
            if (!back.texture(TextureRole::base)) back.textures[0] = material.textures[0];
            material.back = std::make_shared<const Material>(std::move(back));
        }
    } else if (front && front->is(x3d::TwoSidedMaterial::type) &&
               front->get(x3d::TwoSidedMaterial::separateBackColor)) {
        material.back = std::make_shared<const Material>(Reader::backOf(*front, material));
    }
    return material;
}

Material readMultiTexture(const Scene& scene, const Node& node, TextureStore& textures, Diagnostics& diagnostics) {
    Material material;
    Reader{scene, textures, diagnostics}.readStages(material, node);
    return material;
}

}  // namespace rtsg
