// Opens the sources of given sounds.
#include <rtsg/session/given_sounds.h>

#include <memory>
#include <set>
#include <utility>

#include <fmt/format.h>

#include <rtsg/audio/sound_file.h>
#include <rtsg/audio/sound_input.h>
#include <rtsg/core/x3d.h>

namespace rtsg {

namespace {

/// The limit that holds for clips, too.
constexpr std::uint64_t kMaxSamples = std::uint64_t{1} << 29;

/// For messages, with the option.
std::unexpected<Diagnostic> failed(const GivenSound& source, const std::string& why) {
    return fail(source.option + ": " + why);
}

Result<ClipLibrary::Given> openSource(const GivenSound& source, bool live, double seconds, int sampleRate,
                                      const SessionContext& context) {
    const auto opened = [&](auto result, const std::string& name) -> Result<ClipLibrary::Given> {
        if (!result) return failed(source, name + ": " + result.error().text);
        return ClipLibrary::Given(std::move(*result));
    };
    if (source.kind == GivenSound::Kind::device) {
        if (!live)
            return fail(kUsageCode,
                        source.option + ": a device is only for live sound: rtsg listen --live, or --listen device");
        return opened(SoundInput::openDevice(source.name, sampleRate), "device");
    }
    const std::string name = source.name == "-" ? "standard input" : source.name;
    if (source.kind == GivenSound::Kind::pipe && live)
        return opened(SoundInput::openPipe(source.name, sampleRate, source.raw), name);
    std::string damage;
    Result<SoundBuffer> sound = source.kind == GivenSound::Kind::pipe
                                    ? readPipe(source.name, source.raw, seconds, [&] { return !context.interrupted(); })
                                    : readSound(source.name, kMaxSamples, &damage);
    if (!sound) return failed(source, name + ": " + sound.error().text);
    if (!damage.empty()) {
        Diagnostics reported;
        reported.warning({}, fmt::format("{}: {} is damaged or cut short: {}", source.option, name, damage));
        context.report(reported);
    }
    return ClipLibrary::Given(std::make_shared<const SoundBuffer>(std::move(*sound)));
}

/// Checks that the scene has nodes with the ID to which the sound is given.
Result<> checkId(const GivenSound& source, const Scene& scene) {
    const bool stream = source.isStream;
    std::set<std::string> known;
    scene.forEachNode([&](const Node& node) {
        if (!stream && node.is(x3d::MicrophoneSource::type))
            known.insert(node.get(x3d::MicrophoneSource::mediaDeviceID).str());
        if (stream && node.is(x3d::StreamAudioSource::type))
            for (const String& id : node.get(x3d::StreamAudioSource::streamIdentifier)) known.insert(id.str());
    });
    if (source.id.empty() || known.contains(source.id)) return {};
    const std::string type = stream ? "StreamAudioSource" : "MicrophoneSource";
    if (known.empty()) return failed(source, "the scene has no " + type);
    std::string names;
    for (const std::string& name : known) names += fmt::format("{}\"{}\"", names.empty() ? "" : ", ", name);
    return failed(source, fmt::format("no {} has the {} \"{}\"; there are: {}", type,
                                      stream ? "streamIdentifier" : "mediaDeviceID", source.id, names));
}

}  // namespace

Result<ClipLibrary::UsersSounds> openGivenSounds(const std::vector<GivenSound>& sources, const Scene& scene, bool live,
                                                 double seconds, int sampleRate, const SessionContext& context) {
    ClipLibrary::UsersSounds sounds;
    for (const GivenSound& source : sources) {
        if (scene.nodeCount() > 0)
            if (auto ok = checkId(source, scene); !ok) return std::unexpected(ok.error());
        auto opened = openSource(source, live, seconds, sampleRate, context);
        if (!opened) return std::unexpected(opened.error());
        (source.isStream ? sounds.streams : sounds.microphones)[source.id] = std::move(*opened);
    }
    return sounds;
}

}  // namespace rtsg
