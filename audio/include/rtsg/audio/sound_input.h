// SoundInput: sound that comes while it is heard, through a pipe or from a capture device; opened only for who names
// it.
//
// A thread of its own reads, decodes and converts to one rate; who plays takes blocks without a lock and without
// waiting. What comes late leaves a gap of silence, counted. A pipe loses nothing: it waits until it is first heard,
// and its writer while nobody takes more. A device does not wait: what is older than a tenth of a second is dropped,
// counted. Threading: block() on one thread at a time; the rest on any. Source: RIFF WAVE (IBM and Microsoft 1991,
// WAVE_FORMAT_EXTENSIBLE included); the ALC_EXT_CAPTURE extension of OpenAL.
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
#include <thread>
#include <vector>

#include <rtsg/audio/sound_file.h>

namespace rtsg {

/// How samples are that come without a header: little-endian, interleaved.
struct RawSound {
    enum class Sample : std::uint8_t { int16, float32 };
    Sample sample = Sample::int16;
    int sampleRate = 48000, channels = 1;
};

/// Samples from a stream of bytes that comes in pieces: WAV, whose length need not be known, or raw.
class SoundStreamDecoder {
  public:
    explicit SoundStreamDecoder(std::optional<RawSound> raw = {});
    /// Appends the whole frames that the bytes so far hold, interleaved. Error: it is no WAV, or of a kind that is not
    /// read.
    Result<> decode(std::span<const std::byte> bytes, std::vector<float>& samples);
    /// 0 until the header has come.
    int channels() const { return channels_; }
    int sampleRate() const { return sampleRate_; }
    /// All that the header announced has come.
    bool ended() const { return channels_ > 0 && left_ == 0; }

  private:
    enum class Coding : std::uint8_t { unsigned8, int16, int24, int32, float32, float64 };
    Result<> readHeader();
    Result<> readFormat(std::span<const std::byte> chunk);

    int channels_ = 0, sampleRate_ = 0;
    Coding coding_ = Coding::int16;
    std::size_t sampleBytes_ = 2;
    bool riff_ = false, formatKnown_ = false;
    int headerChannels_ = 0;                                          // those of the samples, once they begin
    std::uint64_t left_ = std::numeric_limits<std::uint64_t>::max();  // bytes of samples
    std::vector<std::byte> waiting_;                                  // of a header or a frame that is not whole
};

class SoundInput;

/// The end of a SoundInput that is written to, on its own thread.
class SoundFeed {
  public:
    /// False: nobody hears any more, return.
    bool wanted() const;
    /// Once, before anything is written.
    Result<> begin(int channels, int sampleRate);
    /// Whole frames, interleaved. Waits for room if the input may wait, else drops what finds none.
    void write(std::span<const float> samples);
    void fail(std::string why);

  private:
    friend class SoundInput;
    explicit SoundFeed(SoundInput& input) : input_(input) {}
    ~SoundFeed();
    /// Adds the samples that conversion still holds back.
    void finish();
    void put(std::span<const float> samples);

    SoundInput& input_;
    void* converter_ = nullptr;  // libsamplerate's, which holds back less than libsoxr does
    double ratio_ = 1;
    std::vector<float> converted_;
};

class SoundInput {
  public:
    /// Runs on the input's thread until it returns.
    using Source = std::function<void(SoundFeed&)>;
    enum class Waits : std::uint8_t { yes, no };

    SoundInput(int sampleRate, Waits waits, Source source);
    ~SoundInput();
    SoundInput(const SoundInput&) = delete;
    SoundInput& operator=(const SoundInput&) = delete;

    /// A pipe with a name, or "-": standard input. Nobody need write to it yet. Error: there is no such file.
    static Result<std::shared_ptr<SoundInput>> openPipe(const std::string& path, int sampleRate,
                                                        std::optional<RawSound> raw = {});
    /// Empty: the default one. Error: there is none, or none of this name; it says which there are.
    static Result<std::shared_ptr<SoundInput>> openDevice(const std::string& name, int sampleRate);

    /// 1 until it is known.
    std::size_t channels() const;
    int sampleRate() const { return sampleRate_; }
    /// Interleaved samples of the block of `frames` that begins at sample `first`: what comes next, from frame `from`
    /// on. Asked again for the same `first` it gives the same, so that all who hear it hear it at once.
    std::span<const float> block(std::int64_t first, std::size_t frames, std::size_t from);

    /// Times that it ran out of samples, and frames that were dropped.
    std::uint64_t gaps() const { return gaps_; }
    std::uint64_t dropped() const { return dropped_; }
    /// Nothing comes any more but what waits.
    bool ended() const { return ended_; }
    /// Why; empty if it just ended.
    std::string problem() const;

  private:
    friend class SoundFeed;
    std::size_t ready() const;

    const int sampleRate_;
    const Waits waits_;
    std::vector<float> ring_;                             // of the first begin() on
    std::atomic<std::size_t> channels_ = 0;               // 0: not known, and no ring
    std::atomic<std::uint64_t> written_ = 0, taken_ = 0;  // frames
    std::atomic<std::uint64_t> gaps_ = 0, dropped_ = 0;
    std::atomic<bool> stop_ = false, ended_ = false;
    mutable std::mutex mutex_;
    std::string problem_;

    // The player's.
    std::vector<float> block_;
    std::int64_t blockFirst_ = std::numeric_limits<std::int64_t>::min();
    bool playing_ = false;  // else it waits until enough has come to go on with

    std::thread thread_;  // last: it uses all of the above
};

/// Reads a pipe until it ends or `seconds` of sound have come, at the sound's own rate. `goOn` is asked now and then
/// while nothing comes. Errors: no such file, no sound, more than `maxSamples`, or goOn said no.
Result<SoundBuffer> readPipe(const std::string& path, std::optional<RawSound> raw, double seconds,
                             const std::function<bool()>& goOn = {}, std::uint64_t maxSamples = std::uint64_t{1} << 29);

}  // namespace rtsg
