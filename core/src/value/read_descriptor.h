// The whole content of an opened file, however long it says it is, and however it changes meanwhile.
#pragma once

#include <cstdint>
#include <string>

#include <rtsg/core/diagnostic.h>

namespace rtsg::detail {

/// From the descriptor's position to the end. Errors: more than `limit` bytes, or an error of the system.
Result<std::string> readDescriptor(int descriptor, std::uint64_t limit);

}  // namespace rtsg::detail
