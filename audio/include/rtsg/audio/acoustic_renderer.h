// AcousticRenderer: the sound of one live world, for programs with a single thread, and the options of all sound.
//
// SoundRenderer does the same on a SharedWorld. Call render() when the scene has reached the time up to which sound is
// wanted. It keeps AcousticTables of the scene and an AcousticEngine.
// Threading: the scene's thread. Tracing uses all cores.
#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <rtsg/audio/clip_library.h>
#include <rtsg/audio/hrtf.h>
#include <rtsg/audio/room_openings.h>
#include <rtsg/audio/sound_file.h>
#include <rtsg/audio/sound_scene.h>
#include <rtsg/audio/trace_result.h>
#include <rtsg/renderers/flattener.h>

namespace rtsg {

class AcousticEngine;
class AcousticTables;
class MaterialTable;
class OpenedGeometry;
class RayWorld;

struct AcousticOptions {
    /// x3d: direct sound has the level that the node's distance law gives (times intensity and gain), and reflections
    /// keep the physical ratio to it. physical: the pressure is 1 at a distance of 1 m and falls as 1 / d.
    enum class Levels : std::uint8_t { x3d, physical };

    int sampleRate = 48000;
    bool binaural = false;
    /// The head for binaural sound, and for SpatialSounds with enableHRTF. Null: a rigid sphere, with the listener's
    /// interauralDistance if that is set.
    std::shared_ptr<const Hrtf> hrtf;
    /// 1 to 7: makes ambisonic sound of this order (AmbiX: ACN, SN3D) instead of two channels; 0: does not.
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

class AcousticRenderer final : public InstanceSubscriber {
  public:
    using Options = AcousticOptions;
    using Levels = AcousticOptions::Levels;

    /// `world` must outlive this object, and must be given each delta before this object is.
    static Result<std::unique_ptr<AcousticRenderer>> create(const RayWorld& world, const Options& options);
    ~AcousticRenderer() override;

    Result<> apply(const Scene& scene, const ChangeSet& changes, const InstanceDelta& delta) override;

    /// Renders from the end of the last call to the scene time `untilSeconds`, as of the latest apply(), and appends to
    /// `sound`.
    Result<> render(double untilSeconds, SoundBuffer& sound);
    const SoundScene& scene() const;
    /// The air that results from the options and the scene.
    Air air() const;
    /// Traces sound from a source to a listener, positions in metres. The shape that the source is inside of is left
    /// out.
    TraceResult trace(const glm::dvec3& source, const glm::dvec3& listener, const TraceOptions& options) const;
    Diagnostics diagnostics() const;

    // Its parts, for the library itself (engine/acoustic_engine.h), and the geometry for sound from `source`.
    AcousticTables& tables() const;
    AcousticEngine& engine() const;
    OpenedGeometry geometryFor(const glm::dvec3& source) const;

  private:
    struct Impl;
    explicit AcousticRenderer(std::unique_ptr<Impl> impl);

    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
