// Labels: names of nodes in reports.
// Threading: the scene's thread.
#pragma once

#include <string>
#include <string_view>

#include <rtsg/core/field_text.h>
#include <rtsg/core/scene.h>

namespace rtsg {

/// The node's DEF name, or # and its number. It is not escaped: for a terminal, pass it through terminalText().
std::string labelOf(const Scene& scene, NodeId id);

}  // namespace rtsg
