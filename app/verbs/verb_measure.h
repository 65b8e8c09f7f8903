// rtsg measure: its declaration for main.cpp.
#pragma once

#include "cli.h"

namespace rtsg::app {

Verb addMeasure(Command& program);

}  // namespace rtsg::app
