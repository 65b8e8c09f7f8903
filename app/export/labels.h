// Text that names things of a scene in JSON and in reports. Threading: the scene's thread.
#pragma once

#include <string>
#include <string_view>

#include <rtsg/core/scene.h>

namespace rtsg::app {

std::string jsonString(std::string_view text);
/// Its name, or # and its number; as it is: for a terminal it has to go through terminalText().
std::string nodeLabel(const Scene& scene, NodeId id);

}  // namespace rtsg::app
