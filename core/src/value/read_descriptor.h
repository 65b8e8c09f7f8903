// The whole content of an opened file, however long it says it is, and however it changes meanwhile.
#pragma once

#include <cstdint>
#include <string>

#include <rtsg/core/diagnostic.h>

namespace rtsg::detail {

/// From where the descriptor stands to its end. Errors: more than `limit` bytes, or what the system says.
Result<std::string> readDescriptor(int descriptor, std::uint64_t limit);

}  // namespace rtsg::detail
