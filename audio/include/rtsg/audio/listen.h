// Listening to a scene: what is asked for, what is reported, and a whole run of it in one call.
//
// Frame by frame it is a SoundRenderer. Room-acoustic figures are those of the start, with rays enough for the asked
// error. Threading: on the scene's thread; tracing uses all cores.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <rtsg/audio/acoustic_renderer.h>
#include <rtsg/audio/impulse_response.h>
#include <rtsg/audio/room_metrics.h>
#include <rtsg/audio/room_openings.h>
#include <rtsg/audio/sound_file.h>
#include <rtsg/audio/speech_transmission.h>

namespace rtsg {

struct ListenOptions {
    double seconds = 5;
    double framesPerSecond = 60;  // of the scene
    bool sound = true;            // render it
    /// Scene time of the first sample that is kept, for stretches of a longer sound; what comes before is made and
    /// dropped. None: all is kept.
    std::optional<double> from;
    bool limited = true;  // scaled down where it would clip
    bool metrics = true;  // measure at the start
    /// Measuring is for impulse responses, too: a source that sends more to one side is then traced once more, as it
    /// sends. Figures are always of sources that send alike to all sides, as ISO 3382 has it.
    bool impulseResponses = true;
    /// Rendering: sample rate, stereo or binaural, levels, what urls may open, defaults of walls.
    AcousticRenderer::Options render;
    /// Measuring: rays, image order, air. `seed`, `air` and walls are used for rendering too. render.air goes before.
    TraceOptions trace;
    /// The channels of ListenReport::impulseResponses().
    ImpulseResponseOptions::Channels responses = ImpulseResponseOptions::Channels::mono;
    /// The talker and the noise of the speech transmission index.
    SpeechOptions speech;
    /// When positive: rays are added until the 95 % half widths from 125 Hz to 4 kHz are below `error` times the just
    /// noticeable difference (T 5 %, C80 1 dB, D50 .05, G 1 dB), or `maxRays` is reached.
    double error = 0;
    /// With how many rays the program begins then: enough for intervals that say what they should.
    static constexpr std::uint64_t kFirstRays = 2000;
    std::uint64_t maxRays = 4'000'000;
    /// Runs the scene to a frame's time, where Scene::newFrame is not all that is done in a frame: Inlines are loaded,
    /// events sent.
    std::function<void(double t)> runTo;
    /// Shares done, 0 to 1; returning false stops with an error.
    std::function<bool(double)> progress;
};

struct ListenReport {
    struct Source {
        std::string source;  // DEF name, or the type and a number
        glm::dvec3 position{0};
        MetricsEstimate metrics;
        TraceResult trace;
        /// A trace of the source's directivity, from which impulse responses are made; none if it sends alike to all.
        std::optional<TraceResult> directed;
        /// Below it single modes make the sound of the room, which rays know nothing of. From T20 at 1 kHz and the
        /// volume seen from the listener; NaN where that is not closed.
        double schroederHz = 0;
        RoomOpenings openings;  // where what it emits leaves the room
        SpeechEstimate speech;
    };
    std::vector<Source> sources;
    ListenerPose listener;  // when it was measured
    Air air;
    SpeechOptions speech;  // of their STI
    ImpulseResponseOptions::Channels responses = ImpulseResponseOptions::Channels::mono;
    int ambisonicOrder = 1;
    std::shared_ptr<const Hrtf> hrtf;  // of binaural responses at its sample rate
    std::uint64_t rays = 0;
    double seconds = 0;  // of computing, metrics and sound
    double escaped = 0;  // share of the emitted energy, mean over bands and sources
    SoundBuffer sound;   // two channels or ambisonic; empty unless asked for
    /// The sounds that StreamAudioDestinations received, as long as `sound` and without gain. Empty unless
    /// render.keepStreams is set.
    std::vector<StreamedSound> streams;
    float gain = 1;  // that had to be applied lest the sound clip
    HeardResponses heard;
    Diagnostics diagnostics;

    /// One object as the command line's contract says; NaN and infinity are null.
    std::string toJson() const;
    /// Responses at pressure 1 at 1 m, in the order of `sources`, each with the channels that `responses` says. By
    /// cones what is sent within the inner one is as loud; by ellipsoids (render.levels x3d) what goes to the listener.
    SoundBuffer impulseResponses(int sampleRate = 48000) const;
};

class SoundRenderer;

/// Runs the scene from its present time for `options.seconds` and listens. Error: nothing to hear with, or cancelled;
/// a scene without sounds is not an error, but silent.
Result<ListenReport> listen(Scene& scene, const ListenOptions& options);
/// The same on a world that others share.
Result<ListenReport> listen(SoundRenderer& sound, const ListenOptions& options);

}  // namespace rtsg
