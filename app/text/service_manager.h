// Tells a service manager how a verb that runs for long is doing (systemd's notification protocol, sd_notify(3)).
#pragma once

#include <string_view>

namespace rtsg::app {

/// Sends such lines as "READY=1" to the socket that the environment names; does nothing without one.
void notifyServiceManager(std::string_view lines);
/// Call it often: sends "WATCHDOG=1" as often as the manager asks for, and never if it does not.
void feedWatchdog();

}  // namespace rtsg::app
