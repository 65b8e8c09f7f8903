// ProcessPlayer: runs one processing node of an audio graph and its inputs.
//
// Threading: the engine's thread.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include <rtsg/audio/audio_processing.h>
#include <rtsg/audio/clip_library.h>
#include <rtsg/audio/hrtf.h>

#include "signal/convolver.h"
#include "signal/delay_line.h"
#include "signal/head_filter.h"

namespace rtsg {

using AudioChannels = std::vector<std::vector<float>>;

/// Adds channels to others. One, two, four and six channels are mixed up and down like loudspeakers (Web Audio API 1.1,
/// section 4, which 16.2, "Sound effects processing", refers to). For other numbers, and if `discrete`, each goes into
/// the one of its number, and channels without one are dropped.
void mixInto(std::span<std::vector<float>> out, std::span<const std::vector<float>> in, bool discrete);

/// Samples beyond it are no sound.
constexpr double kLoudest = 1e9;

/// Silences samples that are not finite, or too large once they are multiplied by `gain`, and returns whether there
/// were any: a single such sample would drown all sounds that it is mixed with.
bool silenceNoSound(AudioChannels& out, double gain);

/// The inputs from which a piece of a graph is rendered.
struct GraphBlock {
    ClipLibrary& clips;
    std::int64_t first;            // sample
    std::size_t frames;            // all blocks of a graph have as many
    const SoundEmitter& emitter;   // that the graph leads to: panners are placed in its frame
    const ListenerPose& listener;  // at the end of the block
    const Hrtf& head;              // for panning by a head (enableHRTF)
};

struct AudioLayout {
    bool discrete = false;
    std::size_t exactly = 0, minimum = 1, maximum = 0;  // channels; 0: as many as there are
};

/// Mixes voices and processes, into as many channels as the one with the most has, or as the layout says.
class AudioMix {
  public:
    void render(const std::vector<SoundVoice>& voices,
                const std::vector<std::shared_ptr<const AudioProcess>>& processes, const GraphBlock& block,
                AudioChannels& out, const AudioLayout& layout = {});
    /// Adds the present results of each Analyser and DynamicsCompressor; smoothing goes from call to call.
    void analyse(AudioFindings& found);

  private:
    struct Playing {
        VoicePlayer player;
        std::int64_t heard = 0;  // the first sample of the block in which it was last
    };
    void find(const std::vector<SoundVoice>& voices, std::int64_t first);
    /// By node, and by the number of earlier paths that lead to it.
    std::map<std::pair<std::uint32_t, unsigned>, Playing> players_;
    std::vector<std::pair<NodeId, Playing*>> order_;  // of the voices of the last block
    std::vector<AudioChannels> processed_;
    AudioChannels voice_;  // of a voice with fewer channels than there are
    std::vector<std::unique_ptr<class ProcessPlayer>> processes_;
};

class ProcessPlayer {
  public:
    explicit ProcessPlayer(const AudioProcess& process) : node_(process.node), kind_(process.kind) {}
    bool is(const AudioProcess& process) const { return node_ == process.node && kind_ == process.kind; }
    void render(const AudioProcess& process, const GraphBlock& block, AudioChannels& out);
    void analyse(AudioFindings& found);

  private:
    void listenTo(const AudioProcess& process);
    void select(const AudioProcess& process, AudioChannels& out) const;
    void filter(const AudioProcess& process, double rate, AudioChannels& out);
    void convolve(const AudioProcess& process, double rate, AudioChannels& out);
    void shape(const AudioProcess& process, AudioChannels& out);
    void merge(const AudioProcess& process, const GraphBlock& block, AudioChannels& out);
    void pan(const AudioProcess& process, const GraphBlock& block, AudioChannels& out);
    void panByHead(const glm::dvec3& direction, double level, const GraphBlock& block, AudioChannels& out);

    NodeId node_;
    AudioProcess::Kind kind_;
    AudioMix inputs_;
    AudioChannels in_;                                    // the input
    AudioChannels two_;                                   // of it, as one or two channels
    std::vector<std::unique_ptr<ProcessPlayer>> merged_;  // of a merger, by input
    std::vector<AudioChannels> parts_;                    // the outputs of these
    std::vector<Biquad> filters_;                         // by channel, as the next
    bool filtered_ = false;
    Biquad::Type type_{};  // of the last block
    double frequency_ = 0;
    Biquad::Coefficients last_;
    std::vector<AudioDelay> delays_;
    std::vector<OversampledShaper> shapers_;
    std::vector<Convolver> convolvers_;
    Compressor compressor_;
    std::optional<SpectrumAnalyser> analyser_;
    std::size_t fftSize_ = 0;
    double smoothing_ = 0;
    Array<float> response_;
    bool normalized_ = false;
    using PanGains = std::array<std::array<double, 2>, 2>;  // see equalPowerGains()
    std::optional<PanGains> panned_;                        // at the end of the last block
    // The members below are for a panner with a head.
    HeadFilter head_;
    std::optional<double> heard_;  // how loud, at the end of the last block
};

}  // namespace rtsg
