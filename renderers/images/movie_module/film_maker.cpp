// Encodes pictures and a sound as MP4 files of H.264 and AAC, by FFmpeg's libraries.
#include "film_maker.h"

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <vector>

#include "film_file.h"
#include "film_track.h"

extern "C" {
#include <libavutil/opt.h>
}

namespace rtsg {

namespace {

/// Before FFmpeg 7 the written bytes were not const.
#if LIBAVFORMAT_VERSION_MAJOR < 61
using Written = std::uint8_t;
#else
using Written = const std::uint8_t;
#endif

struct FreeFrame {
    void operator()(AVFormatContext* format) const { avformat_free_context(format); }
};

class FilmMaker final : public MovieMaker {
  public:
    explicit FilmMaker(MovieSink sink) : sink_(std::move(sink)) {}

    std::string begin(const FilmShape& shape) {
        const int width = shape.width, height = shape.height;
        keeps_ = shape.hasSound;
        // Colours are kept for squares of 2 x 2 pixels.
        if (width < 2 || height < 2 || width % 2 != 0 || height % 2 != 0)
            return "the width and height of a film are even, not " + std::to_string(width) + " x " +
                   std::to_string(height);
        if (std::string error = openFile(); !error.empty()) return error;
        if (std::string error = openCodec(width, height, av_d2q(shape.picturesPerSecond, 100'000)); !error.empty())
            return error;
        frame_.reset(av_frame_alloc());
        scaler_.reset(sws_getContext(width, height, AV_PIX_FMT_RGBA, width, height, codec_->pix_fmt,
                                     SWS_BICUBIC | SWS_ACCURATE_RND | SWS_FULL_CHR_H_INP, nullptr, nullptr, nullptr));
        if (!frame_ || !scaler_) return "there is no memory for its pictures";
        const int* bt709 = sws_getCoefficients(SWS_CS_ITU709);
        sws_setColorspaceDetails(scaler_.get(), bt709, 1, bt709, 0, 0, 1 << 16, 1 << 16);
        frame_->width = width, frame_->height = height, frame_->format = codec_->pix_fmt;
        frame_->color_range = codec_->color_range, frame_->colorspace = codec_->colorspace;
        if (const int error = av_frame_get_buffer(frame_.get(), 0); error < 0) return textOfError(error);
        return keeps_ ? std::string() : toFile(avformat_write_header(format_.get(), nullptr));
    }

    std::string add(std::span<const std::uint8_t> rgba) override {
        // The encoder may still look at the picture before.
        if (const int error = av_frame_make_writable(frame_.get()); error < 0) return textOfError(error);
        const std::uint8_t* const planes[] = {rgba.data()};
        const int stride[] = {4 * frame_->width};
        sws_scale(scaler_.get(), planes, stride, 0, frame_->height, frame_->data, frame_->linesize);
        return repeat();
    }

    std::string repeat() override {
        frame_->pts = next_++;
        return encode(frame_.get());
    }

    std::string sound(const FileSound& sound) override { return encodeSound(sound, *format_, sound_); }

    std::string finish() override {
        if (std::string error = encode(nullptr); !error.empty()) return error;
        if (std::string error = keeps_ ? writeKept() : std::string(); !error.empty()) return error;
        if (std::string error = toFile(av_write_trailer(format_.get())); !error.empty()) return error;
        avio_flush(io_.get());
        return toFile(io_->error);
    }

  private:
    std::string openFile() {
        constexpr int kBuffer = 1 << 16;
        auto* buffer = static_cast<unsigned char*>(av_malloc(kBuffer));
        if (buffer) io_.reset(avio_alloc_context(buffer, kBuffer, 1, this, nullptr, &writeBytes, &seek));
        AVFormatContext* format = nullptr;
        if (!io_ || avformat_alloc_output_context2(&format, nullptr, "mp4", nullptr) < 0)
            return "FFmpeg's libraries write no MP4 here";
        format_.reset(format);
        format_->pb = io_.get();
        format_->flags |= AVFMT_FLAG_BITEXACT;  // no versions, no dates
        return {};
    }

    std::string openCodec(int width, int height, AVRational rate) {
        const AVCodec* const encoder = avcodec_find_encoder_by_name("libx264");
        if (!encoder) return "FFmpeg's libraries have no H.264 encoder (libx264) here";
        codec_.reset(avcodec_alloc_context3(encoder));
        stream_ = avformat_new_stream(format_.get(), nullptr);
        if (!codec_ || !stream_) return "there is no memory for its pictures";
        codec_->width = width, codec_->height = height;
        codec_->framerate = rate;
        codec_->time_base = stream_->time_base = av_inv_q(rate);
        stream_->avg_frame_rate = rate;
        codec_->pix_fmt = AV_PIX_FMT_YUV420P;  // what every player shows
        codec_->color_range = AVCOL_RANGE_MPEG;
        codec_->colorspace = AVCOL_SPC_BT709, codec_->color_primaries = AVCOL_PRI_BT709;
        codec_->color_trc = AVCOL_TRC_IEC61966_2_1;  // sRGB
        codec_->gop_size = std::clamp(static_cast<int>(2 * av_q2d(rate)), 1, 250);
        codec_->thread_count = 1;  // others make other bytes
        codec_->flags |= AV_CODEC_FLAG_BITEXACT;
        if (format_->oformat->flags & AVFMT_GLOBALHEADER) codec_->flags |= AV_CODEC_FLAG_GLOBAL_HEADER;
        av_opt_set(codec_->priv_data, "crf", "16", 0);  // differences that are hardly seen
        if (const int error = avcodec_open2(codec_.get(), encoder, nullptr); error < 0)
            return "H.264 does not take pictures of " + std::to_string(width) + " x " + std::to_string(height) + ": " +
                   textOfError(error);
        return toFile(avcodec_parameters_from_context(stream_->codecpar, codec_.get()));
    }

    /// Null: flushes the encoder.
    std::string encode(const AVFrame* frame) {
        if (const int error = avcodec_send_frame(codec_.get(), frame); error < 0) return textOfError(error);
        std::string error;
        if (!takePackets(*codec_, pictures_, error)) return error;
        for (const Owned<AVPacket>& packet : pictures_) packet->duration = 1;
        if (keeps_) return {};
        for (const Owned<AVPacket>& packet : pictures_)
            if (error = write(*packet, *codec_, *stream_); !error.empty()) return error;
        pictures_.clear();
        return {};
    }

    /// In the order in which a player needs them.
    std::string writeKept() {
        if (std::string error = toFile(avformat_write_header(format_.get(), nullptr)); !error.empty()) return error;
        auto heard = sound_.packets.begin();
        const auto writeSound = [&] { return write(**heard++, *sound_.codec, *sound_.stream); };
        for (const Owned<AVPacket>& packet : pictures_) {
            while (heard != sound_.packets.end() &&
                   av_compare_ts((*heard)->dts, sound_.codec->time_base, packet->dts, codec_->time_base) < 0)
                if (std::string error = writeSound(); !error.empty()) return error;
            if (std::string error = write(*packet, *codec_, *stream_); !error.empty()) return error;
        }
        while (heard != sound_.packets.end())
            if (std::string error = writeSound(); !error.empty()) return error;
        return {};
    }

    std::string write(AVPacket& packet, const AVCodecContext& codec, const AVStream& stream) {
        packet.stream_index = stream.index;
        av_packet_rescale_ts(&packet, codec.time_base, stream.time_base);
        return toFile(av_interleaved_write_frame(format_.get(), &packet));
    }

    std::string toFile(int error) const {
        return failed_ ? "it cannot be written" : error < 0 ? textOfError(error) : "";
    }

    static int writeBytes(void* self, Written* from, int length) {
        auto& maker = *static_cast<FilmMaker*>(self);
        const auto size = static_cast<std::size_t>(std::max(length, 0));
        if (!maker.failed_ && !maker.sink_.write(maker.at_, {from, size})) maker.failed_ = true;
        if (maker.failed_) return AVERROR(EIO);
        maker.at_ += size;
        maker.size_ = std::max(maker.size_, maker.at_);
        return length;
    }
    static std::int64_t seek(void* self, std::int64_t offset, int whence) {
        auto& maker = *static_cast<FilmMaker*>(self);
        if (whence == AVSEEK_SIZE) return static_cast<std::int64_t>(maker.size_);
        const std::int64_t base = whence == SEEK_SET   ? 0
                                  : whence == SEEK_CUR ? static_cast<std::int64_t>(maker.at_)
                                                       : static_cast<std::int64_t>(maker.size_);
        if (base + offset < 0) return AVERROR(EINVAL);
        maker.at_ = static_cast<std::uint64_t>(base + offset);
        return base + offset;
    }

    MovieSink sink_;
    std::uint64_t at_ = 0, size_ = 0;
    bool failed_ = false;
    Owned<AVIOContext> io_;
    std::unique_ptr<AVFormatContext, FreeFrame> format_;
    Owned<AVCodecContext> codec_;
    AVStream* stream_ = nullptr;
    Owned<SwsContext> scaler_;
    Owned<AVFrame> frame_;
    std::vector<Owned<AVPacket>> pictures_;  // not written yet
    FilmTrack sound_;
    bool keeps_ = false;  // until finish(): the header says whether there is sound
    std::int64_t next_ = 0;
};

}  // namespace

std::string makeFilm(MovieSink sink, const FilmShape& shape, std::unique_ptr<MovieMaker>& out) {
    auto maker = std::make_unique<FilmMaker>(std::move(sink));
    std::string error = maker->begin(shape);
    if (error.empty()) out = std::move(maker);
    return error;
}

}  // namespace rtsg
