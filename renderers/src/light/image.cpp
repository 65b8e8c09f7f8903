// Pictures into files, one by one or as an animation.
#include <rtsg/renderers/image.h>

#include <algorithm>
#include <cctype>
#include <optional>

#include <fmt/format.h>

#include <rtsg/renderers/movie_writer.h>

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

namespace {

/// The pictures of an animation into their files, as they are made; of a GIF once all are.
class AnimationFiles {
  public:
    AnimationFiles(const std::filesystem::path& file, const AnimationOptions& animation, const ToneMap& toneMap)
        : file_(file),
          animation_(animation),
          toneMap_(toneMap),
          numbered_(numberedName(file.filename().string(), 0).has_value()),
          film_(!numbered_ && MovieWriter::isName(file)),
          gif_(!numbered_ && (file.extension() == ".gif" || file.extension() == ".GIF")) {}

    /// Whether the pictures are one file.
    bool together() const { return film_ || gif_; }
    bool takesSeveral() const { return together() || numbered_; }

    Result<> add(Picture picture, int number) {
        if (film_) {
            if (!movie_) {
                auto movie = MovieWriter::create(file_, picture.width, picture.height, animation_.framesPerSecond);
                if (!movie) return std::unexpected(movie.error());
                movie_.emplace(std::move(*movie));
            }
            return movie_->add(picture, toneMap_);
        }
        if (gif_) {
            frames_.push_back(std::move(picture));
            return {};
        }
        const auto name = numbered_ ? file_.parent_path() / *numberedName(file_.filename().string(), number) : file_;
        return writePicture(picture, name, toneMap_);
    }
    Result<> finish() {
        if (movie_) return movie_->finish();
        return gif_ ? writeAnimation(frames_, file_, animation_.framesPerSecond, toneMap_) : Result<>();
    }

  private:
    const std::filesystem::path& file_;
    const AnimationOptions& animation_;
    const ToneMap& toneMap_;
    bool numbered_, film_, gif_;
    std::vector<Picture> frames_;       // of a GIF
    std::optional<MovieWriter> movie_;  // once there is a picture
};

}  // namespace

Result<int> renderToFile(LightRenderer& light, const std::filesystem::path& file, const ImageOptions& options,
                         const AnimationOptions& animation, const ToneMap& toneMap) {
    if (animation.frames < 1) return fail("an animation needs at least one frame");
    if (!(animation.framesPerSecond > 0)) return fail("frames per second must be positive");
    AnimationFiles files(file, animation, toneMap);
    if (animation.frames > 1 && !files.takesSeveral())
        return fail("several frames need a .mp4 or .gif, or a name with a place for their number such as %04d", {},
                    file.string());
    if (options.settings.layers != 0 && file.extension() != ".exr" && file.extension() != ".EXR")
        return fail("only .exr holds layers", {}, file.string());
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
        if (auto ok = files.add(std::move(*picture), i); !ok) return std::unexpected(ok.error());
        ++done;
        if (animation.progress && !animation.progress(i + 1)) break;
    }
    if (!files.together()) return done;
    if (done < animation.frames) return 0;
    if (auto ok = files.finish(); !ok) return std::unexpected(ok.error());
    return done;
}

}  // namespace rtsg
