// Says of sources that are sealed off from the listener by what, where and since when. Threading: the scene's thread.
#pragma once

#include <filesystem>
#include <span>

#include <rtsg/audio/acoustic_engine.h>
#include <rtsg/core/scene.h>

namespace rtsg {

/// A warning for each. `start`: scene time of the first sample. `document`: see AcousticOptions.
void tellSealed(const Scene& scene, std::span<const SealedSource> sealed, double start,
                const std::filesystem::path& document, Diagnostics& diagnostics);

}  // namespace rtsg
