// Decodes MPEG audio frame by frame, and looks at what lies between the frames.
#include "mpeg_sound.h"

#include <cmath>
#include <memory>

#include <fmt/format.h>
#include <mpg123.h>

#include "sound_length.h"

namespace rtsg {
namespace {

struct Delete {
    void operator()(mpg123_handle* decoder) const { mpg123_delete(decoder); }
};
using Decoder = std::unique_ptr<mpg123_handle, Delete>;

/// Headers of some programs count a frame or two of 1,152 samples more than there are.
constexpr double kCounted = 2 * 1152;

struct Format {
    long rate = 0;
    int channels = 0;
};

/// At its first frame, to give floats of the one format that this has.
Result<Decoder> openDecoder(SoundBytes& file, Format& format) {
    mpg123_init();
    int error = MPG123_OK, encoding = 0;
    Decoder decoder(mpg123_new(nullptr, &error));
    const auto cannot = [&] {
        return fail(fmt::format("cannot read sound: {}",
                                decoder ? mpg123_strerror(decoder.get()) : mpg123_plain_strerror(error)));
    };
    if (!decoder) return cannot();
    mpg123_handle* mp3 = decoder.get();
    mpg123_param(mp3, MPG123_REMOVE_FLAGS, MPG123_AUTO_RESAMPLE, 0);
    mpg123_param(mp3, MPG123_ADD_FLAGS, MPG123_FORCE_FLOAT | MPG123_GAPLESS | MPG123_QUIET, 0);
    mpg123_param(mp3, MPG123_RESYNC_LIMIT, -1, 0);
    mpg123_replace_reader_handle(
        mp3,
        [](void* data, void* to, std::size_t count) {
            return static_cast<ssize_t>(static_cast<SoundBytes*>(data)->read(to, static_cast<std::int64_t>(count)));
        },
        [](void* data, off_t offset, int whence) {
            return static_cast<off_t>(static_cast<SoundBytes*>(data)->seek(offset, whence));
        },
        nullptr);
    if (mpg123_open_handle(mp3, &file) != MPG123_OK ||
        mpg123_getformat(mp3, &format.rate, &format.channels, &encoding) != MPG123_OK)
        return cannot();
    mpg123_format_none(mp3);
    mpg123_format(mp3, format.rate, format.channels, encoding);
    return decoder;
}

/// The bytes between the frames that have been decoded.
class Gaps {
  public:
    void frameAt(const SoundBytes& file, std::int64_t position, std::int64_t size, double seconds) {
        // Files put one behind the other have the tags of the second between them.
        if (expected_ > 0 && position > expected_ && !isTag(file.part(expected_, 3))) {
            if (bytes_ == 0) first_ = seconds;
            bytes_ += position - expected_;
        }
        expected_ = position + size;
    }
    std::string text() const {
        return bytes_ == 0 ? "" : fmt::format("{} bytes after {:.3g} s of it are no sound", bytes_, first_);
    }

  private:
    static bool isTag(std::string_view at) { return at == "ID3" || at == "TAG" || at == "APE"; }

    std::int64_t expected_ = 0, bytes_ = 0;
    double first_ = 0;
};

}  // namespace

bool isMpegSound(const SoundBytes& file) {
    const std::string start = file.part(0, 4);
    if (start.size() < 4) return false;
    if (start.starts_with("ID3")) {
        const std::string tag = file.part(0, 10);
        if (tag.size() < 10) return false;
        std::int64_t size = 0;  // seven bits a byte
        for (std::size_t i = 6; i < 10; ++i) size = size * 128 + (tag[i] & 0x7f);
        const std::string after = file.part(10 + size, 4);
        return after != "fLaC" && after != "OggS" && after != "RIFF" && after != "FORM";
    }
    const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(start[i]); };
    // Eleven ones, then a version, a layer, a bit rate and a sample rate that there are.
    return byte(0) == 0xff && (byte(1) & 0xe0) == 0xe0 && (byte(1) & 0x18) != 0x08 && (byte(1) & 0x06) != 0 &&
           (byte(2) & 0xf0) != 0xf0 && (byte(2) & 0x0c) != 0x0c;
}

Result<SoundBuffer> readMpegSound(SoundBytes file, std::uint64_t maxSamples, std::string& damage) {
    Format format;
    auto decoder = openDecoder(file, format);
    if (!decoder) return std::unexpected(decoder.error());
    mpg123_handle* mp3 = decoder->get();
    SoundBuffer sound{static_cast<int>(format.rate), format.channels, {}};
    const std::int64_t promised = mpg123_length(mp3);
    Gaps gaps;
    int state = MPG123_OK;
    // The format is that of the beginning; the decoder repeats it when it comes back after damage.
    while (state == MPG123_OK || state == MPG123_NEW_FORMAT) {
        off_t number = 0;
        unsigned char* audio = nullptr;
        std::size_t bytes = 0;
        state = mpg123_decode_frame(mp3, &number, &audio, &bytes);
        if (state != MPG123_OK) continue;
        mpg123_frameinfo info{};
        if (mpg123_info(mp3, &info) == MPG123_OK)
            gaps.frameAt(file, mpg123_framepos(mp3), info.framesize, sound.seconds());
        const std::size_t at = sound.samples.size();
        if (auto ok = makeRoom(sound, bytes / sizeof(float)); !ok) return std::unexpected(ok.error());
        std::copy_n(audio, bytes, reinterpret_cast<unsigned char*>(sound.samples.data() + at));
        if (sound.samples.size() > maxSamples) return tooManySamples(maxSamples);
    }
    for (float& sample : sound.samples)
        if (!std::isfinite(sample)) sample = 0;
    damage = missingSound(static_cast<double>(promised), sound, kCounted);
    if (damage.empty()) damage = gaps.text();
    if (damage.empty() && state != MPG123_DONE) damage = unreadableFrom(sound);
    return sound;
}

Result<double> mpegSoundSeconds(SoundBytes file) {
    Format format;
    const auto decoder = openDecoder(file, format);
    if (!decoder) return std::unexpected(decoder.error());
    const auto frames = static_cast<double>(mpg123_length(decoder->get()));
    if (frames < 0) return fail("the header does not say how long the sound is");
    return frames / static_cast<double>(format.rate);
}

}  // namespace rtsg
