// Decodes the sound of a film, in step with its pictures.
#include "film_sound.h"

#include <cmath>

#include "film_file.h"

namespace rtsg {

namespace {

/// When a stream begins, by the file; 0 where it does not say.
double beginning(const AVFormatContext& format, int stream) {
    if (stream < 0 || format.streams[stream]->start_time == AV_NOPTS_VALUE) return 0;
    return static_cast<double>(format.streams[stream]->start_time) * av_q2d(format.streams[stream]->time_base);
}

/// Seconds of the pictures; negative if there are none, or the file does not say.
double lengthOfPictures(const AVFormatContext& format, int stream) {
    if (stream < 0 || format.streams[stream]->duration == AV_NOPTS_VALUE) return -1;
    return static_cast<double>(format.streams[stream]->duration) * av_q2d(format.streams[stream]->time_base);
}

/// Converts the decoder's output to interleaved floats, with the rate and channels that it began with.
class Interleaver {
  public:
    bool begin(const AVFrame& frame, FileSound& out) {
        out.sampleRate = frame.sample_rate;
        out.channels = channelsOf(frame);
        if (out.sampleRate < 1 || out.sampleRate > 1'000'000 || out.channels < 1 || out.channels > 64) return false;
        return true;
    }
    /// False where a sound changes in a way that is not followed.
    bool add(const AVFrame& frame, FileSound& out) {
        if (frame.sample_rate != out.sampleRate || channelsOf(frame) != out.channels) return false;
        const auto format = static_cast<AVSampleFormat>(frame.format);
        if (!resampler_ || format != format_) {
            // The order of channels stays as it is.
            SwrContext* created = nullptr;
            AVChannelLayout layout{};
            av_channel_layout_default(&layout, out.channels);
            const int done = swr_alloc_set_opts2(&created, &layout, AV_SAMPLE_FMT_FLT, out.sampleRate, &layout, format,
                                                 out.sampleRate, 0, nullptr);
            av_channel_layout_uninit(&layout);
            resampler_.reset(created);
            if (done < 0 || swr_init(created) < 0) return false;
            format_ = format;
        }
        const std::size_t before = out.samples.size();
        out.samples.resize(before +
                           static_cast<std::size_t>(frame.nb_samples) * static_cast<std::size_t>(out.channels));
        auto* to = reinterpret_cast<std::uint8_t*>(out.samples.data() + before);
        const int got = swr_convert(resampler_.get(), &to, frame.nb_samples,
                                    const_cast<const std::uint8_t**>(frame.extended_data), frame.nb_samples);
        return got == frame.nb_samples;
    }

  private:
    static int channelsOf(const AVFrame& frame) { return frame.ch_layout.nb_channels; }
    Owned<SwrContext> resampler_;
    AVSampleFormat format_ = AV_SAMPLE_FMT_NONE;
};

/// Cuts or fills so that it begins `late` seconds after the pictures and is as long as these.
void fitToPictures(FileSound& sound, double late, double seconds) {
    const auto channels = static_cast<std::size_t>(sound.channels);
    const auto frames = static_cast<std::size_t>(std::lround(std::min(std::abs(late), 3600.0) * sound.sampleRate));
    if (late > 0)
        sound.samples.insert(sound.samples.begin(), frames * channels, 0.0f);
    else
        sound.samples.erase(
            sound.samples.begin(),
            sound.samples.begin() + static_cast<std::ptrdiff_t>(std::min(sound.samples.size(), frames * channels)));
    const auto length = static_cast<std::size_t>(std::llround(seconds * sound.sampleRate)) * channels;
    sound.samples.resize(length);
}

}  // namespace

std::string readFilmSound(MovieBytes bytes, std::uint64_t maximumSamples, FileSound& out) {
    constexpr std::int64_t kMaxPixels = 1 << 26;
    FilmFile file(std::move(bytes));
    if (std::string error = file.open(kMaxPixels); !error.empty()) return error;
    out.known = true;
    FilmDecoder decoder;
    if (std::string error = decoder.open(file, AVMEDIA_TYPE_AUDIO, kMaxPixels); !error.empty()) return error;
    const int pictures = av_find_best_stream(&file.format(), AVMEDIA_TYPE_VIDEO, -1, -1, nullptr, 0);
    const Owned<AVFrame> frame(av_frame_alloc());
    Interleaver interleaver;
    while (decoder.next(file.format(), *frame)) {
        if (out.channels == 0 && !interleaver.begin(*frame, out)) return "its sound has no rate or too many channels";
        if (out.samples.size() +
                static_cast<std::uint64_t>(frame->nb_samples) * static_cast<std::uint64_t>(out.channels) >
            maximumSamples)
            return "more than " + std::to_string(maximumSamples) + " samples; --limit samples=N raises this";
        // Growing copies the content.
        const std::size_t wanted =
            out.samples.size() + static_cast<std::size_t>(frame->nb_samples) * static_cast<std::size_t>(out.channels);
        if (wanted > out.samples.capacity() && !file.mayTake(2 * sizeof(float) * wanted))
            return "its sound is longer than the process may hold; --limit memory=N raises this";
        if (!interleaver.add(*frame, out)) return "its sound changes its rate or its channels on the way";
    }
    if (out.samples.empty()) return "its sound is empty";
    const double seconds = lengthOfPictures(file.format(), pictures);
    const double late = beginning(file.format(), decoder.stream) - beginning(file.format(), pictures);
    const double samples = seconds * out.sampleRate * out.channels;
    if (seconds > 0 && samples <= static_cast<double>(maximumSamples)) fitToPictures(out, late, seconds);
    for (float& sample : out.samples)
        if (!std::isfinite(sample)) sample = 0;
    return {};
}

}  // namespace rtsg
