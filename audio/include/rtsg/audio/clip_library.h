// ClipLibrary: the sounds of AudioClips, read once and converted to one rate; and playing voices from them.
//
// A clip that cannot be read is replaced by a test signal (a decaying noise burst each second), with a warning, so that
// one hears where it would be. What urls may open says core/resource.h; all clips together have as many samples,
// converted, as its policy lets, and each of them before it is. Threading: one thread.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include <rtsg/audio/sound_file.h>
#include <rtsg/audio/sound_scene.h>

namespace rtsg {

class ClipLibrary {
  public:
    /// What MicrophoneSources hear, by their mediaDeviceID; "" for those of other names.
    using Microphones = std::map<std::string, std::shared_ptr<const SoundBuffer>, std::less<>>;

    ClipLibrary(int sampleRate, Resources resources, Microphones microphones = {})
        : sampleRate_(sampleRate), resources_(std::move(resources)), microphones_(std::move(microphones)) {}

    /// At the library's rate, with the channels it has; never null.
    std::shared_ptr<const SoundBuffer> get(const SoundVoice& voice);
    int sampleRate() const { return sampleRate_; }
    const Diagnostics& diagnostics() const { return diagnostics_; }

  private:
    std::shared_ptr<const SoundBuffer> read(const SoundVoice& voice);
    Result<SoundBuffer> read(const SoundVoice& voice, const std::string& url);
    std::shared_ptr<const SoundBuffer> heardBy(const SoundVoice& microphone);
    Result<SoundBuffer> converted(const SoundBuffer& sound, std::uint64_t room) const;
    std::shared_ptr<const SoundBuffer> testSignal();

    int sampleRate_;
    Resources resources_;
    Microphones microphones_;
    std::map<std::string, std::shared_ptr<const SoundBuffer>> heard_;  // by microphones that have been asked for
    using Key = std::pair<std::vector<std::string>, std::vector<std::filesystem::path>>;
    std::map<Key, std::shared_ptr<const SoundBuffer>> clips_;
    std::uint64_t samplesRead_ = 0;
    std::shared_ptr<const SoundBuffer> test_;
    Diagnostics diagnostics_;
};

/// Where one voice has got to. Follows the rules of time-dependent nodes: a voice that is sounding keeps its start.
class VoicePlayer {
  public:
    /// Adds the samples from `first` on, as many as each channel of `out` holds, at the library's rate, scene time 0
    /// being sample 0. What has one channel goes to all.
    void play(const SoundVoice& voice, ClipLibrary& clips, std::int64_t first, std::span<std::vector<float>> out);
    /// Of what it plays.
    std::size_t channels(const SoundVoice& voice, ClipLibrary& clips);

  private:
    void load(const SoundVoice& voice, ClipLibrary& clips);
    float sampleAt(const SoundVoice& voice, std::size_t channel) const;

    std::shared_ptr<const SoundBuffer> clip_;
    std::vector<std::string> urls_;
    std::vector<std::filesystem::path> folders_;
    const void* buffer_ = nullptr;
    double phase_ = 0;  // clip: samples; oscillator: turns
    double start_ = 0;  // the startTime it plays from
    bool playing_ = false, finished_ = false;
};

}  // namespace rtsg
