// Reading a film's bytes, and decoding one of its streams.
#include "film_file.h"

#include <vector>

#include "film_tables.h"

extern "C" {
#include <libavutil/imgutils.h>
}

namespace rtsg {

namespace {

constexpr int kBuffer = 1 << 16;
/// Formats of one file each: none of them names other files.
constexpr const char* kFormats =
    "mov,mp4,m4a,3gp,3g2,mj2,matroska,webm,avi,ogg,mpeg,mpegvideo,gif,apng,asf,aac,ac3,eac3";

int openNothing(AVFormatContext*, AVIOContext**, const char*, int, AVDictionary**) {
    return AVERROR(EACCES);
}

}  // namespace

int FilmFile::read(void* self, std::uint8_t* to, int length) {
    FilmFile& file = *static_cast<FilmFile*>(self);
    const std::size_t got = file.bytes_.read(file.at_, {to, static_cast<std::size_t>(std::max(length, 0))});
    file.at_ += got;
    return got > 0 ? static_cast<int>(got) : AVERROR_EOF;
}

std::int64_t FilmFile::seek(void* self, std::int64_t offset, int whence) {
    FilmFile& file = *static_cast<FilmFile*>(self);
    const auto size = static_cast<std::int64_t>(file.bytes_.size);
    if (whence & AVSEEK_SIZE) return size;
    const int from = whence & ~AVSEEK_FORCE;
    const std::int64_t base = from == SEEK_CUR ? static_cast<std::int64_t>(file.at_) : from == SEEK_END ? size : 0;
    if (offset < -base || offset > size - base) return AVERROR(EINVAL);
    file.at_ = static_cast<std::uint64_t>(base + offset);
    return base + offset;
}

std::string FilmFile::open(std::int64_t maximum) {
    format_.reset(), io_.reset();
    if (std::string why = whyTablesAreTooLong(bytes_); !why.empty()) return why;
    // No block of memory is larger than a picture may be, of four channels of 16 bits.
    constexpr std::int64_t kBytesOfPixel = 8, kMin = std::int64_t{1} << 26;
    av_max_alloc(static_cast<std::size_t>(std::max(kBytesOfPixel * maximum, kMin)));
    at_ = 0;
    auto* buffer = static_cast<unsigned char*>(av_malloc(kBuffer));
    io_.reset(avio_alloc_context(buffer, kBuffer, 0, this, read, nullptr, seek));
    AVFormatContext* format = avformat_alloc_context();
    format->pb = io_.get();
    format->flags |= AVFMT_FLAG_CUSTOM_IO;
    format->io_open = openNothing;
    AVDictionary* options = nullptr;
    av_dict_set(&options, "format_whitelist", kFormats, 0);
    const int opened = avformat_open_input(&format, nullptr, nullptr, &options);
    av_dict_free(&options);
    if (opened < 0) return "no film that can be read: " + textOfError(opened);
    format_.reset(format);
    // Data that the head lacks are found by decoding a little.
    std::vector<AVDictionary*> streams(format_->nb_streams, nullptr);
    for (AVDictionary*& each : streams) av_dict_set_int(&each, "max_pixels", maximum, 0);
    avformat_find_stream_info(format_.get(), streams.empty() ? nullptr : streams.data());
    for (AVDictionary*& each : streams) av_dict_free(&each);
    return {};
}

namespace {

/// Memory for a picture, if the process may hold it: decoders keep as many as a film says that they need.
int takePicture(AVCodecContext* codec, AVFrame* frame, int flags) {
    const auto format = static_cast<AVPixelFormat>(frame->format);
    if (codec->codec_type == AVMEDIA_TYPE_VIDEO) {
        const int bytes = av_image_get_buffer_size(format, frame->width, frame->height, 1);
        if (bytes < 0 || !static_cast<const FilmFile*>(codec->opaque)->mayTake(static_cast<std::uint64_t>(bytes)))
            return AVERROR(ENOMEM);
    }
    return avcodec_default_get_buffer2(codec, frame, flags);
}

}  // namespace

std::string FilmDecoder::open(FilmFile& file, AVMediaType kind, std::int64_t maxPixels) {
    AVFormatContext& format = file.format();
    const std::string what = kind == AVMEDIA_TYPE_VIDEO ? "pictures" : "sound";
    const AVCodec* decoder = nullptr;
    stream = av_find_best_stream(&format, kind, -1, -1, &decoder, 0);
    if (stream < 0 || !decoder) return "the file holds no " + what + " that can be decoded";
    const AVStream& chosen = *format.streams[stream];
    codec.reset(avcodec_alloc_context3(decoder));
    packet.reset(av_packet_alloc());
    draining = false;
    avcodec_parameters_to_context(codec.get(), chosen.codecpar);
    codec->max_pixels = maxPixels;
    codec->pkt_timebase = chosen.time_base;
    codec->thread_count = 1;
    codec->opaque = &file;
    codec->get_buffer2 = takePicture;
    timeBase = av_q2d(chosen.time_base);
    const int error = avcodec_open2(codec.get(), decoder, nullptr);
    return error < 0 ? "its " + what + " cannot be decoded: " + textOfError(error) : std::string();
}

bool FilmDecoder::next(AVFormatContext& format, AVFrame& frame) {
    for (;;) {
        const int got = avcodec_receive_frame(codec.get(), &frame);
        if (got >= 0) return true;
        if (got == AVERROR_EOF || draining) return false;
        if (av_read_frame(&format, packet.get()) < 0) {
            draining = true;
            avcodec_send_packet(codec.get(), nullptr);
            continue;
        }
        if (packet->stream_index == stream) avcodec_send_packet(codec.get(), packet.get());
        av_packet_unref(packet.get());
    }
}

}  // namespace rtsg
