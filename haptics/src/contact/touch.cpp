// Moves the proxy after the hand, and computes the force: spring, damper, friction, and passivity.
#include "touch.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <glm/geometric.hpp>

namespace rtsg::haptics {

namespace {

constexpr double kDeepest = 0.05;   // metres that a hand counts as ahead of its proxy
constexpr int kSweeps = 64;         // in which a proxy follows a hand that is farther ahead
constexpr int kPushes = 4;          // rounds in which surfaces push the ball apart from all
constexpr double kFarthest = 1e12;  // metres from the world's origin
constexpr double kNoDepth = 1e-12;  // metres

bool isFinite(const Vec3d& v) {
    return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

Vec3d shortened(const Vec3d& v, double maximum) {
    const double length = glm::length(v);
    return length > maximum ? maximum / length * v : v;
}

Vec3d middleOf(const Vec3d (&corners)[3]) {
    return (corners[0] + corners[1] + corners[2]) / 3.0;
}

/// Since the last tick.
Vec3d pathFrom(const NearTriangle& t) {
    return middleOf(t.corners) - middleOf(t.before);
}

}  // namespace

HapticTick Touch::lost(const Vec3d& hand, double seconds) {
    time_.reset();
    pressed_.reset();
    rateBefore_.reset();
    squeezed_ = false;
    surplus_ = 0;
    force_ = elastic_ = Vec3d(0);
    HapticTick tick;
    tick.seconds = seconds;
    tick.known = false;
    if (isFinite(hand)) tick.hand = tick.proxy = hand;
    return tick;
}

HapticTick Touch::tick(const WorldMoment& now, const Vec3d& hand, double seconds) {
    const bool begins = !time_;
    if (!(glm::length(hand) < kFarthest) || (!begins && !(seconds > *time_))) return lost(hand, seconds);
    hand_ = hand;
    if (begins) proxy_ = hand, spring_ = Vec3d(0);
    step_ = begins ? 1 / options_.rate : seconds - *time_;
    if (begins || near_.hasArrivals(now)) comeOut(now, seconds, begins);
    follow(now, seconds);

    HapticTick tick;
    tick.seconds = seconds;
    tick.hand = hand;
    tick.proxy = proxy_;
    press(tick);
    // Whatever numbers met here, a device gets none that is not finite.
    if (!isFinite(tick.force) || !isFinite(proxy_)) return lost(hand, seconds);
    force_ = tick.force;
    time_ = seconds;
    near_.remember(seconds);
    return tick;
}

/// Out of a solid that has come over the ball; whether it was in one. What the scene puts in here, no spring owes.
bool Touch::comeOut(const WorldMoment& now, double seconds, bool everything) {
    const NearTriangles::PathOut out = near_.exitDistance(now, proxy_, options_.radius, seconds, everything);
    if (out.to) {
        spring_ += *out.to - proxy_;
        proxy_ = *out.to;
        squeezed_ = false;
    }
    return out.inside;
}

/// Moves the proxy towards the hand, however far that is: in steps, until something holds it.
void Touch::follow(const WorldMoment& now, double seconds) {
    const double step = std::max(kDeepest, glm::length(hand_ - proxy_) / kSweeps);
    for (int i = 0; i < kSweeps; ++i) {
        const Vec3d from = proxy_, displacement = hand_ - proxy_, goal = proxy_ + shortened(displacement, step);
        near_.find(now, proxy_, goal, options_.radius, seconds);
        if (i == 0 && isSqueezed(now, seconds)) return;
        proxy_ = slide(proxy_, rubbed(goal), options_.radius, near_.all());
        if (glm::length(displacement) <= step || glm::length(proxy_ - from) < 0.5 * step) return;
    }
}

/// Between surfaces that leave it no room the ball stays where it was; from within a solid it comes out, as soon as
/// there is anywhere near to go.
bool Touch::isSqueezed(const WorldMoment& now, double seconds) {
    if (!squeezed_) return squeezed_ = !pushByWhatMoves();
    if (!comeOut(now, seconds, true)) squeezed_ = !touched(proxy_, 0.5 * options_.radius, near_.all()).empty();
    return squeezed_;
}

/// How far a triangle that has passed through the ball since the last tick pushes it along, on the side of it where the
/// ball `stood`.
Vec3d Touch::pushOf(const NearTriangle& t, const Vec3d& stood) const {
    const double apart = options_.radius + kSkin;
    const Vec3d before = glm::cross(t.before[1] - t.before[0], t.before[2] - t.before[0]),
                now = glm::cross(t.corners[1] - t.corners[0], t.corners[2] - t.corners[0]);
    if (!t.moves || glm::length(before) <= 0 || glm::length(now) <= 0) return Vec3d(0);
    const Vec3d normal = glm::normalize(now);
    const double side = glm::dot(stood - t.before[0], before) >= 0 ? 1 : -1;
    const double height = side * glm::dot(proxy_ - t.corners[0], normal);
    const Vec3d closest = closestOnTriangle(proxy_, t.corners), from = proxy_ - closest;
    const double distance = glm::length(from);
    if (glm::length(from - side * height * normal) < 1e-9 + 1e-6 * distance) {
        // Above or below its area; a triangle that is farther past the ball than it moved was never beside it.
        double maximum = options_.radius;
        for (int c = 0; c < 3; ++c) maximum = std::max(maximum, glm::length(t.corners[c] - t.before[c]));
        if (height < apart && apart - height <= 2 * maximum) return side * (apart - height) * normal;
    } else if (distance < apart && distance > 0) {
        return (apart - distance) / distance * from;
    }
    return Vec3d(0);
}

/// By all triangles that move, as far as resting surfaces allow. Whether there is room: if not, the ball is where it
/// was.
bool Touch::pushByWhatMoves() {
    const Vec3d stood = proxy_;
    std::optional<std::vector<NearTriangle>> still;
    double left = 0;
    for (int pass = 0; pass < kPushes; ++pass) {
        left = 0;
        for (const NearTriangle& t : near_.all()) {
            const Vec3d push = pushOf(t, stood);
            if (push == Vec3d(0)) continue;
            if (!still) still = near_.still();
            left = std::max(left, glm::length(push));
            proxy_ = slide(proxy_, proxy_ + push, options_.radius, *still);
        }
        if (left < kSkin) return true;
    }
    if (left < 0.5 * options_.radius) return true;
    proxy_ = stood;
    return false;
}

/// The hand's position with friction: inside the cone of friction about the surface, the proxy stays where it was;
/// outside, it lags behind by the width of the cone.
Vec3d Touch::rubbed(const Vec3d& goal) {
    if (!pressed_) return sticks_ = true, goal;
    const TouchSurface surface = near_.surfaceOf(*pressed_, options_.surface);
    if (surface.staticFriction <= 0 && surface.dynamicFriction <= 0) return goal;
    Vec3d stood = proxy_;
    for (const NearTriangle& t : near_.all())
        if (t.slot == pressed_->slot && t.triangle == pressed_->triangle) stood += pathFrom(t);
    const Vec3d smooth = slide(proxy_, goal, options_.radius, near_.all()), pressing = smooth - goal;
    const double depth = glm::length(pressing);
    if (depth < 1e-12) return goal;
    const Vec3d normal = pressing / depth;
    Vec3d lag = smooth - stood;
    lag -= glm::dot(lag, normal) * normal;
    const double length = glm::length(lag);
    const double maximum =
        sticks_ ? std::max(surface.staticFriction, surface.dynamicFriction) : surface.dynamicFriction;
    sticks_ = length <= maximum * depth;
    return goal - (sticks_ ? lag : surface.dynamicFriction * depth / length * lag);
}

void Touch::press(HapticTick& tick) {
    const Vec3d spring = proxy_ - hand_, change = spring - std::exchange(spring_, spring);
    const std::vector<Touching> contacts = touched(proxy_, options_.radius, near_.all(), 1e-6);
    double maximum = kNoDepth;
    Touching strongest;
    pressed_.reset();
    for (const Touching& t : contacts) {
        const double pressing = squeezed_ ? glm::length(spring) : glm::dot(t.normal, spring);
        if (pressing <= maximum) continue;
        maximum = pressing;
        pressed_ = near_.all()[t.triangle];
        strongest = t;
    }
    if (!pressed_) {
        rateBefore_.reset();
        surplus_ = 0;
        force_ = elastic_ = Vec3d(0);
        return;
    }
    tick.touching = true;
    tick.position = strongest.position;
    tick.normal = strongest.normal;
    tick.shape = near_.shapeOf(*pressed_);
    tick.velocity = pathFrom(*pressed_) / step_;
    const TouchSurface surface = near_.surfaceOf(*pressed_, options_.surface);
    // On the way out the force is that of the end of the tick for which it is held, so that it gives no more than it
    // took on the way in. The damper draws no hand to a surface.
    const double depth = glm::length(spring);
    const Vec3d normal = spring / depth;
    const double rate = glm::dot(change, normal);
    // It goes on to gain speed as in the last tick.
    const double gained = rateBefore_ ? std::min(0.0, rate - std::min(0.0, *rateBefore_)) : 0;
    const double outwards = options_.passive && rate < 0 ? rate + gained : 0;
    rateBefore_ = rate;
    tick.force = surface.stiffness * std::max(0.0, depth + outwards) * normal;
    tick.force += std::max(surface.damping * rate / step_, -glm::dot(tick.force, normal)) * normal;
    const Vec3d elastic = shortened(surface.stiffness * spring, options_.maxForce);
    surplus_ += glm::dot(0.5 * (elastic_ + elastic) - force_, change);
    elastic_ = elastic;
    if (options_.passive) tick.force = passive(tick, change, surface, contacts);
    tick.force += glm::dot(tick.force, tick.normal) * (near_.smoothNormal(strongest) - tick.normal);
    tick.force = shortened(tick.force, options_.maxForce);
}

/// Because a force is held for a tick, the hand gets energy that no spring would give it: in any direction in which a
/// contact holds it. What it got on the way in it owes until it is out; the rest a damper takes back, which is as
/// strong as the hand does not notice, and moves it nowhere that the contacts do not.
Vec3d Touch::passive(const HapticTick& tick, const Vec3d& change, const TouchSurface& surface,
                     const std::vector<Touching>& contacts) const {
    const double squared = glm::dot(change, change);
    const double owed = surplus_ - 0.5 * surface.stiffness * glm::length(spring_) * std::sqrt(squared);
    if (owed <= 0 || squared < 1e-18) return tick.force;
    const Vec3d damped = tick.force + std::min(owed / squared, surface.stiffness) * change;
    if (squeezed_) return damped;
    if (surface.staticFriction > 0 || surface.dynamicFriction > 0)
        return damped - std::min(0.0, glm::dot(damped, tick.normal)) * tick.normal;
    return damped + alongAll(-damped, contacts);  // the nearest that they can give together
}

}  // namespace rtsg::haptics
