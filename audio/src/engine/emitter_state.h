// What an engine remembers of one emitter from block to block.
//
// Threading: the engine's thread.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <vector>

#include <rtsg/audio/acoustic_box.h>
#include <rtsg/audio/clip_library.h>
#include <rtsg/audio/convolver.h>

#include "signal/delay_line.h"

namespace rtsg {

/// Positions over time, one a block, for looking up where a source was when it sent what is heard now.
class Track {
  public:
    void add(const glm::dvec3& position) {
        positions_.push_back(position);
        if (positions_.size() > 8192) {
            positions_.pop_front();
            ++first_;
        }
    }
    /// `block` may lie between two.
    glm::dvec3 at(double block) const {
        const double newestIndex = static_cast<double>(positions_.size() - 1);
        // Written so that what is no number gives the oldest.
        const double wanted = block - static_cast<double>(first_);
        const double index = wanted > 0 ? std::min(wanted, newestIndex) : 0;
        const auto low = static_cast<std::size_t>(index);
        const std::size_t high = std::min(low + 1, positions_.size() - 1);
        return glm::mix(positions_[low], positions_[high], index - static_cast<double>(low));
    }
    double newest() const { return static_cast<double>(first_ + positions_.size() - 1); }

  private:
    std::deque<glm::dvec3> positions_;
    std::size_t first_ = 0;
};

/// How much of an emitter reaches the listener, and when.
struct HeardLevel {
    double delay = 0;  // samples
    double directGain = 0, lateGain = 0;
};

struct EmitterState {
    EmitterState(std::size_t block, std::size_t channels) : gains(channels) {
        for (std::size_t c = 0; c < channels; ++c) late.emplace_back(block);
    }

    std::size_t mixerSource = 0;
    std::map<std::uint32_t, VoicePlayer> players;  // by voice node
    DelayLine line;
    Track track;
    std::vector<Convolver> late;      // by channel
    std::vector<double> gains;        // ambisonic, of direct sound at the end of the last block
    glm::dvec3 from{0}, to{0};        // this frame's way
    std::vector<std::uint32_t> body;  // slots of the shapes that it is in
    HeardLevel level;                 // at the end of the last block
    bool started = false;
    // Of the response in use.
    bool hasResponse = false;
    double tracedAt = 0;
    glm::dvec3 tracedSource{0}, tracedListener{0}, tracedRight{0}, tracedBack{0};
    AcousticBox reached;  // by its paths
    bool stale = false;   // something changed there since
    std::size_t responseFrames = 0;
    /// Gone from the scene; what it sent is still on its way for this many samples.
    bool gone = false;
    std::size_t fading = 0;
};

}  // namespace rtsg
