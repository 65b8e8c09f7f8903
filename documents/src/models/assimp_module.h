// The interface of the module for files of other modellers: one function that converts a file to GLB.
//
// Threading: it is called in a process of its own, since libassimp cannot be trusted with hostile files.
#pragma once

#include <string>
#include <string_view>

#define RTSG_ASSIMP_SYMBOL "rtsg_start_assimp_2"

namespace rtsg::detail {

/// `extension` says which of its readers takes the bytes: "dae". Nothing else is opened. False: `result` says why; else
/// it is the GLB, whose textures are named as the file names them. `faults`: what the library says of it, a line each.
using MakeGlb = bool (*)(std::string_view bytes, const char* extension, std::string& result, std::string& faults);

}  // namespace rtsg::detail
