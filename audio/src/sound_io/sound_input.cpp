// A ring of samples between the thread that reads and the one that plays.
#include <rtsg/audio/sound_input.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include <fmt/format.h>
#include <samplerate.h>

#include "signal/sound_libraries.h"

namespace rtsg {
namespace {

/// The length of the ring.
constexpr double kRingSeconds = 1;
/// The sound that must have come before it is played: the next piece may be late by as much.
constexpr double kAheadSeconds = 0.02;
/// Sound of a device that waits longer than this is dropped.
constexpr double kOldSeconds = 0.1;

std::size_t framesOf(double seconds, int sampleRate) {
    return static_cast<std::size_t>(seconds * sampleRate);
}

}  // namespace

bool SoundFeed::wanted() const {
    return !input_.worker_.stops();
}

SoundFeed::~SoundFeed() {
    if (converter_) src_delete(static_cast<SRC_STATE*>(converter_));
}

Result<> SoundFeed::begin(int channels, int sampleRate) {
    if (channels < 1 || channels > 64 || sampleRate < 1 || sampleRate > 1'000'000)
        return rtsg::fail(fmt::format("sound has {} channels at {} Hz", channels, sampleRate));
    ratio_ = static_cast<double>(input_.sampleRate_) / sampleRate;
    if (sampleRate != input_.sampleRate_) {
        if (const auto loaded = delayed::sound.load(); !loaded) return std::unexpected(loaded.error());
        int error = 0;
        if (src_is_valid_ratio(ratio_) != 0) converter_ = src_new(SRC_SINC_MEDIUM_QUALITY, channels, &error);
        if (!converter_)
            return rtsg::fail(fmt::format("cannot convert from {} to {} Hz", sampleRate, input_.sampleRate_));
    }
    const auto count = static_cast<std::size_t>(channels);
    input_.ring_.resize(count * framesOf(kRingSeconds, input_.sampleRate_));
    input_.channels_.store(count, std::memory_order_release);
    return {};
}

void SoundFeed::fail(std::string why) {
    const std::lock_guard lock(input_.mutex_);
    input_.problem_ = std::move(why);
}

void SoundFeed::write(std::span<const float> samples) {
    if (!converter_) return put(samples);
    const std::size_t channels = input_.channels_;
    std::size_t done = 0;
    const std::size_t frames = samples.size() / channels;
    while (done < frames && wanted()) {
        converted_.resize(channels * (static_cast<std::size_t>(static_cast<double>(frames) * ratio_) + 64));
        SRC_DATA data{};
        data.data_in = samples.data() + done * channels;
        data.input_frames = static_cast<long>(frames - done);
        data.data_out = converted_.data();
        data.output_frames = static_cast<long>(converted_.size() / channels);
        data.src_ratio = ratio_;
        if (src_process(static_cast<SRC_STATE*>(converter_), &data) != 0) return;
        done += static_cast<std::size_t>(data.input_frames_used);
        put(std::span(converted_).first(static_cast<std::size_t>(data.output_frames_gen) * channels));
    }
}

void SoundFeed::finish() {
    if (!converter_) return;
    const std::size_t channels = input_.channels_;
    SRC_DATA data{};
    data.end_of_input = 1;
    data.src_ratio = ratio_;
    data.data_in = converted_.data();
    std::vector<float> rest(channels * 4096);
    do {
        data.data_out = rest.data();
        data.output_frames = 4096;
        if (src_process(static_cast<SRC_STATE*>(converter_), &data) != 0) return;
        put(std::span(rest).first(static_cast<std::size_t>(data.output_frames_gen) * channels));
    } while (data.output_frames_gen > 0 && wanted());
}

void SoundFeed::put(std::span<const float> samples) {
    SoundInput& in = input_;
    const std::size_t channels = in.channels_, room = in.ring_.size() / channels;
    const std::size_t frames = samples.size() / channels;
    std::size_t done = 0;
    std::uint64_t written = in.written_.load(std::memory_order_relaxed);
    while (done < frames && wanted()) {
        const auto used = static_cast<std::size_t>(written - in.taken_.load(std::memory_order_acquire));
        const std::size_t part = std::min(frames - done, room - used);
        for (std::size_t i = 0; i < part; ++i)
            std::copy_n(samples.data() + (done + i) * channels, channels,
                        in.ring_.data() + static_cast<std::size_t>((written + i) % room) * channels);
        written += part;
        done += part;
        in.written_.store(written, std::memory_order_release);
        if (done == frames) return;
        if (in.waits_ == SoundInput::Waits::no) {
            in.dropped_ += frames - done;
            return;
        }
        in.worker_.pause(std::chrono::milliseconds(2));
    }
}

SoundInput::SoundInput(int sampleRate, Waits waits, Source source) : sampleRate_(sampleRate), waits_(waits) {
    worker_.run([this, run = std::move(source)] {
        SoundFeed feed(*this);
        run(feed);
        feed.finish();
    });
}

std::size_t SoundInput::channels() const {
    return std::max<std::size_t>(1, channels_.load(std::memory_order_acquire));
}

std::string SoundInput::problem() const {
    const std::lock_guard lock(mutex_);
    const Result<> failure = worker_.failure("reading it ended");
    return failure ? problem_ : failure.error().text;
}

std::size_t SoundInput::ready() const {
    return static_cast<std::size_t>(written_.load(std::memory_order_acquire) - taken_.load(std::memory_order_relaxed));
}

std::span<const float> SoundInput::block(std::int64_t first, std::size_t frames, std::size_t from) {
    if (first == blockFirst_ && block_.size() % frames == 0 && !block_.empty()) return block_;
    blockFirst_ = first;
    const std::size_t channels = this->channels();
    block_.assign(frames * channels, 0.0f);
    if (channels_.load(std::memory_order_acquire) == 0 || from >= frames) return block_;
    const bool last = ended();  // before looking how much there is
    const std::size_t room = ring_.size() / channels, wanted = frames - from;
    const std::size_t ahead = framesOf(kAheadSeconds, sampleRate_);
    std::uint64_t taken = taken_.load(std::memory_order_relaxed);
    std::size_t there = ready();
    if (waits_ == Waits::no && there > framesOf(kOldSeconds, sampleRate_) + wanted) {
        // A buffer that was full has dropped newer samples: none of its content is recent.
        const std::size_t old = there == room ? there : there - ahead - wanted;
        dropped_ += old;
        taken += old;
        there -= old;
    }
    if (!playing_ && (there >= ahead + wanted || (last && there > 0))) playing_ = true;
    const std::size_t part = playing_ ? std::min(there, wanted) : 0;
    for (std::size_t i = 0; i < part; ++i)
        std::copy_n(ring_.data() + static_cast<std::size_t>((taken + i) % room) * channels, channels,
                    block_.data() + (from + i) * channels);
    taken_.store(taken + part, std::memory_order_release);
    if (playing_ && part < wanted) {
        playing_ = false;
        if (!last) ++gaps_;
    }
    return block_;
}

}  // namespace rtsg
