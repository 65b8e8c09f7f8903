// MovedWalls: the walls in the direct path of an emitter that have moved since the response in use was traced.
//
// A wall that moves into this path takes direct sound away and adds diffracted sound. Both must change together, or a
// gap is heard; but diffracted sound is known only after the next trace. So moved walls keep the share of direct sound
// that they left when the response was traced, and fade with the response (StraightPath). Walls at rest count in every
// block, because edges at rest are followed in every block. Threading: the engine's thread.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "image_player.h"

namespace rtsg {

/// Whether two shares of energy differ audibly.
inline bool isLate(double heard, double there) {
    return std::abs(heard - there) > 0.1;
}

class MovedWalls {
  public:
    /// More walls than this are not tested one by one: their effect counts at once.
    static constexpr std::size_t kMax = 64;

    void add(std::uint32_t slot, double seconds) {
        const auto found = std::ranges::find(slots_, slot);
        if (found != slots_.end()) {
            times_[static_cast<std::size_t>(found - slots_.begin())] = seconds;
        } else if (slots_.size() < kMax) {
            slots_.push_back(slot);
            times_.push_back(seconds);
            grown_ = true;
        }
    }
    bool any() const { return !slots_.empty(); }
    std::span<const std::uint32_t> slots() const { return slots_; }
    /// Whether there are more since the last call.
    bool takeGrown() { return std::exchange(grown_, false); }
    /// Removes walls that have rested since the trace at that time; tells whether there were any.
    bool settle(double since) {
        std::size_t left = 0;
        for (std::size_t i = 0; i < slots_.size(); ++i) {
            if (times_[i] <= since) continue;
            slots_[left] = slots_[i];
            times_[left++] = times_[i];
        }
        const bool less = left < slots_.size();
        slots_.resize(left);
        times_.resize(left);
        return less;
    }
    void clear() {
        slots_.clear();
        times_.clear();
        grown_ = false;
    }

    /// Shares of energy left on the direct path at the end of the last block: by all walls, by walls at rest, and in
    /// the sound that is heard.
    double all = 0, resting = 0, heard = 0;
    /// The straight way of the last trace, and of the one that was asked for since.
    StraightPath traced, asked;
    /// Since when the sound that is heard differs from the present state, seconds.
    double lateSince = 0;

    /// Whether the requested response will differ audibly from the present state.
    bool outdated() const { return any() && isLate(resting * asked.open * asked.open, all); }
    /// The amplitude that moved walls leave, relative to that of the others.
    double open() const { return resting > 0 ? std::sqrt(std::min(1.0, all / resting)) : 1; }

  private:
    std::vector<std::uint32_t> slots_;
    std::vector<double> times_;  // when each moved, seconds
    bool grown_ = false;
};

}  // namespace rtsg
