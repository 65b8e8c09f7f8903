// MCAP schemas: the JSON Schemas of exported topics. Foxglove knows its own by name; fields that we leave out are
// optional.
#pragma once

#include <string>

namespace rtsg::app {

/// foxglove.FrameTransforms
std::string frameTransformsSchema();
/// foxglove.SceneUpdate
std::string sceneUpdateSchema();
/// rtsg.Changes
std::string changesSchema();

}  // namespace rtsg::app
