// NearTriangles: the triangles of a world around a hand, at their present positions and at those of the last tick.
//
// States arrive once a frame, ticks a thousand times a second. Motion between the last two states is extrapolated until
// the next state arrives. Threading: one thread; states may come from another.
#pragma once

#include <memory>
#include <optional>
#include <unordered_map>
#include <vector>

#include <rtsg/haptics/haptic_tick.h>
#include <rtsg/renderers/shared_world.h>

#include "ball.h"

namespace rtsg::haptics {

/// The renderer's data for one state besides the triangles.
struct TouchTables {
    std::shared_ptr<const std::unordered_map<std::uint32_t, TouchSurface>> surfaces;  // by the appearance's number
    struct Mover {
        WorldFromLocal from{1.0}, to{1.0};
        std::uint32_t generation = 0;
        bool steady = false;  // it moved before that, too
    };
    std::unordered_map<std::uint32_t, Mover> movers;  // by slot: those that moved since the state before
    bool arrived = false;                             // things that were not there, or jumped, or have another shape
    double farthest = 0;                              // metres that any point of a steady one moved
    double seconds = 0;                               // of the scene, since the state before
};

/// A state as the clock sees it.
struct WorldMoment {
    std::shared_ptr<const WorldState> state;  // with rays; null: there is nothing
    std::shared_ptr<const TouchTables> tables;
    double since = 0;  // of the clock
};

class NearTriangles {
  public:
    /// Those that a ball may meet on its way from `from` to `to`, and between two ticks those that may meet it.
    void find(const WorldMoment& now, const Vec3d& from, const Vec3d& to, double radius, double seconds);
    /// To be called at the end of a tick.
    void remember(double seconds) { last_ = now_, lastTime_ = seconds; }
    /// Whether anything may have come over the hand since the last tick.
    bool hasArrivals(const WorldMoment& now) const {
        return now.state != last_.state && (!now.tables || now.tables->arrived);
    }
    const std::vector<NearTriangle>& all() const { return all_; }
    std::vector<NearTriangle> still() const;

    struct PathOut {
        bool inside = false;      // of a solid
        std::optional<Vec3d> to;  // where a ball has room; null: nowhere near
    };
    /// The way out of a solid that has come over a place since the last tick, other than by steady motion: the place
    /// lies behind the solid's nearest surface. `everything`: nothing was there before.
    PathOut exitDistance(const WorldMoment& now, const Vec3d& position, double radius, double seconds,
                         bool everything) const;
    /// Preconditions: of a triangle of find().
    TouchSurface surfaceOf(const NearTriangle& triangle, const TouchSurface& otherwise) const;
    NodeId shapeOf(const NearTriangle& triangle) const;
    /// Where a surface of facets stands for a smooth one, that one's normal at the point that is touched; otherwise the
    /// contact's own.
    Vec3d smoothNormal(const Touching& contact) const;

  private:
    struct Surface {
        double distance = 0;         // metres
        Vec3d closest{0}, front{0};  // a point; towards the outside, not of unit length
    };
    template <class Counts>
    std::vector<Surface> surfacesNear(const WorldMoment& now, const Vec3d& position, double reach, double seconds,
                                      bool nearest, const Counts& counts) const;
    bool hasRoom(const WorldMoment& now, const Vec3d& position, double radius, double seconds) const;

    WorldMoment now_, last_;
    double lastTime_ = 0;
    std::vector<NearTriangle> all_;
    std::vector<std::pair<std::uint32_t, std::uint32_t>> found_;  // slots and triangles
};

}  // namespace rtsg::haptics
