// `rtsg serve LOG`: a log played to mirrors, with commands by standard input and by those mirrors that may send.
#pragma once

#include <string>

#include <rtsg/sync/mirror_server.h>

#include "cli.h"
#include "web.h"

namespace rtsg::app {

struct ServeLogArguments {
    double rate = 1;
    bool loop = false, paused = false, control = false;

    void addTo(Command& command);
};

struct ServedLog {
    std::string file, endpoint;
    ServeLogArguments arguments;
    WebArguments web;
    Resources resources;  // what urls of the log open for browsers
    double seconds = 0;   // how long to serve; may be infinite
    double linger = 0;    // how long mirrors may catch up then
    bool json = false;
};

/// The exit status.
int serveLog(const ServedLog& log, const MirrorServerOptions& server);

}  // namespace rtsg::app
