// ClipLibrary: the sounds of AudioClips, read once and converted to one rate; and playing voices from them.
//
// A clip that cannot be read is silent, with a warning. What urls may open says core/resource.h; all clips together
// have as many samples, converted, as its policy lets, and each of them before it is. A clip that plays faster than it
// was made loses what would lie above half the sample rate; beyond 16 times as fast some of that is heard, folded down.
// Threading: one thread.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <set>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include <rtsg/audio/sound_file.h>
#include <rtsg/audio/sound_input.h>
#include <rtsg/audio/sound_scene.h>

namespace rtsg {

class ClipLibrary {
  public:
    /// A sound that is there, or one that comes while it is heard: at the rate of the library, and of one library.
    using Given = std::variant<std::shared_ptr<const SoundBuffer>, std::shared_ptr<SoundInput>>;
    using GivenSounds = std::map<std::string, Given, std::less<>>;
    /// The sounds that the user names.
    struct UsersSounds {
        /// The sounds of MicrophoneSources by their mediaDeviceID; "" stands for all other names.
        GivenSounds microphones;
        /// The sounds of StreamAudioSources by one of their streamIdentifiers; "" stands for all other names. Others
        /// are files.
        GivenSounds streams;
    };

    ClipLibrary(int sampleRate, Resources resources, UsersSounds given = {})
        : sampleRate_(sampleRate), resources_(std::move(resources)), given_(std::move(given)) {}

    /// At the library's rate, with the channels it has; never null.
    std::shared_ptr<const SoundBuffer> get(const SoundVoice& voice);
    /// Whether the user has said what it hears: that begins when it is first heard, whenever its node began.
    bool isGiven(const SoundVoice& voice) const { return given(voice) != nullptr; }
    /// Null unless it comes while it is heard.
    std::shared_ptr<SoundInput> inputOf(const SoundVoice& voice) const;
    int sampleRate() const { return sampleRate_; }
    const Diagnostics& diagnostics() const { return diagnostics_; }
    /// Adds to what could not be heard as it should.
    void note(std::string text) { diagnostics_.warning({}, std::move(text)); }
    /// Says once of a node that what it made was no sound: no numbers, or far beyond all loudness.
    void noteNoSound(const std::string& name);

  private:
    std::shared_ptr<const SoundBuffer> read(const SoundVoice& voice);
    Result<SoundBuffer> read(const SoundVoice& voice, const std::string& url);
    const Given* given(const SoundVoice& voice) const;
    std::shared_ptr<const SoundBuffer> heardBy(const SoundVoice& voice);
    Result<SoundBuffer> converted(const SoundBuffer& sound, std::uint64_t room) const;
    std::shared_ptr<const SoundBuffer> silence();

    int sampleRate_;
    Resources resources_;
    UsersSounds given_;
    std::map<std::pair<SoundVoice::Kind, std::vector<std::string>>, std::shared_ptr<const SoundBuffer>>
        heard_;  // of what was given, by kind and names of the voice
    using Key = std::pair<std::vector<std::string>, std::vector<std::filesystem::path>>;
    std::map<Key, std::shared_ptr<const SoundBuffer>> clips_;
    std::uint64_t samplesRead_ = 0;
    std::set<std::string> noSounds_;
    std::shared_ptr<const SoundBuffer> silence_;
    Diagnostics diagnostics_;
};

/// Plays one voice on from where it is. By the rules of time-dependent nodes a voice that sounds keeps its start.
class VoicePlayer {
  public:
    /// Adds the samples from `first` on, as many as each channel of `out` holds, at the library's rate, scene time 0
    /// being sample 0. What has one channel goes to all.
    void play(const SoundVoice& voice, ClipLibrary& clips, std::int64_t first, std::span<std::vector<float>> out);
    /// The number of channels that the voice plays.
    std::size_t channels(const SoundVoice& voice, ClipLibrary& clips);

  private:
    void load(const SoundVoice& voice, ClipLibrary& clips);
    void playInput(const SoundVoice& voice, double rate, std::int64_t first, std::span<std::vector<float>> out) const;
    /// The part that repeats, in samples: the whole clip unless the voice says otherwise.
    struct Loop {
        double begin, end;
    };
    double lengthOf(const SoundVoice& voice, double rate) const;
    Loop loopOf(const SoundVoice& voice, double rate) const;
    double inLoop(const Loop* loop, double at) const;
    bool goOn(const Loop* loop, double step, double length);
    float sampleAt(const Loop* loop, double length, std::size_t channel, double faster) const;

    std::shared_ptr<const SoundBuffer> clip_;
    std::shared_ptr<SoundInput> input_;  // instead of a clip
    bool given_ = false;                 // by the user
    std::vector<std::string> urls_;
    std::vector<std::filesystem::path> folders_;
    Array<float> buffer_;
    std::pair<double, int> format_;  // of the buffer: samples a second and channels
    double phase_ = 0;               // clip: samples; oscillator: turns
    double start_ = 0;               // the startTime it plays from
    bool playing_ = false, finished_ = false;
    bool repeated_ = false;  // it has come to the beginning of its loop from the end
};

}  // namespace rtsg
