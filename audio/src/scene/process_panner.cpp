// Sounds that are placed between other nodes of a graph: panned by loudness, or heard by a head.
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "process_player.h"
#include "signal/panning.h"

namespace rtsg {

/// The PannerNode of the Web Audio API: more than two channels are mixed down, and the output is left and right. Level
/// and direction change gradually from those of the block before.
void ProcessPlayer::pan(const AudioProcess& process, const GraphBlock& block, AudioChannels& out) {
    const SoundNode& sound = *process.placed;
    const SoundEmitter at{{}, process.placed, block.emitter.worldFromLocal, {}};
    const glm::dvec3 displacement = at.position() - block.listener.position, local = at.localFrom(-displacement);
    const double level = sound.intensity * sound.level(local) * sound.coneGain(local);
    PanGains gains{{{level, 0}, {0, level}}};
    if (sound.spatialize) {
        const bool stereo = in_.size() > 1;
        two_.resize(2);
        for (std::vector<float>& channel : two_) channel.assign(block.frames, 0.0f);
        mixInto(std::span(two_).first(stereo ? 2 : 1), in_, false);
        const double distance = glm::length(displacement);
        const glm::dvec3 direction =
            distance > 0 ? block.listener.toLocal(displacement) / distance : glm::dvec3(0, 0, -1);
        if (sound.head) {
            if (!stereo) two_[1] = two_[0];
            return panByHead(direction, level, block, out);
        }
        gains = equalPowerGains(direction, stereo);
        for (auto& row : gains)
            for (double& gain : row) gain *= level;
        out = two_;
    } else {
        out = in_;
    }
    const PanGains before = panned_.value_or(gains);
    panned_ = gains;
    heard_.reset();
    for (std::size_t i = 0; i < block.frames; ++i) {
        const double w = static_cast<double>(i + 1) / static_cast<double>(block.frames);
        const auto gain = [&](std::size_t to, std::size_t from) {
            return static_cast<float>(before[to][from] + (gains[to][from] - before[to][from]) * w);
        };
        if (!sound.spatialize) {
            for (std::vector<float>& channel : out) channel[i] *= gain(0, 0);
            continue;
        }
        const float left = out[0][i], right = out[1][i];
        out[0][i] = gain(0, 0) * left + gain(0, 1) * right;
        out[1][i] = gain(1, 0) * left + gain(1, 1) * right;
    }
}

/// Its "HRTF": each ear hears the channel of its side, as loud together as "equalpower" is, and as much late as the
/// head may be early.
void ProcessPlayer::panByHead(const glm::dvec3& direction, double level, const GraphBlock& block, AudioChannels& out) {
    constexpr double kHalfPower = std::numbers::sqrt2 / 2;
    const double gain = level * kHalfPower, before = heard_.value_or(gain);
    heard_ = gain;
    panned_.reset();
    head_.setDirection(block.head, direction, block.frames);
    out.resize(2);
    for (std::size_t e = 0; e < 2; ++e) {
        for (std::size_t i = 0; i < block.frames; ++i) {
            const double w = static_cast<double>(i + 1) / static_cast<double>(block.frames);
            two_[e][i] *= static_cast<float>(before + (gain - before) * w);
        }
        out[e].assign(block.frames, 0.0f);
        head_.process(e, two_[e], out[e]);
    }
}

}  // namespace rtsg
