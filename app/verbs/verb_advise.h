// rtsg advise: its declaration for main.cpp.
#pragma once

#include "cli.h"

namespace rtsg::app {

Verb addAdvise(Command& program);

}  // namespace rtsg::app
