// Names of nodes in reports. Threading: the scene's thread.
#pragma once

#include <string>
#include <string_view>

#include <rtsg/core/field_text.h>
#include <rtsg/core/scene.h>

namespace rtsg::app {

/// Its name, or # and its number; as it is: for a terminal it has to go through terminalText().
std::string nodeLabel(const Scene& scene, NodeId id);

}  // namespace rtsg::app
