// Touch: the position of a hand's proxy among the triangles of a world, and the resulting force.
//
// One call of tick() is one step of the clock. The proxy is a ball that follows the hand as far as surfaces let it; a
// spring draws the hand to it. Surfaces that move carry the proxy along and push it; between two states of the scene
// they are taken to move on as before. Threading: one thread; states may be of another.
// Source: C. B. Zilles, J. K. Salisbury, "A constraint-based god-object method for haptic display", 1995; friction:
// W. S. Harwin, N. Melder, "Improved haptic rendering for multi-finger manipulation using friction cone based
// god-objects", 2002; passivity: B. Hannaford, J.-H. Ryu, "Time-domain passivity control of haptic interfaces", 2002.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "ball.h"
#include "near_triangles.h"

namespace rtsg::haptics {

class Touch {
  public:
    explicit Touch(const HapticOptions& options) : options_(options) {}

    /// `seconds`: of the clock, later than at the last call. `hand`: in the world.
    HapticTick tick(const WorldMoment& now, const Vec3d& hand, double seconds);

  private:
    HapticTick lost(const Vec3d& hand, double seconds);
    bool comeOut(const WorldMoment& now, double seconds, bool everything);
    void follow(const WorldMoment& now, double seconds);
    Vec3d pushOf(const NearTriangle& t, const Vec3d& stood) const;
    bool pushByWhatMoves();
    bool isSqueezed(const WorldMoment& now, double seconds);
    Vec3d rubbed(const Vec3d& goal);
    void press(HapticTick& tick);
    Vec3d passive(const HapticTick& tick, const Vec3d& change, const TouchSurface& surface,
                  const std::vector<Touching>& contacts) const;

    const HapticOptions options_;
    NearTriangles near_;
    Vec3d proxy_{0}, hand_{0};
    Vec3d spring_{0}, elastic_{0},
        force_{0};                // of the last tick: from hand to proxy; what a spring gave; what was felt
    std::optional<double> time_;  // of the last tick with a hand
    double step_ = 0;             // seconds since that
    bool sticks_ = true;
    bool squeezed_ = false;                // surfaces leave the ball no room
    double surplus_ = 0;                   // J that the hand got and would not have got from a spring without ticks
    std::optional<double> rateBefore_;     // metres deeper, in the last tick
    std::optional<NearTriangle> pressed_;  // the triangle that was pressed most at the last tick
};

}  // namespace rtsg::haptics
