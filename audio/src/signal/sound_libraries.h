// The libraries that read, convert and transform sound. They are loaded when the first sound is.
#pragma once

#include <rtsg/core/delayed_library.h>

namespace rtsg::delayed {
extern DelayedLibrary sound;
}
