// SoundInput: sound that arrives while it is heard, through a pipe or from a capture device.
//
// A thread of its own reads, decodes and converts to one rate. The player takes blocks without a lock and without
// waiting. Sound that is late leaves a gap of silence, which is counted. A pipe loses nothing: it waits until it is
// first heard, and its writer has to wait while nobody takes more. A device does not wait: sound older than a tenth of
// a second is dropped and counted. Threading: block() on one thread at a time; the rest on any. Source: RIFF WAVE (IBM
// and Microsoft 1991, WAVE_FORMAT_EXTENSIBLE included); the ALC_EXT_CAPTURE extension of OpenAL.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <rtsg/audio/sound_file.h>
#include <rtsg/core/worker.h>

namespace rtsg {

/// The format of samples without a header: little-endian, interleaved.
struct RawSound {
    enum class Sample : std::uint8_t { int16, float32 };
    Sample sample = Sample::int16;
    int sampleRate = 48000, channels = 1;
};

/// Decodes a stream of bytes that arrives in pieces: WAV of known or unknown length, or raw samples.
class SoundStreamDecoder {
  public:
    explicit SoundStreamDecoder(std::optional<RawSound> raw = {});
    /// Appends the whole frames that the bytes so far contain, interleaved. Error: this is no WAV, or an unsupported
    /// kind.
    Result<> decode(std::span<const std::byte> bytes, std::vector<float>& samples);
    /// 0 until the header has arrived.
    int channels() const { return channels_; }
    int sampleRate() const { return sampleRate_; }
    /// Whether all samples that the header announced have arrived.
    bool ended() const { return channels_ > 0 && left_ == 0; }

  private:
    enum class Coding : std::uint8_t { unsigned8, int16, int24, int32, float32, float64 };
    Result<> readHeader();
    Result<> readFormat(std::span<const std::byte> chunk);

    int channels_ = 0, sampleRate_ = 0;
    Coding coding_ = Coding::int16;
    std::size_t sampleBytes_ = 2;
    bool riff_ = false, formatKnown_ = false;
    int headerChannels_ = 0;                                          // of the samples, used once they begin
    std::uint64_t left_ = std::numeric_limits<std::uint64_t>::max();  // bytes of samples
    std::vector<std::byte> waiting_;                                  // part of a header or of a frame
};

class SoundInput;

/// The writing end of a SoundInput, used on its own thread.
class SoundFeed {
  public:
    /// False: nobody listens any more; the source should return.
    bool wanted() const;
    /// Call once, before the first write.
    Result<> begin(int channels, int sampleRate);
    /// Writes whole frames, interleaved. If there is no room, it waits or drops samples, as the input is set up.
    void write(std::span<const float> samples);
    void fail(std::string why);

  private:
    friend class SoundInput;
    explicit SoundFeed(SoundInput& input) : input_(input) {}
    ~SoundFeed();
    /// Adds the samples that the rate converter still holds back.
    void finish();
    void put(std::span<const float> samples);

    SoundInput& input_;
    void* converter_ = nullptr;  // libsamplerate's
    double ratio_ = 1;
    std::vector<float> converted_;
};

class SoundInput {
  public:
    /// Runs on the input's thread until it returns.
    using Source = std::function<void(SoundFeed&)>;
    enum class Waits : std::uint8_t { yes, no };

    SoundInput(int sampleRate, Waits waits, Source source);

    /// A named pipe, or "-" for standard input. Nobody need write to it yet. Error: there is no such file.
    static Result<std::shared_ptr<SoundInput>> openPipe(const std::string& path, int sampleRate,
                                                        std::optional<RawSound> raw = {});
    /// Empty: the default device. Error: there is no device, or none of this name; the message lists the devices.
    static Result<std::shared_ptr<SoundInput>> openDevice(const std::string& name, int sampleRate);

    /// 1 until the number is known.
    std::size_t channels() const;
    int sampleRate() const { return sampleRate_; }
    /// The next interleaved samples, from frame `from` on, for the block of `frames` that begins at sample `first`.
    /// Calls with the same `first` give the same samples, so that all players of the input are in time.
    std::span<const float> block(std::int64_t first, std::size_t frames, std::size_t from);

    /// How often it ran out of samples, and the number of dropped frames.
    std::uint64_t gaps() const { return gaps_; }
    std::uint64_t dropped() const { return dropped_; }
    /// Whether the source has ended; samples may still wait.
    bool ended() const { return worker_.idle(); }
    /// The reason for the end; empty for a normal end.
    std::string problem() const;

  private:
    friend class SoundFeed;
    std::size_t ready() const;

    const int sampleRate_;
    const Waits waits_;
    std::vector<float> ring_;                             // of the first begin() on
    std::atomic<std::size_t> channels_ = 0;               // 0: not known yet, and there is no ring
    std::atomic<std::uint64_t> written_ = 0, taken_ = 0;  // frames
    std::atomic<std::uint64_t> gaps_ = 0, dropped_ = 0;
    mutable std::mutex mutex_;
    std::string problem_;

    // Used by the player.
    std::vector<float> block_;
    std::int64_t blockFirst_ = std::numeric_limits<std::int64_t>::min();
    bool playing_ = false;  // otherwise it waits until enough samples have arrived

    Worker worker_{"rtsg sound in"};  // last: it uses all of the above
};

/// Reads a pipe until it ends or `seconds` of sound have arrived, at the sound's own rate. Calls `goOn` now and then
/// while nothing arrives. Errors: there is no such file; it is no sound; it has more than `maxSamples`; goOn returned
/// false.
Result<SoundBuffer> readPipe(const std::string& path, std::optional<RawSound> raw, double seconds,
                             const std::function<bool()>& goOn = {}, std::uint64_t maxSamples = std::uint64_t{1} << 29);

}  // namespace rtsg
