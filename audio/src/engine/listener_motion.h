// ListenerMotion: the position and orientation of the listener over time, smoothed as in Trajectory.
// Threading: the engine's thread.
#pragma once

#include <cstddef>

#include <glm/glm.hpp>

#include <rtsg/audio/sound_scene.h>

#include "trajectory.h"

namespace rtsg {

class ListenerMotion {
  public:
    explicit ListenerMotion(std::size_t block) : position_(block), right_(block), back_(block) {}

    /// See Trajectory::put(). A turn by more than 60 degrees at once is a jump of the turn alone.
    void put(double time, const ListenerPose& pose, bool jump) {
        constexpr double kFullTurn = 0.5;
        const bool rotations =
            jump || !(glm::dot(last_.right, pose.right) > kFullTurn && glm::dot(last_.back, pose.back) > kFullTurn);
        position_.put(time, pose.position, jump);
        right_.put(time, pose.right, rotations);
        back_.put(time, pose.back, rotations);
        last_ = pose;
    }
    void advance(double time) {
        position_.advance(time);
        right_.advance(time);
        back_.advance(time);
    }
    Trajectory::Point positionAt(double time) const { return position_.at(time); }
    /// All but the place and the axes is that of the last one.
    ListenerPose at(double time) const {
        ListenerPose pose = last_;
        pose.position = positionAt(time).position;
        const glm::dvec3 right = right_.at(time).position, back = back_.at(time).position;
        const glm::dvec3 up = glm::cross(back, right);
        // Between two turns that are far apart there may be none.
        if (!(glm::length(right) > 0.1 && glm::length(up) > 0.1)) return pose;
        pose.right = glm::normalize(right);
        pose.up = glm::normalize(up);
        pose.back = glm::cross(pose.right, pose.up);
        return pose;
    }

  private:
    Trajectory position_, right_, back_;
    ListenerPose last_;
};

}  // namespace rtsg
