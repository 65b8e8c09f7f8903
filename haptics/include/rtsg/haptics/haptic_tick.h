// HapticTick: the result of one haptic step, and the options.
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
    double pressAt = 0.5;     // N; from this force on, the pointer's button is down
    int pointer = 63;         // number of the pointing device
    TouchSurface surface;     // for an Appearance that defines none
    Vec3d origin{0};          // of the device's space in the world, metres
    double scale = 1;         // metres in the world for a metre of the device; forces are not scaled
    bool passive = true;      // surfaces at rest give no energy; can be switched off for comparisons
    bool keepsTicks = false;  // whether takeTicks() returns ticks
};

/// One step of the clock.
struct HapticTick {
    double seconds = 0;       // of the clock
    Vec3d hand{0}, proxy{0};  // world, metres
    Vec3d force{0};           // N, on the hand
    bool known = true;        // whether the hand's position is known; if not, there is no force
    bool touching = false;
    Vec3d position{0}, normal{0, 0, 1};  // of the strongest contact: in world space; a unit vector, towards the proxy
    Vec3d velocity{0};                   // of the touched surface there, m/s
    NodeId shape;                        // the Shape of that surface
};

}  // namespace rtsg
