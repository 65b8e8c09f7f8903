// Listening to a scene: the options, the report, and a function that does a whole run.
//
// For frame-by-frame use see SoundRenderer. Room-acoustic figures are measured at the start, with as many rays as the
// requested error needs. Threading: on the scene's thread; tracing uses all cores.
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
    /// Scene time of the first sample that is kept, to get a part of a longer sound; earlier sound is rendered and
    /// dropped. None: all sound is kept.
    std::optional<double> from;
    bool limited = true;  // scales the sound down if it would clip
    bool metrics = true;  // measures room-acoustic figures at the start
    /// Whether impulse responses are wanted. If so, a directional source is traced a second time with its directivity.
    /// Figures are always those of an omnidirectional source, as ISO 3382 requires.
    bool impulseResponses = true;
    /// For rendering: sample rate, stereo or binaural, levels, which urls may be opened, default material of walls.
    AcousticRenderer::Options render;
    /// For measuring: rays, image order, air. `seed`, `air` and walls are used for rendering too; render.air takes
    /// precedence.
    TraceOptions trace;
    /// The kind of channels in ListenReport::impulseResponses().
    ImpulseResponseOptions::Channels responses = ImpulseResponseOptions::Channels::mono;
    /// The speech and the noise for the speech transmission index.
    SpeechOptions speech;
    /// If positive, rays are added until the 95 % half widths from 125 Hz to 4 kHz are below `error` times the just
    /// noticeable difference (T 5 %, C80 1 dB, D50 .05, G 1 dB), or until `maxRays` is reached.
    double error = 0;
    /// The number of rays to begin with then; enough for valid intervals.
    static constexpr std::uint64_t kFirstRays = 2000;
    std::uint64_t maxRays = 4'000'000;
    /// Runs the scene to a frame's time, for programs that do more than Scene::newFrame in a frame: load Inlines, send
    /// events.
    std::function<void(double t)> runTo;
    /// Called with the share done, 0 to 1; if it returns false, the run stops with an error.
    std::function<bool(double)> progress;
};

struct ListenReport {
    struct Source {
        std::string source;  // DEF name, or the type and a number
        glm::dvec3 position{0};
        MetricsEstimate metrics;
        TraceResult trace;
        /// A trace with the source's directivity, for impulse responses; none if the source is omnidirectional.
        std::optional<TraceResult> directed;
        /// The Schroeder frequency: below it, single modes dominate, which rays do not model. Computed from T20 at 1
        /// kHz and the volume seen from the listener; NaN if the room is not closed.
        double schroederHz = 0;
        RoomOpenings openings;  // where energy of the source leaves the room
        SpeechEstimate speech;
    };
    std::vector<Source> sources;
    ListenerPose listener;  // at the time of measuring
    Air air;
    SpeechOptions speech;  // of their STI
    ImpulseResponseOptions::Channels responses = ImpulseResponseOptions::Channels::mono;
    int ambisonicOrder = 1;
    std::shared_ptr<const Hrtf> hrtf;  // of binaural responses at its sample rate
    std::uint64_t seed = 1;            // of the noise in responses
    std::uint64_t rays = 0;
    double seconds = 0;  // of computation, for figures and sound
    double escaped = 0;  // share of the emitted energy that escaped, mean over bands and sources
    SoundBuffer sound;   // two channels, or ambisonic; empty unless requested
    /// The sounds that StreamAudioDestinations received, as long as `sound` and without `gain`. Empty unless
    /// render.keepStreams is set.
    std::vector<StreamedSound> streams;
    float gain = 1;  // factor that was applied so that the sound does not clip
    HeardResponses heard;
    Diagnostics diagnostics;

    /// One JSON object, as `rtsg listen --json` prints it; NaN and infinity become null.
    std::string toJson() const;
    /// Impulse responses with pressure 1 at 1 m, in the order of `sources`, each with the channels of `responses`. For
    /// a source with cones this is the level inside the inner cone; for one with ellipsoids (render.levels x3d) it is
    /// the level towards the listener. Their length is `seconds`, or else that of the longest.
    SoundBuffer impulseResponses(int sampleRate = 48000, double seconds = 0) const;
};

class SoundRenderer;

/// Runs the scene from its present time for `options.seconds` and renders its sound. Errors: there is no way to make
/// sound, or the run was cancelled. A scene without sounds is no error but silent.
Result<ListenReport> listen(Scene& scene, const ListenOptions& options);
/// The same on a world that is shared with other renderers.
Result<ListenReport> listen(SoundRenderer& sound, const ListenOptions& options);

}  // namespace rtsg
