// TextureLookup: the values of a hit's textures, by the coordinates of its mesh or by generated ones.
//
// Threading: values; what they refer to must outlive them.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "lighting/trace_scene.h"
#include "texture/generated_coordinates.h"

namespace rtsg::trace {

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
    Hit hit;
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
        const Vec3f created = generatedCoordinates(channel, in);
        return isInWorld(channel.generator) ? fromCamera(created) : created;
    }
    static bool isInWorld(TexCoords::Generator generator) {
        return generator == TexCoords::Generator::worldSpaceNormal ||
               generator == TexCoords::Generator::worldSpaceReflection;
    }
    Vec3f fromCamera(const Vec3f& v) const { return v.x * scene->right + v.y * scene->up - v.z * scene->forward; }
    /// Coordinates where authors gave none: for a cube, the direction from the shape's middle; for a block, the place
    /// in the box around the shape, with r from its front to its back.
    Vec4f solid(const TextureUse& use) const {
        const Mesh& mesh = *instance.mesh;
        const Vec3f position = mesh.position(hit.triangle, hit.u, hit.v);
        if (use.generated || use.space->isCube()) return {position, 1};
        const Vec3f size = mesh.bounds.size(), within = position - mesh.bounds.min;
        const auto fraction = [](float x, float of) { return of > 0 ? x / of : 0.0f; };
        return {fraction(within.x, size.x), fraction(within.y, size.y), 1 - fraction(within.z, size.z), 1};
    }
    /// The direction in the world by which a GeneratedCubeMapTexture is looked up, whatever frame it was found in.
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
    /// (s, t, r, q) before the texture's transform.
    Vec4f untransformed(std::size_t channel, const TextureUse& use) const {
        const TexCoords* own = coordsOf(channel);
        Vec4f str;
        if (own && own->generator != TexCoords::Generator::none)
            str = {generated(*own), 1};
        else if (!use.texture && !isFlat(use) && !(own && own->authored))
            str = solid(use);
        else
            str = instance.mesh->texCoord(hit.triangle, hit.u, hit.v, channel);
        if (use.generated && !isFlat(use)) str = {inWorld(own, Vec3f(str)), str.w};
        return str;
    }
    /// Before they are divided by q.
    static Vec4f transformed(const TextureUse& use, const Vec4f& str) {
        if (use.matrix3) [[unlikely]]
            return *use.matrix3 * str;
        return {use.matrix.apply({str.x, str.y}), str.z, str.w};
    }
    Vec3f coordinates(std::size_t channel, const TextureUse& use) const {
        const Vec4f str = transformed(use, untransformed(channel, use));
        return str.w == 1 || str.w == 0 ? Vec3f(str) : Vec3f(str) / str.w;
    }
    /// At another place in the plane of the triangle that was hit.
    TextureLookup at(float u, float v) const {
        TextureLookup there = *this;
        const Mesh& mesh = *instance.mesh;
        there.hit.u = u, there.hit.v = v;
        there.position += glm::mat3(instance.rayFromLocal) *
                          (mesh.position(hit.triangle, u, v) - mesh.position(hit.triangle, hit.u, hit.v));
        const Vec3f turned = glm::normalize(instance.normalFromLocal * mesh.shadingNormal(hit.triangle, u, v));
        there.normal = glm::dot(turned, normal) < 0 ? -turned : turned;
        return there;
    }
    /// Side of the pixel on the texture, as a share of the texture's side.
    float spread(std::size_t channel, const TextureUse& use) const {
        if (footprint <= 0) return 0;
        // Generated coordinates and directions have no stretch that the corners could tell.
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

}  // namespace rtsg::trace
