// EmitterState: the data that an engine keeps of one emitter from block to block.
//
// Threading: the engine's thread.
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include <rtsg/audio/acoustic_geometry.h>
#include <rtsg/audio/clip_library.h>
#include <rtsg/audio/echogram.h>

#include "geometry/world_geometry.h"
#include "image_player.h"
#include "moved_walls.h"
#include "scene/process_player.h"
#include "signal/convolver.h"
#include "signal/delay_line.h"
#include "signal/head_filter.h"
#include "signal/panning.h"
#include "trace_worker.h"
#include "trajectory.h"

namespace rtsg {

/// How sound from a direction is converted to two ears or other channels.
enum class HeardBy : std::uint8_t { gains, head };

/// How much of an emitter reaches the listener, and when.
struct HeardLevel {
    double delay = 0;  // samples
    double slope = 0;  // of the delay, samples a sample
    double directGain = 0, lateGain = 0;
    bool heard = false;  // straight
};

/// One channel of an emitter's sound, on its way to the listener.
struct EmitterInput {
    DelayLine line;
    std::vector<double> gains;  // by channel of the output, at the end of the last block
    HeadFilter head;
    std::size_t ringing = 0;  // samples in which that is still heard of what came through it before
};

struct EmitterState {
    /// `turn`: of its reflections, as Convolver has it.
    EmitterState(std::size_t block, std::size_t channels, std::size_t fade, std::size_t round)
        : motion(block), images(block, fade) {
        late.emplace_back(block, fade, round);
        for (std::size_t c = 1; c < channels; ++c) late.push_back(late.front().beside());
    }

    AudioMix mix;
    std::vector<EmitterInput> inputs;
    // The samples of a block, by input: as they are played, and as they come straight.
    AudioChannels dry, direct;
    AudioChannels lead;       // the sound of a destination of one channel
    AudioChannels reflected;  // the reflected sound: of all channels, or left and right
    Trajectory motion;
    std::vector<Convolver> late;        // by channel
    ImagePlayer images;                 // those that `late` leaves out
    glm::dvec3 to{0};                   // where it is at the end of this frame
    std::vector<std::uint32_t> around;  // slots of the shapes that may be its body
    std::vector<std::uint32_t> body;    // of those, the ones that the listener is not in
    HeardLevel level;                   // at the end of the last block
    bool started = false;
    bool jumps = false;     // will be put somewhere else when this frame ends
    bool jumped = false;    // moved by a jump: sound on its way is not followed
    bool held = false;      // kept its delay in the last block, as it is not to be shifted
    std::size_t quiet = 0;  // samples since something was played
    bool spatialisedOnce = false;
    HeardBy heardBy = HeardBy::gains;      // what came straight in the last block,
    HeardBy reflectedBy = HeardBy::gains;  // and by way of walls
    // The members below belong to the response in use.
    bool hasResponse = false;
    bool tracing = false;  // in the background: where its paths go is not known yet
    double tracedAt = -std::numeric_limits<double>::infinity();
    HeardBy tracedBy = HeardBy::gains;
    double tracedRadius = kHeadRadius;
    glm::dvec3 tracedSource{0}, tracedListener{0}, tracedRight{0}, tracedBack{0}, tracedAim{0};
    std::shared_ptr<const Echogram> traced;  // for when the listener turns
    KeptEnergy kept;                         // and for the next trace
    std::uint64_t traces = 0;
    std::optional<double> waitsSince;  // scene time from which on it was heard without reflections, as none were traced
    ImagePlayer::Images tracedImages;  // that the response leaves out
    bool moves = false;                // it, or the listener, since it was traced before
    AcousticBox reached;               // by its paths
    bool stale = false;                // something changed there since,
    bool staleSoon = false;            // and near source or listener, for its size
    std::size_t responseFrames = 0;
    std::optional<Seal> seal;              // nothing arrived, and why; until it was told
    RoomOpenings openings;                 // of the room, until they were told
    MovedWalls movedWalls;                 // in the direct path, since the sound that is heard was traced
    std::vector<std::uint32_t> alongside;  // slots of walls near that way that go along with it
    bool leaksSought = false;
    /// Gone from the scene; its sound is still on its way for this many samples.
    bool gone = false;
    std::size_t fading = 0;
};

}  // namespace rtsg
