// `rtsg serve LOG`: a log played to mirrors, with commands by standard input and by those mirrors that may send.
#pragma once

#include <string>

#include <rtsg/sync/mirror_server.h>

#include "cli.h"

namespace rtsg::app {

struct ServeLogArguments {
    double rate = 1;
    bool loop = false, paused = false, control = false;

    void addTo(Command& command);
};

/// The exit status. `seconds`: how long to serve; `linger`: how long mirrors may catch up then.
int serveLog(const std::string& log, const std::string& endpoint, const MirrorServerOptions& server,
             const ServeLogArguments& arguments, double seconds, double linger, bool json);

}  // namespace rtsg::app
