// How messages name a node: its DEF name or, without one, "#" and its number.
#pragma once

#include <string>

#include <rtsg/core/scene.h>

namespace rtsg {

std::string nodeLabel(const Scene& scene, NodeId node);

}  // namespace rtsg
