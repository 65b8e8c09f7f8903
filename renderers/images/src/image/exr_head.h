// Checks the headers of an OpenEXR file, attribute by attribute: all that they refer to must lie within the file.
//
// Source: "OpenEXR File Layout" (openexr.com). Threading: pure functions.
#pragma once

#include <string>

#include "head_bytes.h"

namespace rtsg {

bool isExr(const HeadBytes& file);
/// See whyNotWithin().
std::string whyNotWithinExr(const HeadBytes& file);

}  // namespace rtsg
