// Checks what the JSON of a glTF file says, before anything is made of it: what kind each value is of, and that what it
// names is there.
//
// What is at fault is reported with its JSON pointer, as /nodes/3/mesh; whoever reads the file then takes it as absent.
// Threading: one thread a file. Source: glTF 2.0 (ISO/IEC 12113:2022) 5, RFC 6901 (JSON pointers).
#pragma once

#include <nlohmann/json.hpp>

#include <rtsg/core/diagnostic.h>

namespace rtsg::detail {

/// Of what is read here; extensions that are not, and what is called otherwise, may hold anything.
void checkGltf(const nlohmann::json& root, Diagnostics& diagnostics);

}  // namespace rtsg::detail
