// The inside of AcousticEngine: its state between calls, and the steps of a block.
//
// Threading: the engine's thread.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include <rtsg/audio/clip_library.h>

#include "acoustic_engine.h"
#include "emitter_state.h"
#include "head_maker.h"
#include "listener_motion.h"
#include "signal/ambisonics.h"
#include "trace_worker.h"

namespace rtsg {

/// Nothing is heard from farther away; metres.
constexpr double kHorizon = 20'000;

struct AcousticEngine::Impl {
    explicit Impl(const AcousticOptions& o)
        : options(o),
          channels(static_cast<std::size_t>(o.ambisonicOrder > 0 ? ambisonicChannels(o.ambisonicOrder) : 2)),
          air(o.air.over(o.trace.air)),
          longest(o.trace.maxSeconds * air.speedOfSound),
          geometry({.edges = !o.background}),  // the worker has its own
          clips(o.sampleRate, o.resources, o.given),
          listenerMotion(o.blockSize),
          renderedUntil(o.startTime),
          posedAt(o.startTime),
          samples(std::llround(o.startTime * o.sampleRate)),
          firstSample(samples) {
        if (options.binaural) runAhead();
        // So that live sound finds a head whenever it needs one.
        if (options.background) makeHead(now);
    }

    /// The state of one block while it is made.
    struct Block {
        ListenerPose listener;       // at the end
        std::vector<double> delays;  // by sample
        AudioChannels out;           // everything except the sound that goes through the head
        AudioChannels ears;          // what went through the head
        // The levels of the emitter that is being rendered, at the ends of the block before and of this one.
        HeardLevel before, after;
        bool crossfade = false;  // from one delay to the other
        /// The place from which the emitter is heard until sample `end`, in the listener's frame.
        struct HeadRotation {
            std::size_t end = 0;
            glm::dvec3 offset{0};  // metres
        };
        std::vector<HeadRotation> rotations;
        // Room for steps of it.
        std::vector<double> gains;  // by channel
        std::vector<float> part;    // of the emitter, by sample
        std::vector<std::uint32_t> bodies, open;
    };
    /// The factor of sound that comes or goes in a block.
    struct Ramp {
        double from = 1, to = 1;
    };

    /// Samples by which blocks run ahead of the sound.
    std::size_t latency() const { return lateRing.size() / channels; }
    void runAhead();
    void runAheadFor(const SoundVersion& sounds);
    void findHead(const ListenerPose& listener);
    void makeHead(const ListenerPose& listener);
    bool hearsAs(const ListenerPose& listener) const;
    HeardBy heardBy(const SoundNode& sound) const;

    void follow(const AcousticState& state, const RayView& rays);
    /// Everything except the sound: the positions at `poseSeconds`.
    void followState(const AcousticState& state, const RayView& rays, double poseSeconds);
    /// From here on `sounds` is played, with all its changes.
    void takeOver(const SoundVersion& sounds, double poseSeconds);
    void goBack(double seconds);
    Result<> renderTo(const SoundVersion& sounds, double untilSeconds, SoundBuffer& sound);
    void followEmitters(const SoundVersion& sounds, double poseSeconds);
    void followListener(const ListenerPose& listener, double poseSeconds);
    void followAir(const SoundVersion& sounds);
    std::vector<std::uint32_t> bodyOf(std::vector<std::uint32_t> around, const glm::dvec3& listener) const;
    void leaveOutRooms(std::vector<std::uint32_t>& around, const glm::dvec3& listener) const;
    EmitterState& stateOf(const SoundEmitter& emitter, double time);

    void block();
    void renderEmitter(const SoundEmitter& emitter, EmitterState& state, Block& block);
    void play(const SoundEmitter& emitter, EmitterState& state, const Block& block);
    void streamOut(const SoundEmitter& emitter, EmitterState& state, const Block& block);
    void endStreams();
    void makeInputs(EmitterState& state, std::size_t count) const;
    /// Finds the delay of the source, or of an image of it.
    void findDelay(const Trajectory& motion, const FollowedImage* image, double time, double& delay,
                   double& slope) const;
    void delaysOf(const EmitterState& state, HeardLevel& to, Block& block) const;
    glm::dvec3 apparentPosition(const EmitterState& state, double delay) const;
    void findBodyAt(const EmitterState& state, const glm::dvec3& apparent, const ListenerPose& listener,
                    std::vector<std::uint32_t>& body) const;
    double straightFraction(std::vector<std::uint32_t>& open, const glm::dvec3& apparent,
                            const glm::dvec3& listener) const;
    double fractionOfAll(EmitterState& state, const glm::dvec3& apparent, Block& block) const;
    void measurePath(const SoundNode& sound, EmitterState& state, const glm::dvec3& apparent, Block& block) const;
    void levelOf(const SoundEmitter& emitter, const EmitterState& state, const glm::dvec3& apparent, const Block& block,
                 HeardLevel& to, bool& audible) const;
    void renderDirect(EmitterState& state, const HeardLevel& to, bool crossfade, Block& block);
    void findHeadRotations(const EmitterState& state, const glm::dvec3& apparent, bool even, Block& block) const;
    void spatialise(const SoundNode& sound, EmitterState& state, Block& block);
    void readDirect(const DelayLine& line, const Block& block, std::vector<float>& out) const;
    void gainsOf(const glm::dvec3& towards, bool spatialize, std::size_t input, std::size_t inputs,
                 std::vector<double>& gains) const;
    void hear(EmitterState& state, std::size_t input, HeardBy by, bool spatialize, const Ramp& ramp, Block& block);
    void ringOut(EmitterInput& input, Block& block) const;
    void mixInput(const EmitterInput& input, const std::vector<double>& gains, std::size_t channel,
                  std::span<const float> direct, std::span<float> out) const;
    void hearGone(EmitterState& state, Block& block);
    void renderLate(EmitterState& state, const SoundEmitter* emitter, const HeardLevel& to, bool jumped, Block& block);
    void noteSilence(EmitterState& state) const;
    void noteWaiting(EmitterState& state, bool audible) const;
    void countWaiting();
    void noteUnheard(const SoundEmitter& emitter, double distance, bool inReach, const ListenerPose& listener);
    void fadeOut(Block& block);
    void mixDown(const Block& block);
    void begin(Block& block, const ListenerPose& listener) const;

    /// The work that a response needs: none; making it again, as the listener's head has turned or something begins to
    /// move; or tracing it again.
    enum class Renewal : std::uint8_t { none, rotation, setOff, trace };
    Renewal renewalOf(const SoundEmitter& emitter, const EmitterState& state, const glm::dvec3& source,
                      const ListenerPose& listener) const;
    void reuse(EmitterState& state, const SoundEmitter& emitter, const ListenerPose& listener, Renewal why);
    bool setsOff(const SoundEmitter& emitter, const EmitterState& state, const glm::dvec3& source,
                 const ListenerPose& listener) const;
    void renew(const SoundEmitter& emitter, EmitterState& state);
    void renewLongestDue();
    ImpulseResponseOptions responseFor(const SoundEmitter* emitter, HeardBy by, const ListenerPose& listener) const;
    void submit(EmitterState& state, TraceJob job, const ListenerPose& listener);
    void trace(EmitterState& state, const SoundEmitter& emitter, const glm::dvec3& source,
               const ListenerPose& listener);
    std::size_t followedOf(const EmitterState& state, std::size_t maximum) const;
    bool isFollowed(const SoundEmitter& emitter, const EmitterState& state, const glm::dvec3& source,
                    const ListenerPose& listener, double minimum) const;
    void takeResponse(TracedResponse traced);
    void noteSeal(const SoundEmitter& emitter, const glm::dvec3& source, const glm::dvec3& listener, double seconds,
                  Seal seal);
    void endSeal(InstanceId emitter, double seconds);
    double seconds() const { return static_cast<double>(samples) / options.sampleRate; }
    void noteWallsChanged(EmitterState& state) const;
    void noteMoved(const WorldGeometry::Changes& changes, const glm::dvec3& motion, EmitterState& emitter) const;
    void noteLeaks(const SoundEmitter& emitter, const RoomOpenings& openings);

    AcousticOptions options;
    std::size_t channels;
    Air air;         // of the state being rendered
    double longest;  // metres that sound goes within a response
    WorldGeometry geometry;
    std::shared_ptr<const Hrtf> head;      // of the listener: the user's, or a sphere
    HeadMaker::Size headSize;              // of that, if it is one
    std::unique_ptr<HeadMaker> headMaker;  // of sound that does not wait, once there was another
    HeadMaker::Size headAsked;
    ClipLibrary clips;
    std::map<InstanceId, EmitterState> states;
    ListenerPose before, now;  // at the ends of the frame being rendered
    ListenerMotion listenerMotion;
    bool posed = false, listenerJumps = false;
    SoundVersion playing;  // the sound that is heard; changes of the next version are heard from its time on
    double renderedUntil;
    double posedAt = 0;           // the scene time of the last poses
    std::int64_t samples;         // consumed from the voices
    std::int64_t firstSample;     // what `samples` began with, less what time went back by
    std::vector<float> lateRing;  // interleaved; delays all else by as much as heads may be early
    std::size_t lateAt = 0;       // the oldest in it
    Block work;                   // is kept from block to block
    std::size_t toSkip = 0;       // of the latency, still to be dropped
    std::vector<float> ready;     // interleaved, rendered but not yet asked for
    HeardResponses heard;
    std::vector<StreamedSound> streams;
    std::vector<SealedSource> sealed;
    std::map<InstanceId, UnheardSource> unheard;  // until any sound was in its reach
    bool anyInReach = false, anyHeard = false;
    /// For each source that is sealed: whether it is the one inside, and its index in `sealed`.
    std::map<InstanceId, std::pair<bool, std::size_t>> reportedSealed;
    std::vector<SoundLeak> leaks;
    int leakSearches = 0;
    // The members below are for live sound.
    std::shared_ptr<const AcousticState> liveState;
    std::shared_ptr<const RayView> liveRays;
    std::unique_ptr<TraceWorker> worker;
    double load = 0;  // share of the time that live sound takes, of late
    /// The response that the worker is to make after this block.
    struct {
        const SoundEmitter* emitter = nullptr;
        EmitterState* state = nullptr;
        Renewal renewal = Renewal::none;
    } due;
};

}  // namespace rtsg
