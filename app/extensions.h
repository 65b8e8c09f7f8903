// The program's extensions: what the plug-ins and node tables add that the user names by --plugin, --nodes and
// RTSG_PLUGINS.
//
// Nothing that a scene, a log or a peer says loads one. Threading: the main thread.
#pragma once

#include <rtsg/plugins/extensions.h>

#include "command.h"

namespace rtsg::app {

/// Adds --plugin and --nodes to a verb.
void addExtensions(Command& command);

/// Loads what the verb that was typed asks for: first what RTSG_PLUGINS names, if the verb makes a scene of files of
/// the user's, then plug-ins and tables in the order in which they were typed. What cannot be loaded is reported, and
/// counts as missing (noteLeftOut); the rest is there.
void loadExtensions(const Command& verb);

/// What has been loaded.
const Extensions& extensions();

/// Attaches the plug-ins' subscribers to a scene, for as long as the result is kept.
Extensions::Attached attachSubscribers(Scene& scene);

}  // namespace rtsg::app
