// Parses the options for microphones and streams, and writes what streams carry.
#include "given_sounds.h"

#include <sys/stat.h>

#include <algorithm>
#include <charconv>
#include <string_view>
#include <utility>

#include <fmt/format.h>

namespace rtsg::app {

namespace {

/// Parses s16@48000x1:REST. Empty if the text begins otherwise.
std::optional<RawSound> rawFormat(std::string_view& text, const std::string& option) {
    const bool whole = text.starts_with("s16@");
    if (!whole && !text.starts_with("f32@")) return std::nullopt;
    RawSound raw;
    raw.sample = whole ? RawSound::Sample::int16 : RawSound::Sample::float32;
    const std::size_t colon = text.find(':'), cross = text.find('x');
    const auto number = [&](std::size_t from, std::size_t to, int& value) {
        const auto [end, problem] = std::from_chars(text.data() + from, text.data() + to, value);
        return problem == std::errc() && end == text.data() + to && value > 0;
    };
    if (colon == std::string_view::npos || cross > colon || !number(4, cross, raw.sampleRate) ||
        !number(cross + 1, colon, raw.channels) || raw.sampleRate > 1'000'000 || raw.channels > 64)
        throw UsageError(option, std::string(text) + ": raw sound is s16@RATExCHANNELS:PIPE or f32@RATExCHANNELS:PIPE");
    text.remove_prefix(colon + 1);
    return raw;
}

GivenSound parseSource(const std::string& option, const std::string& given) {
    GivenSound source;
    source.option = option;
    source.isStream = option == "--stream";
    std::string_view text = given;
    if (const std::size_t split = text.find('='); split != std::string_view::npos) {
        source.id = text.substr(0, split);
        text.remove_prefix(split + 1);
    }
    if (text == "device" || text.starts_with("device:")) {
        source.kind = GivenSound::Kind::device;
        source.name = text.substr(std::min<std::size_t>(text.size(), 7));
        return source;
    }
    source.raw = rawFormat(text, option);
    source.name = text;
    if (text.empty()) throw UsageError(option, given + ": a file, a pipe, - or device is missing");
    struct stat status{};
    const bool pipe = ::stat(source.name.c_str(), &status) == 0 && !S_ISREG(status.st_mode);
    if (source.raw || source.name == "-" || pipe) source.kind = GivenSound::Kind::pipe;
    return source;
}

}  // namespace

std::vector<GivenSound> GivenSoundArguments::sources() const {
    std::vector<GivenSound> all;
    for (const std::string& given : microphones) all.push_back(parseSource("--microphone", given));
    for (const std::string& given : streams) all.push_back(parseSource("--stream", given));
    return all;
}

ClipLibrary::UsersSounds GivenSoundArguments::open(const Scene& scene, bool live, double seconds,
                                                   int sampleRate) const {
    auto sounds = refusingUsage(openGivenSounds(sources(), scene, live, seconds, sampleRate, programContext()));
    if (!sounds) throw InputError(sounds.error().text);
    return std::move(*sounds);
}

void GivenSoundArguments::addTo(Command& command) {
    const Command::Section section(command, "Sound");
    command.addOption("--microphone", microphones,
                      "[ID=]SOURCE: what MicrophoneSources hear, those with that mediaDeviceID: a sound file, a pipe "
                      "or - with WAV (raw: s16@RATExCHANNELS:PIPE, f32@...), or device[:NAME], live only");
    command.addOption("--stream", streams, "[ID=]SOURCE: the same for StreamAudioSources with that streamIdentifier");
}

void GivenSoundArguments::check(const std::vector<std::string>& inputs) const {
    std::ptrdiff_t standard = std::ranges::count(inputs, "-");
    for (const GivenSound& source : sources())
        if (source.kind == GivenSound::Kind::pipe && source.name == "-" && ++standard > 1)
            throw UsageError(source.option, "standard input is already used for another input");
}

std::vector<std::string> GivenSoundArguments::files() const {
    std::vector<std::string> names;
    for (const GivenSound& source : sources())
        if (source.kind != GivenSound::Kind::device && source.name != "-") names.push_back(source.name);
    return names;
}

namespace {

/// Returns ID and file. An empty ID means all streams.
std::pair<std::string, std::string> parseSent(const std::string& given) {
    const std::size_t split = given.find('=');
    if (split == std::string::npos) return {{}, given};
    return {given.substr(0, split), given.substr(split + 1)};
}

/// The sum of the streams called `id`, with as many channels as the one with the most.
std::optional<SoundBuffer> sumOf(const std::vector<StreamedSound>& streams, const std::string& id) {
    std::optional<SoundBuffer> sum;
    for (const StreamedSound& stream : streams) {
        if (!id.empty() && !std::ranges::count(stream.identifiers, id)) continue;
        if (!sum) sum = SoundBuffer{stream.sound.sampleRate, stream.sound.channels, {}};
        const int channels = std::max(sum->channels, stream.sound.channels);
        const SoundBuffer more = spread(stream.sound, channels);
        sum = spread(*sum, channels);
        sum->samples.resize(std::max(sum->samples.size(), more.samples.size()));
        for (std::size_t i = 0; i < more.samples.size(); ++i) sum->samples[i] += more.samples[i];
    }
    return sum;
}

}  // namespace

void SentSoundArguments::addTo(Command& command) {
    const Command::Section section(command, "Sound");
    command.addOption("--stream-out", given,
                      "[ID=]WAV to write: what leads into StreamAudioDestinations, those with that streamIdentifier; "
                      "of several the sum, in floating point");
}

std::vector<std::string> SentSoundArguments::files() const {
    std::vector<std::string> files;
    for (const std::string& one : given) {
        files.push_back(parseSent(one).second);
        if (files.back().empty()) throw UsageError("--stream-out", one + ": a file is missing");
    }
    return files;
}

Result<> SentSoundArguments::write(const std::vector<StreamedSound>& streams) const {
    for (const std::string& one : given) {
        const auto [id, file] = parseSent(one);
        const auto sum = sumOf(streams, id);
        if (!sum && id.empty()) return fail("--stream-out: the scene has no StreamAudioDestination");
        if (!sum) return fail("--stream-out: no StreamAudioDestination has the streamIdentifier \"" + id + "\"");
        if (auto ok = writeWav(file, *sum, WavFormat::float32); !ok) return ok;
    }
    return {};
}

}  // namespace rtsg::app
