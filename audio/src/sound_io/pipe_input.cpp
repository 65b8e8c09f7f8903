// Reads pipes without ever waiting longer than a moment, and decodes what comes through them.
#include <fcntl.h>
#include <poll.h>
#include <unistd.h>

#include <array>
#include <bit>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include <rtsg/audio/sound_input.h>
#include <rtsg/core/descriptor.h>

namespace rtsg {
namespace {

/// How long is waited at a time before it is asked whether to go on.
constexpr int kWaitMs = 20;
/// The longest header of a WAV.
constexpr std::size_t kLongestHeader = 1 << 20;
/// The length that a writer announces if it does not know the length.
constexpr std::uint32_t kEndless = 0x7FFF0000;

template <class T>
T at(std::span<const std::byte> bytes, std::size_t offset) {
    static_assert(std::endian::native == std::endian::little);
    T value;
    std::memcpy(&value, bytes.data() + offset, sizeof value);
    return value;
}
bool says(std::span<const std::byte> bytes, std::size_t offset, std::string_view tag) {
    return std::memcmp(bytes.data() + offset, tag.data(), tag.size()) == 0;
}

/// A file that is read as far as it goes.
class Pipe {
  public:
    static Result<Pipe> open(const std::string& path) {
        // Not to wait here until somebody writes to it. Standard input is others' too, and stays as it is.
        Descriptor file(path == "-" ? ::fcntl(STDIN_FILENO, F_DUPFD_CLOEXEC, 0)
                                    : ::open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC));
        if (!file) return fail(std::strerror(errno), {}, path);
        return Pipe(std::move(file));
    }

    enum class Outcome : std::uint8_t { some, none, end };
    /// Reads the bytes that have come, and waits for a moment if none have.
    Outcome read(std::vector<std::byte>& bytes) {
        pollfd waiting{file_.get(), POLLIN, 0};
        if (::poll(&waiting, 1, kWaitMs) <= 0 || waiting.revents == 0) return Outcome::none;
        bytes.resize(16384);
        const ssize_t got = ::read(file_.get(), bytes.data(), bytes.size());
        bytes.resize(static_cast<std::size_t>(std::max<ssize_t>(0, got)));
        if (got > 0) return Outcome::some;
        return got < 0 && (errno == EAGAIN || errno == EINTR) ? Outcome::none : Outcome::end;
    }

  private:
    explicit Pipe(Descriptor file) : file_(std::move(file)) {}
    Descriptor file_;
};

/// Reads until the pipe or its sound ends, or `goOn` says no. `take` gets whole frames.
Result<> follow(Pipe& pipe, SoundStreamDecoder& decoder, const std::function<bool()>& goOn,
                const std::function<Result<>(std::span<const float>)>& take) {
    std::vector<std::byte> bytes;
    std::vector<float> samples;
    while (goOn() && !decoder.ended()) {
        const Pipe::Outcome outcome = pipe.read(bytes);
        if (outcome == Pipe::Outcome::none) continue;
        if (outcome == Pipe::Outcome::end) break;
        samples.clear();
        if (auto ok = decoder.decode(bytes, samples); !ok) return ok;
        if (samples.empty()) continue;
        if (auto ok = take(samples); !ok) return ok;
    }
    if (decoder.channels() == 0 && goOn()) return fail("it ended before any sound came");
    return {};
}

}  // namespace

SoundStreamDecoder::SoundStreamDecoder(std::optional<RawSound> raw) {
    if (!raw) return;
    channels_ = raw->channels;
    sampleRate_ = raw->sampleRate;
    const bool whole = raw->sample == RawSound::Sample::int16;
    coding_ = whole ? Coding::int16 : Coding::float32;
    sampleBytes_ = whole ? 2 : 4;
}

Result<> SoundStreamDecoder::readFormat(std::span<const std::byte> chunk) {
    if (chunk.size() < 16) return fail("the format of the WAV is cut short");
    auto tag = at<std::uint16_t>(chunk, 0);
    const auto bits = at<std::uint16_t>(chunk, 14);
    if (tag == 0xFFFE && chunk.size() >= 26) tag = at<std::uint16_t>(chunk, 24);
    const auto is = [&](std::uint16_t kind, int size) { return tag == kind && bits == size; };
    if (is(1, 8))
        coding_ = Coding::unsigned8;
    else if (is(1, 16))
        coding_ = Coding::int16;
    else if (is(1, 24))
        coding_ = Coding::int24;
    else if (is(1, 32))
        coding_ = Coding::int32;
    else if (is(3, 32))
        coding_ = Coding::float32;
    else if (is(3, 64))
        coding_ = Coding::float64;
    else
        return fail(fmt::format("a WAV of kind {} with {} bits is not read", tag, bits));
    const auto channels = at<std::uint16_t>(chunk, 2);
    const auto rate = at<std::uint32_t>(chunk, 4);
    if (channels < 1 || channels > 64 || rate < 1 || rate > 1'000'000)
        return fail(fmt::format("sound has {} channels at {} Hz", channels, rate));
    channels_ = 0;  // not before its samples begin
    sampleBytes_ = bits / 8;
    sampleRate_ = static_cast<int>(rate);
    formatKnown_ = true;
    headerChannels_ = channels;
    return {};
}

/// Takes chunks from the front of the waiting bytes, up to where the samples begin.
Result<> SoundStreamDecoder::readHeader() {
    if (!riff_) {
        if (waiting_.size() < 12) return {};
        if (!says(waiting_, 0, "RIFF") || !says(waiting_, 8, "WAVE"))
            return fail("it is no WAV; of what has no header the form must be said");
        waiting_.erase(waiting_.begin(), waiting_.begin() + 12);
        riff_ = true;
    }
    while (waiting_.size() >= 8) {
        const auto size = at<std::uint32_t>(waiting_, 4);
        if (says(waiting_, 0, "data")) {
            if (!formatKnown_) return fail("the WAV does not say how its samples are");
            left_ = size == 0 || size >= kEndless ? left_ : size;
            channels_ = headerChannels_;
            waiting_.erase(waiting_.begin(), waiting_.begin() + 8);
            return {};
        }
        if (size > kLongestHeader) return fail("the header of the WAV is too long");
        const std::size_t whole = 8 + size + size % 2;
        if (waiting_.size() < whole) return {};
        if (says(waiting_, 0, "fmt "))
            if (auto ok = readFormat(std::span<const std::byte>(waiting_).subspan(8, size)); !ok) return ok;
        waiting_.erase(waiting_.begin(), waiting_.begin() + static_cast<std::ptrdiff_t>(whole));
    }
    return {};
}

Result<> SoundStreamDecoder::decode(std::span<const std::byte> bytes, std::vector<float>& samples) {
    waiting_.insert(waiting_.end(), bytes.begin(), bytes.end());
    if (channels_ == 0)
        if (auto ok = readHeader(); !ok) return ok;
    if (channels_ == 0) return {};
    const std::size_t frame = sampleBytes_ * static_cast<std::size_t>(channels_);
    const std::size_t there = static_cast<std::size_t>(std::min<std::uint64_t>(waiting_.size(), left_));
    const std::size_t used = there / frame * frame;
    const std::span<const std::byte> from(waiting_);
    for (std::size_t i = 0; i < used; i += sampleBytes_) {
        double value = 0;
        switch (coding_) {
            case Coding::unsigned8:
                value = (at<std::uint8_t>(from, i) - 128) / 128.0;
                break;
            case Coding::int16:
                value = at<std::int16_t>(from, i) / 32768.0;
                break;
            case Coding::int24:
                value = (at<std::uint16_t>(from, i) + 65536.0 * at<std::int8_t>(from, i + 2)) / 8388608.0;
                break;
            case Coding::int32:
                value = at<std::int32_t>(from, i) / 2147483648.0;
                break;
            case Coding::float32:
                value = static_cast<double>(at<float>(from, i));
                break;
            case Coding::float64:
                value = at<double>(from, i);
                break;
        }
        samples.push_back(std::isfinite(value) ? static_cast<float>(value) : 0.0f);
    }
    if (left_ != std::numeric_limits<std::uint64_t>::max()) {
        left_ -= used;
        if (left_ < frame) left_ = 0;
    }
    waiting_.erase(waiting_.begin(), waiting_.begin() + static_cast<std::ptrdiff_t>(used));
    if (left_ == 0) waiting_.clear();
    return {};
}

Result<std::shared_ptr<SoundInput>> SoundInput::openPipe(const std::string& path, int sampleRate,
                                                         std::optional<RawSound> raw) {
    auto opened = Pipe::open(path);
    if (!opened) return std::unexpected(opened.error());
    const auto pipe = std::make_shared<Pipe>(std::move(*opened));
    return std::make_shared<SoundInput>(sampleRate, Waits::yes, [pipe, raw](SoundFeed& feed) {
        SoundStreamDecoder decoder(raw);
        bool begun = false;
        const auto take = [&](std::span<const float> samples) -> Result<> {
            if (!std::exchange(begun, true))
                if (auto ok = feed.begin(decoder.channels(), decoder.sampleRate()); !ok) return ok;
            feed.write(samples);
            return {};
        };
        if (auto ok = follow(*pipe, decoder, [&] { return feed.wanted(); }, take); !ok) feed.fail(ok.error().text);
    });
}

Result<SoundBuffer> readPipe(const std::string& path, std::optional<RawSound> raw, double seconds,
                             const std::function<bool()>& goOn, std::uint64_t maxSamples) {
    auto pipe = Pipe::open(path);
    if (!pipe) return std::unexpected(pipe.error());
    SoundStreamDecoder decoder(raw);
    SoundBuffer sound;
    bool cancelled = false;
    const auto isComplete = [&] { return decoder.channels() > 0 && sound.seconds() >= seconds; };
    const auto take = [&](std::span<const float> samples) -> Result<> {
        sound.channels = decoder.channels();
        sound.sampleRate = decoder.sampleRate();
        sound.samples.insert(sound.samples.end(), samples.begin(), samples.end());
        if (sound.samples.size() > maxSamples)
            return fail(fmt::format("more than {} samples; --limit samples=N raises this", maxSamples));
        return {};
    };
    const auto wanted = [&] {
        cancelled = cancelled || (goOn && !goOn());
        return !cancelled && !isComplete();
    };
    auto ok = follow(*pipe, decoder, wanted, take);
    if (ok && cancelled) ok = fail("cancelled");
    if (!ok) return fail(ok.error().text, {}, path);
    return sound;
}

}  // namespace rtsg
