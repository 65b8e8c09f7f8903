// The hand that an option names: where its positions come from.
#pragma once

#include <memory>
#include <string>

#include <rtsg/haptics/haptic_device.h>

namespace rtsg::app {

struct Hand {
    std::unique_ptr<HapticDevice> device;
    double seconds = 0;  // that its path has; 0: it goes on
    bool isSimulated = false;
    std::uint16_t port = 0;  // of this machine, where places may be sent
};

/// `name`: sim:FILE.csv, udp:PORT or spnav, as `option` has it. `arm`: of a simulated hand; its path is the file's.
/// Throws UsageError.
Result<Hand> openHand(const std::string& option, const std::string& name, SimulatedHand arm = {});

}  // namespace rtsg::app
