// The module librtsg_movies.so: pictures of films, and films of pictures, by FFmpeg's libraries. It does not link this
// project's libraries, and throws nothing.
#include <algorithm>
#include <climits>
#include <cmath>
#include <cstring>
#include <string_view>
#include <utility>
#include <vector>

#include "film_file.h"
#include "film_maker.h"
#include "film_sound.h"

extern "C" {
#include <libavutil/pixdesc.h>
}

namespace rtsg {

namespace {

/// Times are told apart up to this, in seconds: a scene's clock that counts from 1970 has no finer ones.
constexpr double kSameTime = 1e-6;
/// Forward by more than this is sought, not decoded picture by picture.
constexpr double kFar = 2;
constexpr const char* kRaise = "; --limit pixels=N raises this, to a fourth of N";

class Film final : public MovieFile {
  public:
    Film(MovieBytes bytes, std::uint64_t maximumPixels) : file_(std::move(bytes)), maximumPixels_(maximumPixels) {}

    std::string begin() {
        if (std::string error = open(); !error.empty()) return error;
        if (isCounted()) {
            seconds_ = countedSeconds();
            if (std::string error = open(); !error.empty()) return error;
        }
        // Decoders refuse larger ones, and do not say so.
        if (!decode(*ahead_, aheadTime_))
            return "no picture of at most " + std::to_string(maximumPixels_) + " pixels can be decoded" + kRaise;
        first_ = std::exchange(aheadTime_, 0.0);
        hasAhead_ = true;
        return std::isfinite(seconds_) && seconds_ > 0 ? std::string() : "the film does not tell how long it is";
    }

    double seconds() const override { return seconds_; }

    std::string frameAt(double time, bool& changed, FilePixels& out) override {
        changed = false;
        if (!(time >= 0)) time = 0;
        if (hasShown_ && time < shownTime_ - kSameTime)
            if (std::string error = goTo(time); !error.empty()) return error;
        if (hasAhead_ && time > aheadTime_ + kFar && canSeek_)
            if (std::string error = goTo(time); !error.empty()) return error;
        while (hasAhead_ && (!hasShown_ || aheadTime_ <= time + kSameTime)) {
            std::swap(shown_, ahead_);
            shownTime_ = aheadTime_;
            hasShown_ = changed = true;
            hasAhead_ = next();
        }
        return changed ? convert(*shown_, out) : std::string();
    }

  private:
    std::string open() {
        scaler_.reset();
        hasShown_ = hasAhead_ = false;
        lastTime_ = 0;
        const auto maximum = static_cast<std::int64_t>(std::min<std::uint64_t>(maximumPixels_, INT32_MAX));
        if (std::string error = file_.open(maximum); !error.empty()) return error;
        if (std::string error = decoder_.open(file_, AVMEDIA_TYPE_VIDEO, maximum); !error.empty()) return error;
        const AVCodecContext& codec = *decoder_.codec;
        // Some know it only when they have decoded a picture.
        if (codec.width > 0 && codec.height > 0)
            if (std::string refusal = check(codec.width, codec.height); !refusal.empty()) return refusal;
        shown_.reset(av_frame_alloc());
        ahead_.reset(av_frame_alloc());
        const AVStream& stream = *file_.format().streams[decoder_.stream];
        const double rate = av_q2d(stream.avg_frame_rate.num > 0 ? stream.avg_frame_rate : stream.r_frame_rate);
        frameLength_ = rate > 0 && std::isfinite(rate) ? 1 / rate : .04;
        canSeek_ = !isCounted();
        if (isCounted()) return {};
        if (stream.duration != AV_NOPTS_VALUE)
            seconds_ = static_cast<double>(stream.duration) * decoder_.timeBase;
        else if (file_.format().duration != AV_NOPTS_VALUE)
            seconds_ = static_cast<double>(file_.format().duration) / AV_TIME_BASE;
        return {};
    }

    /// Formats that neither say how long they are nor find a time: they are read through.
    bool isCounted() {
        const std::string_view name = file_.format().iformat->name;
        return name == "mpeg" || name == "mpegvideo" || name == "gif" || name == "apng";
    }

    double countedSeconds() {
        std::int64_t frames = 0;
        double end = 0, begin = HUGE_VAL;
        bool timed = true;
        AVPacket& packet = *decoder_.packet;
        while (av_read_frame(&file_.format(), &packet) >= 0) {
            if (packet.stream_index == decoder_.stream) {
                ++frames;
                if (packet.pts == AV_NOPTS_VALUE) timed = false;
                const double at = static_cast<double>(packet.pts) * decoder_.timeBase;
                const double length =
                    packet.duration > 0 ? static_cast<double>(packet.duration) * decoder_.timeBase : frameLength_;
                if (timed) begin = std::min(begin, at), end = std::max(end, at + length);
            }
            av_packet_unref(&packet);
        }
        return timed ? end - begin : static_cast<double>(frames) * frameLength_;
    }

    /// The next picture in the order in which they are shown; false at the end.
    bool decode(AVFrame& frame, double& time) {
        if (!decoder_.next(file_.format(), frame)) return false;
        // A picture without a time follows the one before.
        time = frame.best_effort_timestamp == AV_NOPTS_VALUE
                   ? lastTime_ + frameLength_
                   : static_cast<double>(frame.best_effort_timestamp) * decoder_.timeBase;
        lastTime_ = time;
        return true;
    }

    bool next() {
        if (!decode(*ahead_, aheadTime_)) return false;
        aheadTime_ -= first_;
        return true;
    }

    /// To the last picture whose decoding needs none before it and that is not shown later than `time`; it is ahead.
    std::string goTo(double time) {
        if (canSeek_) {
            const auto target = static_cast<std::int64_t>(std::floor((time + first_ + kSameTime) / decoder_.timeBase));
            if (av_seek_frame(&file_.format(), decoder_.stream, target, AVSEEK_FLAG_BACKWARD) >= 0) {
                avcodec_flush_buffers(decoder_.codec.get());
                decoder_.draining = hasShown_ = false;
                hasAhead_ = next();
                if (hasAhead_ && aheadTime_ <= time + kSameTime) return {};
            }
        }
        if (std::string error = open(); !error.empty()) return error;
        hasAhead_ = next();
        return hasAhead_ ? std::string() : "the film cannot be read again from its beginning";
    }

    std::string check(int width, int height) const {
        if (width > 0 && height > 0 && width <= 1 << 15 && height <= 1 << 15 &&
            static_cast<std::uint64_t>(width) * static_cast<std::uint64_t>(height) <= maximumPixels_)
            return {};
        return "its pictures have " + std::to_string(width) + " x " + std::to_string(height) + " pixels, and at most " +
               std::to_string(maximumPixels_) + " are let" + kRaise;
    }

    std::string convert(const AVFrame& frame, FilePixels& out) {
        if (std::string refusal = check(frame.width, frame.height); !refusal.empty()) return refusal;
        const auto format = static_cast<AVPixelFormat>(frame.format);
        const AVPixFmtDescriptor* about = av_pix_fmt_desc_get(format);
        if (!about) return "the film's pictures are of a kind that is not known";
        const bool alpha = about->flags & AV_PIX_FMT_FLAG_ALPHA, rgb = about->flags & AV_PIX_FMT_FLAG_RGB;
        constexpr int kExact = SWS_BILINEAR | SWS_ACCURATE_RND | SWS_FULL_CHR_H_INT | SWS_FULL_CHR_H_INP | SWS_BITEXACT;
        scaler_.reset(sws_getCachedContext(scaler_.release(), frame.width, frame.height, format, frame.width,
                                           frame.height, alpha ? AV_PIX_FMT_RGBA : AV_PIX_FMT_RGB24, kExact, nullptr,
                                           nullptr, nullptr));
        if (!scaler_) return "the film's colours cannot be converted";
        if (!rgb) {
            // Films that do not say which matrix: by size, as players have it (ITU-R BT.709 from 720 lines on).
            const int matrix = frame.colorspace == AVCOL_SPC_UNSPECIFIED || frame.colorspace == AVCOL_SPC_RGB
                                   ? (frame.height >= 720 ? SWS_CS_ITU709 : SWS_CS_ITU601)
                                   : frame.colorspace;
            const int full = frame.color_range == AVCOL_RANGE_JPEG;
            sws_setColorspaceDetails(scaler_.get(), sws_getCoefficients(matrix), full,
                                     sws_getCoefficients(SWS_CS_DEFAULT), 1, 0, 1 << 16, 1 << 16);
        }
        out.width = frame.width, out.height = frame.height, out.layers = 1;
        out.channels = alpha ? 4 : 3;
        out.encoded = true;
        const auto row = static_cast<std::size_t>(frame.width) * static_cast<std::size_t>(out.channels);
        // Its loops write whole vectors: rows with room behind them, then without.
        const std::size_t stride = (row + 127) / 64 * 64;
        rows_.resize(stride * static_cast<std::size_t>(frame.height));
        std::uint8_t* const planes[4] = {rows_.data(), nullptr, nullptr, nullptr};
        const int strides[4] = {static_cast<int>(stride), 0, 0, 0};
        if (sws_scale(scaler_.get(), frame.data, frame.linesize, 0, frame.height, planes, strides) != frame.height)
            return "the film's colours cannot be converted";
        out.values.clear();
        out.bytes.resize(row * static_cast<std::size_t>(frame.height));
        for (std::size_t y = 0; y < static_cast<std::size_t>(frame.height); ++y)
            std::memcpy(out.bytes.data() + (static_cast<std::size_t>(frame.height) - 1 - y) * row,
                        rows_.data() + y * stride, row);
        return {};
    }

    FilmFile file_;
    std::uint64_t maximumPixels_;
    FilmDecoder decoder_;
    Owned<AVFrame> shown_, ahead_;
    Owned<SwsContext> scaler_;
    std::vector<std::uint8_t> rows_;
    double frameLength_ = .04, seconds_ = -1;
    double first_ = 0;                                     // start time of the first picture in the file
    double shownTime_ = 0, aheadTime_ = 0, lastTime_ = 0;  // the first two from `first_` on
    bool hasShown_ = false, hasAhead_ = false, canSeek_ = false;
};

class Files final : public MovieFiles {
  public:
    std::string open(MovieBytes bytes, std::uint64_t maximumPixels, std::unique_ptr<MovieFile>& out) const override {
        av_log_set_level(AV_LOG_QUIET);  // faults of a file are not written to the terminal
        auto film = std::make_unique<Film>(std::move(bytes), maximumPixels);
        std::string error = film->begin();
        if (error.empty()) out = std::move(film);
        return error;
    }
    std::string make(MovieSink sink, const FilmShape& shape, std::unique_ptr<MovieMaker>& out) const override {
        av_log_set_level(AV_LOG_QUIET);
        av_max_alloc(INT_MAX);  // the user's pictures, not a file's
        return makeFilm(std::move(sink), shape, out);
    }
    std::string readSound(MovieBytes bytes, std::uint64_t maximumSamples, FileSound& out) const override {
        av_log_set_level(AV_LOG_QUIET);
        return readFilmSound(std::move(bytes), maximumSamples, out);
    }
};

}  // namespace

}  // namespace rtsg

extern "C" __attribute__((visibility("default"))) const rtsg::MovieFiles* RTSG_MOVIE_FILES_SYMBOL() {
    static const rtsg::Files files;
    return &files;
}
