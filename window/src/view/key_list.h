// The keys of a window and what they do, for people.
//
// Threading: a pure function.
#pragma once

#include <vector>

#include "overlay_content.h"

namespace rtsg {

std::vector<OverlayContent::Line> keyList();

}  // namespace rtsg
