// Encodes the sound of a film, by FFmpeg's libraries.
#include "film_track.h"

#include <algorithm>
#include <cstddef>
#include <cstring>

namespace rtsg {

namespace {

constexpr std::int64_t kBitsPerSecond = 96'000;  // a channel: the loss is inaudible

std::string openEncoder(const FileSound& sound, AVFormatContext& format, FilmTrack& out) {
    if (sound.channels < 1 || sound.channels > 2)
        return "a film's sound has one or two channels, not " + std::to_string(sound.channels);
    const AVCodec* const encoder = avcodec_find_encoder_by_name("aac");
    if (!encoder) return "FFmpeg's libraries have no AAC encoder here";
    out.codec.reset(avcodec_alloc_context3(encoder));
    out.stream = avformat_new_stream(&format, nullptr);
    if (!out.codec || !out.stream) return "there is no memory for its sound";
    AVCodecContext& codec = *out.codec;
    codec.sample_fmt = AV_SAMPLE_FMT_FLTP;
    codec.sample_rate = sound.sampleRate;
    av_channel_layout_default(&codec.ch_layout, sound.channels);
    codec.bit_rate = kBitsPerSecond * sound.channels;
    codec.time_base = out.stream->time_base = {1, sound.sampleRate};
    codec.thread_count = 1;
    codec.flags |= AV_CODEC_FLAG_BITEXACT;
    if (format.oformat->flags & AVFMT_GLOBALHEADER) codec.flags |= AV_CODEC_FLAG_GLOBAL_HEADER;
    if (const int error = avcodec_open2(&codec, encoder, nullptr); error < 0)
        return "AAC does not take sound of " + std::to_string(sound.sampleRate) + " Hz: " + textOfError(error);
    const int error = avcodec_parameters_from_context(out.stream->codecpar, &codec);
    return error < 0 ? textOfError(error) : "";
}

/// Interleaved samples from `first` on into a frame of planes.
std::string fill(const FileSound& sound, std::size_t first, AVFrame& frame) {
    if (const int error = av_frame_make_writable(&frame); error < 0) return textOfError(error);
    const auto channels = static_cast<std::size_t>(sound.channels);
    std::vector<float> plane(static_cast<std::size_t>(frame.nb_samples));
    for (std::size_t c = 0; c < channels; ++c) {
        for (std::size_t i = 0; i < plane.size(); ++i) plane[i] = sound.samples[(first + i) * channels + c];
        std::memcpy(frame.data[c], plane.data(), plane.size() * sizeof(float));
    }
    frame.pts = static_cast<std::int64_t>(first);
    return {};
}

}  // namespace

bool takePackets(AVCodecContext& codec, std::vector<Owned<AVPacket>>& into, std::string& error) {
    for (;;) {
        Owned<AVPacket> packet(av_packet_alloc());
        if (!packet) return error = "there is no memory for it", false;
        const int got = avcodec_receive_packet(&codec, packet.get());
        if (got == AVERROR(EAGAIN) || got == AVERROR_EOF) return true;
        if (got < 0) return error = textOfError(got), false;
        into.push_back(std::move(packet));
    }
}

std::string encodeSound(const FileSound& sound, AVFormatContext& format, FilmTrack& out) {
    std::string error = openEncoder(sound, format, out);
    if (!error.empty()) return error;
    AVCodecContext& codec = *out.codec;
    const Owned<AVFrame> frame(av_frame_alloc());
    if (!frame) return "there is no memory for its sound";
    frame->format = codec.sample_fmt;
    frame->sample_rate = codec.sample_rate;
    frame->nb_samples = codec.frame_size;
    if (const int failed = av_channel_layout_copy(&frame->ch_layout, &codec.ch_layout); failed < 0)
        return textOfError(failed);
    if (const int failed = av_frame_get_buffer(frame.get(), 0); failed < 0) return textOfError(failed);
    const std::size_t all = sound.samples.size() / static_cast<std::size_t>(sound.channels);
    const auto maximum = static_cast<std::size_t>(codec.frame_size);
    for (std::size_t first = 0; first < all; first += maximum) {
        frame->nb_samples = static_cast<int>(std::min(maximum, all - first));
        if (error = fill(sound, first, *frame); !error.empty()) return error;
        if (const int failed = avcodec_send_frame(&codec, frame.get()); failed < 0) return textOfError(failed);
        if (!takePackets(codec, out.packets, error)) return error;
    }
    if (const int failed = avcodec_send_frame(&codec, nullptr); failed < 0) return textOfError(failed);
    takePackets(codec, out.packets, error);
    return error;
}

}  // namespace rtsg
