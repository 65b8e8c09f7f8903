// `rtsg serve LOG`: plays a log to mirrors. Standard input, and mirrors that may send, give commands.
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
    std::string file, shown, endpoint;  // `shown`: how the file is named to the user
    ServeLogArguments arguments;
    WebArguments web;
    Resources resources;  // the files that browsers may load
    double seconds = 0;   // how long to serve; may be infinite
    double linger = 0;    // how long mirrors may catch up after that
    bool json = false;
    std::string nats;  // where to publish; empty: nowhere
};

/// Returns the exit status.
int serveLog(const ServedLog& log, const MirrorServerOptions& server);

}  // namespace rtsg::app
