// rtsg replay --blame: who changed a field, as a table or JSON.
#pragma once

#include <string>

namespace rtsg::app {

/// Returns the exit status.
int blame(const std::string& log, const std::string& path, bool json);

}  // namespace rtsg::app
