// Moves the proxy after the hand, and computes the force: spring, damper, friction, and passivity.
#include "touch.h"

#include <algorithm>
#include <cmath>

#include <glm/geometric.hpp>

namespace rtsg::haptics {

namespace {

constexpr double kDeepest = 0.05;  // metres that a hand counts as ahead of its proxy

bool isFinite(const Vec3d& v) {
    return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

Vec3d shortened(const Vec3d& v, double most) {
    const double length = glm::length(v);
    return length > most ? most / length * v : v;
}

Vec3d middleOf(const Vec3d (&corners)[3]) {
    return (corners[0] + corners[1] + corners[2]) / 3.0;
}

/// Since the last tick.
Vec3d wayOf(const NearTriangle& t) {
    return middleOf(t.corners) - middleOf(t.before);
}

}  // namespace

HapticTick Touch::lost(const Vec3d& hand, double seconds) {
    time_.reset();
    pressed_.reset();
    rateBefore_.reset();
    force_ = Vec3d(0);
    energy_ = 0;
    HapticTick tick;
    tick.seconds = seconds;
    tick.known = false;
    if (isFinite(hand)) tick.hand = tick.proxy = hand;
    return tick;
}

HapticTick Touch::tick(const WorldMoment& now, const Vec3d& hand, double seconds) {
    const bool begins = !time_;
    if (!isFinite(hand) || (!begins && (glm::length(hand - hand_) > options_.maxStep || seconds <= *time_)))
        return lost(hand, seconds);
    handBefore_ = begins ? hand : hand_;
    hand_ = hand;
    if (begins) proxy_ = hand;
    step_ = begins ? 1 / options_.rate : seconds - *time_;
    if (begins || near_.hasArrivals(now)) {
        if (const auto out = near_.wayOut(now, proxy_, options_.radius, seconds, begins)) {
            // The scene has put in what brings the hand there.
            energy_ -= options_.maxForce * glm::length(*out - proxy_);
            proxy_ = *out;
        }
    }
    const Vec3d goal = proxy_ + shortened(hand - proxy_, kDeepest);
    near_.find(now, proxy_, goal, options_.radius, seconds);
    pushByWhatMoves();
    proxy_ = slide(proxy_, rubbed(goal), options_.radius, near_.all());

    HapticTick tick;
    tick.seconds = seconds;
    tick.hand = hand;
    tick.proxy = proxy_;
    press(tick);
    keepPassive(tick);
    force_ = tick.force;
    time_ = seconds;
    near_.remember(seconds);
    return tick;
}

/// A triangle that has passed through the ball since the last tick pushes it along, on its old side, as far as resting
/// surfaces allow.
void Touch::pushByWhatMoves() {
    std::optional<std::vector<NearTriangle>> still;
    const double apart = options_.radius + kSkin;
    for (const NearTriangle& t : near_.all()) {
        if (!t.moves) continue;
        const Vec3d before = glm::cross(t.before[1] - t.before[0], t.before[2] - t.before[0]),
                    now = glm::cross(t.corners[1] - t.corners[0], t.corners[2] - t.corners[0]);
        if (glm::length(before) <= 0 || glm::length(now) <= 0) continue;
        const Vec3d normal = glm::normalize(now);
        const double side = glm::dot(proxy_ - t.before[0], before) >= 0 ? 1 : -1;
        const double height = side * glm::dot(proxy_ - t.corners[0], normal);
        const Vec3d closest = closestOnTriangle(proxy_, t.corners), from = proxy_ - closest;
        const double distance = glm::length(from);
        Vec3d push(0);
        if (glm::length(from - side * height * normal) < 1e-9 + 1e-6 * distance) {
            // Above or below its area; a triangle that is farther past the ball than it moved was never beside it.
            double most = options_.radius;
            for (int c = 0; c < 3; ++c) most = std::max(most, glm::length(t.corners[c] - t.before[c]));
            if (height < apart && apart - height <= 2 * most) push = side * (apart - height) * normal;
        } else if (distance < apart && distance > 0) {
            push = (apart - distance) / distance * from;
        }
        if (push == Vec3d(0)) continue;
        if (!still) still = near_.still();
        proxy_ = slide(proxy_, proxy_ + push, options_.radius, *still);
    }
}

/// The hand's position with friction: inside the cone of friction about the surface, the proxy stays where it was;
/// outside, it lags behind by the width of the cone.
Vec3d Touch::rubbed(const Vec3d& goal) {
    if (!pressed_) return sticks_ = true, goal;
    const TouchSurface surface = near_.surfaceOf(*pressed_, options_.surface);
    if (surface.staticFriction <= 0 && surface.dynamicFriction <= 0) return goal;
    Vec3d stood = proxy_;
    for (const NearTriangle& t : near_.all())
        if (t.slot == pressed_->slot && t.triangle == pressed_->triangle) stood += wayOf(t);
    const Vec3d smooth = slide(proxy_, goal, options_.radius, near_.all()), pressing = smooth - goal;
    const double depth = glm::length(pressing);
    if (depth < 1e-12) return goal;
    const Vec3d normal = pressing / depth;
    Vec3d lag = smooth - stood;
    lag -= glm::dot(lag, normal) * normal;
    const double length = glm::length(lag);
    const double most = sticks_ ? std::max(surface.staticFriction, surface.dynamicFriction) : surface.dynamicFriction;
    sticks_ = length <= most * depth;
    return goal - (sticks_ ? lag : surface.dynamicFriction * depth / length * lag);
}

void Touch::press(HapticTick& tick) {
    const Vec3d spring = proxy_ - hand_;
    double most = 0;
    pressed_.reset();
    for (const Touching& t : touched(proxy_, options_.radius, near_.all(), 1e-6)) {
        const double pressing = glm::dot(t.normal, spring);
        if (pressing <= most) continue;
        most = pressing;
        pressed_ = near_.all()[t.triangle];
        tick.place = t.place;
        tick.normal = t.normal;
    }
    if (!pressed_) {
        rateBefore_.reset();
        return;
    }
    tick.touching = true;
    tick.shape = near_.shapeOf(*pressed_);
    tick.velocity = wayOf(*pressed_) / step_;
    const TouchSurface surface = near_.surfaceOf(*pressed_, options_.surface);
    // On the way out the force is that of the end of the tick for which it is held, so that it gives no more than it
    // took on the way in. The damper draws no hand to a surface.
    const double depth = glm::length(spring);
    const Vec3d normal = spring / depth;
    const double rate = glm::dot((hand_ - handBefore_) / step_ - tick.velocity, normal);
    // It goes on to gain speed as in the last tick.
    const double gained = rateBefore_ ? std::max(0.0, rate - std::max(0.0, *rateBefore_)) : 0;
    const double outwards = options_.passive && rate > 0 ? (rate + gained) * step_ : 0;
    rateBefore_ = rate;
    tick.force = surface.stiffness * std::max(0.0, depth - outwards) * normal;
    tick.force -= std::min(surface.damping * rate, glm::dot(tick.force, normal)) * normal;
    tick.force = shortened(tick.force, options_.maxForce);
}

/// Because a force is held for a tick, more energy is given on the way out than was taken on the way in. A damper takes
/// the surplus back; and it never draws the hand to a surface.
void Touch::keepPassive(HapticTick& tick) {
    const Vec3d way = hand_ - handBefore_ - step_ * tick.velocity;
    energy_ += glm::dot(force_, way);
    if (!tick.touching) {
        energy_ = 0;
        return;
    }
    const double squared = glm::dot(way, way);
    if (!options_.passive || energy_ <= 0 || squared < 1e-18) return;
    const Vec3d damped = tick.force - energy_ / squared * way;
    tick.force = shortened(damped - std::min(0.0, glm::dot(damped, tick.normal)) * tick.normal, options_.maxForce);
}

}  // namespace rtsg::haptics
