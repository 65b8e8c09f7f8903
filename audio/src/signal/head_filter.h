// HeadFilter: renders one sound for both ears through a head, from a direction that may change.
//
// The arrival time at an ear changes smoothly with the direction, by a delay line that follows the sphere model. The
// rest of the response changes slowly with the direction and is interpolated from block to block. After its first sound
// it allocates nothing. Threading: the engine's thread.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

#include <glm/glm.hpp>

#include <rtsg/audio/hrtf.h>

#include "convolver.h"
#include "delay_line.h"

namespace rtsg {

class HeadFilter {
  public:
    /// The direction that the next blocks come from: a unit vector in the listener's frame. Once a block at most.
    void setDirection(const Hrtf& hrtf, const glm::dvec3& towards, std::size_t block) {
        constexpr double kFullTurn = 1e-5;  // radians
        if (heard_ && &hrtf == head_ && glm::distance(towards, from_) < kFullTurn) return;
        if (ears_.empty()) {
            ears_.resize(2);
            for (Ear& ear : ears_) {
                ear.filter = Convolver(block, block);
                ear.filter.fadeEvenly();
            }
        }
        std::array<double, 2> earlier{};
        for (int e = 0; e < 2; ++e) {
            Ear& ear = ears_[static_cast<std::size_t>(e)];
            earlier[static_cast<std::size_t>(e)] = hrtf.smoothDelay(towards, e);
            ear.goTo(earlier[static_cast<std::size_t>(e)], heard_);
        }
        hrtf.at(towards, responses_, earlier);
        for (std::size_t e = 0; e < 2; ++e) ears_[e].filter.setResponse(responses_[e]);
        from_ = towards;
        head_ = &hrtf;
        heard_ = true;
    }
    const glm::dvec3& direction() const { return from_; }
    /// Number of samples for which its output continues after its input ends. Precondition as of process().
    std::size_t rings() const {
        return responses_[0].size() + static_cast<std::size_t>(std::max(ears_[0].to, ears_[1].to)) + SincTable::kHalf;
    }
    /// Adds to `output` what ear 0 (left) or 1 hears of a block. Precondition: setDirection() was called.
    void process(std::size_t ear, std::span<const float> input, std::span<float> output) {
        ears_[ear].process(input, output);
    }
    /// Forgets its input, and keeps its memory.
    void restart() {
        for (Ear& ear : ears_) {
            ear.filter.restart();
            ear.line.restart();
        }
        heard_ = false;
    }

  private:
    struct Ear {
        DelayLine line;
        Convolver filter;
        // Samples: at the ends of the last block and of the next, and the growth in a block there.
        double from = 0, to = 0, fromGrowth = 0, toGrowth = 0;
        double grew = 0;  // in the last block

        void goTo(double delay, bool goesOn) {
            // The slope at the end of the parabola through the last three.
            const double now = delay - to;
            to = delay;
            toGrowth = goesOn ? now + 0.5 * (now - grew) : 0;
            if (!goesOn) from = to, fromGrowth = 0, grew = 0;
        }

        void process(std::span<const float> input, std::span<float> output) {
            thread_local std::vector<double> delays;
            thread_local std::vector<float> read, before;
            const std::size_t count = input.size();
            line.write(input, static_cast<std::size_t>(std::max(from, to)) + 64);
            const std::size_t first = line.written() - count;
            delays.resize(count);
            read.resize(count);
            const double blockSize = static_cast<double>(count), distance = to - from;
            // If the direction jumps, one sound fades into the other, because a moving delay would change the pitch.
            const bool jumps = std::abs(distance) > 0.01 * blockSize;
            if (jumps) {
                std::ranges::fill(delays, from);
                before.resize(count);
                line.read(first, delays, before);
                std::ranges::fill(delays, to);
            } else {
                const double a = fromGrowth, b = toGrowth;
                for (std::size_t i = 0; i < count; ++i) {
                    const double u = static_cast<double>(i + 1) / blockSize;
                    delays[i] = from + u * (a + u * (3 * distance - 2 * a - b + u * (a + b - 2 * distance)));
                }
            }
            line.read(first, delays, read);
            for (std::size_t i = 0; jumps && i < count; ++i)
                read[i] = before[i] + (read[i] - before[i]) * static_cast<float>(i + 1) / static_cast<float>(count);
            from = to;
            grew = jumps ? 0 : distance;
            fromGrowth = jumps ? 0 : toGrowth;
            toGrowth = 0;
            filter.process(read, output);
        }
    };

    std::vector<Ear> ears_;
    Hrtf::Ears responses_;
    glm::dvec3 from_{0};
    const Hrtf* head_ = nullptr;  // of the last direction
    bool heard_ = false;
};

}  // namespace rtsg
