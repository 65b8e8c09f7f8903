// Pictures into files, one by one or as an animation.
#include <rtsg/renderers/image.h>

#include <algorithm>
#include <cctype>

#include <fmt/format.h>

namespace rtsg {

std::optional<std::string> numberedName(const std::string& pattern, int number) {
    std::string result;
    bool placed = false;
    for (std::size_t i = 0; i < pattern.size(); ++i) {
        if (pattern[i] != '%') {
            result.push_back(pattern[i]);
            continue;
        }
        if (i + 1 < pattern.size() && pattern[i + 1] == '%') {
            result.push_back(pattern[i++]);
            continue;
        }
        std::size_t end = i + 1;
        const bool zeros = end < pattern.size() && pattern[end] == '0';
        std::size_t width = 0;
        for (; end < pattern.size() && std::isdigit(static_cast<unsigned char>(pattern[end])); ++end)
            width = std::min<std::size_t>(width * 10 + static_cast<std::size_t>(pattern[end] - '0'), 64);
        if (placed || end >= pattern.size() || pattern[end] != 'd') return std::nullopt;
        const std::string digits = std::to_string(number);
        if (digits.size() < width) result.append(width - digits.size(), zeros ? '0' : ' ');
        result += digits;
        placed = true;
        i = end;
    }
    if (!placed) return std::nullopt;
    return result;
}

Result<int> renderToFile(LightRenderer& light, const std::filesystem::path& file, const ImageOptions& options,
                         const AnimationOptions& animation, const ToneMap& toneMap) {
    if (animation.frames < 1) return fail("an animation needs at least one frame");
    if (!(animation.framesPerSecond > 0)) return fail("frames per second must be positive");
    const bool gif = file.extension() == ".gif" || file.extension() == ".GIF";
    const bool numbered = numberedName(file.filename().string(), 0).has_value();
    if (animation.frames > 1 && !gif && !numbered)
        return fail("several frames need a .gif, or a name with a place for their number such as %04d", {},
                    file.string());
    if (options.settings.layers != 0 && file.extension() != ".exr" && file.extension() != ".EXR")
        return fail("only .exr holds layers", {}, file.string());
    std::vector<Picture> frames;
    int done = 0;
    for (int i = 0; i < animation.frames; ++i) {
        const double t = animation.start + i / animation.framesPerSecond;
        if (animation.runTo)
            animation.runTo(t);
        else
            light.world().scene().newFrame(t);
        RenderStats stats;
        auto picture = light.picture(options, &stats);
        if (!picture) return std::unexpected(picture.error());
        if (stats.cancelled) break;
        if (animation.stats) animation.stats(stats);
        if (gif && !numbered) {
            frames.push_back(std::move(*picture));
        } else {
            const auto name = numbered ? file.parent_path() / *numberedName(file.filename().string(), i) : file;
            if (auto ok = writePicture(*picture, name, toneMap); !ok) return std::unexpected(ok.error());
        }
        ++done;
        if (animation.progress && !animation.progress(i + 1)) break;
    }
    if (!gif || numbered) return done;
    if (done < animation.frames) return 0;
    if (auto ok = writeAnimation(frames, file, animation.framesPerSecond, toneMap); !ok)
        return std::unexpected(ok.error());
    return done;
}

}  // namespace rtsg
