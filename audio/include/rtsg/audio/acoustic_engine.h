// AcousticEngine: renders what the listener of a scene hears: stereo, binaural or ambisonic.
//
//     auto engine = AcousticEngine::create({.binaural = true});
//     (*engine)->render(*tables.latest(), *world.freeze(), t, sound);      // to scene time t
//
// Each emitter goes two ways: direct sound through a delay line of its own (propagation delay, hence Doppler) to the
// panning or a head; reflections through a Convolver with the impulse response of the traced room, traced anew when
// emitter or listener have moved, or a wall within reach of its paths. Clips keep their channels. Time runs in samples:
// scene time t is sample t * sampleRate; places in between are smooth. Levels: 1 is full scale.
// Threading: one thread at a time, which need not be the scene's: the state and the rays are all that it reads. Tracing
// runs on all cores. Source: ISO/IEC 19775-1 V4.0 clause 16; Vorlaender 2008, 11.4 for the split into direct and rest.
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
    /// x3d: direct sound has the level that the node's distance law gives (times intensity, gain), reflections keep the
    /// physical ratio to it. physical: pressure 1 is that at 1 m, 1 / d beyond.
    enum class Levels : std::uint8_t { x3d, physical };

    int sampleRate = 48000;
    bool binaural = false;
    /// The head of binaural sound, and of SpatialSounds with enableHRTF; null: a sphere, of the listener's
    /// interauralDistance if it has one.
    std::shared_ptr<const Hrtf> hrtf;
    /// 1 to 7: an ambisonic sound (see ambisonics.h) instead of two channels; 0: not.
    int ambisonicOrder = 0;
    /// Directions and levels are found once in a block, and are smooth in between.
    std::size_t blockSize = 256;
    Levels levels = Levels::x3d;
    /// How the responses that are heard are traced. Metrics want more rays (see listen()).
    TraceOptions trace = heardTrace();
    /// Goes before what the scene says of its air, and that before trace.air.
    AirChoice air;
    AcousticMaterial defaultMaterial;
    /// Goes before what the scene says of the materials that it has a name of; see SoundScene.
    std::shared_ptr<const MaterialTable> materials;
    /// A response is traced anew at most this often (seconds of scene time), and only when something moved by more
    /// than `moveTolerance` metres or the walls changed.
    double retraceSeconds = 0.2;
    double moveTolerance = 0.1;
    /// Authors put a Sound into the thing that sounds. Shapes around it that measure no more than this from corner
    /// to corner (metres) let its sound pass, unless the listener is in them too: that is a room.
    double bodySize = 2.5;
    /// No reflections at all: direct sound only.
    bool reflections = true;
    /// Scene time from which on there are reflections; before it direct sound is all that is made, quickly.
    double reflectedFrom = -std::numeric_limits<double>::infinity();
    /// Rooms are traced on a thread of its own, and sound goes on with what was traced before; for renderLive() only.
    bool background = false;
    /// Keeps the sounds that StreamAudioDestinations receive, see AcousticEngine::streams().
    bool keepStreams = false;
    /// Scene time of the first sample.
    double startTime = 0;
    /// These say which files urls of clips may open, and where relative urls start.
    Resources resources;
    /// The file that the scene was read from, if it was: what is said of a node in it has its line.
    std::filesystem::path document;
    /// A scene opens no microphone, pipe or device: who runs it says what each source hears.
    ClipLibrary::UsersSounds given;

    /// With so many rays for a quality of 1, and as many candidates of images.
    static constexpr std::uint64_t kHeardRays = 2000;
    /// How responses that are heard are traced for a quality above 0. Their error by chance falls as 1 / quality. Rays
    /// grow with its square, and above 1 candidates of images do, too. `rtsg chart heard` measures error and time.
    static TraceOptions heardTrace(double quality = 1);
    /// The same for the quality that has so many rays.
    static TraceOptions heardTraceOf(std::uint64_t rays);
};

/// The responses that were heard.
struct HeardResponses {
    std::uint64_t responses = 0;  // traced
    std::uint64_t turned = 0;     // made again from what had been traced, as the listener turned
    std::uint64_t rays = 0;       // the most in one,
    std::uint64_t raysInAll = 0;  // and of all together
    std::size_t images = 0;       // the most in one
    /// Sources within earshot of which nothing was traced so far, so that they are heard without reflections; and the
    /// longest time that one was, seconds. Sound that waits for its responses has none.
    std::size_t unreflected = 0;
    double longestWait = 0;
};

/// A source of which nothing is heard because no way leads from it to the listener.
struct SealedSource {
    std::string name;  // of the emitter
    NodeId sound;
    glm::dvec3 source{0}, listener{0};
    double seconds = 0;  // scene time
    Seal seal;
    std::optional<double> until = std::nullopt;  // scene time, if it was let out again
};

/// A source of which nothing was heard, whatever it played, because of itself or of how far away it was.
struct UnheardSource {
    /// off: not enabled; empty: nothing leads into it; silent: its intensity or gain is 0; deaf: the listener's gain
    /// is; far: it was out of its reach; still: what leads into it made no sound.
    enum class Why : std::uint8_t { off, empty, silent, deaf, far, still };
    std::string name;  // of the emitter
    NodeId sound;
    Why why = Why::far;
    double nearest = 0;  // metres from the listener, at any time
    std::string reach;   // the fields that say how far it is heard
};

/// A hole or a crack through which sound of a source is lost.
struct SoundLeak {
    std::string name;  // of the emitter by which it was found
    NodeId sound;
    glm::dvec3 source{0};
    double seconds = 0;  // scene time
    RoomOpening opening;
};

/// The sound that leads into a StreamAudioDestination, with its gain.
struct StreamedSound {
    NodeId node;
    std::string name;                      // DEF; without one the type and a number
    std::vector<std::string> identifiers;  // as its streamIdentifier was last
    SoundBuffer sound;  // from the start time on; as many channels as there were at most, and one goes to all of them
};

class AcousticEngine {
  public:
    static Result<std::unique_ptr<AcousticEngine>> create(const AcousticOptions& options);
    ~AcousticEngine();

    /// Renders the scene time from the end of the last call (at first the start time) to `untilSeconds`, in whole
    /// blocks, and appends it to `sound`. The latency of heads is taken out. The state is that of `untilSeconds`:
    /// places are on their way there, smoothly, from those of the call before; what else changed (fields, what comes
    /// and goes, who is put somewhere else) is heard from the first block that begins then or later, and until then
    /// what the call before was given; at the first call it is so from the start. Walls, and with them reflections,
    /// are those of `state` all the way. States may be skipped. Where time goes back, nothing is made, and the next
    /// call goes on from there. `rays` are of the same state and used in the call only.
    Result<> render(const AcousticState& state, const RayView& rays, double untilSeconds, SoundBuffer& sound);

    /// The same for sound that does not wait, of one block: the poses are those at `poseSeconds`, which may lie before
    /// or after its end. Responses come when they are ready, in the background if the options say so.
    Result<> renderLive(std::shared_ptr<const AcousticState> state, std::shared_ptr<const RayView> rays,
                        double poseSeconds, SoundBuffer& sound);
    /// When the next block of renderLive() ends, seconds. Counted in samples: times of today are too coarse to be added
    /// up without losing one now and then.
    double liveEnd() const;

    /// Reads the clips that the state names, and computes the head, so that none of this has to be done while sound is
    /// made.
    void prepare(const AcousticState& state);
    /// The number of channels that render() appends.
    int channels() const;
    Air airOf(const AcousticState& state) const;
    /// The room ready to be traced, as it is for sound from `source`: its own body left out. Good until the next call;
    /// `rays` must live as long.
    OpenedGeometry geometryFor(const AcousticState& state, const RayView& rays, const glm::dvec3& source);
    const HeardResponses& heard() const;
    /// If the options keep them: one a node, in the order of their first sound, in whole blocks up to the last sample.
    const std::vector<StreamedSound>& streams() const;
    /// The findings of each Analyser and DynamicsCompressor in the samples up to the end of the last call.
    AudioFindings analyse();
    /// Diagnostics about clips that could not be heard so far, once each.
    const Diagnostics& diagnostics() const;
    /// The sources that played while they were sealed off from the listener, in the order in which that was found: each
    /// once, and again whenever it is sealed anew, or from the other side; the first thousand.
    const std::vector<SealedSource>& sealed() const;
    /// Those of which nothing can have been heard so far; empty once any sound was in its reach.
    std::vector<UnheardSource> unheard() const;
    /// Notes what a trace for figures found, by the same rule: `seal` is what keeps the emitter from the listener, or
    /// none.
    void note(const SoundEmitter& emitter, const glm::dvec3& listener, double seconds, std::optional<Seal> seal);
    /// The leaks of rooms, each once, by whichever source it was found first; the first thousand. They are looked for
    /// when a source is first heard in a room that loses some of its sound, and again half a second after walls changed
    /// there (after five if these never rest), for eight sources at most.
    const std::vector<SoundLeak>& leaks() const;
    /// Notes those that a trace for figures found.
    void note(const SoundEmitter& emitter, double seconds, const RoomOpenings& openings);

  private:
    struct Impl;
    explicit AcousticEngine(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
