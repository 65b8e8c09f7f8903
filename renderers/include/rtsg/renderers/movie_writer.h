// MovieWriter: pictures, and a sound, into a film, MP4 of H.264 and AAC (FFmpeg's libraries, a module that is loaded
// when the first is made).
//
// Pictures are encoded as they come, so a film of any length takes the memory of some dozen; one that will have sound
// that of its file, as it is written when its sound is known. Colours are sRGB, rounded
// to 8 bits and kept by twos in both directions, as players have them; what is transparent lies on black. The same
// pictures give the same bytes. Threading: one thread a film.
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
    /// Whether a file of this name is a film: .mp4.
    static bool isName(const std::filesystem::path& file);
    /// The file is there once finish() has done. Errors: odd width or height, a rate that is not above 0, a folder that
    /// cannot be written, a build or a machine without an encoder.
    static Result<MovieWriter> create(const std::filesystem::path& file, int width, int height,
                                      double picturesPerSecond, Sound sound = Sound::none);
    MovieWriter(MovieWriter&&) noexcept;
    MovieWriter& operator=(MovieWriter&&) noexcept;
    ~MovieWriter();

    /// Errors: another size; a full disk.
    Result<> add(const Picture& picture, const ToneMap& toneMap = {});
    /// The last one stays for so many more. Precondition: there is one.
    Result<> hold(std::uint64_t pictures);
    /// Adds the sound from the first picture on: interleaved samples of one or two channels, full scale at 1. May be
    /// called once, for a film that was opened with sound. Errors: more channels; a rate that AAC does not know. There
    /// is no film then.
    Result<> addSound(std::span<const float> samples, int sampleRate, int channels);
    Result<> finish();

  private:
    struct Impl;
    explicit MovieWriter(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
