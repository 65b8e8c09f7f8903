// The part of light's tables for lights, viewpoints, backgrounds, fogs and NavigationInfos.
#include <algorithm>
#include <optional>

#include <fmt/format.h>

#include <rtsg/core/navigation.h>
#include <rtsg/core/placement.h>
#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>

#include "light_tables.h"
#include "lighting/environment.h"

namespace rtsg {

using namespace trace;

namespace {

/// N: the node's type.
template <class N>
Binding bindingOf(const Scene& scene, const Node& node) {
    if (node.get(N::isBound)) return Binding::bound;
    if (node.get(N::bindTime).seconds != 0) return Binding::unbound;  // it was bound once
    return isInlined(scene, node) ? Binding::inlined : Binding::first;
}

Navigation readNavigation(const Scene& scene, const Node& node) {
    using N = x3d::NavigationInfo;
    return {node.get(N::headlight), bindingOf<N>(scene, node), node.get(N::visibilityLimit)};
}

View readView(const Scene& scene, const Node& node) {
    View view;
    view.name = scene.name(node.id());
    const auto common = [&]<class V>(const V*) {
        view.orientation = node.get(V::orientation);
        view.binding = bindingOf<V>(scene, node);
        view.viewAll = node.get(V::viewAll);
        view.nearDistance = node.get(V::nearDistance), view.farDistance = node.get(V::farDistance);
        view.description = node.get(V::description).str();
        // A GeoViewpoint is where its coordinates are: the flattener places it.
        view.position = Vec3d(0);
        if constexpr (!std::is_same_v<V, x3d::GeoViewpoint>) view.position = Vec3d(node.get(V::position));
        const Node* brought = scene.effectiveNode(node.get(V::navigationInfo));
        if (brought && brought->is(x3d::NavigationInfo::type)) view.navigation = readNavigation(scene, *brought);
    };
    if (node.is(x3d::Viewpoint::type)) {
        common(static_cast<const x3d::Viewpoint*>(nullptr));
        view.fieldOfView = node.get(x3d::Viewpoint::fieldOfView);
    } else if (node.is(x3d::OrthoViewpoint::type)) {
        common(static_cast<const x3d::OrthoViewpoint*>(nullptr));
        view.orthographic = true;
        view.extent = extentOf(node);
    } else if (node.is(x3d::GeoViewpoint::type)) {
        common(static_cast<const x3d::GeoViewpoint*>(nullptr));
        view.fieldOfView = node.get(x3d::GeoViewpoint::fieldOfView);
    }
    if (const auto moved = movedView(node)) {
        view.position = moved->position;
        view.orientation = orientationOf(*moved);
    }
    return view;
}

/// Angles lie between colours (24.2.1).
void checkColors(const Scene& scene, const Node& node, const Sky& sky, Diagnostics& diagnostics) {
    const auto check = [&](const char* kind, std::size_t colors, std::size_t angles) {
        if (colors == angles + 1 || (colors == 0 && angles == 0)) return;
        const std::string_view name = scene.name(node.id());
        diagnostics.warningAt(scene.locationOf(node.id()),
                              fmt::format("{}{}{}: {}Color has {} colours, which is not one more than the {} of "
                                          "{}Angle: those without a partner are left out",
                                          node.type().name, name.empty() ? "" : " ", name, kind, colors, angles, kind));
    };
    check("sky", sky.skyColors.size(), sky.skyAngles.size());
    check("ground", sky.groundColors.size(), sky.groundAngles.size());
}

template <class S>
void readColors(const Node& node, Sky& sky, const S*) {
    const auto colors = [](const Array<Color>& from) {
        std::vector<Vec3f> result;
        for (const Color& c : from) result.emplace_back(std::max(c.r, 0.0f), std::max(c.g, 0.0f), std::max(c.b, 0.0f));
        return result;
    };
    sky.skyColors = colors(node.get(S::skyColor));
    sky.groundColors = colors(node.get(S::groundColor));
    // One that goes back, which 24.2.1 does not allow, is taken as that before it.
    const auto angles = [](const Array<float>& from) {
        std::vector<float> result;
        for (const float angle : from) result.push_back(std::max(result.empty() ? 0.0f : result.back(), angle));
        return result;
    };
    sky.skyAngles = angles(node.get(S::skyAngle));
    sky.groundAngles = angles(node.get(S::groundAngle));
    sky.alpha = std::clamp(1 - node.get(S::transparency), 0.0f, 1.0f);
}

}  // namespace

namespace {

/// The plane in the world, if the frame's transform has an inverse; nothing if it has no direction.
std::optional<CutPlane> planeIn(const WorldFromLocal& m, const Vec4d& plane) {
    CutPlane result;
    result.normal = glm::transpose(glm::inverse(glm::dmat3(m[0], m[1], m[2]))) * Vec3d(plane);
    result.offset = plane.w - glm::dot(result.normal, m[3]);
    const double length = glm::length(result.normal);
    if (!(length > 0) || !std::isfinite(length + result.offset)) return std::nullopt;
    result.normal /= length, result.offset /= length;
    return result;
}

/// A ClipPlane, or a LayoutGroup's viewport, which divides a square of side 1 about the origin.
ClipEntry readClip(const Node& node, const WorldFromLocal& m) {
    ClipEntry clip;
    std::vector<Vec4d> planes;
    if (node.is(x3d::ClipPlane::type) && node.get(x3d::ClipPlane::enabled)) {
        planes.emplace_back(node.get(x3d::ClipPlane::plane));
        clip.capped = true;
    } else if (node.is(x3d::Viewport::type)) {
        const auto [left, right, bottom, top] = clipBoundaryOf(node);
        planes = {{1, 0, 0, .5 - double{left}},
                  {-1, 0, 0, double{right} - .5},
                  {0, 1, 0, .5 - double{bottom}},
                  {0, -1, 0, double{top} - .5}};
    }
    if (determinantSign(m) == 0 || !isFinite(m)) return clip;
    for (const Vec4d& plane : planes)
        if (const auto in = planeIn(m, plane)) clip.planes.push_back(*in);
    return clip;
}

}  // namespace

std::shared_ptr<const PlacedEntry> LightTables::readPlaced(const Scene& scene, const Placed& placed) {
    auto entry = std::make_shared<PlacedEntry>();
    entry->placed = placed;
    const Node* node = scene.find(placed.node);
    if (!node) return entry;
    switch (placed.kind) {
        case PlacedKind::light:
            entry->what = readLights(scene, *node, placed);
            ++counts_.lightsRead;
            break;
        case PlacedKind::view:
            entry->what = readView(scene, *node);
            break;
        case PlacedKind::background:
            entry->what = readSky(scene, *node, placed.worldFromLocal);
            break;
        case PlacedKind::fog:
            if (node->is(x3d::Fog::type))
                entry->what =
                    FogEntry{readFog(scene, placed.node, placed.worldFromLocal), bindingOf<x3d::Fog>(scene, *node)};
            break;
        case PlacedKind::navigation:
            if (node->is(x3d::NavigationInfo::type)) entry->what = readNavigation(scene, *node);
            break;
        case PlacedKind::clipPlane:
            if (ClipEntry clip = readClip(*node, placed.worldFromLocal); !clip.planes.empty()) {
                clip.scope = scopeNumber(placed.scope);
                entry->what = std::move(clip);
            }
            break;
        case PlacedKind::window:
            if (node->is(x3d::Viewport::type))
                entry->what = ClipEntry{{}, clipBoundaryOf(*node), scopeNumber(placed.scope), false};
            break;
        case PlacedKind::localFog:
            if (node->is(x3d::LocalFog::type) && node->get(x3d::LocalFog::enabled))
                entry->what =
                    LocalFogEntry{readFog(scene, placed.node, placed.worldFromLocal), scopeNumber(placed.scope)};
            break;
        default:
            break;
    }
    return entry;
}

Light LightTables::readLights(const Scene& scene, const Node& node, const Placed& placed) {
    Light light = readLight(scene, placed.node, placed.worldFromLocal, placed.scope);
    NodeId picture;
    if (light.kind == Light::Kind::environment) {
        light.environment = environmentOf(scene, node);
        return light;
    }
    if (light.kind == Light::Kind::projector)
        picture = node.get(x3d::TextureProjector::texture);
    else if (light.kind == Light::Kind::projectorParallel)
        picture = node.get(x3d::TextureProjectorParallel::texture);
    else
        return light;
    const Node* texture = scene.effectiveNode(picture);
    showPicture(light, texture ? textures_->ofNode(scene, *texture, Texture::Content::color, diagnostics_) : nullptr);
    return light;
}

std::shared_ptr<const Environment> LightTables::environmentOf(const Scene& scene, const Node& node) {
    using E = x3d::EnvironmentLight;
    const auto say = [&](const std::string& what) {
        const std::string_view name = scene.name(node.id());
        diagnostics_.warningAt(scene.locationOf(node.id()),
                               fmt::format("EnvironmentLight{}{}: {}", name.empty() ? "" : " ", name, what));
    };
    const auto cube = [&](NodeId id) -> std::shared_ptr<const SpaceTexture> {
        const Node* texture = scene.effectiveNode(id);
        if (!texture) return nullptr;
        if (TextureStore::isSpace(*texture))
            return textures_->spaceOfNode(scene, *texture, Texture::Content::color, diagnostics_);
        say(fmt::format("a {} is no light that is there beforehand, and is left out", texture->type().name));
        return nullptr;
    };
    Environment::Source source{cube(node.get(E::specularTexture)), cube(node.get(E::diffuseTexture)), std::nullopt};
    if (const Array<float>& numbers = node.get(E::diffuseCoefficients); numbers.size() == 27) {
        Harmonics& irradiance = source.irradiance.emplace();
        for (std::size_t i = 0; i < 27; ++i)
            irradiance[i / 3][static_cast<glm::length_t>(i % 3)] = std::isfinite(numbers[i]) ? numbers[i] : 0.0f;
    } else if (!numbers.empty()) {
        say(fmt::format("diffuseCoefficients are 27 numbers, not {}, and are left out", numbers.size()));
    }
    if (node.get(E::shadows)) say("its shadows are in pictures by path alone");
    std::erase_if(environments_, [](const auto& known) { return known.expired(); });
    for (const auto& known : environments_)
        if (auto same = known.lock(); same && same->source() == source) return same;
    auto created = std::make_shared<const Environment>(std::move(source));
    environments_.emplace_back(created);
    return created;
}

SkyEntry LightTables::readSky(const Scene& scene, const Node& node, const WorldFromLocal& worldFromLocal) {
    SkyEntry entry;
    constexpr auto color = Texture::Content::color;
    if (node.is(x3d::Background::type)) {
        using B = x3d::Background;
        readColors(node, entry.sky, static_cast<const B*>(nullptr));
        entry.binding = bindingOf<B>(scene, node);
        const Field<Array<String>> urls[] = {B::frontUrl, B::backUrl, B::leftUrl, B::rightUrl, B::topUrl, B::bottomUrl};
        for (std::size_t i = 0; i < 6; ++i)
            entry.sky.panorama[i] = textures_->ofUrls(scene, node, node.get(urls[i]), color, diagnostics_);
    } else if (node.is(x3d::TextureBackground::type)) {
        using B = x3d::TextureBackground;
        readColors(node, entry.sky, static_cast<const B*>(nullptr));
        entry.binding = bindingOf<B>(scene, node);
        const Field<NodeId> sides[] = {B::frontTexture, B::backTexture, B::leftTexture,
                                       B::rightTexture, B::topTexture,  B::bottomTexture};
        for (std::size_t i = 0; i < 6; ++i)
            if (const Node* side = scene.effectiveNode(node.get(sides[i])))
                entry.sky.panorama[i] = textures_->ofNode(scene, *side, color, diagnostics_);
    }
    checkColors(scene, node, entry.sky, diagnostics_);
    entry.sky.localFromWorld = glm::mat3(glm::transpose(turningOf(worldFromLocal)));
    return entry;
}

}  // namespace rtsg
