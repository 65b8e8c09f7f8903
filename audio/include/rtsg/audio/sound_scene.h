// SoundScene: what a scene says about sound: who sounds where and how, who listens, what walls are made of.
//
// Invariant: after apply() it is what reading the scene anew would give; it is self-contained, so that sound may be
// rendered while the scene moves on. An emitter is one placed Sound or SpatialSound: a USEd one is several.
// AcousticProperties: the fields are shares of the incident energy. absorption is lost, refraction passes straight on,
// diffuse is scattered by Lambert's law, specular mirrored; what is left over goes to diffuse and specular in their
// proportion, and all of it to specular while specular is 0. Octave bands, which the node has not, may be given by a
// MetadataFloat (or a MetadataSet of them) in its `metadata`, named like the field: 10 or 9 values from 31.5 Hz, 8 from
// 63 Hz, 7 or 6 from 125 Hz; beyond them the nearest value stands. The air: one in the metadata of a WorldInfo, see
// readAir(). Source: ISO/IEC 19775-1 V4.0 12.4.1 (AcousticProperties), 16.4 (Sound component), 8.2.4 (time-dependent
// nodes). Threading: apply() on the scene's thread; the rest between two of them.
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
#include <rtsg/audio/panning.h>
#include <rtsg/core/resource.h>
#include <rtsg/core/scene.h>
#include <rtsg/renderers/flattener.h>

namespace rtsg {

class FieldNumbers;
class MaterialTable;
class Walls;

/// Is called with a metadata node and a text that says what is wrong with it and which value counts.
using TellMaterial = std::function<void(NodeId metadata, std::string)>;
/// A node's acoustic material; `defaults` while it is not enabled.
AcousticMaterial acousticMaterial(const Scene& scene, const Node& acousticProperties, const AcousticMaterial& defaults,
                                  const TellMaterial& tell = {});

/// When a time-dependent node is active (8.2.4), in seconds of scene time.
struct SoundTimes {
    double startTime = 0, stopTime = 0, pauseTime = 0, resumeTime = 0;
    /// Seconds that it was paused for since its start, and whether it is: of the state that this was read from.
    double pausedTotal = 0;
    bool paused = false;

    /// Whether it is at scene time `t`, but for a clip's end.
    bool active(double t) const;
    friend bool operator==(const SoundTimes&, const SoundTimes&) = default;
};

/// One generator of sound.
struct SoundVoice : SoundTimes {
    enum class Kind : std::uint8_t { clip, buffer, oscillator, microphone, stream };
    Kind kind = Kind::clip;
    NodeId node;
    std::string name;                            // DEF, or the type
    NodePlace place;                             // for messages
    std::vector<std::string> urls;               // the first that can be read counts; microphone: its name
    std::vector<std::filesystem::path> folders;  // where they start, see Resources::foldersOf
    Array<float> buffer;                         // buffer: mono
    double bufferRate = 48000;
    int bufferChannels = 1;                    // one after the other, as Web Audio's buffers have them
    double loopStart = 0, loopEnd = 0;         // seconds; no region unless the end is after the start
    std::shared_ptr<const PeriodicWave> wave;  // oscillator; null: a sine
    double gain = 1, pitch = 1;
    double frequency = 440;                                     // oscillator, Hz
    double duration = std::numeric_limits<double>::infinity();  // seconds of it that are used
    bool loop = false;
};

struct SoundNode;

/// A node that does something with what leads into it. A tree: what is USEd more than once is several.
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
    double gain = 1;        // of what comes out,
    double above = 1;       // and of it what nodes above it make
    bool discrete = false;  // channelInterpretation of what leads in
    SoundTimes times;       // outside of them what leads in comes out as it is
    Biquad::Type filter = Biquad::Type::lowpass;
    double frequency = 350, quality = 1, filterGainDb = 0;  // biquad: Hz, detuned already
    double delay = 0;                                       // s
    Array<float> buffer;                                    // convolver: mono, at the rate of what is heard
    bool normalize = false;
    Compressor::Settings compressor;
    std::vector<float> curve;    // shaper
    unsigned oversample = 1;     // shaper: 1, 2 or 4 times the rate
    int selection = 0;           // selector
    std::size_t fftSize = 2048;  // analyser: a power of two
    double smoothing = .8;
    std::shared_ptr<const SoundNode> placed;  // panner: where it is and how loud, without what leads into it
    std::vector<SoundVoice> voices;
    std::vector<std::shared_ptr<const AudioProcess>> inputs;
};

/// The spectrum that an Analyser finds in its input, all channels mixed to one.
struct AudioSpectrum {
    NodeId node;
    std::vector<double> decibels;  // of fftSize / 2 bins, see SpectrumAnalyser
};
/// By how much a DynamicsCompressor makes its loudest sound softer at present.
struct AudioReduction {
    NodeId node;
    double decibels = 0;  // at most 0; what makes up for it is not counted
};
/// The findings of nodes of the audio graph in the sound that goes through them, one a node.
struct AudioFindings {
    std::vector<AudioSpectrum> spectra;
    std::vector<AudioReduction> reductions;
};

/// A Sound, a SpatialSound, or a destination of an audio graph.
struct SoundNode {
    /// none: as loud everywhere, of an AudioDestination.
    enum class Law : std::uint8_t { ellipsoids, linear, inverse, exponential, none };
    NodeId node;
    std::string name;  // DEF; without one the type and a number
    bool enabled = true, spatialize = true, doppler = true;
    bool head = false;      // enableHRTF: through a head, where there are two channels
    bool reflected = true;  // heard by way of walls too
    bool discrete = false;  // channelInterpretation of a destination
    int maxChannels = 2;    // that a destination has, at least 1
    /// The names of its stream, for a StreamAudioDestination, which nobody in the scene hears.
    std::optional<std::vector<std::string>> stream;
    double intensity = 1;  // with gain
    glm::dvec3 location{0}, direction{0, 0, 1};
    Law law = Law::ellipsoids;
    double minBack = 1, minFront = 1, maxBack = 10, maxFront = 10;   // ellipsoids
    double referenceDistance = 1, maxDistance = 10000, rolloff = 1;  // the others
    double coneInner = 6.2832, coneOuter = 6.2832, coneOuterGain = 0;
    std::vector<SoundVoice> voices;
    std::vector<std::shared_ptr<const AudioProcess>> processes;

    /// Amplitude at a place in the node's frame, intensity not included. Ellipsoids: 1 in the inner, falling linearly
    /// in decibels to -20 dB at the outer, silent beyond; location is one focus of both.
    double level(const glm::dvec3& listener) const;
    /// Amplitude factor of the cones towards a place.
    double coneGain(const glm::dvec3& listener) const;
    /// Whether anything leads into it.
    bool plays() const { return !voices.empty() || !processes.empty(); }
    /// Whether it sends more to one side than to another, by its cones or, if `levels` count, by its ellipsoids.
    bool directional(bool levels) const;
};

struct SoundEmitter {
    InstanceId id;
    std::shared_ptr<const SoundNode> sound;  // never null
    WorldFromLocal worldFromLocal{1.0};
    std::string name;  // the node's, numbered if it is placed more than once

    /// In the world; out of all hearing when it is not a number.
    glm::dvec3 position() const;
    /// The unit direction in which it points in the world; 0 if it points nowhere.
    glm::dvec3 aim() const;
    /// The place in the node's frame that lies by this from the emitter in the world; as it is if the frame is
    /// singular.
    glm::dvec3 localFrom(const glm::dvec3& offset) const;
};

struct ListenerPose {
    glm::dvec3 position{0, 0, 10};
    glm::dvec3 right{1, 0, 0}, up{0, 1, 0}, back{0, 0, 1};  // orthonormal
    double gain = 1;
    bool doppler = false;    // of all that it hears; else as each source says
    double earDistance = 0;  // metres between its ears; 0: not said
    double headRadius() const { return earDistance > 0 ? earDistance / 2 : kHeadRadius; }
    /// A world direction in the listener's frame.
    glm::dvec3 toLocal(const glm::dvec3& world) const {
        return {glm::dot(world, right), glm::dot(world, up), glm::dot(world, back)};
    }
};

/// A place to listen at.
struct ListeningPlace {
    std::string name;
    glm::dvec3 position{0};
    /// Right, up, back; nothing: those of the scene's listener.
    std::optional<glm::dmat3> axes = std::nullopt;
    double headRadius = kHeadRadius;  // where there are axes; else that of the scene's listener
};

/// Who sounds and who listens, as a version that does not change.
struct SoundVersion {
    std::shared_ptr<const std::vector<SoundEmitter>> emitters;  // in the order of their slots; never null
    ListenerPose listener;
    AirChoice air;  // of the scene's metadata

    /// Null when there is none of this name.
    const SoundEmitter* find(InstanceId id) const;
};

class SoundScene {
  public:
    /// Materials go to `walls` when there are any; they must outlive this. `resources`: where urls of clips start.
    /// `keepsStreams`: somebody takes what StreamAudioDestinations get. `materials`: of this table is what it has the
    /// name of, whatever fields say: the first of a shape's AcousticProperties, Appearance and Material that has one in
    /// it, by a MetadataString "acousticMaterial" in its metadata or else by its DEF.
    explicit SoundScene(Walls* walls = nullptr, const AcousticMaterial& defaults = {}, Resources resources = {},
                        bool keepsStreams = false, std::shared_ptr<const MaterialTable> materials = nullptr);

    void apply(const Scene& scene, const ChangeSet& changes, const InstanceDelta& delta);

    const std::vector<SoundEmitter>& emitters() const { return *emitters_; }
    const SoundNode& sound(const SoundEmitter& emitter) const { return *emitter.sound; }
    glm::dvec3 position(const SoundEmitter& emitter) const { return emitter.position(); }
    /// The first enabled ListenerPointSource, else the bound viewpoint, else X3D's default of 0 0 10. Where its place
    /// or its turn is no finite one the last that was counts, which is told once.
    const ListenerPose& listener() const { return listener_; }
    /// The places where one may listen: every enabled ListenerPointSource that does not follow the view, or if there is
    /// none every viewpoint, or else the place of listener().
    const std::vector<ListeningPlace>& places() const { return places_; }
    /// Nodes that are there but cannot be heard, and why; each once.
    const Diagnostics& diagnostics() const { return diagnostics_; }
    /// Which node says what a shape is made of.
    NodeId materialNode(const Scene& scene, const Instance& instance) const;
    /// The names of the table that nothing in the scene has had so far, in the table's order.
    std::vector<std::string> unusedMaterials() const;
    /// The present version. The next change copies the emitters once.
    SoundVersion freeze();

  private:
    std::shared_ptr<const SoundNode> readSound(const Scene& scene, const Node& node);
    /// The name by which the table has a node, if it does.
    std::string_view materialName(const Scene& scene, NodeId id) const;
    void readMaterial(const Scene& scene, NodeId id);
    void readWalls(const Scene& scene, const ChangeSet& changes, const InstanceDelta& delta);
    bool placeEmitters(const Scene& scene, const InstanceDelta& delta);
    void nameEmitters();
    std::vector<SoundEmitter>& ownEmitters();
    /// The lists to which a branch of an audio graph adds.
    struct Branch {
        std::vector<SoundVoice>& voices;
        std::vector<std::shared_ptr<const AudioProcess>>& processes;
        const std::string& sound;                           // its name
        std::shared_ptr<const AudioProcess> fed = nullptr;  // what the node on top gets besides its children
    };
    void readVoices(const Scene& scene, NodeId id, double gain, int depth, Branch to);
    /// The numbers in its fields; those that are not finite are told.
    FieldNumbers numbersIn(const Scene& scene, const Node& node);
    /// Whether it is one that a sound may have; else it is told.
    bool tellPitch(const Scene& scene, const Node& node, double pitch);
    bool readSource(const Scene& scene, const Node& node, double gain, Branch to);
    bool readProcess(const Scene& scene, const Node& node, double gain, int depth, Branch to);
    void readMerged(const Scene& scene, NodeId id, int depth, AudioProcess& merger, Branch to);
    bool readPanner(const Scene& scene, const Node& node, double gain, int depth, Branch to);
    bool readOutputs(const Scene& scene, const Node& splitter, int depth, AudioProcess& process, Branch to);
    std::vector<std::filesystem::path> foldersOf(const Scene& scene, const Node& node) const;
    void chooseListener(const Scene& scene);
    ListenerPose poseOf(const Scene& scene, const Placed& placed);
    void findPlaces(const Scene& scene);
    double earDistance(const Scene& scene, const Node& node);
    void readAir(const Scene& scene, const ChangeSet& changes);
    void nameSilent(const Scene& scene, const ChangeSet& changes);
    void warnOnce(const NodePlace& place, std::string text);

    Walls* walls_;
    AcousticMaterial defaults_;
    Resources resources_;
    bool keepsStreams_;
    std::shared_ptr<const MaterialTable> materials_;
    std::unordered_set<std::string> usedMaterials_;
    int visits_ = 0;  // of readVoices, for the sound being read
    std::unordered_map<std::uint32_t, std::shared_ptr<const SoundNode>> sounds_;  // by NodeId
    std::unordered_map<std::uint32_t, Placed> others_;                            // listeners and views, by slot
    std::unordered_map<std::uint32_t, ListenerPose> poses_;                       // of them, as far as they were finite
    std::unordered_set<std::uint32_t> acousticsKnown_;                            // by NodeId
    std::shared_ptr<std::vector<SoundEmitter>> emitters_ = std::make_shared<std::vector<SoundEmitter>>();
    bool shared_ = false;  // emitters_ belong to a version too
    ListenerPose listener_;
    std::vector<ListeningPlace> places_;
    AirChoice air_;
    std::unordered_set<std::uint32_t> infos_;  // WorldInfo nodes, by NodeId
    Diagnostics diagnostics_;
    std::unordered_set<std::string> told_;
};

}  // namespace rtsg
