// Pictures into files: one, a numbered row of them, or an animation, of a scene that runs meanwhile.
//
// Threading: the scene's thread; a picture itself is made by several.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include <rtsg/renderers/light_renderer.h>

namespace rtsg {

struct AnimationOptions {
    int frames = 1;
    double framesPerSecond = 25;
    double start = 0;  // scene time of the first frame, seconds
    /// Runs the scene to a frame's time, where Scene::newFrame is not all that is done in a frame: Inlines are loaded,
    /// events sent.
    std::function<void(double t)> runTo{};
    /// Called after each frame with the number done; false stops.
    std::function<bool(int)> progress{};
    /// Called with every picture's counts.
    std::function<void(const RenderStats&)> stats{};
};
/// Runs the renderer's scene and writes its pictures, the first after what LightRenderer::remember() was told of: a
/// film
/// (.mp4), a GIF that moves, or one file a frame where the name holds a place for its number such as %04d. A single
/// frame needs neither. Returns how many frames are in files: all, unless `progress` or the settings' ended it; a file
/// is complete or is not there. Errors: as picture() and writePicture(); several frames without a place for the number;
/// layers for another format than .exr.
Result<int> renderToFile(LightRenderer& light, const std::filesystem::path& file, const ImageOptions& options,
                         const AnimationOptions& animation = {}, const ToneMap& toneMap = {});

/// Puts `number` in place of the one `%d` or `%0Nd`; nothing if the name has none or another conversion.
std::optional<std::string> numberedName(const std::string& pattern, int number);

}  // namespace rtsg
