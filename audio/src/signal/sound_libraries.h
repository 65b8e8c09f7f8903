// The libraries that read, convert and transform sound. They are loaded when the first sound is.
#pragma once

#include <rtsg/core/module.h>

namespace rtsg::delayed {
extern DelayedLibrary sound;
}
