// Writes results of listening as JSON and as impulse responses, and does a whole run in one call.
#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include <rtsg/audio/listen.h>
#include <rtsg/audio/sound_renderer.h>

#include "report/json_text.h"
#include "report/opening_text.h"

namespace rtsg {

std::string ListenReport::toJson() const {
    std::string text = "{\"sources\":[";
    for (std::size_t i = 0; i < sources.size(); ++i) {
        const Source& s = sources[i];
        std::uint32_t highest = 0;
        for (const Arrival& arrival : s.trace.arrivals) highest = std::max(highest, arrival.order);
        text += fmt::format(
            "{}{{\"source\":{},\"position\":[{},{},{}],\"bands_hz\":{},\"bands_computed\":{},{},\"ci95\":{{{}}},{},"
            "{},\"schroeder_hz\":{},"
            "\"image_"
            "order\":{},"
            "\"images\":{},\"edge_pairs\":{{\"heard\":{},\"left_out\":{}}},"
            "\"rays\":{},\"absorbed\":{},\"escaped\":{},\"truncated\":{},\"losses\":{}}}",
            i ? "," : "", jsonString(s.source), jsonNumber(s.position.x), jsonNumber(s.position.y),
            jsonNumber(s.position.z), jsonArray(kBandHz), jsonBandsComputed(s.trace.bandsTraced, s.metrics.bandsApart),
            jsonFigures(s.metrics.value), jsonFigures(s.metrics.ci95), jsonSlopes(s.metrics), jsonSpeech(s.speech),
            jsonNumber(s.schroederHz), highest, s.trace.arrivals.size(), s.trace.edgePairs.heard,
            s.trace.edgePairs.leftOut, s.trace.rays, jsonArray(s.trace.absorbed), jsonArray(s.trace.escaped),
            jsonArray(s.trace.truncated), openingsJson(s.openings));
    }
    text += fmt::format("],\"rays\":{},\"seconds\":{},\"escaped\":{},\"gain\":{}", rays, jsonNumber(seconds),
                        jsonNumber(escaped), jsonNumber(static_cast<double>(gain)));
    text += ",\"speech\":" + jsonSpeechOptions(speech);
    text += fmt::format(
        ",\"air\":{{\"absorbs\":{},\"temperature_c\":{},\"humidity_percent\":{},\"pressure_kpa\":{},\"speed_m_s\":{}}}",
        air.absorbs, jsonNumber(air.celsius), jsonNumber(air.relativeHumidity), jsonNumber(air.pressureKpa),
        jsonNumber(air.speedOfSound));
    text += fmt::format(",\"heard\":{{\"responses\":{},\"rays\":{},\"images\":{}}}}}", heard.responses, heard.rays,
                        heard.images);
    return text;
}

SoundBuffer ListenReport::impulseResponses(int sampleRate, double seconds) const {
    std::vector<ImpulseResponse> parts;
    std::size_t frames = 1, channels = 0;
    for (const Source& source : sources) {
        ImpulseResponseOptions options;
        options.channels = responses;
        options.ambisonicOrder = ambisonicOrder;
        if (hrtf && hrtf->sampleRate() == sampleRate) options.hrtf = hrtf;
        options.sampleRate = sampleRate;
        options.listenerRight = listener.right;
        options.listenerUp = listener.up;
        options.listenerBack = listener.back;
        options.speedOfSound = air.speedOfSound;
        options.headRadius = listener.headRadius();
        options.seed = noiseSeed(seed, source.position, listener.position);
        options.seconds = seconds;
        parts.push_back(makeImpulseResponse((source.directed ? *source.directed : source.trace).echogram(), options));
        frames = std::max(frames, parts.back().frames());
        channels += parts.back().channels.size();
    }
    SoundBuffer result{sampleRate, static_cast<int>(std::max<std::size_t>(1, channels)), {}};
    result.samples.resize(frames * static_cast<std::size_t>(result.channels));
    std::size_t at = 0;
    for (const ImpulseResponse& part : parts)
        for (const std::vector<float>& channel : part.channels) {
            for (std::size_t i = 0; i < channel.size(); ++i) result.samples[i * channels + at] = channel[i];
            ++at;
        }
    return result;
}

Result<ListenReport> listen(Scene& scene, const ListenOptions& options) {
    SharedWorld world(scene);
    SoundRenderer sound(world, options);
    auto report = listen(sound, options);
    if (report) report->diagnostics.append(world.diagnostics());
    return report;
}

Result<ListenReport> listen(SoundRenderer& sound, const ListenOptions& options) {
    if (!(options.seconds >= 0 && options.seconds <= 24 * 3600)) return fail("the duration must be 0 to 24 hours");
    if (!(options.framesPerSecond > 0 && options.framesPerSecond <= 1000))
        return fail("the frame rate must be up to 1000");
    Scene& scene = sound.world().scene();
    const double start = scene.now();
    const auto runTo = [&](double t) {
        if (options.runTo)
            options.runTo(t);
        else
            scene.newFrame(t);
    };
    runTo(start);
    if (options.metrics)
        if (auto measured = sound.measure(); !measured) return std::unexpected(measured.error());
    if (options.sound) {
        // A frame of no length: the state that is heard until the first frame.
        if (auto begun = sound.renderFrame(); !begun) return std::unexpected(begun.error());
        const auto frames = static_cast<std::uint64_t>(std::ceil(options.seconds * options.framesPerSecond - 1e-9));
        for (std::uint64_t frame = 1; frame <= frames; ++frame) {
            const double t = start + std::min(options.seconds, static_cast<double>(frame) / options.framesPerSecond);
            runTo(t);
            if (auto done = sound.renderFrame(); !done) return std::unexpected(done.error());
            sound.sendEvents();
            if (options.progress && !options.progress(static_cast<double>(frame) / static_cast<double>(frames)))
                return fail("cancelled");
        }
    }
    return sound.finish();
}

}  // namespace rtsg
