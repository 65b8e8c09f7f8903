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

PictureFiles::PictureFiles(std::filesystem::path file, double picturesPerSecond, const ToneMap& toneMap,
                           MovieWriter::Sound sound)
    : file_(std::move(file)), picturesPerSecond_(picturesPerSecond), toneMap_(toneMap), sound_(sound) {
    if (numberedName(file_.filename().string(), 0))
        kind_ = Kind::numbered;
    else if (MovieWriter::isName(file_))
        kind_ = Kind::film;
    else if (lowerExtension(file_) == ".gif")
        kind_ = Kind::gif;
}

Result<> PictureFiles::add(Picture picture, std::uint64_t skipped) {
    if (!together()) {
        const int number = count_++;
        const auto name =
            kind_ == Kind::numbered ? file_.parent_path() / *numberedName(file_.filename().string(), number) : file_;
        return writePicture(picture, name, toneMap_);
    }
    const bool first = count_++ == 0;
    if (!first)
        if (auto ok = hold(skipped); !ok) return ok;
    if (auto ok = store(std::move(picture)); !ok || !first) return ok;
    return hold(skipped);
}

Result<> PictureFiles::store(Picture picture) {
    if (kind_ == Kind::gif) {
        frames_.push_back(std::move(picture));
        return {};
    }
    if (!movie_) {
        auto movie = MovieWriter::create(file_, picture.width, picture.height, picturesPerSecond_, sound_);
        if (!movie) return std::unexpected(movie.error());
        movie_.emplace(std::move(*movie));
    }
    return movie_->add(picture, toneMap_);
}

Result<> PictureFiles::hold(std::uint64_t pictures) {
    if (movie_) return movie_->hold(pictures);
    for (; pictures > 0; --pictures) frames_.emplace_back(frames_.back());
    return {};
}

Result<> PictureFiles::addSound(std::span<const float> samples, int sampleRate, int channels) {
    if (!movie_) return fail("there is no film to put the sound into", {}, file_.string());
    return movie_->addSound(samples, sampleRate, channels);
}

Result<> PictureFiles::finish(std::uint64_t skipped) {
    if (!together() || count_ == 0) return {};
    if (auto ok = hold(skipped); !ok) return ok;
    return movie_ ? movie_->finish() : writeAnimation(frames_, file_, picturesPerSecond_, toneMap_);
}

Result<int> renderToFile(LightRenderer& light, const std::filesystem::path& file, const ImageOptions& options,
                         const AnimationOptions& animation, const ToneMap& toneMap) {
    const auto next = [&](RenderStats& stats) { return light.nextPicture(options, &stats); };
    return renderToFile(light.world().scene(), next, file, options, animation, toneMap);
}

Result<int> renderToFile(Scene& scene, const std::function<Result<Picture>(RenderStats&)>& next,
                         const std::filesystem::path& file, const ImageOptions& options,
                         const AnimationOptions& animation, const ToneMap& toneMap) {
    if (animation.frames < 1) return fail("an animation needs at least one frame");
    if (!(animation.framesPerSecond > 0)) return fail("frames per second must be positive");
    PictureFiles files(file, animation.framesPerSecond, toneMap);
    if (animation.frames > 1 && !files.takesSeveral())
        return fail("several frames need a .mp4 or .gif, or a name with a place for their number such as %04d", {},
                    file.string());
    if (options.settings.layers != 0 && lowerExtension(file) != ".exr")
        return fail("only .exr holds layers", {}, file.string());
    if (auto ok = checkPictureSize(file, options.fileWidth(), options.fileHeight()); !ok)
        return std::unexpected(ok.error());
    int done = 0;
    for (int i = 0; i < animation.frames; ++i) {
        const double t = animation.start + i / animation.framesPerSecond;
        if (animation.runTo)
            animation.runTo(t);
        else
            scene.newFrame(t);
        RenderStats stats;
        auto picture = next(stats);
        if (!picture) return std::unexpected(picture.error());
        if (stats.cancelled) break;
        if (animation.stats) animation.stats(stats);
        if (auto ok = files.add(std::move(*picture)); !ok) return std::unexpected(ok.error());
        ++done;
        if (animation.progress && !animation.progress(i + 1)) break;
    }
    if (!files.together()) return done;
    if (done < animation.frames) return 0;
    if (auto ok = files.finish(); !ok) return std::unexpected(ok.error());
    return done;
}

}  // namespace rtsg
