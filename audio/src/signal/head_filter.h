// HeadFilter: what both ears hear of one sound by a head of one's own, from a direction that may change.
//
// From another direction it fades over within the block. Once it has heard one it allocates nothing. Threading: the
// engine's thread.
#pragma once

#include <span>
#include <vector>

#include <glm/glm.hpp>

#include <rtsg/audio/convolver.h>
#include <rtsg/audio/hrtf.h>

namespace rtsg {

class HeadFilter {
  public:
    bool hasHeard() const { return heard_; }
    /// The direction that the next blocks come from: a unit vector in the listener's frame.
    void turn(const Hrtf& hrtf, const glm::dvec3& towards, std::size_t block) {
        constexpr double kTurn = 0.9999;  // cosine of .8 degrees
        if (heard_ && glm::dot(towards, from_) >= kTurn) return;
        while (ears_.size() < 2) ears_.emplace_back(block, block);
        hrtf.at(towards, responses_);
        for (std::size_t e = 0; e < 2; ++e) ears_[e].setResponse(responses_[e]);
        from_ = towards;
        heard_ = true;
    }
    const glm::dvec3& direction() const { return from_; }
    /// Adds to `output` what ear 0 (left) or 1 hears of a block. Precondition: turn() was called.
    void process(std::size_t ear, std::span<const float> input, std::span<float> output) {
        ears_[ear].process(input, output);
    }
    /// Forgets what it heard, and keeps its memory.
    void restart() {
        for (Convolver& ear : ears_) ear.restart();
        heard_ = false;
    }

  private:
    std::vector<Convolver> ears_;
    Hrtf::Ears responses_;
    glm::dvec3 from_{0};
    bool heard_ = false;
};

}  // namespace rtsg
