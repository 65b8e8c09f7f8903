// SoundScene: the description of sound in a scene: sources, listener, and the acoustic materials of walls.
//
// Invariant: after apply() it equals a SoundScene that reads the scene anew. It needs no scene afterwards, so sound may
// be rendered while the scene moves on. An emitter is one placed Sound or SpatialSound; a node that is USEd makes
// several. AcousticProperties: the fields are shares of the incident energy. absorption is lost, refraction passes
// straight on, diffuse is scattered by Lambert's law, specular is reflected like a mirror. The rest is divided between
// diffuse and specular in proportion; all of it is specular if specular is 0. The node has no octave bands: a
// MetadataFloat (or a MetadataSet of them) in its `metadata`, named like the field, may give 10 or 9 values from 31.5
// Hz, 8 from 63 Hz, 7 or 6 from 125 Hz; beyond these the nearest value counts. Air: metadata of a WorldInfo, see
// readAir(). Source: ISO/IEC 19775-1 V4.0 12.4.1 (AcousticProperties), 16.4 (Sound component), 8.2.4 (time-dependent
// nodes). Threading: apply() on the scene's thread; the rest between two calls of it.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include <rtsg/audio/acoustic_geometry.h>
#include <rtsg/audio/audio_processing.h>
#include <rtsg/audio/hrtf.h>
#include <rtsg/core/resource.h>
#include <rtsg/core/scene.h>
#include <rtsg/renderers/flattener.h>

namespace rtsg {

class FieldNumbers;
class MaterialTable;
class Walls;

/// Called with a metadata node and a text that says what is wrong with it and which value is used.
using ReportMaterial = std::function<void(NodeId metadata, std::string)>;
/// A node's acoustic material; `defaults` while the node is not enabled.
AcousticMaterial acousticMaterial(const Scene& scene, const Node& acousticProperties, const AcousticMaterial& defaults,
                                  const ReportMaterial& report = {});

/// The active period of a time-dependent node (8.2.4), in seconds of scene time.
struct SoundTimes {
    double startTime = 0, stopTime = 0, pauseTime = 0, resumeTime = 0;
    /// The paused time since its start, seconds, and whether it is paused now, in the state that was read.
    double pausedTotal = 0;
    bool paused = false;

    /// Whether it is active at scene time `t`. The end of a clip is not considered.
    bool active(double t) const;
    friend bool operator==(const SoundTimes&, const SoundTimes&) = default;
};

/// One generator of sound.
struct SoundVoice : SoundTimes {
    enum class Kind : std::uint8_t { clip, buffer, oscillator, microphone, stream };
    Kind kind = Kind::clip;
    NodeId node;
    std::string name;                            // DEF, or the type
    NodeLocation location;                       // for messages
    std::vector<std::string> urls;               // the first readable one counts; microphone: its name
    std::vector<std::filesystem::path> folders;  // for relative urls, see Resources::foldersOf
    Array<float> buffer;                         // buffer: mono
    double bufferRate = 48000;
    int bufferChannels = 1;                    // one after the other, as in Web Audio
    double loopStart = 0, loopEnd = 0;         // seconds; no loop unless the end is after the start
    std::shared_ptr<const PeriodicWave> wave;  // oscillator; null: a sine
    double gain = 1, pitch = 1;
    double frequency = 440;                                     // oscillator, Hz
    double duration = std::numeric_limits<double>::infinity();  // of the buffer, seconds
    bool loop = false;
};

struct SoundNode;

/// A processing node of the audio graph, as a tree: a node that is USEd several times appears several times.
struct AudioProcess {
    enum class Kind : std::uint8_t {
        mix,
        biquad,
        delay,
        convolver,
        compressor,
        shaper,
        splitter,
        merger,
        selector,
        analyser,
        panner
    };
    Kind kind = Kind::mix;
    NodeId node;
    std::string name;       // for messages
    double gain = 1;        // of the output
    double above = 1;       // the factor in it that comes from the nodes above
    bool discrete = false;  // channelInterpretation of the inputs
    SoundTimes times;       // while inactive, the node passes its input unchanged
    Biquad::Type filter = Biquad::Type::lowpass;
    double frequency = 350, quality = 1, filterGainDb = 0;  // biquad: Hz, with detune applied
    double delay = 0;                                       // s
    Array<float> buffer;                                    // convolver: mono, at the output rate
    bool normalize = false;
    Compressor::Settings compressor;
    std::vector<float> curve;    // shaper
    unsigned oversample = 1;     // shaper: 1, 2 or 4 times the rate
    int selection = 0;           // selector
    std::size_t fftSize = 2048;  // analyser: a power of two
    double smoothing = .8;
    std::shared_ptr<const SoundNode> placed;  // panner: position and level, without inputs
    std::vector<SoundVoice> voices;
    std::vector<std::shared_ptr<const AudioProcess>> inputs;
};

/// The spectrum that an Analyser finds in its input, mixed to mono.
struct AudioSpectrum {
    NodeId node;
    std::vector<double> decibels;  // of fftSize / 2 bins, see SpectrumAnalyser
};
/// The present gain reduction of a DynamicsCompressor for its loudest channel.
struct AudioReduction {
    NodeId node;
    double decibels = 0;  // at most 0; without make-up gain
};
/// The results of the analysing nodes of the audio graph, one a node.
struct AudioFindings {
    std::vector<AudioSpectrum> spectra;
    std::vector<AudioReduction> reductions;
};

/// A Sound, a SpatialSound, or a destination of an audio graph.
struct SoundNode {
    /// none: equally loud everywhere (AudioDestination).
    enum class Law : std::uint8_t { ellipsoids, linear, inverse, exponential, none };
    NodeId node;
    std::string name;  // DEF; without one the type and a number
    bool enabled = true, spatialize = true, doppler = true;
    bool head = false;      // enableHRTF: through a head, if there are two channels
    bool reflected = true;  // reflected by walls
    bool discrete = false;  // channelInterpretation of a destination
    int maxChannels = 2;    // that a destination has, at least 1
    /// The streamIdentifier of a StreamAudioDestination, which nobody in the scene hears.
    std::optional<std::vector<std::string>> stream;
    double intensity = 1;  // gain included
    glm::dvec3 location{0}, direction{0, 0, 1};
    Law law = Law::ellipsoids;
    double minBack = 1, minFront = 1, maxBack = 10, maxFront = 10;   // ellipsoids
    double referenceDistance = 1, maxDistance = 10000, rolloff = 1;  // the others
    double coneInner = 6.2832, coneOuter = 6.2832, coneOuterGain = 0;
    std::vector<SoundVoice> voices;
    std::vector<std::shared_ptr<const AudioProcess>> processes;

    /// Amplitude at a point in the node's frame, without intensity. Ellipsoids: 1 inside the inner one, falling
    /// linearly in decibels to -20 dB at the outer one, silent beyond; location is one focus of both.
    double level(const glm::dvec3& listener) const;
    /// Amplitude factor of the cones towards a point.
    double coneGain(const glm::dvec3& listener) const;
    /// Whether it has any input.
    bool plays() const { return !voices.empty() || !processes.empty(); }
    /// Whether it is directional because of its cones or, if `levels` is set, because of its ellipsoids.
    bool directional(bool levels) const;
};

struct SoundEmitter {
    InstanceId id;
    std::shared_ptr<const SoundNode> sound;  // never null
    WorldFromLocal worldFromLocal{1.0};
    std::string name;  // the node's, with a number if it is placed more than once

    /// In the world; out of earshot if it is not finite.
    glm::dvec3 position() const;
    /// The unit direction in which it points in the world; 0 if it points nowhere.
    glm::dvec3 aim() const;
    /// The point in the node's frame that is `offset` away from the emitter in the world; `offset` itself if the frame
    /// is singular.
    glm::dvec3 localFrom(const glm::dvec3& offset) const;
};

struct ListenerPose {
    glm::dvec3 position{0, 0, 10};
    glm::dvec3 right{1, 0, 0}, up{0, 1, 0}, back{0, 0, 1};  // orthonormal
    double gain = 1;
    bool doppler = false;    // for all sources; otherwise each source decides
    double earDistance = 0;  // distance between the ears, metres; 0: not given
    double headRadius() const { return earDistance > 0 ? earDistance / 2 : kHeadRadius; }
    /// Transforms a world direction to the listener's frame.
    glm::dvec3 toLocal(const glm::dvec3& world) const {
        return {glm::dot(world, right), glm::dot(world, up), glm::dot(world, back)};
    }
};

/// A place for a listener.
struct ListeningPosition {
    std::string name;
    glm::dvec3 position{0};
    /// Right, up, back; none: those of the scene's listener.
    std::optional<glm::dmat3> axes = std::nullopt;
    double headRadius = kHeadRadius;  // if there are axes; otherwise that of the scene's listener
};

/// The sources and the listener, as a version that does not change.
struct SoundVersion {
    std::shared_ptr<const std::vector<SoundEmitter>> emitters;  // in the order of their slots; never null
    ListenerPose listener;
    AirChoice air;  // of the scene's metadata

    /// Null if there is no emitter with this id.
    const SoundEmitter* find(InstanceId id) const;
};

class SoundScene {
  public:
    /// Writes materials to `walls`, if given, which must outlive this object. `resources`: for urls of clips.
    /// `keepsStreams`: the inputs of StreamAudioDestinations are wanted. `materials`: a shape whose AcousticProperties,
    /// Appearance or Material (in this order) is named in this table takes the table's values and ignores the fields.
    /// The name is a MetadataString "acousticMaterial" in the node's metadata, or else its DEF.
    explicit SoundScene(Walls* walls = nullptr, const AcousticMaterial& defaults = {}, Resources resources = {},
                        bool keepsStreams = false, std::shared_ptr<const MaterialTable> materials = nullptr);

    void apply(const Scene& scene, const ChangeSet& changes, const InstanceDelta& delta);

    const std::vector<SoundEmitter>& emitters() const { return *emitters_; }
    const SoundNode& sound(const SoundEmitter& emitter) const { return *emitter.sound; }
    glm::dvec3 position(const SoundEmitter& emitter) const { return emitter.position(); }
    /// The first enabled ListenerPointSource, otherwise the bound viewpoint, otherwise X3D's default 0 0 10. If its
    /// position or orientation is not finite, the last finite one counts, and this is reported once.
    const ListenerPose& listener() const { return listener_; }
    /// The listening places: every enabled ListenerPointSource that does not follow the view; if there is none, every
    /// viewpoint; otherwise the place of listener().
    const std::vector<ListeningPosition>& positions() const { return positions_; }
    /// Nodes that exist but cannot be heard, with the reason; each once.
    const Diagnostics& diagnostics() const { return diagnostics_; }
    /// The node that defines the material of a shape.
    NodeId materialNode(const Scene& scene, const Instance& instance) const;
    /// The names of the table that no node in the scene has had so far, in the table's order.
    std::vector<std::string> unusedMaterials() const;
    /// The present version. The next change copies the emitters once.
    SoundVersion freeze();

  private:
    std::shared_ptr<const SoundNode> readSound(const Scene& scene, const Node& node);
    /// The name under which the table has a node; empty if it has not.
    std::string_view materialName(const Scene& scene, NodeId id) const;
    void readMaterial(const Scene& scene, NodeId id);
    void readWalls(const Scene& scene, const ChangeSet& changes, const InstanceDelta& delta);
    bool moveEmitters(const Scene& scene, const InstanceDelta& delta);
    void nameEmitters();
    std::vector<SoundEmitter>& ownEmitters();
    /// The lists that a branch of an audio graph adds to.
    struct Branch {
        std::vector<SoundVoice>& voices;
        std::vector<std::shared_ptr<const AudioProcess>>& processes;
        const std::string& sound;                           // its name
        std::shared_ptr<const AudioProcess> fed = nullptr;  // additional input of the node on top, besides its children
    };
    void readVoices(const Scene& scene, NodeId id, double gain, int depth, Branch to);
    /// The numbers in a node's fields; values that are not finite are reported.
    FieldNumbers numbersIn(const Scene& scene, const Node& node);
    /// Whether the node's pitch is allowed for a sound; otherwise this is reported.
    bool reportPitch(const Scene& scene, const Node& node, double pitch);
    bool readSource(const Scene& scene, const Node& node, double gain, Branch to);
    bool readProcess(const Scene& scene, const Node& node, double gain, int depth, Branch to);
    void readMerged(const Scene& scene, NodeId id, int depth, AudioProcess& merger, Branch to);
    bool readPanner(const Scene& scene, const Node& node, double gain, int depth, Branch to);
    bool readOutputs(const Scene& scene, const Node& splitter, int depth, AudioProcess& process, Branch to);
    std::vector<std::filesystem::path> foldersOf(const Scene& scene, const Node& node) const;
    void chooseListener(const Scene& scene);
    ListenerPose poseOf(const Scene& scene, const Placed& placed);
    void findPositions(const Scene& scene);
    double earDistance(const Scene& scene, const Node& node);
    void readAir(const Scene& scene, const ChangeSet& changes);
    void nameSilent(const Scene& scene, const ChangeSet& changes);
    void warnOnce(const NodeLocation& location, std::string text);

    Walls* walls_;
    AcousticMaterial defaults_;
    Resources resources_;
    bool keepsStreams_;
    std::shared_ptr<const MaterialTable> materials_;
    std::unordered_set<std::string> usedMaterials_;
    int visits_ = 0;  // of readVoices, for the sound being read
    std::unordered_map<std::uint32_t, std::shared_ptr<const SoundNode>> sounds_;  // by NodeId
    std::unordered_map<std::uint32_t, Placed> others_;                            // listeners and views, by slot
    std::unordered_map<std::uint32_t, ListenerPose> poses_;                       // the last finite ones
    std::unordered_set<std::uint32_t> acousticsKnown_;                            // by NodeId
    std::shared_ptr<std::vector<SoundEmitter>> emitters_ = std::make_shared<std::vector<SoundEmitter>>();
    bool shared_ = false;  // whether a version shares emitters_
    ListenerPose listener_;
    std::vector<ListeningPosition> positions_;
    AirChoice air_;
    std::unordered_set<std::uint32_t> infos_;  // WorldInfo nodes, by NodeId
    Diagnostics diagnostics_;
    std::unordered_set<std::string> reported_;
};

}  // namespace rtsg
