// Keeps the sound that leads into StreamAudioDestinations for those who asked for it.
#include <algorithm>

#include "acoustic_engine_impl.h"

namespace rtsg {

void AcousticEngine::Impl::streamOut(const SoundEmitter& emitter, EmitterState& state, const Block& block) {
    const SoundNode& sound = *emitter.sound;
    const std::size_t size = options.blockSize;
    const auto since = static_cast<std::size_t>(samples - firstSample);
    auto found = std::ranges::find(streams, sound.node, &StreamedSound::node);
    if (found == streams.end()) {
        streams.push_back({sound.node, sound.name, {}, SoundBuffer{options.sampleRate, 1, std::vector<float>(since)}});
        found = streams.end() - 1;
    }
    StreamedSound& stream = *found;
    stream.identifiers = *sound.stream;
    if (stream.sound.frames() > since) return;  // in two places it is one stream all the same
    play(emitter, state, block);
    const std::size_t inputs = state.dry.size();
    if (inputs > static_cast<std::size_t>(stream.sound.channels))
        stream.sound = spread(stream.sound, static_cast<int>(inputs));
    SoundBuffer fresh{options.sampleRate, static_cast<int>(inputs), {}};
    for (std::size_t i = 0; i < size; ++i)
        for (std::size_t c = 0; c < inputs; ++c)
            fresh.samples.push_back(state.dry[c][i] * static_cast<float>(sound.intensity));
    fresh = spread(fresh, stream.sound.channels);
    stream.sound.samples.insert(stream.sound.samples.end(), fresh.samples.begin(), fresh.samples.end());
}

/// Streams whose node is gone continue in silence.
void AcousticEngine::Impl::endStreams() {
    const auto until = static_cast<std::size_t>(samples - firstSample) + options.blockSize;
    for (StreamedSound& stream : streams)
        stream.sound.samples.resize(
            std::max(stream.sound.samples.size(), until * static_cast<std::size_t>(stream.sound.channels)));
}

}  // namespace rtsg
