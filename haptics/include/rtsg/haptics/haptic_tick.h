// HapticTick: one step of touch, and what it goes by.
//
// Lengths are metres of the world unless they say otherwise. Threading: values.
#pragma once

#include <rtsg/core/value.h>
#include <rtsg/haptics/touch_surface.h>

namespace rtsg {

struct HapticOptions {
    double rate = 1000;       // ticks a second
    double radius = 0.005;    // of the proxy, metres; at least 1e-4
    double maxForce = 5;      // N
    double maxStep = 0.1;     // metres a tick; a hand that jumps farther is not known for that tick
    double pressAt = 0.5;     // N, from which on the pointer's button is down
    int pointer = 63;         // number of the pointing device
    TouchSurface surface;     // where an Appearance says nothing
    Vec3d origin{0};          // of the device's space in the world, metres
    double scale = 1;         // metres in the world for a metre of the device's; forces stay as they are
    bool passive = true;      // surfaces at rest give no energy; off to measure what that is worth
    bool keepsTicks = false;  // takeTicks() has them
};

/// One step of the clock.
struct HapticTick {
    double seconds = 0;       // of the clock
    Vec3d hand{0}, proxy{0};  // world, metres
    Vec3d force{0};           // N, on the hand
    bool known = true;        // the hand's place; if not, there is no force
    bool touching = false;
    Vec3d place{0}, normal{0, 0, 1};  // of what is touched most: world; unit, towards the proxy
    Vec3d velocity{0};                // of that surface there, m/s
    NodeId shape;                     // what it belongs to
};

}  // namespace rtsg
