// Reads the audio graph that leads into a Sound, SpatialSound or AudioDestination: its sources and its processing.
#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include <rtsg/audio/sound_scene.h>
#include <rtsg/core/x3d.h>

#include "sound_fields.h"

namespace rtsg {
namespace {

constexpr int kMaxAudioNodes = 1000;  // looked at for one Sound

/// The factor of so many cents, within the range that the Web Audio API gives them (1.3.2, nominal range of detune).
double detuned(double cents) {
    return std::pow(2.0, std::clamp(cents, -153'600.0, 153'600.0) / 1200);
}

void readTimes(const Node& node, const FieldNumbers& in, SoundTimes& times) {
    const auto seconds = [&](std::string_view name) { return in.any(name, 0, 0); };
    times.startTime = seconds("startTime");
    times.stopTime = seconds("stopTime");
    times.pauseTime = seconds("pauseTime");
    times.resumeTime = seconds("resumeTime");
    times.pausedTotal = seconds("_pausedTotal");
    times.paused = fieldOr(node, "isPaused", false);
}

/// The periodic wave of an OscillatorSource, if it has one; null stands for a sine.
std::shared_ptr<const PeriodicWave> waveOf(const Scene& scene, const Node& oscillator) {
    const Node* node = scene.effectiveNode(fieldOr(oscillator, "periodicWave", NodeId{}));
    if (!node || !node->is(x3d::PeriodicWave::type) || !fieldOr(*node, "enabled", true)) return nullptr;
    using P = x3d::PeriodicWave;
    const String typeText = fieldOr(*node, "type", String());
    const std::string_view type = typeText.view();
    const bool isKnown = type == "SINE" || type == "SAWTOOTH" || type == "TRIANGLE";  // else the default
    const auto& real = node->get(P::optionsReal);
    const auto& imag = node->get(P::optionsImag);
    return std::make_shared<const PeriodicWave>(
        type == "CUSTOM" ? PeriodicWave::custom({real.data(), real.size()}, {imag.data(), imag.size()})
                         : PeriodicWave::named(isKnown ? type : "SQUARE"));
}

Biquad::Type filterType(std::string_view name) {
    using enum Biquad::Type;
    static constexpr std::pair<std::string_view, Biquad::Type> kTypes[] = {
        {"LOWPASS", lowpass},     {"HIGHPASS", highpass}, {"BANDPASS", bandpass}, {"LOWSHELF", lowshelf},
        {"HIGHSHELF", highshelf}, {"PEAKING", peaking},   {"NOTCH", notch},       {"ALLPASS", allpass}};
    for (const auto& [text, type] : kTypes)
        if (text == name) return type;
    return lowpass;
}

/// The place of sounds without a place: so far away that they are not heard.
constexpr glm::dvec3 kOutOfHearing{1e12};

/// Reads the place and the level of a Sound or SpatialSound; false if the node is neither.
bool readPosition(const Node& node, const FieldNumbers& in, SoundNode& sound) {
    if (node.is(x3d::Sound::type)) {
        using S = x3d::Sound;
        sound.enabled = node.get(S::enabled);
        sound.spatialize = node.get(S::spatialize);
        sound.intensity = in.within(S::intensity, 0);
        sound.location = in.vector(S::location, kOutOfHearing, "it is not heard");
        sound.direction = in.vector(S::direction, {0, 0, 1}, "0 0 1 counts");
        sound.minBack = in.within(S::minBack, 0);
        sound.minFront = in.within(S::minFront, 0);
        sound.maxBack = in.within(S::maxBack, 0);
        sound.maxFront = in.within(S::maxFront, 0);
        return true;
    }
    if (!node.is(x3d::SpatialSound::type)) return false;
    using S = x3d::SpatialSound;
    sound.enabled = node.get(S::enabled);
    sound.spatialize = node.get(S::spatialize);
    sound.doppler = node.get(S::dopplerEnabled);
    sound.head = node.get(S::enableHRTF);
    sound.intensity = in.within(S::intensity, 0) * in.any(S::gain, 0);
    sound.location = in.vector(S::location, kOutOfHearing, "it is not heard");
    sound.direction = in.vector(S::direction, {0, 0, 1}, "0 0 1 counts");
    const std::string_view model = node.get(S::distanceModel).view();
    sound.law = model == "LINEAR"        ? SoundNode::Law::linear
                : model == "EXPONENTIAL" ? SoundNode::Law::exponential
                                         : SoundNode::Law::inverse;
    sound.referenceDistance = in.within(S::referenceDistance, 0);
    sound.maxDistance = in.within(S::maxDistance, 0);
    sound.rolloff = in.within(S::rolloffFactor, 0);
    sound.coneInner = in.within(S::coneInnerAngle, 0);
    sound.coneOuter = in.within(S::coneOuterAngle, 0);
    sound.coneOuterGain = in.any(S::coneOuterGain, 0);
    return true;
}

/// The nodes that lead into a Sound or SpatialSound.
Array<NodeId> inputsOf(const Node& node) {
    if (node.is(x3d::Sound::type)) return {node.get(x3d::Sound::source)};
    return node.get(x3d::SpatialSound::children);
}

bool isDiscrete(const Node& node) {
    return fieldOr(node, "channelInterpretation", String()).view() == "DISCRETE";
}

/// Numbers of a field, or of a metadata node of that name, in tables that have no such field.
std::vector<float> numbersOf(const Scene& scene, const Node& node, std::string_view name) {
    const Array<float> field = fieldOr(node, name, Array<float>{});
    std::vector<float> result(field.begin(), field.end());
    const Node* metadata = scene.find(fieldOr(node, "metadata", NodeId{}));
    if (result.empty() && metadata && metadata->is(x3d::MetadataFloat::type) &&
        metadata->get(x3d::MetadataFloat::name).view() == name)
        for (const float value : metadata->get(x3d::MetadataFloat::value)) result.push_back(value);
    for (float& value : result)
        if (!std::isfinite(value)) value = 0;
    return result;
}

}  // namespace

bool SoundScene::reportPitch(const Scene& scene, const Node& node, double pitch) {
    if (pitch > 0) return true;
    warnOnce(scene.locationOf(node.id()), fmt::format("{} is silent: its pitch is not above 0", nameOf(scene, node)));
    return false;
}

FieldNumbers SoundScene::numbersIn(const Scene& scene, const Node& node) {
    return {scene, node,
            [this, &scene, &node](std::string text) { warnOnce(scene.locationOf(node.id()), std::move(text)); }};
}

bool SoundScene::readSource(const Scene& scene, const Node& node, double gain, Branch to) {
    const FieldNumbers in = numbersIn(scene, node);
    SoundVoice voice;
    voice.node = node.id();
    voice.name = nameOf(scene, node);
    voice.location = scene.locationOf(node.id());
    voice.gain = gain;
    if (node.is(x3d::AudioClip::type)) {
        if (!node.get(x3d::AudioClip::load)) return true;
        for (const String& url : node.get(x3d::AudioClip::url)) voice.urls.push_back(url.str());
        voice.folders = foldersOf(scene, node);
        voice.loop = node.get(x3d::AudioClip::loop);
        const double pitch = in.any(x3d::AudioClip::pitch, 0);
        if (!reportPitch(scene, node, pitch)) return true;
        voice.pitch = std::clamp(pitch, 1e-3, 1e3);
    } else if (node.is(x3d::MovieTexture::type)) {
        using M = x3d::MovieTexture;
        const double speed = in.any(M::speed, 1);
        // A film that runs backwards, or not at all, is silent.
        if (!node.get(M::load) || !(speed > 0)) return true;
        for (const String& url : node.get(M::url)) voice.urls.push_back(url.str());
        voice.folders = foldersOf(scene, node);
        voice.loop = node.get(M::loop);
        const double pitch = in.any(M::pitch, 0);
        if (!reportPitch(scene, node, pitch)) return true;
        voice.pitch = std::clamp(speed * pitch, 1e-3, 1e3);
    } else if (node.is(x3d::BufferAudioSource::type)) {
        using B = x3d::BufferAudioSource;
        voice.kind = SoundVoice::Kind::buffer;
        voice.buffer = node.get(B::buffer);
        for (const String& url : node.get(B::url)) voice.urls.push_back(url.str());
        voice.folders = foldersOf(scene, node);
        if (node.get(B::sampleRate) > 0) voice.bufferRate = static_cast<double>(node.get(B::sampleRate));
        voice.bufferChannels = std::clamp(node.get(B::numberOfChannels), 1, 32);
        voice.loop = node.get(B::loop);
        voice.loopStart = in.any(B::loopStart, 0);
        voice.loopEnd = in.any(B::loopEnd, 0);
        voice.pitch = std::clamp(in.any(B::playbackRate, 1) * detuned(in.any(B::detune, 0)), -1e3, 1e3);
        if (voice.buffer.empty()) voice.kind = SoundVoice::Kind::clip;
        if (const double used = in.any(B::bufferDuration, 0); used > 0) voice.duration = used;
    } else if (node.is(x3d::OscillatorSource::type)) {
        using O = x3d::OscillatorSource;
        voice.kind = SoundVoice::Kind::oscillator;
        voice.frequency = std::clamp(in.any(O::frequency, 0) * detuned(in.any(O::detune, 0)), -1e5, 1e5);
        voice.loop = true;
        voice.wave = waveOf(scene, node);
    } else if (node.is(x3d::StreamAudioSource::type) && !node.get(x3d::StreamAudioSource::streamIdentifier).empty()) {
        // The name of a stream is that of a file here, unless the user has given the stream.
        voice.kind = SoundVoice::Kind::stream;
        for (const String& name : node.get(x3d::StreamAudioSource::streamIdentifier)) voice.urls.push_back(name.str());
        voice.folders = resources_.foldersOf(scene, node, x3d::StreamAudioSource::streamIdentifier.index);
    } else if (node.is(x3d::MicrophoneSource::type)) {
        voice.kind = SoundVoice::Kind::microphone;
        voice.urls.push_back(node.get(x3d::MicrophoneSource::mediaDeviceID).str());
    } else {
        return false;
    }
    readTimes(node, in, voice);
    to.voices.push_back(std::move(voice));
    return true;
}

bool SoundScene::readProcess(const Scene& scene, const Node& node, double above, int depth, Branch to) {
    using Kind = AudioProcess::Kind;
    const FieldNumbers in = numbersIn(scene, node);
    auto created = std::make_shared<AudioProcess>();
    AudioProcess& process = *created;
    process.node = node.id();
    process.name = nameOf(scene, node);
    process.gain = above * in.any("gain", 0, 1);
    process.above = above;
    process.discrete = isDiscrete(node);
    if (!node.type().isA("X3DSoundChannelNode")) readTimes(node, in, process.times);
    if (node.is(x3d::BiquadFilter::type)) {
        using B = x3d::BiquadFilter;
        process.kind = Kind::biquad;
        process.filter = filterType(fieldOr(node, "type", String()).view());
        process.frequency = in.any(B::frequency, 350) * detuned(in.any(B::detune, 0));
        process.quality = in.any(B::qualityFactor, 1);
        // The gain of shelves and peaks belongs to the filter, in decibels; it does not scale the output.
        using enum Biquad::Type;
        if (process.filter == lowshelf || process.filter == highshelf || process.filter == peaking) {
            process.filterGainDb = in.any(B::gain, 0);
            process.gain = above;
        }
    } else if (node.is(x3d::Delay::type)) {
        process.kind = Kind::delay;
        const double maximum = std::min(in.within(x3d::Delay::maxDelayTime, 1), 180.0);
        process.delay = std::min(in.within(x3d::Delay::delayTime, 0), maximum);
    } else if (node.is(x3d::Convolver::type)) {
        process.kind = Kind::convolver;
        process.buffer = node.get(x3d::Convolver::buffer);
        process.normalize = node.get(x3d::Convolver::normalize);
    } else if (node.is(x3d::DynamicsCompressor::type)) {
        using D = x3d::DynamicsCompressor;
        process.kind = Kind::compressor;
        process.compressor = {in.any(D::threshold, -24), in.any(D::knee, 30), in.any(D::ratio, 12),
                              in.any(D::attack, .003), in.any(D::release, .25)};
    } else if (node.is(x3d::WaveShaper::type)) {
        process.kind = Kind::shaper;
        process.curve = numbersOf(scene, node, "curve");
        const std::string_view times = node.get(x3d::WaveShaper::oversample).view();
        process.oversample = times == "2X" ? 2 : times == "4X" ? 4 : 1;
    } else if (node.is(x3d::ChannelSplitter::type)) {
        process.kind = Kind::splitter;
    } else if (node.is(x3d::ChannelMerger::type)) {
        process.kind = Kind::merger;
    } else if (node.is(x3d::ChannelSelector::type)) {
        process.kind = Kind::selector;
        process.selection = node.get(x3d::ChannelSelector::channelSelection);
    } else if (node.is(x3d::Analyser::type)) {
        using A = x3d::Analyser;
        process.kind = Kind::analyser;
        const auto asked = static_cast<std::size_t>(std::max(0, node.get(A::fftSize)));
        process.fftSize = std::clamp<std::size_t>(std::bit_floor(asked), 32, 32768);
        if (process.fftSize != asked)
            warnOnce(scene.locationOf(node.id()),
                     fmt::format("fftSize {} of {} is no power of two from 32 to 32768: {} is used", asked,
                                 nameOf(scene, node), process.fftSize));
        process.smoothing = std::clamp(in.any(A::smoothingTimeConstant, 0), 0.0, 1.0);
    } else if (node.is(x3d::Gain::type) && process.times != SoundTimes()) {
        process.kind = Kind::mix;  // one that always amplifies is a factor
    } else {
        return false;
    }
    if (process.kind == Kind::splitter && readOutputs(scene, node, depth, process, to)) {
        to.processes.push_back(std::move(created));
        return true;
    }
    for (const NodeId child : node.get(Field<Array<NodeId>>{node.type().findExact("children")}))
        if (process.kind == Kind::merger)
            readMerged(scene, child, depth + 1, process, {to.voices, to.processes, to.sound});
        else
            readVoices(scene, child, 1, depth + 1, {process.voices, process.inputs, to.sound});
    if (to.fed) process.inputs.push_back(to.fed);
    to.processes.push_back(std::move(created));
    return true;
}

/// A Sound or SpatialSound between other nodes: 16.4.18 has the latter as the PannerNode of the Web Audio API.
bool SoundScene::readPanner(const Scene& scene, const Node& node, double above, int depth, Branch to) {
    auto placed = std::make_shared<SoundNode>();
    if (!readPosition(node, numbersIn(scene, node), *placed)) return false;
    auto panner = std::make_shared<AudioProcess>();
    panner->kind = AudioProcess::Kind::panner;
    panner->node = node.id();
    panner->name = nameOf(scene, node);
    panner->gain = above;
    panner->placed = std::move(placed);
    for (const NodeId child : inputsOf(node))
        readVoices(scene, child, 1, depth + 1, {panner->voices, panner->inputs, to.sound});
    to.processes.push_back(std::move(panner));
    return true;
}

/// Reads an input that becomes a channel of its own.
void SoundScene::readMerged(const Scene& scene, NodeId id, int depth, AudioProcess& merger, Branch to) {
    auto input = std::make_shared<AudioProcess>();
    input->discrete = merger.discrete;
    readVoices(scene, id, 1, depth, {input->voices, input->inputs, to.sound, to.fed});
    if (input->voices.empty() && input->inputs.size() == 1)
        merger.inputs.push_back(input->inputs.front());
    else
        merger.inputs.push_back(std::move(input));
}

/// Each output of a splitter gets the channel of its number: its own processing applies to that channel of the
/// splitter's output. False: there is no such output.
bool SoundScene::readOutputs(const Scene& scene, const Node& splitter, int depth, AudioProcess& process, Branch to) {
    const Array<NodeId>& outputs = splitter.get(x3d::ChannelSplitter::outputs);
    if (outputs.empty()) return false;
    process.kind = AudioProcess::Kind::merger;
    for (std::size_t i = 0; i < outputs.size(); ++i) {
        // Each output renders the splitter's input anew, as each USE of a source does.
        auto channel = std::make_shared<AudioProcess>();
        channel->kind = AudioProcess::Kind::selector;
        channel->discrete = process.discrete;
        channel->selection = static_cast<int>(i);
        for (const NodeId child : splitter.get(x3d::ChannelSplitter::children))
            readVoices(scene, child, 1, depth + 1, {channel->voices, channel->inputs, to.sound});
        if (to.fed) channel->inputs.push_back(to.fed);
        readMerged(scene, outputs[i], depth + 1, process, {to.voices, to.processes, to.sound, std::move(channel)});
    }
    return true;
}

void SoundScene::readVoices(const Scene& scene, NodeId id, double gain, int depth, Branch to) {
    const Node* node = scene.effectiveNode(id);
    if (!node) return;
    if (depth > 32)
        return warnOnce(scene.locationOf(id),
                        fmt::format("{} is nested too deeply: what is below is not heard", to.sound));
    // A few lines of USE make as many paths through the audio graph as they like.
    if (++visits_ > kMaxAudioNodes)
        return warnOnce(
            scene.locationOf(id),
            fmt::format("{}: more than {} paths lead to its sources; the rest is not heard", to.sound, kMaxAudioNodes));
    if (!fieldOr(*node, "enabled", true)) return;
    const double above = gain;
    gain *= numbersIn(scene, *node).any("gain", 0, 1);
    if (readSource(scene, *node, gain, to)) {
        if (to.fed)
            warnOnce(scene.locationOf(id),
                     fmt::format("{} of {} is a source: as an output of a ChannelSplitter it hears "
                                 "nothing of it",
                                 node->type().name, to.sound));
        return;
    }
    if (readPanner(scene, *node, above, depth, to) || readProcess(scene, *node, above, depth, to)) return;
    // Other nodes pass their children on; their own effect is not modelled, which is reported.
    const FieldIndex children = node->type().findExact("children");
    const bool silent = children == kNoField || node->type().fields[children].type != FieldType::MFNode;
    if (!node->is(x3d::Gain::type))
        warnOnce(scene.locationOf(node->id()),
                 fmt::format("{} of {} is {}", node->type().name, to.sound,
                             silent ? "not a source that can be heard" : "passed through unprocessed"));
    if (silent) return;
    if (to.fed) {
        auto louder = std::make_shared<AudioProcess>();
        louder->gain = gain;
        louder->inputs.push_back(std::exchange(to.fed, nullptr));
        to.processes.push_back(std::move(louder));
    }
    for (const NodeId child : node->get(Field<Array<NodeId>>{children})) readVoices(scene, child, gain, depth + 1, to);
}

std::shared_ptr<const SoundNode> SoundScene::readSound(const Scene& scene, const Node& node) {
    auto read = std::make_shared<SoundNode>();
    SoundNode& sound = *read;
    visits_ = 0;
    sound.node = node.id();
    sound.name = nameOf(scene, node);
    const FieldNumbers in = numbersIn(scene, node);
    const auto readDestination = [&]<class D>() {
        sound.enabled = node.get(D::enabled);
        sound.spatialize = sound.doppler = sound.reflected = false;
        sound.law = SoundNode::Law::none;
        sound.intensity = in.any(D::gain, 0);
        sound.discrete = isDiscrete(node);
        for (const NodeId child : node.get(D::children))
            readVoices(scene, child, 1, 0, {sound.voices, sound.processes, sound.name});
    };
    if (readPosition(node, in, sound)) {
        for (const NodeId child : inputsOf(node))
            readVoices(scene, child, 1, 0, {sound.voices, sound.processes, sound.name});
    } else if (node.is(x3d::AudioDestination::type)) {
        readDestination.template operator()<x3d::AudioDestination>();
        sound.maxChannels = std::max(1, node.get(x3d::AudioDestination::maxChannelCount));
    } else if (node.is(x3d::StreamAudioDestination::type)) {
        readDestination.template operator()<x3d::StreamAudioDestination>();
        sound.stream.emplace();
        for (const String& name : node.get(x3d::StreamAudioDestination::streamIdentifier))
            sound.stream->emplace_back(name.view());
    }
    return read;
}

}  // namespace rtsg
