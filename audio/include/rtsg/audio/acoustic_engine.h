// AcousticEngine: renders what the listener of a scene hears: stereo, binaural or ambisonic.
//
//     auto engine = AcousticEngine::create({.binaural = true});
//     (*engine)->render(*tables.latest(), *world.freeze(), t, sound);      // to scene time t
//
// The sound of an emitter is made in two parts. Direct sound goes through a delay line of its own (propagation delay,
// hence Doppler) to panning or to a head. Reflections go through a Convolver with the impulse response of the traced
// room. The response is traced anew when the emitter, the listener or a wall near its paths has moved. Clips keep their
// channels. Time is counted in samples: scene time t is sample t * sampleRate. Positions are interpolated in between.
// Level 1 is full scale.
// Threading: one thread at a time, which need not be the scene's, because the engine reads only the state and the rays.
// Tracing uses all cores. Source: ISO/IEC 19775-1 V4.0 clause 16; Vorlaender 2008, 11.4 for the split into direct and
// rest.
#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <rtsg/audio/acoustic_tables.h>
#include <rtsg/audio/acoustic_tracer.h>
#include <rtsg/audio/clip_library.h>
#include <rtsg/audio/hrtf.h>
#include <rtsg/audio/sound_file.h>
#include <rtsg/audio/world_geometry.h>

namespace rtsg {

class MaterialTable;

struct AcousticOptions {
    /// x3d: direct sound has the level that the node's distance law gives (times intensity and gain), and reflections
    /// keep the physical ratio to it. physical: the pressure is 1 at a distance of 1 m and falls as 1 / d.
    enum class Levels : std::uint8_t { x3d, physical };

    int sampleRate = 48000;
    bool binaural = false;
    /// The head for binaural sound, and for SpatialSounds with enableHRTF. Null: a rigid sphere, with the listener's
    /// interauralDistance if that is set.
    std::shared_ptr<const Hrtf> hrtf;
    /// 1 to 7: makes ambisonic sound of this order (see ambisonics.h) instead of two channels; 0: does not.
    int ambisonicOrder = 0;
    /// Directions and levels are computed once a block and interpolated in between.
    std::size_t blockSize = 256;
    Levels levels = Levels::x3d;
    /// The options for tracing the responses that are heard. Room-acoustic figures need more rays (see listen()).
    TraceOptions trace = heardTrace();
    /// Takes precedence over the air that the scene describes, which takes precedence over trace.air.
    AirChoice air;
    AcousticMaterial defaultMaterial;
    /// These take precedence over the scene's values for materials of the same name; see SoundScene.
    std::shared_ptr<const MaterialTable> materials;
    /// A response is traced anew at most once in this time (seconds of scene time), and only if something moved by more
    /// than `moveTolerance` metres or the walls changed.
    double retraceSeconds = 0.2;
    double moveTolerance = 0.1;
    /// Authors put a Sound inside the shape that makes it. Shapes around a Sound whose diagonal is no longer than this
    /// (metres) let its sound pass, unless the listener is inside them too: then they are a room.
    double bodySize = 2.5;
    /// False: direct sound only.
    bool reflections = true;
    /// Scene time from which on reflections are made. Before it only direct sound is made, which is quick.
    double reflectedFrom = -std::numeric_limits<double>::infinity();
    /// Traces rooms on a thread of its own, while sound goes on with the earlier responses; for renderLive() only.
    bool background = false;
    /// Keeps the sounds that StreamAudioDestinations receive, see AcousticEngine::streams().
    bool keepStreams = false;
    /// Scene time of the first sample.
    double startTime = 0;
    /// Which files the urls of clips may open, and the folders of relative urls.
    Resources resources;
    /// The file that the scene was read from, if any; diagnostics about its nodes name their lines.
    std::filesystem::path document;
    /// The sounds for microphones, pipes and devices. A scene opens none of them itself: the user says what each node
    /// hears.
    ClipLibrary::UsersSounds given;

    /// The number of rays for quality 1. The number of candidate images is that of quality 1, too.
    static constexpr std::uint64_t kHeardRays = 2000;
    /// Options for tracing heard responses at a quality above 0. The random error falls as 1 / quality. The number of
    /// rays grows with its square, and above 1 so does the number of candidate images. `rtsg chart heard` measures
    /// error and time.
    static TraceOptions heardTrace(double quality = 1);
    /// The same for the quality that needs this number of rays.
    static TraceOptions heardTraceOf(std::uint64_t rays);
};

/// Statistics of the responses that were heard.
struct HeardResponses {
    std::uint64_t responses = 0;  // traced anew
    std::uint64_t turned = 0;     // made again from an earlier trace because the listener turned
    std::uint64_t rays = 0;       // the most for one response
    std::uint64_t raysInAll = 0;  // the sum over all responses
    std::size_t images = 0;       // the most for one response
    /// Sources within earshot for which nothing has been traced yet, so that they are heard without reflections; and
    /// the longest time that a source was heard so, seconds. Sound that waits for its responses has no such sources.
    std::size_t unreflected = 0;
    double longestWait = 0;
};

/// A source that is not heard because no path leads from it to the listener.
struct SealedSource {
    std::string name;  // of the emitter
    NodeId sound;
    glm::dvec3 source{0}, listener{0};
    double seconds = 0;  // scene time
    Seal seal;
    std::optional<double> until = std::nullopt;  // scene time at which a path was found again, if one was
};

/// A source that was not heard at all: because of its own fields, or because it was too far away.
struct UnheardSource {
    /// off: not enabled; empty: it has no input; silent: its intensity or gain is 0; deaf: the listener's gain is 0;
    /// far: the listener was out of its reach; still: its input was silent.
    enum class Why : std::uint8_t { off, empty, silent, deaf, far, still };
    std::string name;  // of the emitter
    NodeId sound;
    Why why = Why::far;
    double nearest = 0;  // smallest distance from the listener, metres
    std::string reach;   // the fields that set how far it is heard
};

/// A hole or a crack through which a source loses sound.
struct SoundLeak {
    std::string name;  // of the emitter that it was found with
    RoomOpenings openings;
};

/// The input of a StreamAudioDestination, with its gain.
struct StreamedSound {
    NodeId node;
    std::string name;                      // DEF; without one the type and a number
    std::vector<std::string> identifiers;  // the latest value of streamIdentifier
    SoundBuffer sound;  // from the start time on; with the largest number of channels that the input had; mono goes to
                        // all of them
};

class AcousticEngine {
  public:
    static Result<std::unique_ptr<AcousticEngine>> create(const AcousticOptions& options);
    ~AcousticEngine();

    /// Renders the sound from the end of the last call (at first the start time) to the scene time `untilSeconds`, in
    /// whole blocks, and appends it to `sound`. The delay of heads is compensated. `state` is the state at
    /// `untilSeconds`. Positions move smoothly from those of the previous call to those of this one. Other changes
    /// (fields, nodes that come and go, jumps) are heard from the first block that begins after them; until then the
    /// previous state counts. At the first call `state` counts from the start. The walls, and so the reflections, are
    /// those of `state` for the whole call. States may be skipped. If time goes back, no sound is made, and the next
    /// call goes on from there. `rays` must be of the same state and are used only during the call.
    Result<> render(const AcousticState& state, const RayView& rays, double untilSeconds, SoundBuffer& sound);

    /// The same for one block of live sound. `poseSeconds` is the time of the positions; it may be before or after the
    /// end of the block. Responses are used when they are ready; the options may have them traced in the background.
    Result<> renderLive(std::shared_ptr<const AcousticState> state, std::shared_ptr<const RayView> rays,
                        double poseSeconds, SoundBuffer& sound);
    /// The time at which the next block of renderLive() ends, seconds. It is computed from a count of samples, because
    /// adding up clock times loses a sample now and then.
    double liveEnd() const;

    /// Reads the clips of the state and computes the head beforehand, so that render() need not.
    void prepare(const AcousticState& state);
    /// The number of channels that render() appends.
    int channels() const;
    Air airOf(const AcousticState& state) const;
    /// The room as it is for sound from `source`: without the shape that the source is inside of. Valid until the next
    /// call; `rays` must live as long.
    OpenedGeometry geometryFor(const AcousticState& state, const RayView& rays, const glm::dvec3& source);
    const HeardResponses& heard() const;
    /// Filled only if the options keep streams: one entry a node, in the order of their first sound, in whole blocks up
    /// to the last sample.
    const std::vector<StreamedSound>& streams() const;
    /// The results of each Analyser and DynamicsCompressor for the samples up to the end of the last call.
    AudioFindings analyse();
    /// Diagnostics about clips that could not be played, once each.
    const Diagnostics& diagnostics() const;
    /// The sources that played while no path led from them to the listener, in the order in which this was found. A
    /// source is listed once, and again when it is sealed off anew or from the other side; at most a thousand.
    const std::vector<SealedSource>& sealed() const;
    /// The sources that cannot have been heard so far; empty as soon as one source was within its reach.
    std::vector<UnheardSource> unheard() const;
    /// Records the result of a trace for room-acoustic figures, by the same rule. `seal`: the shapes between emitter
    /// and listener, or none.
    void note(const SoundEmitter& emitter, const glm::dvec3& listener, double seconds, std::optional<Seal> seal);
    /// The leaks of rooms, each once, with the source that it was found with; at most a thousand. They are looked for
    /// once, when a source is first heard, for eight sources at most.
    const std::vector<SoundLeak>& leaks() const;
    /// Records the leaks that a trace for room-acoustic figures found.
    void note(const SoundEmitter& emitter, const RoomOpenings& openings);

  private:
    struct Impl;
    explicit AcousticEngine(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
