// Parses the options for microphones and streams, and opens their sources.
#include "given_sounds.h"

#include <sys/stat.h>

#include <algorithm>
#include <charconv>
#include <set>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include <rtsg/core/x3d.h>

namespace rtsg::app {

namespace {

/// The limit that holds for clips, too.
constexpr std::uint64_t kMostSamples = std::uint64_t{1} << 29;

struct GivenSource {
    enum class Kind : std::uint8_t { file, pipe, device };
    Kind kind = Kind::file;
    std::string option, id, name;  // name: of the file or the device
    std::optional<RawSound> raw;
};

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

GivenSource parseSource(const std::string& option, const std::string& given) {
    GivenSource source;
    source.option = option;
    std::string_view text = given;
    if (const std::size_t split = text.find('='); split != std::string_view::npos) {
        source.id = text.substr(0, split);
        text.remove_prefix(split + 1);
    }
    if (text == "device" || text.starts_with("device:")) {
        source.kind = GivenSource::Kind::device;
        source.name = text.substr(std::min<std::size_t>(text.size(), 7));
        return source;
    }
    source.raw = rawFormat(text, option);
    source.name = text;
    if (text.empty()) throw UsageError(option, given + ": a file, a pipe, - or device is missing");
    struct stat status{};
    const bool pipe = ::stat(source.name.c_str(), &status) == 0 && !S_ISREG(status.st_mode);
    if (source.raw || source.name == "-" || pipe) source.kind = GivenSource::Kind::pipe;
    return source;
}

std::vector<GivenSource> parseAll(const GivenSoundArguments& arguments) {
    std::vector<GivenSource> all;
    for (const std::string& given : arguments.microphones) all.push_back(parseSource("--microphone", given));
    for (const std::string& given : arguments.streams) all.push_back(parseSource("--stream", given));
    return all;
}

ClipLibrary::Given openSource(const GivenSource& source, bool live, double seconds, int sampleRate) {
    const auto opened = [&](auto result, const std::string& name) {
        if (!result) throw InputError(source.option, name + ": " + result.error().text);
        return std::move(*result);
    };
    if (source.kind == GivenSource::Kind::device) {
        if (!live)
            throw UsageError(source.option, "a device is only for live sound: rtsg listen --live, or --listen device");
        return opened(SoundInput::openDevice(source.name, sampleRate), "device");
    }
    const std::string name = source.name == "-" ? "standard input" : source.name;
    if (source.kind == GivenSource::Kind::pipe && live)
        return opened(SoundInput::openPipe(source.name, sampleRate, source.raw), name);
    if (source.kind == GivenSource::Kind::pipe)
        return std::make_shared<const SoundBuffer>(
            opened(readPipe(source.name, source.raw, seconds, [] { return !interrupted(); }), name));
    std::string damage;
    SoundBuffer sound = opened(readSound(source.name, kMostSamples, &damage), name);
    if (!damage.empty()) {
        Diagnostics told;
        told.warning({}, fmt::format("{}: {} is damaged or cut short: {}", source.option, name, damage));
        print(told);
    }
    return std::make_shared<const SoundBuffer>(std::move(sound));
}

/// Checks that the scene has nodes with the ID to which the sound is given.
void checkId(const GivenSource& source, const Scene& scene) {
    const bool stream = source.option == "--stream";
    std::set<std::string> known;
    scene.forEachNode([&](const Node& node) {
        if (!stream && node.is(x3d::MicrophoneSource::type))
            known.insert(node.get(x3d::MicrophoneSource::mediaDeviceID).str());
        if (stream && node.is(x3d::StreamAudioSource::type))
            for (const String& id : node.get(x3d::StreamAudioSource::streamIdentifier)) known.insert(id.str());
    });
    if (source.id.empty() || known.contains(source.id)) return;
    const std::string type = stream ? "StreamAudioSource" : "MicrophoneSource";
    if (known.empty()) throw InputError(source.option, "the scene has no " + type);
    std::string names;
    for (const std::string& name : known) names += fmt::format("{}\"{}\"", names.empty() ? "" : ", ", name);
    throw InputError(source.option, fmt::format("no {} has the {} \"{}\"; there are: {}", type,
                                                stream ? "streamIdentifier" : "mediaDeviceID", source.id, names));
}

}  // namespace

void GivenSoundArguments::addTo(Command& command) {
    const Command::Section section(command, "Sound");
    command.addOption("--microphone", microphones,
                      "[ID=]SOURCE: what MicrophoneSources hear, those with that mediaDeviceID: a sound file, a pipe "
                      "or - with WAV (raw: s16@RATExCHANNELS:PIPE, f32@...), or device[:NAME], live only");
    command.addOption("--stream", streams, "[ID=]SOURCE: the same for StreamAudioSources with that streamIdentifier");
}

void GivenSoundArguments::check(const std::vector<std::string>& inputs) const {
    std::ptrdiff_t standard = std::ranges::count(inputs, "-");
    for (const GivenSource& source : parseAll(*this))
        if (source.kind == GivenSource::Kind::pipe && source.name == "-" && ++standard > 1)
            throw UsageError(source.option, "standard input is already used for another input");
}

std::vector<std::string> GivenSoundArguments::files() const {
    std::vector<std::string> names;
    for (const GivenSource& source : parseAll(*this))
        if (source.kind != GivenSource::Kind::device && source.name != "-") names.push_back(source.name);
    return names;
}

ClipLibrary::UsersSounds GivenSoundArguments::open(const Scene& scene, bool live, double seconds,
                                                   int sampleRate) const {
    ClipLibrary::UsersSounds sounds;
    for (const GivenSource& source : parseAll(*this)) {
        if (scene.nodeCount() > 0) checkId(source, scene);
        auto& to = source.option == "--stream" ? sounds.streams : sounds.microphones;
        to[source.id] = openSource(source, live, seconds, sampleRate);
    }
    return sounds;
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
