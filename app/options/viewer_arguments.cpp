// Declares the options of live viewers and metrics.
#include "viewer_arguments.h"

namespace rtsg::app {

void FoxgloveArguments::addTo(Command& command) {
    command.addOption("--foxglove", listen,
                      "PORT on loopback, or ADDRESS:PORT: the scene live for Foxglove and Lichtblick, /tf, /scene and "
                      "--fields; 0 picks a port");
}

void MetricsArguments::addTo(Command& command) {
    command.addOption(
        "--metrics-port", listen,
        "PORT on loopback, or ADDRESS:PORT: figures at /metrics for Prometheus and rtsg top; 0 picks one");
}

}  // namespace rtsg::app
