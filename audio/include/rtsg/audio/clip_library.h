// ClipLibrary: reads the sounds of AudioClips once, and plays voices from them.
//
// A clip that cannot be read is silent, with a warning. core/resource.h describes which urls may be opened; its policy
// limits the samples of all clips together. Clips keep their own sample rates, so that loops have periods of whole
// samples; voices read them between samples, across the seams of loops. A clip that has more samples a second than are
// heard loses the content above half the rate heard; if they are more than 32 times as many, some of it is aliased.
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
    /// A sound that is complete, or one that arrives while it is heard. The latter has the library's rate and belongs
    /// to one library.
    using Given = std::variant<std::shared_ptr<const SoundBuffer>, std::shared_ptr<SoundInput>>;
    using GivenSounds = std::map<std::string, Given, std::less<>>;
    /// The sounds that the user gives.
    struct UsersSounds {
        /// The sounds of MicrophoneSources by their mediaDeviceID; "" stands for all other names.
        GivenSounds microphones;
        /// The sounds of StreamAudioSources by one of their streamIdentifiers; "" stands for all other names. Others
        /// are files.
        GivenSounds streams;
    };

    ClipLibrary(int sampleRate, Resources resources, UsersSounds given = {})
        : sampleRate_(sampleRate), resources_(std::move(resources)), given_(std::move(given)) {}

    /// With its own sample rate and channels; never null.
    std::shared_ptr<const SoundBuffer> get(const SoundVoice& voice);
    /// Whether the user has given the sound of this voice. Such a sound begins when it is first heard, whenever its
    /// node began.
    bool isGiven(const SoundVoice& voice) const { return given(voice) != nullptr; }
    /// Null unless the sound arrives while it is heard.
    std::shared_ptr<SoundInput> inputOf(const SoundVoice& voice) const;
    int sampleRate() const { return sampleRate_; }
    const Diagnostics& diagnostics() const { return diagnostics_; }
    /// Adds a warning about something that cannot be heard as it should.
    void note(std::string text) { diagnostics_.warning({}, std::move(text)); }
    /// Reports once that a node made invalid samples: not finite, or far too loud.
    void noteNoSound(const std::string& name);

  private:
    std::shared_ptr<const SoundBuffer> read(const SoundVoice& voice);
    Result<SoundBuffer> read(const SoundVoice& voice, const std::string& url);
    const Given* given(const SoundVoice& voice) const;
    std::shared_ptr<const SoundBuffer> heardBy(const SoundVoice& voice);
    std::shared_ptr<const SoundBuffer> silence();

    int sampleRate_;
    Resources resources_;
    UsersSounds given_;
    std::map<std::pair<SoundVoice::Kind, std::vector<std::string>>, std::shared_ptr<const SoundBuffer>>
        heard_;  // of the sounds given, by kind and names of the voice
    using Key = std::pair<std::vector<std::string>, std::vector<std::filesystem::path>>;
    std::map<Key, std::shared_ptr<const SoundBuffer>> clips_;
    std::uint64_t samplesRead_ = 0;
    std::set<std::string> noSounds_;
    std::shared_ptr<const SoundBuffer> silence_;
    Diagnostics diagnostics_;
};

/// Plays one voice. By the rules of time-dependent nodes, a voice keeps its start time while it sounds.
class VoicePlayer {
  public:
    /// Adds the samples from `first` on, as many as the channels of `out` hold, at the library's rate; sample 0 is
    /// scene time 0. Mono goes to all channels.
    void play(const SoundVoice& voice, ClipLibrary& clips, std::int64_t first, std::span<std::vector<float>> out);
    /// The number of channels that the voice plays.
    std::size_t channels(const SoundVoice& voice, ClipLibrary& clips);

  private:
    void load(const SoundVoice& voice, ClipLibrary& clips);
    void playInput(const SoundVoice& voice, double rate, std::int64_t first, std::span<std::vector<float>> out) const;
    /// The part that repeats, in samples: the whole clip unless the voice sets a loop.
    struct Loop {
        double begin = 0, end = 0;
        bool operator==(const Loop&) const = default;
    };
    /// What a loop has beyond its ends, frame by frame away from them, as far as voices reach.
    struct Seam {
        Loop loop;
        double length = 0;
        std::size_t reach = 0;
        std::vector<float> before, after;
    };
    double lengthOf(const SoundVoice& voice) const;
    Loop loopOf(const SoundVoice& voice) const;
    bool goOn(const Loop* loop, double step, double length);
    void weigh(double faster);
    void unrollLoop(const Loop& loop, double length, double faster);
    float sampleAt(const Loop* loop, double length, std::size_t channel) const;

    std::shared_ptr<const SoundBuffer> clip_;
    std::shared_ptr<SoundInput> input_;  // instead of a clip
    bool given_ = false;                 // by the user
    std::vector<std::string> urls_;
    std::vector<std::filesystem::path> folders_;
    Array<float> buffer_;
    std::pair<double, int> format_;  // of the buffer: sample rate and channels
    double phase_ = 0;               // clip: its samples; oscillator: turns
    double start_ = 0;               // the startTime that it plays from
    bool playing_ = false, finished_ = false;
    bool repeated_ = false;       // whether the loop has been repeated
    std::vector<float> weights_;  // of the samples around the phase
    std::ptrdiff_t first_ = 0;    // the first of these samples
    Seam seam_;
};

}  // namespace rtsg
