// HapticDevice: what a hand holds: it says where the hand is, and takes a force.
//
// A driver of a vendor's is such, either in the same process or at the other end of a datagram socket (docs/touch.md
// has that end in 20 lines of Python). Invariant: a device that gives nothing usable gets no force. Threading: both
// functions are called on one thread, that of the touch, a thousand times a second: they must not wait.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <rtsg/core/diagnostic.h>
#include <rtsg/core/value.h>

namespace rtsg {

class HapticDevice {
  public:
    virtual ~HapticDevice() = default;
    /// Where the hand is now, metres in the device's own space. `seconds`: of the touch's clock. Error: it is not
    /// known; the hand is pushed by nothing until it is.
    virtual Result<Vec3d> place(double seconds) = 0;
    /// What pushes the hand from now on, newtons.
    virtual void push(const Vec3d& force) = 0;
    /// It has no more to do: a path that has ended.
    virtual bool hasEnded() const { return false; }
};

/// A hand on a path, for tests and for figures. The hand is a mass, held to the path by a spring and a damper.
struct SimulatedHand {
    struct Stop {
        double seconds = 0;
        Vec3d place{0};  // metres
    };
    std::vector<Stop> path;  // by time; in between it goes straight
    double mass = 0;         // kg; 0: the hand is wherever the path is
    double stiffness = 200;  // N/m, of the arm
    double damping = 2;      // N s/m, of the arm
};
/// Lines of "seconds,x,y,z"; what follows '#' is left out, and a first line of words. Error: the line.
Result<std::vector<SimulatedHand::Stop>> readHandPath(const std::string& file);
std::unique_ptr<HapticDevice> simulatedDevice(SimulatedHand hand);

/// A device at the other end of a socket of this machine: each datagram to 127.0.0.1:`port` is three doubles, the
/// place, and is answered with three doubles, the force; little-endian. When no datagram has come for
/// `patience` seconds the place is not known. Port 0: any; which one goes to `bound`. Error: the port cannot be had.
Result<std::unique_ptr<HapticDevice>> udpDevice(std::uint16_t port, double patience = 0.1,
                                                std::uint16_t* bound = nullptr);

/// A 3D mouse by spacenavd: it moves the hand by at most `speed` m/s, and takes no force. Error: there is no daemon.
Result<std::unique_ptr<HapticDevice>> spaceMouse(const std::string& socket = "/run/spnav.sock", double speed = 0.2);

}  // namespace rtsg
