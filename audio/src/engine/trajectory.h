// Trajectory: a smooth position over time from positions that are known once a frame.
//
// Between the ends of blocks it is cubic, with velocities from the frames. Beyond the last frame it continues straight,
// because a block may be longer than the frame. Motion that is even apart from the rounding of positions to single
// precision is taken as a straight line, so that the rounding is not heard.
// Threading: the engine's thread.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>

#include <glm/glm.hpp>

#include "ring.h"

namespace rtsg {

class Trajectory {
  public:
    struct Point {
        double time = 0;  // samples
        glm::dvec3 position{0};
        glm::dvec3 velocity{0};  // metres a sample
    };

    /// `block`: samples from one advance() to the next.
    explicit Trajectory(std::size_t block) : spacing_(static_cast<double>(block) / 8) {}

    /// Notes where the scene puts it at `time`, which is not before the last. A jump forgets the way there.
    void put(double time, const glm::dvec3& position, bool jump) {
        if (jump) {
            const double since = knots_.empty() ? time : knots_.back().time;
            frames_.clear();
            even_ = false;
            knots_.clear();
            knots_.push_back({since, position, glm::dvec3(0)});
        }
        if (!frames_.empty() && time <= frames_.back().time) {
            frames_.back().position = position;
            return;
        }
        // If frames are much shorter than blocks, only some are kept, besides the last.
        const std::size_t count = frames_.size();
        if (count > 1 && frames_[count - 1].time - frames_[count - 2].time < spacing_) frames_.pop_back();
        frames_.push_back({time, position, velocityAt(time, position)});
        if (frames_.size() > kFrames) frames_.dropFirst();
        fitLine();
    }
    /// Goes on to `time`, the end of a block. Precondition: put() was called.
    void advance(double time) {
        Point target = known(time);
        target.time = time;
        // Before the new one comes: a ring that is full would take twice the memory.
        if (knots_.size() == kMax) knots_.dropFirst();
        knots_.push_back(target);
    }
    /// At a time up to the last that advance() went to; before the first, where it was first.
    Point at(double time) const {
        // Written so that a time that is not finite gives the oldest.
        if (!(time > knots_.front().time)) return {time, knots_.front().position, glm::dvec3(0)};
        if (time >= knots_.back().time) return knots_.back();
        // From the newest backwards, because old positions are seldom asked for, and are no longer in the cache.
        std::size_t next = knots_.size() - 1, step = 1;
        for (; next > step && time < knots_[next - step].time; step *= 2) next -= step;
        std::size_t before = next > step ? next - step : 0;
        while (next - before > 1) {
            const std::size_t middle = before + (next - before) / 2;
            (time < knots_[middle].time ? next : before) = middle;
        }
        return between(knots_[before], knots_[next], time);
    }

  private:
    /// Farther back than sound from the horizon takes, with blocks of a usual size.
    static constexpr std::size_t kMax = 16384;

    static Point between(const Point& a, const Point& b, double time) {
        const double h = b.time - a.time, u = (time - a.time) / h;
        const glm::dvec3 displacement = b.position - a.position, from = a.velocity * h, to = b.velocity * h;
        const glm::dvec3 second = 3.0 * displacement - 2.0 * from - to, third = from + to - 2.0 * displacement;
        return {time, a.position + u * (from + u * (second + u * third)),
                (from + u * (2.0 * second + 3.0 * u * third)) / h};
    }
    /// The slope at the end of the parabola through the last two frames and this; less of a bend where it starts or
    /// stops.
    glm::dvec3 velocityAt(double time, const glm::dvec3& position) const {
        if (frames_.empty()) return glm::dvec3(0);
        const Point& last = frames_.back();
        const double step = time - last.time;
        const glm::dvec3 now = (position - last.position) / step;
        if (frames_.size() < 2) return now;
        const Point& first = frames_[frames_.size() - 2];
        const glm::dvec3 before = (last.position - first.position) / (last.time - first.time);
        const glm::dvec3 bend = (now - before) * (step / (time - first.time));
        const double maximum = 0.5 * std::min(glm::length(now), glm::length(before)), size = glm::length(bend);
        return size > maximum ? now + bend * (maximum / size) : now + bend;
    }
    /// The line of least squares through the frames, if they lie on one but for rounding.
    void fitLine() {
        even_ = false;
        if (frames_.size() < 3) return;
        const double count = static_cast<double>(frames_.size()), origin = frames_.back().time;
        double st = 0, stt = 0, size = 0;
        glm::dvec3 sp(0), stp(0);
        for (std::size_t k = 0; k < frames_.size(); ++k) {
            const Point& p = frames_[k];
            const double t = p.time - origin;
            st += t, stt += t * t, sp += p.position, stp += t * p.position;
            for (int i = 0; i < 3; ++i) size = std::max(size, std::abs(p.position[i]));
        }
        const double determinant = count * stt - st * st;
        line_.time = origin;
        line_.velocity = (count * stp - st * sp) / determinant;
        line_.position = (sp - st * line_.velocity) / count;
        const double rounding = 0x1p-21 * size;
        even_ = true;
        for (std::size_t k = 0; k < frames_.size(); ++k)
            even_ = even_ && glm::distance(onLine(frames_[k].time).position, frames_[k].position) <= rounding;
    }
    Point onLine(double time) const {
        return {time, line_.position + line_.velocity * (time - line_.time), line_.velocity};
    }
    Point known(double time) const {
        if (even_) return onLine(time);
        const Point& last = frames_.back();
        if (time >= last.time || frames_.size() == 1)
            return {time, last.position + last.velocity * (time - last.time), last.velocity};
        const Point& before = frames_[frames_.size() - 2];
        return time > before.time ? between(before, last, time) : before;
    }

    static constexpr std::size_t kFrames = 16;

    double spacing_;
    Ring<Point> frames_;  // the last ones
    Point line_;
    bool even_ = false;
    Ring<Point> knots_;  // ends of blocks
};

}  // namespace rtsg
