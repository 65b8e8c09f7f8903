// --set, --edit, --undo, --redo and --lock of `rtsg mirror`.
//
// Threading: none.
#pragma once

#include <rtsg/session/requests.h>

#include "command.h"

namespace rtsg::app {

struct RequestArguments : RequestOptions {
    void addTo(Command& command);
};

}  // namespace rtsg::app
