// Renders the processing nodes of an audio graph from their inputs.
#include "process_player.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>

#include "signal/panning.h"

namespace rtsg {
namespace {

/// The factor for a response by which sound keeps about its loudness when it is convolved, as the Web Audio API has it.
double loudness(std::span<const float> response, double rate) {
    double power = 0;
    for (const float sample : response) power += static_cast<double>(sample) * static_cast<double>(sample);
    power = std::sqrt(power / static_cast<double>(std::max<std::size_t>(1, response.size())));
    return 0.00125 / std::max(power, 0.000125) * 44100 / rate;
}

struct ChannelGain {
    unsigned to, from;
    float gain;
};
constexpr float kHalfPower = std::numbers::sqrt2_v<float> / 2;
/// The shares of the standard layouts: two channels are left and right, four add left and right surround, and six have
/// centre and low frequencies before these.
std::span<const ChannelGain> fractionsOf(std::size_t from, std::size_t to) {
    static constexpr ChannelGain k1To2[] = {{0, 0, 1}, {1, 0, 1}}, k1To6[] = {{2, 0, 1}},
                                 k2To1[] = {{0, 0, .5f}, {0, 1, .5f}}, k2To4[] = {{0, 0, 1}, {1, 1, 1}},
                                 k4To1[] = {{0, 0, .25f}, {0, 1, .25f}, {0, 2, .25f}, {0, 3, .25f}},
                                 k4To2[] = {{0, 0, .5f}, {0, 2, .5f}, {1, 1, .5f}, {1, 3, .5f}},
                                 k4To6[] = {{0, 0, 1}, {1, 1, 1}, {4, 2, 1}, {5, 3, 1}},
                                 k6To1[] = {{0, 0, kHalfPower},
                                            {0, 1, kHalfPower},
                                            {0, 2, 1},
                                            {0, 4, .5f},
                                            {0, 5, .5f}},
                                 k6To2[] = {{0, 0, 1}, {0, 2, kHalfPower}, {0, 4, kHalfPower},
                                            {1, 1, 1}, {1, 2, kHalfPower}, {1, 5, kHalfPower}},
                                 k6To4[] = {{0, 0, 1},          {0, 2, kHalfPower}, {1, 1, 1},
                                            {1, 2, kHalfPower}, {2, 4, 1},          {3, 5, 1}};
    switch (10 * from + to) {
        case 12:
        case 14:
            return k1To2;
        case 16:
            return k1To6;
        case 21:
            return k2To1;
        case 24:
        case 26:
            return k2To4;
        case 41:
            return k4To1;
        case 42:
            return k4To2;
        case 46:
            return k4To6;
        case 61:
            return k6To1;
        case 62:
            return k6To2;
        case 64:
            return k6To4;
        default:
            return {};
    }
}

}  // namespace

void mixInto(std::span<std::vector<float>> out, std::span<const std::vector<float>> in, bool discrete) {
    const auto add = [&](const ChannelGain& gain) {
        const std::vector<float>& from = in[gain.from];
        std::vector<float>& to = out[gain.to];
        for (std::size_t i = 0; i < from.size(); ++i) to[i] += gain.gain * from[i];
    };
    if (const auto gains = fractionsOf(in.size(), out.size()); !discrete && !gains.empty()) {
        std::ranges::for_each(gains, add);
        return;
    }
    for (unsigned c = 0; c < std::min(out.size(), in.size()); ++c) add({c, c, 1});
}

bool silenceNoSound(AudioChannels& out, double gain) {
    const auto maximum = static_cast<float>(kLoudest / std::max(1.0, std::abs(gain)));
    bool any = false;
    for (std::vector<float>& channel : out)
        for (float& sample : channel)
            if (!(std::abs(sample) <= maximum)) {
                sample = 0;
                any = true;
            }
    return any;
}

/// Finds where each voice has got to; a voice that comes back begins at the present time of its clock.
void AudioMix::find(const std::vector<SoundVoice>& voices, std::int64_t first) {
    if (std::ranges::equal(voices, order_, {}, &SoundVoice::node, &std::pair<NodeId, Playing*>::first)) return;
    order_.clear();
    std::map<std::uint32_t, unsigned> channels;
    for (const SoundVoice& voice : voices) {
        Playing& one = players_[{voice.node.value, channels[voice.node.value]++}];
        one.heard = first;
        order_.emplace_back(voice.node, &one);
    }
    if (players_.size() > voices.size())
        std::erase_if(players_, [&](const auto& one) { return one.second.heard != first; });
}

void AudioMix::render(const std::vector<SoundVoice>& voices,
                      const std::vector<std::shared_ptr<const AudioProcess>>& processes, const GraphBlock& block,
                      AudioChannels& out, const AudioLayout& layout) {
    ClipLibrary& clips = block.clips;
    const std::int64_t first = block.first;
    const std::size_t frames = block.frames;
    find(voices, first);
    std::size_t channels = layout.minimum;
    for (std::size_t i = 0; i < voices.size(); ++i)
        channels = std::max(channels, order_[i].second->player.channels(voices[i], clips));
    processes_.resize(processes.size());
    processed_.resize(processes.size());
    for (std::size_t i = 0; i < processes.size(); ++i) {
        if (!processes_[i] || !processes_[i]->is(*processes[i]))
            processes_[i] = std::make_unique<ProcessPlayer>(*processes[i]);
        processes_[i]->render(*processes[i], block, processed_[i]);
        channels = std::max(channels, processed_[i].size());
    }
    if (layout.maximum > 0) channels = std::min(channels, layout.maximum);
    if (layout.exactly > 0) channels = layout.exactly;
    out.resize(channels);
    for (std::vector<float>& channel : out) channel.assign(frames, 0.0f);
    for (std::size_t i = 0; i < voices.size(); ++i) {
        VoicePlayer& player = order_[i].second->player;
        const std::size_t own = player.channels(voices[i], clips);
        if (own == channels) {
            player.play(voices[i], clips, first, out);
            continue;
        }
        voice_.resize(std::max(voice_.size(), own));
        const std::span<std::vector<float>> one(voice_.data(), own);
        for (std::vector<float>& channel : one) channel.assign(frames, 0.0f);
        player.play(voices[i], clips, first, one);
        mixInto(out, one, layout.discrete);
    }
    for (const AudioChannels& one : processed_) mixInto(out, one, layout.discrete);
}

void ProcessPlayer::merge(const AudioProcess& process, const GraphBlock& block, AudioChannels& out) {
    const std::size_t count = process.inputs.size();
    merged_.resize(count);
    parts_.resize(count);
    const auto isSplitter = [&](std::size_t i) { return process.inputs[i]->kind == AudioProcess::Kind::splitter; };
    std::size_t channels = 0;
    for (std::size_t i = 0; i < count; ++i) {
        const AudioProcess& input = *process.inputs[i];
        if (!merged_[i] || !merged_[i]->is(input)) merged_[i] = std::make_unique<ProcessPlayer>(input);
        merged_[i]->render(input, block, parts_[i]);
        channels += isSplitter(i) ? parts_[i].size() : 1;
    }
    out.resize(std::max<std::size_t>(1, channels));
    for (std::vector<float>& channel : out) channel.assign(block.frames, 0.0f);
    const std::span<std::vector<float>> all(out);
    for (std::size_t i = 0, at = 0; i < count; ++i) {
        const std::size_t own = isSplitter(i) ? parts_[i].size() : 1;
        if (isSplitter(i))
            std::ranges::copy(parts_[i], all.subspan(at).begin());
        else
            mixInto(all.subspan(at, 1), parts_[i], process.discrete);
        at += own;
    }
}

void ProcessPlayer::convolve(const AudioProcess& process, double rate, AudioChannels& out) {
    if (process.buffer.empty()) {
        for (std::vector<float>& channel : out) std::fill(channel.begin(), channel.end(), 0.0f);
        return;
    }
    const std::size_t frames = out[0].size();
    const bool fresh = response_.data() != process.buffer.data() || normalized_ != process.normalize;
    if (!convolvers_.empty() && convolvers_[0].blockSize() != frames) convolvers_.clear();
    const std::size_t known = fresh ? 0 : convolvers_.size();
    while (convolvers_.size() < out.size()) convolvers_.emplace_back(frames, 1);
    if (known < convolvers_.size()) {
        response_ = process.buffer;
        normalized_ = process.normalize;
        std::vector<float> response(process.buffer.begin(), process.buffer.end());
        for (float& sample : response) sample = std::isfinite(sample) ? sample : 0;
        const auto scale = static_cast<float>(process.normalize ? loudness(response, rate) : 1);
        for (float& sample : response) sample *= scale;
        for (std::size_t c = known; c < convolvers_.size(); ++c) convolvers_[c].setResponse(response);
    }
    for (std::size_t c = 0; c < out.size(); ++c) {
        std::fill(out[c].begin(), out[c].end(), 0.0f);
        convolvers_[c].process(in_[c], out[c]);
    }
}

void ProcessPlayer::filter(const AudioProcess& process, double rate, AudioChannels& out) {
    const auto c = Biquad::coefficients(process.filter, process.frequency, rate, process.quality, process.filterGainDb);
    // The stored state of a filter suits one that differs little; another one begins anew, and fades in over a block.
    const bool another = filtered_ && (type_ != process.filter || !(process.frequency < 1.5 * frequency_) ||
                                       !(frequency_ < 1.5 * process.frequency));
    for (std::size_t k = 0; k < out.size(); ++k) {
        if (!another) {
            filters_[k].process(c, out[k]);
            continue;
        }
        std::vector<float> old = out[k];
        filters_[k].process(last_, old);
        filters_[k] = Biquad();
        filters_[k].process(c, out[k]);
        for (std::size_t i = 0; i < old.size(); ++i) {
            const float gain = static_cast<float>(i + 1) / static_cast<float>(old.size());
            out[k][i] = old[i] + (out[k][i] - old[i]) * gain;
        }
    }
    filtered_ = true;
    type_ = process.filter;
    frequency_ = process.frequency;
    last_ = c;
}

void ProcessPlayer::shape(const AudioProcess& process, AudioChannels& out) {
    if (process.oversample > 1 && !process.curve.empty()) {
        shapers_.resize(std::max(shapers_.size(), out.size()));
        for (std::size_t k = 0; k < out.size(); ++k) shapers_[k].process(process.curve, process.oversample, out[k]);
        return;
    }
    for (std::vector<float>& channel : out)
        for (float& sample : channel) sample = shaped(process.curve, sample);
}

/// An analyser's samples: all channels as one.
void ProcessPlayer::listenTo(const AudioProcess& process) {
    if (!analyser_ || fftSize_ != process.fftSize) analyser_.emplace(process.fftSize);
    fftSize_ = process.fftSize;
    smoothing_ = process.smoothing;
    two_.resize(2);
    two_[0].assign(in_[0].size(), 0.0f);
    mixInto(std::span(two_).first(1), in_, false);
    analyser_->write(two_[0]);
}

void ProcessPlayer::analyse(AudioFindings& found) {
    // A node that several sounds USE is heard in the first.
    const auto fresh = [&](const auto& known) {
        return std::ranges::none_of(known, [&](const auto& one) { return one.node == node_; });
    };
    if (analyser_ && fresh(found.spectra)) found.spectra.push_back({node_, analyser_->decibels(smoothing_)});
    if (kind_ == AudioProcess::Kind::compressor && fresh(found.reductions))
        found.reductions.push_back({node_, compressor_.reductionDb()});
    inputs_.analyse(found);
    for (const auto& input : merged_)
        if (input) input->analyse(found);
}

void AudioMix::analyse(AudioFindings& found) {
    for (const auto& process : processes_)
        if (process) process->analyse(found);
}

void ProcessPlayer::select(const AudioProcess& process, AudioChannels& out) const {
    const auto chosen = static_cast<std::size_t>(std::max(0, process.selection));
    out.resize(1);
    if (chosen < in_.size())
        out[0] = in_[chosen];
    else
        out[0].assign(in_[0].size(), 0.0f);
}

void ProcessPlayer::render(const AudioProcess& process, const GraphBlock& block, AudioChannels& out) {
    using Kind = AudioProcess::Kind;
    const double rate = block.clips.sampleRate();
    if (process.kind == Kind::merger) {
        merge(process, block, out);
        if (process.times != SoundTimes()) in_ = out;
    } else {
        inputs_.render(process.voices, process.inputs, block, in_, {.discrete = process.discrete});
        if (process.kind == Kind::selector)
            select(process, out);
        else if (process.kind == Kind::panner)
            pan(process, block, out);
        else
            out = in_;
    }
    filters_.resize(std::max(filters_.size(), out.size()));
    delays_.resize(std::max(delays_.size(), out.size()));
    switch (process.kind) {
        case Kind::biquad:
            filter(process, rate, out);
            break;
        case Kind::delay:
            for (std::size_t k = 0; k < out.size(); ++k) delays_[k].process(process.delay * rate, out[k]);
            break;
        case Kind::convolver:
            convolve(process, rate, out);
            break;
        case Kind::compressor:
            compressor_.process(process.compressor, rate, out);
            break;
        case Kind::shaper:
            shape(process, out);
            break;
        case Kind::analyser:
            listenTo(process);
            break;
        case Kind::selector:
        case Kind::panner:
        case Kind::mix:
        case Kind::splitter:
        case Kind::merger:
            break;
    }
    if (process.gain != 1)
        for (std::vector<float>& channel : out)
            for (float& sample : channel) sample *= static_cast<float>(process.gain);
    // Nodes without times are always active; others are as their times say at each sample.
    for (std::size_t i = 0; process.times != SoundTimes() && i < block.frames; ++i) {
        const double t = (static_cast<double>(block.first) + static_cast<double>(i) + 0.5) / rate;
        if (process.times.active(t)) continue;
        for (std::size_t k = 0; k < out.size(); ++k) out[k][i] = in_[k][i] * static_cast<float>(process.above);
    }
    if (silenceNoSound(out, 1)) block.clips.noteNoSound(process.name);
}

}  // namespace rtsg
