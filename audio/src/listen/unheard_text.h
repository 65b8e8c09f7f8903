// Says why nothing at all was heard. Threading: the scene's thread.
#pragma once

#include <span>

#include <rtsg/core/scene.h>

#include "engine/acoustic_engine.h"

namespace rtsg {

/// A warning for each of the first of them, as far as their nodes are still there with their lines.
void reportUnheard(const Scene& scene, std::span<const UnheardSource> unheard, Diagnostics& diagnostics);

/// Tells that a scene has no sounds, or where the first of those is that are not shown.
void reportNoSounds(const Scene& scene, Diagnostics& diagnostics);

}  // namespace rtsg
