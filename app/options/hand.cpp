// Opens the devices for touch that options name.
#include "hand.h"

#include <charconv>

#include <fmt/format.h>

#include "command.h"

namespace rtsg::app {

Result<Hand> openHand(const std::string& option, const std::string& name, SimulatedHand arm) {
    Hand hand;
    if (name.starts_with("sim:")) {
        auto path = readHandPath(name.substr(4));
        if (!path) return std::unexpected(path.error());
        hand.seconds = path->back().seconds;
        hand.isSimulated = true;
        arm.path = std::move(*path);
        hand.device = simulatedDevice(std::move(arm));
        return hand;
    }
    if (name.starts_with("udp:")) {
        std::uint16_t port = 0;
        const char* const end = name.data() + name.size();
        const auto [rest, error] = std::from_chars(name.data() + 4, end, port);
        if (error != std::errc() || rest != end) throw UsageError(option, "udp: needs a port number, 0 to 65535");
        auto device = udpDevice(port, 0.1, &hand.port);
        if (!device) return std::unexpected(device.error());
        hand.device = std::move(*device);
        return hand;
    }
    if (name == "spnav" || name.starts_with("spnav:")) {
        auto device = name == "spnav" ? spaceMouse() : spaceMouse(name.substr(6));
        if (!device) return std::unexpected(device.error());
        hand.device = std::move(*device);
        return hand;
    }
    throw UsageError(option, fmt::format("is sim:FILE.csv, udp:PORT or spnav, not '{}'", name));
}

}  // namespace rtsg::app
