// What colours, textures and maps make of the plain numbers of materials.
//
// Threading: functions of their arguments.
#pragma once

#include <algorithm>
#include <cstdint>

#include "surface_packet.h"
#include "texture_lookup.h"

namespace rtsg::trace {

/// What a file's number does as a share: the colours of a mesh and what stages of textures make of them may be any.
/// More than one, or less than nothing, would let rays multiply without end; what is no number is opaque.
inline float share(float number) {
    return number < 1 ? std::max(number, 0.0f) : 1;
}

/// `opacity`: the material's, or what the colours of a mesh have in its place (11.2.2).
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
    return share(textureAlpha);
}

inline float opacityOf(const Material& material, float opacity) {
    return material.alphaMode == AlphaMode::opaque || material.alphaMode == AlphaMode::mask ? 1.0f : share(opacity);
}

/// What a MultiTexture makes of a colour and of the material's alpha, `opacity`, with which its first stage begins
/// (18.4.3).
Vec4f applyStages(const TextureLookup& look, const Material& material, const Vec3f& base, const Vec3f& specular,
                  float opacity);

/// The whole alpha that a MultiTexture made, as a share that the textures cover of the material's opacity: what is less
/// than that was cut out by textures, what is more is the opacity itself. Where nothing has an alpha its formulas make
/// none, as browsers have it: SUBTRACT of two opaque textures would be clear.
void splitAlpha(const Material& material, float made, float& coverage, float& opacity);

/// Of a surface whose opacity, before textures, is this: the alpha of its textures, and its opacity with them.
void findAlpha(const TextureLookup& look, const Material& material, float& alpha, float& opacity);

/// Where in the picture a place is seen, in pixels from its middle.
Vec2f pixelOf(const TraceScene& scene, const Vec3f& place);

/// Of lanes on one instance, which have their material's plain numbers; caps keep those. `tasks`: the rays, null for
/// primary ones. What a lane gets does not depend on the others.
void addDetail(const TraceScene& scene, const RayInstance& instance, const SlotShading& slot, const PathTask* tasks,
               std::uint32_t lanes, SurfacePacket& out);

}  // namespace rtsg::trace
