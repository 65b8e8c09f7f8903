// Message schemas: the JSON Schemas of the topics for viewers. Foxglove knows its own schemas by name; fields that we
// leave out are optional.
#pragma once

#include <string>

#include <rtsg/core/value.h>

namespace rtsg {

/// foxglove.FrameTransforms
std::string frameTransformsSchema();
/// foxglove.SceneUpdate
std::string sceneUpdateSchema();
/// rtsg.Changes
std::string changesSchema();
/// {"timestamp":…,"value":…}, as far as viewers can plot values of this type.
std::string fieldSchema(FieldType type);

}  // namespace rtsg
