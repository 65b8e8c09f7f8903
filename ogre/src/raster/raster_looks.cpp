// Turns materials, lights and skies into a rasteriser's numbers.
#include "raster_looks.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <unordered_map>

namespace rtsg {

std::uint32_t RasterTextures::take(const std::shared_ptr<const Texture>& texture, bool linear) {
    if (!texture) return 0;
    const auto [found, isNew] = numbers_.try_emplace({texture.get(), linear}, next_ + 1);
    Entry& entry = entries_[found->second];
    ++entry.users;
    if (!isNew) return found->second;
    ++next_;
    entry.texture = texture, entry.linear = linear;
    hand(found->second, *texture, linear);
    return found->second;
}

void RasterTextures::hand(std::uint32_t number, const Texture& texture, bool linear) {
    RasterTexture handed;
    const ColorSpace space = linear ? ColorSpace::linear : ColorSpace::display;
    std::vector<Vec4f> sampled;
    if (texture.inTiles()) {
        // The largest size that every graphics card supports.
        constexpr int kMax = 2048;
        lack_("a texture in tiles is shown with 2048 pixels a side at most");
        const int width = std::min(texture.width(), kMax), height = std::min(texture.height(), kMax);
        const TextureAccess access{TextureWrap::clamp, TextureWrap::clamp, true};
        for (int y = 0; y < height; ++y)
            for (int x = 0; x < width; ++x)
                sampled.push_back(texture.sample((static_cast<float>(x) + .5f) / static_cast<float>(width),
                                                 (static_cast<float>(y) + .5f) / static_cast<float>(height),
                                                 1 / static_cast<float>(std::max(width, height)), access, space));
        handed.levels.push_back({width, height, {}, sampled});
    } else {
        constexpr int kMax = 8192;  // that every graphics card takes
        for (int i = 0; i < texture.levels(); ++i) {
            const Texture::LevelPixels level = texture.level(i, space);
            if (std::max(level.width, level.height) > kMax) {
                lack_("a texture is shown with 8192 pixels a side at most");
                continue;
            }
            handed.levels.push_back({level.width, level.height, level.encoded, level.linear});
        }
        handed.decoded = linear;
    }
    if (module_) module_->setTexture(number, handed);
    ++created_;
}

void RasterTextures::drop(std::uint32_t number) {
    const auto found = entries_.find(number);
    if (found == entries_.end() || --found->second.users > 0) return;
    numbers_.erase({found->second.texture.get(), found->second.linear});
    entries_.erase(found);
    if (module_) module_->dropTexture(number);
}

namespace {

RasterWrap wrapOf(TextureWrap wrap) {
    switch (wrap) {
        case TextureWrap::mirror:
            return RasterWrap::mirror;
        case TextureWrap::clamp:
            return RasterWrap::clamp;
        case TextureWrap::border:
            return RasterWrap::border;
        case TextureWrap::repeat:
            break;
    }
    return RasterWrap::repeat;
}

/// `color`: the texture holds colours, not numbers. `linear`: the material computes in linear light.
RasterUse rasterUse(const TextureUse& use, bool color, bool linear, RasterTextures& textures) {
    RasterUse result;
    result.texture = textures.take(use.texture, color && linear);
    result.s = use.matrix.s, result.t = use.matrix.t;
    result.wrapS = wrapOf(use.access.wrapS), result.wrapT = wrapOf(use.access.wrapT);
    result.smooth = use.access.smooth, result.smoothFar = use.access.smoothFar;
    result.coarse = use.access.levels != TextureLevels::finest;
    result.mixed = use.access.levels != TextureLevels::nearest;
    const bool wide = use.texture && use.texture->bytesPerPixel() > 4;
    result.encodes = color && wide && !linear && !use.texture->inTiles();
    result.border = use.access.border;
    if (color && (linear || result.encodes))
        result.border = Vec4f(linearFromSrgb(Vec3f(use.access.border)), use.access.border.a);
    return result;
}

bool isColor(TextureRole role) {
    return role == TextureRole::base || role == TextureRole::emissive || role == TextureRole::specular ||
           role == TextureRole::ambient;
}

/// Reports the features of a material that the rasteriser does not show.
void reportOfLacks(const Material& material, const RasterTextures::Lack& lack) {
    if (material.reflectivity != Vec3f(0)) lack("mirrors reflect nothing");
    if (material.refractiveIndex > 0) lack("glass bends nothing");
    if (!material.stages.empty()) lack("a MultiTexture is left out");
    for (const TextureUse& use : material.textures) {
        if (use.space) lack("a cube map or a texture of three dimensions is left out");
        if (use.generated) lack("a GeneratedCubeMapTexture or RenderedTexture is left out");
        if (use.matrix3 && use.texture) lack("a texture transform of three dimensions is left out");
    }
}

void addTextures(const Material& material, bool linear, RasterTextures& textures, RasterMaterial& result) {
    for (std::size_t role = 0; role < kTextureRoles; ++role) {
        const TextureUse& use = material.textures[role];
        if (use.texture) result.uses[role] = rasterUse(use, isColor(static_cast<TextureRole>(role)), linear, textures);
    }
}

RasterModel modelOf(ShadingModel model) {
    return model == ShadingModel::unlit   ? RasterModel::unlit
           : model == ShadingModel::phong ? RasterModel::phong
                                          : RasterModel::physical;
}

}  // namespace

RasterMaterial rasterMaterial(const Material& material, const LookKind& kind, RasterTextures& textures,
                              const RasterTextures::Lack& lack) {
    RasterMaterial result;
    const bool linear = material.model == ShadingModel::physical;
    const Material::Linear plain{material.base, material.specular, material.emissive};
    const Material::Linear& colors = linear ? material.linear : plain;
    result.model = modelOf(material.model);
    result.strokes = kind.strokes, result.points = kind.points;
    result.alpha = material.alphaMode == AlphaMode::opaque ? RasterAlpha::opaque
                   : material.alphaMode == AlphaMode::mask ? RasterAlpha::mask
                                                           : RasterAlpha::blend;
    result.base = colors.base, result.specular = colors.specular, result.emissive = colors.emissive;
    result.ambient = material.ambient, result.exponent = material.exponent, result.opacity = material.opacity;
    result.cutoff = material.alphaCutoff;
    result.metallic = material.metallic, result.roughness = material.roughness;
    if (kind.strokes) {
        // Without normals they have the colour that the material shines with (12.2.4, 17.2.2.3).
        if (!kind.normals && material.model != ShadingModel::unlit) {
            result.base = linear ? srgbFromLinear(colors.emissive) : colors.emissive;
            result.model = RasterModel::unlit;
        }
        result.clear = material.opacity < 1 || kind.alphaColored;
        return result;
    }
    reportOfLacks(material, lack);
    result.normalScale = material.normalScale, result.occlusionStrength = material.occlusionStrength;
    result.reflectivity = material.reflectivity;
    const Hatching& hatching = material.hatching;
    result.hatched = hatching.present, result.filled = hatching.filled;
    result.hatchStyle = hatching.style, result.hatchColor = hatching.color;
    addTextures(material, linear, textures, result);
    const TextureUse& base = material.texture(TextureRole::base);
    const bool cut = base.texture && base.hasAlpha(), partly = base.texture && base.texture->hasPartialAlpha();
    const bool blends = result.alpha == RasterAlpha::blend && (material.opacity < 1 || kind.alphaColored || cut);
    result.clear = blends;
    result.cutOut = blends && cut && !partly && !(material.opacity < 1) && !kind.alphaColored;
    return result;
}

void dropTextures(const RasterMaterial& material, RasterTextures& textures) {
    for (const RasterUse& use : material.uses)
        if (use.texture != 0) textures.drop(use.texture);
}

namespace {

/// Nothing for what only rays show.
std::optional<RasterLight> rasterLight(const Light& light, const Vec3d& origin, const RasterTextures::Lack& lack) {
    RasterLight result;
    switch (light.kind) {
        case Light::Kind::directional:
            break;
        case Light::Kind::point:
            result.kind = 1;
            break;
        case Light::Kind::spot:
            result.kind = 2;
            break;
        case Light::Kind::projector:
        case Light::Kind::projectorParallel:
            lack("a TextureProjector is left out");
            return std::nullopt;
        case Light::Kind::environment:
            lack("an EnvironmentLight lights what is matte, and is not mirrored");
            result.kind = 3;
            result.harmonics = matteHarmonics(light);
            break;
    }
    result.color = light.color, result.ambient = light.ambient;
    result.position = Vec3f(light.position - origin), result.direction = light.direction;
    result.attenuation = light.attenuation, result.radius = light.radius;
    result.localFromWorld = light.localFromWorld;
    result.beamWidth = light.beamWidth, result.cutOffAngle = light.cutOffAngle;
    return result;
}

void addFog(const Fog& fog, const Vec3d& origin, RasterSurroundings& surroundings) {
    surroundings.fogType = fog.type == FogType::linear ? 1.0f : fog.type == FogType::exponential ? 2.0f : 0.0f;
    surroundings.fogRange = fog.visibilityRange;
    surroundings.fogColor = fog.color, surroundings.fogAlong = fog.along;
    surroundings.fogBegin = static_cast<float>(double{fog.begin} - glm::dot(Vec3d(fog.along), origin));
}

}  // namespace

RasterTables rasterTables(std::span<const std::vector<SurfaceState::Surroundings>> views, const Vec3d& origin,
                          const RasterTextures::Lack& lack) {
    RasterTables tables;
    constexpr std::uint32_t kNotShown = 0xFFFFFFFF;
    std::unordered_map<const Light*, std::uint32_t> numbers;
    for (const auto& positions : views)
        for (const SurfaceState::Surroundings& from : positions) {
            RasterSurroundings& surroundings = tables.surroundings.emplace_back();
            for (const Light* light : from.lights) {
                const auto [found, isNew] = numbers.try_emplace(light, kNotShown);
                if (isNew)
                    if (const auto created = rasterLight(*light, origin, lack)) {
                        found->second = static_cast<std::uint32_t>(tables.lights.size());
                        tables.lights.push_back(*created);
                    }
                if (found->second != kNotShown) surroundings.lights.push_back(found->second);
            }
            for (const CutPlane& cut : from.cuts)
                surroundings.cuts.emplace_back(Vec3f(cut.normal),
                                               static_cast<float>(cut.offset + glm::dot(cut.normal, origin)));
            addFog(from.fog, origin, surroundings);
        }
    return tables;
}

RasterSky rasterSky(const Sky* sky, bool over, RasterTextures& textures) {
    RasterSky result;
    if (!sky) {
        if (!over) result.colors.emplace_back(0, 0, 0, 1);
        return result;
    }
    Sky colors = *sky;
    colors.panorama = {};
    colors.localFromWorld = glm::mat3(1.0f);
    const int steps = colors.uniform() ? 1 : 8192;  // a fortieth of a degree
    for (int i = 0; i < steps; ++i) {
        const float angle = (static_cast<float>(i) + .5f) * std::numbers::pi_v<float> / static_cast<float>(steps);
        result.colors.push_back(colors.color({std::sin(angle), std::cos(angle), 0}, ColorSpace::display));
    }
    result.localFromWorld = sky->localFromWorld;
    for (std::size_t i = 0; i < result.sides.size(); ++i) result.sides[i] = textures.take(sky->panorama[i], false);
    return result;
}

}  // namespace rtsg
