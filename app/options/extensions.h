// The program's extensions: plug-ins and node tables that the user names with --plugin, --nodes and RTSG_PLUGINS.
//
// A scene, a log or a peer cannot load one. Threading: the main thread.
#pragma once

#include <rtsg/plugins/extensions.h>

#include "command.h"

namespace rtsg::app {

/// Adds --plugin and --nodes to a verb.
void addExtensions(Command& command);

/// Loads the plug-ins in RTSG_PLUGINS, if the verb makes a scene of the user's files, and then the plug-ins and tables
/// of the command line in their order. Those that cannot be loaded are reported and count as missing (noteLeftOut); the
/// others are used.
void loadExtensions(const Command& verb);

/// The plug-ins and tables that have been loaded.
const Extensions& extensions();

}  // namespace rtsg::app
