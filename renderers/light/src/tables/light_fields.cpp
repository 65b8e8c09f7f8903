// Reads lights and fogs into the flat numbers that shading uses.
#include <algorithm>
#include <cmath>

#include <glm/gtc/matrix_transform.hpp>

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>
#include <rtsg/renderers/camera.h>
#include <rtsg/renderers/material.h>

namespace rtsg {

namespace {

float orNothing(float x) {
    return std::isfinite(x) ? std::max(x, 0.0f) : 0.0f;
}
Vec3f orNothing(const Vec3f& v) {
    return {orNothing(v.x), orNothing(v.y), orNothing(v.z)};
}
Vec3f orNothing(const Color& c) {
    return orNothing(Vec3f(c.r, c.g, c.b));
}

float lengthsOf(const WorldFromLocal& m) {
    const double scale = std::cbrt(std::abs(glm::determinant(glm::dmat3(m[0], m[1], m[2]))));
    return scale > 0 && std::isfinite(scale) ? static_cast<float>(scale) : 1.0f;
}

/// Reads the fields of one light node, group by group.
struct LightFields {
    const Node& node;
    const WorldFromLocal& worldFromLocal;
    Light& light;

    Vec3d toWorld(const Vec3f& v) const {
        return worldFromLocal[0] * double{v.x} + worldFromLocal[1] * double{v.y} + worldFromLocal[2] * double{v.z};
    }
    template <class L>
    void common() {
        light.on = node.get(L::on);
        light.shadows = node.get(L::shadows);
        light.shadowIntensity = std::min(orNothing(node.get(L::shadowIntensity)), 1.0f);
        const Vec3f color = orNothing(node.get(L::color));
        light.color = color * orNothing(node.get(L::intensity));
        light.ambient = color * orNothing(node.get(L::ambientIntensity));
    }
    template <class L>
    void turned() {
        const Vec3d world = toWorld(node.get(L::direction));
        const double length = glm::length(world);
        if (length > 0 && std::isfinite(length))
            light.direction = world / length;
        else
            light.on = false;  // it shines nowhere
    }
    template <class L>
    void placed() {
        light.position = toWorld(node.get(L::location)) + worldFromLocal[3];
        light.localFromWorld = 1 / lengthsOf(worldFromLocal);
        if (!glm::all(glm::lessThan(glm::abs(light.position), Vec3d(1e18)))) light.on = false;
    }
    template <class L>
    void falling() {
        light.attenuation = orNothing(node.get(L::attenuation));
        light.radius = node.get(L::radius);
    }
    /// Into the frame that is turned by `rotation` within the light's own; scales do not matter.
    void surrounding(const Rotation& rotation) {
        const Vec3d axis(rotation.x, rotation.y, rotation.z);
        const double length = glm::length(axis);
        glm::dmat3 turned = turningOf(worldFromLocal);
        if (length > 0 && std::isfinite(length + rotation.angle))
            turned *= glm::dmat3(glm::rotate(glm::dmat4(1), double{rotation.angle}, axis / length));
        light.localFromWorldRotation = glm::mat3(glm::transpose(turned));
    }
    template <class L>
    void projecting() {
        const Vec3d forward(light.direction);
        Vec3d right = glm::cross(forward, toWorld(node.get(L::upVector)));
        // An up that is none, or lies along the direction: any that is across.
        if (!(glm::length(right) > 1e-9) || !std::isfinite(glm::length(right)))
            right = glm::cross(forward, std::abs(forward.y) < .9 ? Vec3d(0, 1, 0) : Vec3d(0, 0, -1));
        right = glm::normalize(right);
        light.right = right, light.up = glm::cross(right, forward);
        const float near = node.get(L::nearDistance), far = node.get(L::farDistance);
        if (near > 0) light.nearDistance = near / light.localFromWorld;
        if (far >= 0) light.farDistance = far / light.localFromWorld;
    }
};

}  // namespace

Light readLight(const Scene& scene, NodeId id, const WorldFromLocal& worldFromLocal, ScopeId scope) {
    Light light;
    light.scope = scope;
    const Node* node = scene.find(id);
    if (!node) {
        light.on = false;
        return light;
    }
    LightFields fields{*node, worldFromLocal, light};
    if (node->is(x3d::DirectionalLight::type)) {
        fields.common<x3d::DirectionalLight>();
        fields.turned<x3d::DirectionalLight>();
    } else if (node->is(x3d::PointLight::type)) {
        light.kind = Light::Kind::point;
        fields.common<x3d::PointLight>();
        fields.placed<x3d::PointLight>();
        fields.falling<x3d::PointLight>();
    } else if (node->is(x3d::SpotLight::type)) {
        using S = x3d::SpotLight;
        light.kind = Light::Kind::spot;
        fields.common<S>();
        fields.placed<S>();
        fields.falling<S>();
        fields.turned<S>();
        light.beamWidth = orNothing(node->get(S::beamWidth));
        light.cutOffAngle = orNothing(node->get(S::cutOffAngle));
    } else if (node->is(x3d::TextureProjector::type)) {
        using P = x3d::TextureProjector;
        light.kind = Light::Kind::projector;
        fields.common<P>();
        fields.placed<P>();
        fields.turned<P>();
        fields.projecting<P>();
        const double half = std::clamp(static_cast<double>(node->get(P::fieldOfView)) / 2, 0.0, 1.57);
        light.extent = static_cast<float>(std::tan(half)) * Vec4f(-1, -1, 1, 1);
    } else if (node->is(x3d::TextureProjectorParallel::type)) {
        using P = x3d::TextureProjectorParallel;
        light.kind = Light::Kind::projectorParallel;
        fields.common<P>();
        fields.placed<P>();
        fields.turned<P>();
        fields.projecting<P>();
        light.extent = node->get(P::fieldOfView) / light.localFromWorld;
    } else if (node->is(x3d::EnvironmentLight::type)) {
        light.kind = Light::Kind::environment;
        fields.common<x3d::EnvironmentLight>();
        fields.surrounding(node->get(x3d::EnvironmentLight::rotation));
    } else {
        light.on = false;
    }
    return light;
}

void showPicture(Light& projector, std::shared_ptr<const Texture> picture) {
    if (!picture) {
        projector.on = false;
        return;
    }
    if (projector.kind == Light::Kind::projector) {
        const auto width = static_cast<float>(picture->width()), height = static_cast<float>(picture->height());
        const float shorter = std::min(width, height);
        projector.extent *= Vec4f(width, height, width, height) / shorter;
    }
    const Vec4f& e = projector.extent;
    if (!(e.z > e.x) || !(e.w > e.y) || !std::isfinite(e.x + e.y + e.z + e.w)) projector.on = false;
    projector.picture = std::move(picture);
}

Fog readFog(const Scene& scene, NodeId id, const WorldFromLocal& worldFromLocal) {
    Fog fog;
    const Node* node = scene.find(id);
    const auto read = [&]<class F>(const F*) {
        fog.color = orNothing(node->get(F::color));
        fog.visibilityRange = orNothing(node->get(F::visibilityRange)) * lengthsOf(worldFromLocal);
        const bool exponential = node->get(F::fogType) == String("EXPONENTIAL");
        fog.type = exponential ? FogType::exponential : FogType::linear;
        if (fog.visibilityRange <= 0) fog.type = FogType::none;
        if (!node->get(F::volumetric)) return;
        // Along its own direction from its own origin, as Castle Game Engine describes it.
        const Vec3d along = glm::dmat3(worldFromLocal) * Vec3d(node->get(F::volumetricDirection));
        const double length = glm::length(along);
        if (!(length > 0) || !std::isfinite(length)) {
            fog.type = FogType::none;
            return;
        }
        fog.along = Vec3f(along / length);
        const float start = node->get(F::volumetricVisibilityStart);
        fog.begin = static_cast<float>(glm::dot(along / length, Vec3d(worldFromLocal[3]))) +
                    (std::isfinite(start) ? start : 0.0f) * lengthsOf(worldFromLocal);
    };
    if (node && node->is(x3d::Fog::type)) read(static_cast<const x3d::Fog*>(nullptr));
    if (node && node->is(x3d::LocalFog::type)) read(static_cast<const x3d::LocalFog*>(nullptr));
    return fog;
}

}  // namespace rtsg
