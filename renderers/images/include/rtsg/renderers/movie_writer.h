// MovieWriter: writes pictures and a sound as a film, MP4 with H.264 and AAC (by FFmpeg's libraries, in a module that
// is loaded when the first film is made).
//
// Pictures are encoded as they come, so a film of any length takes the memory of some dozen pictures; a film that will
// have sound takes that of its encoded pictures, since it is written when its sound is known. Colours are sRGB, rounded
// to 8 bits, with one colour sample for 2 x 2 pixels, as players expect; transparent parts are on black. The same
// pictures give the same bytes. Threading: one thread for each film.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>

#include <rtsg/core/diagnostic.h>
#include <rtsg/renderers/picture.h>

namespace rtsg {

class MovieWriter {
  public:
    enum class Sound : std::uint8_t { none, awaited };
    /// Whether a file of this name is a film, which is .mp4.
    static bool isName(const std::filesystem::path& file);
    /// The file exists once finish() has returned. Errors: odd width or height; a rate that is not above 0; a folder
    /// that cannot be written; no encoder in this build or on this machine.
    static Result<MovieWriter> create(const std::filesystem::path& file, int width, int height,
                                      double picturesPerSecond, Sound sound = Sound::none);
    MovieWriter(MovieWriter&&) noexcept;
    MovieWriter& operator=(MovieWriter&&) noexcept;
    ~MovieWriter();

    /// Errors: a picture of another size; a full disk.
    Result<> add(const Picture& picture, const ToneMap& toneMap = {});
    /// Shows the last picture for `pictures` more frames. Precondition: there is one.
    Result<> hold(std::uint64_t pictures);
    /// Adds the sound from the first picture on: interleaved samples of one or two channels, full scale at 1. Call it
    /// once, for a film that was created with sound. Errors, after which there is no film: more channels; a rate that
    /// AAC does not support.
    Result<> addSound(std::span<const float> samples, int sampleRate, int channels);
    Result<> finish();

  private:
    struct Impl;
    explicit MovieWriter(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
