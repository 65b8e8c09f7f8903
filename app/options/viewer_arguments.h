// --foxglove and --metrics-port: who may look at a verb while it runs.
//
// Threading: none.
#pragma once

#include <string>

#include "command.h"

namespace rtsg::app {

/// For live viewers (Foxglove).
struct FoxgloveArguments {
    std::string listen;
    void addTo(Command& command);
    bool wanted() const { return !listen.empty(); }
};

/// For Prometheus and `rtsg top` (Health).
struct MetricsArguments {
    std::string listen;
    void addTo(Command& command);
};

}  // namespace rtsg::app
