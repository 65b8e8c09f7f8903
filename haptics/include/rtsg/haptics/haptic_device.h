// HapticDevice: a device that a hand holds; it measures the hand's position and applies a force to it.
//
// A vendor's driver is such a device, either in the same process or at the other end of a datagram socket
// (docs/touch.md shows one in 20 lines of Python). Invariant: a device without a valid position gets no force.
// Threading: all functions are called on the haptic thread, a thousand times a second, and must not wait.
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
    /// The present position of the hand, in metres in the device's own space. `seconds` is the time of the haptic
    /// clock. Error: it is unknown; until it is known, there is no force.
    virtual Result<Vec3d> position(double seconds) = 0;
    /// Sets the force on the hand from now on, in newtons.
    virtual void push(const Vec3d& force) = 0;
    /// Whether the device has finished, such as a path at its end.
    virtual bool hasEnded() const { return false; }
    /// What its user should know when it has been used; empty if nothing.
    virtual std::string warning() const { return {}; }
};

/// A simulated hand on a path, for tests and measurements. The hand is a mass that a spring and a damper hold to the
/// path.
struct SimulatedHand {
    struct Stop {
        double seconds = 0;
        Vec3d position{0};  // metres
    };
    std::vector<Stop> path;  // ordered by time; straight lines between the stops
    double mass = 0;         // kg; 0: the hand follows the path exactly
    double stiffness = 200;  // N/m, of the arm
    double damping = 2;      // N s/m, of the arm
};
/// Reads lines of "seconds,x,y,z"; text after '#' and a first line of words are ignored. Error: names the invalid line.
Result<std::vector<SimulatedHand::Stop>> readHandPath(const std::string& file);
std::unique_ptr<HapticDevice> simulatedDevice(SimulatedHand hand);

/// A device at the other end of a socket on this machine. Each datagram to 127.0.0.1:`port` has three doubles, the
/// position, and is answered with three doubles, the force; all little-endian. The first sender is the device, until
/// nothing comes from it for `patience` seconds; then the position is unknown, and the next one is. Port 0 selects a
/// free port; `bound` receives it. Error: the port is not available.
Result<std::unique_ptr<HapticDevice>> udpDevice(std::uint16_t port, double patience = 0.1,
                                                std::uint16_t* bound = nullptr);

/// A 3D mouse by spacenavd: it moves the hand by at most `speed` m/s, and applies no force. Error: there is no daemon.
Result<std::unique_ptr<HapticDevice>> spaceMouse(const std::string& socket = "/run/spnav.sock", double speed = 0.2);

}  // namespace rtsg
