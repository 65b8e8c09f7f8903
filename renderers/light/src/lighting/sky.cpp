// Mixes the colours of backgrounds.
#include <rtsg/renderers/sky.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include <rtsg/renderers/space_texture.h>

namespace rtsg {

namespace {

/// Colour at `angle` on a run of colours, the first of which is at angle 0.
Vec3f gradient(const std::vector<Vec3f>& colors, const std::vector<float>& angles, float angle) {
    const std::size_t steps = std::min(colors.size() - 1, angles.size());
    const auto last = angles.begin() + static_cast<std::ptrdiff_t>(steps);
    const auto i = static_cast<std::size_t>(std::lower_bound(angles.begin(), last, angle) - angles.begin());
    if (i == steps) return colors[steps];
    const float before = i > 0 ? angles[i - 1] : 0, width = angles[i] - before;
    return width > 0 ? glm::mix(colors[i], colors[i + 1], (angle - before) / width) : colors[i + 1];
}

/// The angle between a unit vector and an axis, along which it is `along` and across which it is `across` long. Near
/// the axis an arc cosine knows no angles below a three-thousandth.
float angleTo(float along, float across) {
    constexpr float kNear = .99f;
    if (std::abs(along) < kNear) return std::acos(along);
    return along > 0 ? std::asin(std::min(across, 1.0f))
                     : std::numbers::pi_v<float> - std::asin(std::min(across, 1.0f));
}

}  // namespace

bool Sky::uniform() const {
    for (const auto& side : panorama)
        if (side) return false;
    return groundColors.empty() && (skyColors.size() <= 1 || skyAngles.empty());
}

Vec4f Sky::color(const Vec3f& direction, ColorSpace space) const {
    const auto inSpace = [space](const Vec3f& color) {
        return space == ColorSpace::linear ? linearFromSrgb(color) : color;
    };
    if (uniform()) return Vec4f(skyColors.empty() ? Vec3f(0) : inSpace(skyColors[0]), 1) * alpha;
    const Vec3f d = localFromWorld * direction;
    const float across = std::sqrt(d.x * d.x + d.z * d.z);
    Vec3f result = skyColors.empty() ? Vec3f(0) : gradient(skyColors, skyAngles, angleTo(d.y, across));
    if (!groundColors.empty()) {
        // A single colour without an angle is a ground up to the horizon.
        const float reach =
            groundAngles.empty()
                ? std::numbers::pi_v<float> / 2
                : groundAngles[std::min(groundAngles.size(), std::max<std::size_t>(groundColors.size() - 1, 1)) - 1];
        const float fromNadir = angleTo(-d.y, across);
        if (fromNadir <= reach) result = gradient(groundColors, groundAngles, fromNadir);
    }
    Vec4f rgba(inSpace(result) * alpha, alpha);
    if (std::ranges::none_of(panorama, [](const auto& picture) { return picture != nullptr; })) return rgba;

    const CubePosition onCube = cubePosition(d);
    if (const auto& texture = panorama[static_cast<std::size_t>(onCube.side)]) {
        const TextureAccess access{TextureWrap::clamp, TextureWrap::clamp, true};
        const Vec4f texel = texture->sample(onCube.st.x, onCube.st.y, 0, access, space);
        rgba = Vec4f(Vec3f(texel) * texel.a, texel.a) + rgba * (1 - texel.a);
    }
    return rgba;
}

}  // namespace rtsg
