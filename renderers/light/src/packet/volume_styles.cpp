// Applies render styles to a place in a volume: ISO/IEC 19775-1 V4.0 41.4.
#include <algorithm>
#include <cmath>
#include <numbers>

#include <rtsg/core/color_blend.h>
#include <rtsg/renderers/shading.h>

#include "surface/surface_packet.h"
#include "tables/left_out.h"
#include "volume_march.h"

namespace rtsg::trace {

namespace {

constexpr float kNoNormal = 1e-6f;  // gradients shorter than this, per voxel, have no direction

TextureAccess clamped() {
    TextureAccess access;
    access.wrapS = access.wrapT = access.wrapR = TextureWrap::clamp;
    return access;
}

/// The light that a place receives.
struct LightThere {
    Vec3f direction{0};  // towards it, unit
    float distance = std::numeric_limits<float>::infinity();
    float factor = 0;  // 0: nothing
};
LightThere lightAt(const TraceLight& light, const Vec3f& at) {
    LightThere there;
    if (light.picture) return there;
    if (light.kind == Light::Kind::directional) {
        there.direction = -light.direction, there.factor = 1;
        return there;
    }
    there.distance = glm::length(light.position - at);
    const float local = there.distance * light.localFromWorld;
    if (!(there.distance > 1e-12f) || (light.radius >= 0 && local > light.radius)) return there;
    there.direction = (light.position - at) / there.distance;
    there.factor = attenuationAt(light.attenuation, local);
    if (light.kind == Light::Kind::spot) {
        const float angle = std::acos(std::clamp(-glm::dot(there.direction, light.direction), -1.0f, 1.0f));
        there.factor *= spotFactor(angle, light.beamWidth, light.cutOffAngle);
    }
    return there;
}

}  // namespace

Vec4f TransferFunction::of(const Vec4f& voxel, int components) const {
    const Vec3f position = components > 2 ? Vec3f(voxel) : Vec3f(voxel.r, components == 2 ? voxel.a : 0, 0);
    if (block) return block->sample(position, 0, clamped(), ColorSpace::display);
    if (plane && components == 1) {
        const auto n = static_cast<float>(row.size());
        const float at = std::clamp(position.x * n - .5f, 0.0f, n - 1);
        const auto low = static_cast<std::size_t>(at);
        const float fraction = at - static_cast<float>(low);
        return row[low] * (1 - fraction) + row[std::min(low + 1, row.size() - 1)] * fraction;
    }
    if (plane) return plane->sample(position.x, position.y, 0, clamped(), ColorSpace::display);
    if (components == 1) return {Vec3f(voxel.r), voxel.r};
    if (components == 3) return {Vec3f(voxel), (voxel.r + voxel.g + voxel.b) / 3};
    return voxel;
}

float Blended::Weight::of(float alpha1, float alpha2) const {
    switch (weight) {
        case WeightFunction::constant:
            return constant;
        case WeightFunction::alpha1:
            return alpha1;
        case WeightFunction::alpha2:
            return alpha2;
        case WeightFunction::oneMinusAlpha1:
            return 1 - alpha1;
        case WeightFunction::oneMinusAlpha2:
            return 1 - alpha2;
        case WeightFunction::table:
            break;
    }
    return table->sample(alpha1, alpha2, 0, clamped(), ColorSpace::display).r;
}

Vec4f StyledPoint::operator()(const VolumeStyle& style) {
    const VoxelGrid& voxels = *volume_.volume->voxels;
    const Vec4f voxel = voxels.at(position_);
    return apply(style, voxels, voxel, voxels.components(), TransferFunction().of(voxel, voxels.components()));
}

Vec4f StyledPoint::surface(const VolumeStyle& style, float value) {
    const Vec4f voxel(value, value, value, 1);
    onSurface_ = true;
    return apply(style, *volume_.volume->voxels, voxel, 1, voxel);
}

/// `color`: in display values; the result is in the march's colour space.
Vec4f StyledPoint::apply(const VolumeStyle& style, const VoxelGrid& voxels, const Vec4f& voxel, int components,
                         Vec4f color) {
    const auto painted = [&](const Vec4f& display) {
        return display.a > 0 && colors_ ? Vec4f(paint(Vec3f(display)), display.a) : display;
    };
    color = painted(color);
    for (const StyleStep& step : style.steps) {
        if (const auto* opacity = std::get_if<OpacityMap>(&step.what)) {
            color = painted(opacity->map.of(voxel, components));
            continue;
        }
        if (const auto* blended = std::get_if<std::shared_ptr<const Blended>>(&step.what)) {
            apply(**blended, color);
            continue;
        }
        if (!(color.a > 0)) continue;  // all others only make less of it
        if (const auto* boundary = std::get_if<BoundaryEnhancement>(&step.what)) {
            apply(*boundary, voxels, color);
            continue;
        }
        const Vec3f normal = normalOf(step, voxels);
        if (const auto* cartoon = std::get_if<Cartoon>(&step.what)) apply(*cartoon, normal, color);
        if (const auto* edge = std::get_if<EdgeEnhancement>(&step.what)) apply(*edge, normal, color);
        if (const auto* silhouette = std::get_if<SilhouetteEnhancement>(&step.what)) apply(*silhouette, normal, color);
        if (const auto* tone = std::get_if<ToneMapped>(&step.what)) apply(*tone, normal, color);
        if (const auto* shaded = std::get_if<Shaded>(&step.what)) apply(*shaded, normal, color);
    }
    color.a = std::clamp(color.a, 0.0f, 1.0f);
    return color;
}

/// Away from where voxels are denser, in ray space; 0: there is none.
Vec3f StyledPoint::normalOf(const StyleStep& step, const VoxelGrid& voxels) const {
    const VoxelGrid* given = step.normals ? step.normals.get() : volume_.volume->gradients.get();
    Vec3f local;
    if (given)
        local = 2.0f * Vec3f(given->at(position_)) - 1.0f;
    else
        local = -voxels.gradient(position_) * Vec3f(voxels.size()) / volume_.volume->dimensions;
    const Vec3f size = volume_.volume->dimensions / Vec3f(voxels.size());
    if (!given && !(glm::length(local * size) > kNoNormal)) return Vec3f(0);
    const Vec3f normal = volume_.normalFromLocal * local;
    const float length = glm::length(normal);
    return length > 0 && std::isfinite(length) ? normal / length : Vec3f(0);
}

void StyledPoint::apply(const BoundaryEnhancement& step, const VoxelGrid& voxels, Vec4f& color) const {
    const float strength = glm::length(voxels.gradient(position_));
    color.a *= step.retained + step.boundary * std::pow(strength, step.exponent);
    color.a = std::min(color.a, 1.0f);
}

/// 41.4.3: in bands of equal angle to the view, from the orthogonal colour to the parallel one; places without a
/// surface are transparent.
void StyledPoint::apply(const Cartoon& step, const Vec3f& normal, Vec4f& color) const {
    if (normal == Vec3f(0)) {
        color.a = 0;
        return;
    }
    const float angle = std::acos(std::min(std::abs(glm::dot(normal, view_)), 1.0f));
    const auto steps = static_cast<float>(step.steps);
    const float band = std::min(std::floor(angle * 2 / std::numbers::pi_v<float> * steps), steps - 1);
    const float fraction = step.steps > 1 ? band / (steps - 1) : 0;
    if (colors_) {
        const auto of = [](const Vec4f& c) { return Color{c.r, c.g, c.b}; };
        const Color mixed = blend(of(step.orthogonal), of(step.parallel), fraction);
        color = Vec4f(paint({mixed.r, mixed.g, mixed.b}), color.a);
    }
    color.a *= step.orthogonal.a + fraction * (step.parallel.a - step.orthogonal.a);
}

/// 41.4.5: across the view in the edge's colour, along it as they are, and a mix between, beyond the threshold alone.
void StyledPoint::apply(const EdgeEnhancement& step, const Vec3f& normal, Vec4f& color) const {
    if (!colors_ || normal == Vec3f(0)) return;
    const float along = std::min(std::abs(glm::dot(normal, view_)), 1.0f);
    if (along < step.cosine) color = Vec4f(glm::mix(paint(step.color), Vec3f(color), along), color.a);
}

void StyledPoint::apply(const SilhouetteEnhancement& step, const Vec3f& normal, Vec4f& color) const {
    const float across = normal == Vec3f(0) ? 0 : 1 - std::min(std::abs(glm::dot(normal, view_)), 1.0f);
    color.a *= step.retained + step.boundary * std::pow(across, step.sharpness);
    color.a = std::min(color.a, 1.0f);
}

/// 41.4.12: the sum over the lights; places without a surface are between warm and cool.
void StyledPoint::apply(const ToneMapped& step, const Vec3f& normal, Vec4f& color) const {
    if (!colors_) return;
    const Vec3f warm = paint(step.warm), cool = paint(step.cool);
    Vec3f sum(0);
    const LightGroups& groups = scene_.lightGroups;
    for (std::uint32_t at = groups.start(volume_.lights); at != LightGroups::kEnd; at = groups.next(at))
        for (const TraceLight& light : groups.lightsOf(at)) {
            const LightThere there = lightAt(light, at_);
            if (!(there.factor > 0)) continue;
            sum += glm::mix(cool, warm, .5f + .5f * glm::dot(normal, there.direction));
        }
    color = Vec4f(sum, color.a);
}

float StyledPoint::visible(const TraceLight& light, const Vec3f& direction, float distance) const {
    Ray ray{at_, kLeave, direction, distance};
    const ViewOfLight world(scene_, light);
    float left = (*world).occluded(ray) ? 0.0f : 1.0f;
    if (left == 0 && scene_.anyTransmits) {
        // A light at a place is one length of the direction away there.
        if (std::isfinite(distance)) ray.direction = direction * distance, ray.tMax = 1;
        const Vec3f through = leftAlong(scene_, *world, ray);
        left = (through.x + through.y + through.z) / 3;
    }
    // A surface is no farther off than half a voxel from where it was met.
    const Vec3f step = glm::mat3(volume_.positionFromRay) * direction * Vec3f(volume_.volume->voxels->size());
    const float from = onSurface_ ? .5f / std::max(glm::length(step), 1e-20f) : 0;
    if (left > 0 && from < distance) left *= volumesLeft(scene_, {at_, from, direction, distance}, light.scope);
    return 1 - light.shadowIntensity * (1 - left);
}

/// 17.2.2 with the voxel's colour as diffuseColor, or the style's material; from whichever side it is seen.
void StyledPoint::apply(const Shaded& step, const Vec3f& normal, Vec4f& color) const {
    const Material& m = step.material;
    if (step.hasMaterial) color.a *= m.opacity;
    if (!colors_ || !(color.a > 0)) return;
    const Material::Linear own =
        asLight_ ? m.linear : Material::Linear{.base = m.base, .specular = m.specular, .emissive = m.emissive};
    const Vec3f diffuse = step.hasMaterial ? own.base : Vec3f(color);
    if (!step.lighting) {
        color = Vec4f(step.hasMaterial ? own.base + own.emissive : diffuse, color.a);
        return;
    }
    Vec3f sum = step.hasMaterial ? own.emissive : Vec3f(0);
    const Vec3f n = normal == Vec3f(0) ? view_ : glm::dot(normal, view_) < 0 ? -normal : normal;
    const LightGroups& groups = scene_.lightGroups;
    for (std::uint32_t at = groups.start(volume_.lights); at != LightGroups::kEnd; at = groups.next(at))
        for (const TraceLight& light : groups.lightsOf(at)) {
            const LightThere there = lightAt(light, at_);
            if (!(there.factor > 0)) continue;
            if (step.hasMaterial) sum += there.factor * light.ambient * m.ambient * diffuse;
            const float cosine = glm::dot(n, there.direction);
            if (!(cosine > 0)) continue;
            Vec3f direct = diffuse * cosine;
            if (step.hasMaterial && own.specular != Vec3f(0)) {
                const Vec3f half = glm::normalize(there.direction + view_);
                direct += own.specular * std::pow(std::max(glm::dot(n, half), 0.0f), m.exponent);
            }
            const bool shadowed = step.shadows && light.shadows;
            const float fraction = shadowed ? visible(light, there.direction, there.distance) : 1;
            sum += there.factor * fraction * light.color * direct;
        }
    color = Vec4f(sum, color.a);
}

void StyledPoint::apply(const Blended& step, Vec4f& color) {
    Vec4f other(0);
    if (step.style.drawn) {
        const Vec4f voxel = step.voxels->at(position_);
        const int components = step.voxels->components();
        other = apply(step.style, *step.voxels, voxel, components, TransferFunction().of(voxel, components));
    }
    const float first = step.first.of(color.a, other.a), second = step.second.of(color.a, other.a);
    color = glm::clamp(color * first + other * second, Vec4f(0), Vec4f(1));
}

}  // namespace rtsg::trace
