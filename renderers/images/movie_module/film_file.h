// FilmFile: a film's bytes as FFmpeg reads them, and nothing else: no other file, no network, no format that names any.
//
// Threading: one thread.
#pragma once

#include <algorithm>
#include <memory>
#include <string>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libswresample/swresample.h>
#include <libswscale/swscale.h>
}

#include "image/movie_files.h"

namespace rtsg {

inline std::string textOfError(int error) {
    char text[AV_ERROR_MAX_STRING_SIZE] = {};
    av_strerror(error, text, sizeof text);
    return text;
}

struct FreeFilm {
    void operator()(AVFormatContext* format) const { avformat_close_input(&format); }
    void operator()(AVCodecContext* codec) const { avcodec_free_context(&codec); }
    void operator()(AVPacket* packet) const { av_packet_free(&packet); }
    void operator()(AVFrame* frame) const { av_frame_free(&frame); }
    void operator()(SwsContext* scaler) const { sws_freeContext(scaler); }
    void operator()(SwrContext* resampler) const { swr_free(&resampler); }
    void operator()(AVIOContext* io) const {
        av_freep(&io->buffer);  // which may not be the one that it began with
        avio_context_free(&io);
    }
};
template <class T>
using Owned = std::unique_ptr<T, FreeFilm>;

class FilmFile {
  public:
    explicit FilmFile(MovieBytes bytes) : bytes_(std::move(bytes)) {}
    FilmFile(const FilmFile&) = delete;
    FilmFile& operator=(const FilmFile&) = delete;

    /// From its beginning, with what is in it found out; pictures of more than `most` pixels are not looked at.
    std::string open(std::int64_t maximum);
    AVFormatContext& format() { return *format_; }
    bool mayTake(std::uint64_t bytes) const { return !bytes_.mayTake || bytes_.mayTake(bytes); }

  private:
    static int read(void* self, std::uint8_t* to, int length);
    static std::int64_t seek(void* self, std::int64_t offset, int whence);

    MovieBytes bytes_;
    std::uint64_t at_ = 0;
    Owned<AVIOContext> io_;
    Owned<AVFormatContext> format_;
};

/// One stream of it at work. Empty, with the reason, if there is none of that kind or none that can be decoded.
struct FilmDecoder {
    int stream = -1;
    double timeBase = 1;  // seconds
    Owned<AVCodecContext> codec;
    Owned<AVPacket> packet;
    bool draining = false;

    std::string open(FilmFile& file, AVMediaType kind, std::int64_t maxPixels);
    /// Reads the next picture or piece of sound; false at the end. A damaged packet is skipped.
    bool next(AVFormatContext& format, AVFrame& frame);
};

}  // namespace rtsg
