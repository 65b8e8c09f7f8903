// Writes pictures of a running scene to files: one, a numbered sequence, a film or an animated GIF.
//
// Threading: the scene's thread; each picture is made by several threads.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <rtsg/renderers/light_renderer.h>
#include <rtsg/renderers/movie_writer.h>

namespace rtsg {

struct AnimationOptions {
    int frames = 1;
    double framesPerSecond = 25;
    double start = 0;  // scene time of the first frame, seconds
    /// Runs the scene to a frame's time, for callers that do more in a frame than Scene::newFrame, such as loading
    /// Inlines and sending events.
    std::function<void(double t)> runTo{};
    /// Called after each frame with the number of frames done; false stops.
    std::function<bool(int)> progress{};
    /// Called with the statistics of every picture.
    std::function<void(const RenderStats&)> stats{};
};
/// Runs the renderer's scene and writes its pictures by PictureFiles; the picture before the first is the state of the
/// last LightRenderer::remember(). A single frame needs no name for several. Returns the number of frames in files:
/// all, unless `progress` or that of the settings ended it; a file is complete or absent. Errors: those of picture()
/// and PictureFiles; several frames without a name for them; layers for another format than .exr.
Result<int> renderToFile(LightRenderer& light, const std::filesystem::path& file, const ImageOptions& options,
                         const AnimationOptions& animation = {}, const ToneMap& toneMap = {});

/// The same with pictures of another renderer: `next` makes one of the scene's present state.
Result<int> renderToFile(Scene& scene, const std::function<Result<Picture>(RenderStats&)>& next,
                         const std::filesystem::path& file, const ImageOptions& options,
                         const AnimationOptions& animation = {}, const ToneMap& toneMap = {});

/// The files of a sequence of pictures. The name decides: with a place for a number such as %04d, one file for each
/// picture; .mp4, a film; .gif with several, an animated GIF that is written at the end; otherwise one file that each
/// picture replaces. Threading: one thread.
class PictureFiles {
  public:
    PictureFiles(std::filesystem::path file, double picturesPerSecond, const ToneMap& toneMap = {},
                 MovieWriter::Sound sound = MovieWriter::Sound::none);

    /// Whether the name allows several pictures, and whether they all go into one file.
    bool takesSeveral() const { return kind_ != Kind::one; }
    bool together() const { return kind_ == Kind::film || kind_ == Kind::gif; }
    /// Adds a picture. `skipped` pictures before it were not made: in a film or GIF the previous picture stays for
    /// their time too; if this is the first, it stays longer itself. Errors: those of writePicture() and MovieWriter.
    Result<> add(Picture picture, std::uint64_t skipped = 0);
    /// Calls MovieWriter::addSound(). Error: there is no film yet, since no picture has been added.
    Result<> addSound(std::span<const float> samples, int sampleRate, int channels);
    /// Ends the files; the last picture stays for the time of `skipped` more. Without a picture there is no file.
    Result<> finish(std::uint64_t skipped = 0);

  private:
    enum class Kind : std::uint8_t { one, numbered, film, gif };
    Result<> store(Picture picture);
    Result<> hold(std::uint64_t pictures);

    std::filesystem::path file_;
    double picturesPerSecond_;
    ToneMap toneMap_;
    MovieWriter::Sound sound_;
    Kind kind_ = Kind::one;
    int count_ = 0;
    std::vector<Picture> frames_;       // of a GIF
    std::optional<MovieWriter> movie_;  // once there is a picture
};

/// Puts `number` in place of the one `%d` or `%0Nd`; nothing if the name has none or another conversion.
std::optional<std::string> numberedName(const std::string& pattern, int number);

}  // namespace rtsg
