// Applies colours, textures and maps to the plain numbers of materials.
//
// Threading: functions of their arguments.
#pragma once

#include <algorithm>
#include <cstdint>

#include "surface_packet.h"
#include "texture_lookup.h"

namespace rtsg::trace {

/// A number of a file as a share. Colours of a mesh, and what stages of textures make of them, may have any value. A
/// share above 1 or below 0 would let rays multiply without end, so it is clamped; NaN counts as opaque.
inline float fraction(float number) {
    return number < 1 ? std::max(number, 0.0f) : 1;
}

/// `opacity`: the material's, or the alpha of a mesh's colours in its place (11.2.2).
inline float coverageOf(const Material& material, float textureAlpha, float opacity) {
    switch (material.alphaMode) {
        case AlphaMode::opaque:
            return 1;
        case AlphaMode::mask:
            return textureAlpha * opacity < material.alphaCutoff ? 0.0f : 1.0f;
        case AlphaMode::automatic:
        case AlphaMode::blend:
            break;
    }
    return fraction(textureAlpha);
}

inline float opacityOf(const Material& material, float opacity) {
    return material.alphaMode == AlphaMode::opaque || material.alphaMode == AlphaMode::mask ? 1.0f : fraction(opacity);
}

/// The share of light that the absorption of a surface leaves. In a body it depends on the distance; a surface that
/// bends nothing is a thin sheet.
inline Vec3f leftBySheet(const Material& material) {
    return material.refractiveIndex > 0 || material.absorption == Vec3f(0) ? Vec3f(1) : glm::exp(-material.absorption);
}

/// Applies the stages of a MultiTexture to a colour and to the material's alpha, `opacity`, with which the first stage
/// begins (18.4.3).
Vec4f applyStages(const TextureLookup& look, const Material& material, const Vec3f& base, const Vec3f& specular,
                  float opacity);

/// Splits the alpha that a MultiTexture made into the share that its textures cover and the material's opacity: if it
/// is less than the opacity, textures cut the rest out; if it is more, it is the opacity itself. If nothing has an
/// alpha, the formulas make none, as in browsers: SUBTRACT of two opaque textures would otherwise be clear.
void splitAlpha(const Material& material, float created, float& coverage, float& opacity);

/// `opacity` is that of the surface before textures. Sets `alpha` to that of its textures, and `opacity` to the opacity
/// with them.
void findAlpha(const TextureLookup& look, const Material& material, float& alpha, float& opacity);

/// The position of a place in the picture, in pixels from the picture's middle.
Vec2f pixelOf(const TraceScene& scene, const Vec3f& position);

/// Adds detail to lanes on one instance that have their material's plain numbers; caps keep these. `tasks` are the
/// rays, null for primary ones. The result of a lane does not depend on the others.
void addDetail(const TraceScene& scene, const RayInstance& instance, const SlotShading& slot, const PathTask* tasks,
               std::uint32_t lanes, SurfacePacket& out);

}  // namespace rtsg::trace
