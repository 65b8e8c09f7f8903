// Motions: the instances that have moved between two states of a RayWorld; and MovedView: the world at an instant in
// between.
//
// Two places of an instance are known. It is taken to move evenly: its pivot (Instance::pivot) straight on, while it
// turns about that by the shorter way and stretches; so nothing shrinks that turns. Instances that were merged with
// resting ones, lines, points and volumes are where they are in the later state, and triangles have the shape of that
// state. Invariant: at 1 all is as in the later state, up to rounding. Threading: const once made; the later state must
// outlive both. Source: Shoemake & Duff 1992 (polar decomposition), Higham 1986 (its iteration).
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include <glm/gtc/quaternion.hpp>

#include <rtsg/renderers/ray_view.h>

#include "embree/moved_top.h"
#include "ray_view_impl.h"

namespace rtsg {

/// The way of one thing from a place to another.
class Course {
  public:
    /// `pivot`: in the local frame.
    Course(const WorldFromLocal& from, const WorldFromLocal& to, const Vec3d& pivot);
    WorldFromLocal at(double t) const;

  private:
    WorldFromLocal from_, to_;
    Vec3d pivot_, pivotFrom_, pivotTo_;
    bool rotates_ = false;  // else numbers change evenly: one of the two is flat, or it is turned inside out
    glm::dquat rotation_{1, 0, 0, 0};
    glm::dmat3 stretch_{1.0}, linearFrom_{1.0};
};

/// Whether an instance of the later state was there in the earlier one too.
bool wasThere(const RayView& before, const RayInstance& now);

class Motions {
  public:
    /// The cost depends on the changes between them; if something has moved, every instance is looked at.
    Motions(const RayView& before, const RayView& now);
    bool empty() const { return objects_.empty(); }
    /// Whether an instance of the later state is elsewhere at other times.
    bool moves(std::uint32_t slot) const { return slot < moves_.size() && moves_[slot]; }
    /// Objects of which each time has its own tree.
    std::size_t size() const { return leaves_.size(); }

  private:
    friend class MovedView;
    /// Instances that move as one.
    struct Object {
        std::uint32_t number = 0;            // in the top
        std::vector<std::uint32_t> slots;    // that are in it
        Course course;                       // of the first of them
        WorldFromLocal firstFromWorld{1.0};  // in the later state
    };
    std::vector<Object> objects_;
    std::vector<bool> moves_;  // by slot
    std::vector<bvh::TopLeaf> leaves_;
};

class MovedView final : public RayView {
  public:
    /// `t`: from 0, the earlier state, to 1.
    MovedView(const RayView& now, const Motions& motions, double t);
    MovedView(const MovedView&) = delete;
    MovedView& operator=(const MovedView&) = delete;

  private:
    std::optional<std::pair<bvh::TopObject, bvh::InstanceTree::Box>> moved(const bvh::TopObject& now,
                                                                           const WorldFromLocal& change,
                                                                           const WorldFromLocal& first) const;

    std::vector<const RayInstance*> pages_;
    std::vector<std::unique_ptr<RayInstance[]>> own_;  // pages with moved instances
    std::unique_ptr<bvh::MovedTop> top_;
    Tables ownTables_;
};

}  // namespace rtsg
