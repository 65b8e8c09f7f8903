// The directivity of an emitter, by which paths and rays are weighted.
//
// Source: ISO/IEC 19775-1 V4.0 16.4.17 (ellipsoids of Sound), 16.4.18 (cones of SpatialSound). Threading: pure
// function.
#pragma once

#include <glm/glm.hpp>

#include <rtsg/audio/sound_scene.h>

namespace rtsg {

/// The energy that an emitter at `source` sends to each side: by its cones, and if `levels` count by its ellipsoids,
/// whose level is 1 towards the listener. Empty where it sends alike to all sides, and where by its ellipsoids nothing
/// is heard at the listener, so that no side can be set against that one.
SourcePattern patternOf(const SoundEmitter& emitter, const glm::dvec3& source, const glm::dvec3& listener, bool levels);

}  // namespace rtsg
