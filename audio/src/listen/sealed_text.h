// Says what keeps sound from the listener, and where a room loses it: by which shapes, where and since when. Threading:
// the scene's thread.
#pragma once

#include <filesystem>
#include <span>

#include <rtsg/core/scene.h>

#include "engine/acoustic_engine.h"

namespace rtsg {

/// A warning for each. `start`: scene time of the first sample. `document`: see AcousticOptions.
void reportSealed(const Scene& scene, std::span<const SealedSource> sealed, double start,
                  const std::filesystem::path& document, Diagnostics& diagnostics);

/// A warning for each that the author does not mean, by a MetadataBoolean "opening" TRUE in the metadata of a shape
/// beside.
void reportLeaks(const Scene& scene, std::span<const SoundLeak> leaks, const std::filesystem::path& document,
                 Diagnostics& diagnostics);
/// Sets the names of the shapes beside; an opening that the author intends is no leak.
void nameShapes(const Scene& scene, RoomOpenings& openings);

}  // namespace rtsg
