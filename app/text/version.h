// The version of the program as JSON.
#pragma once

#include <string>

namespace rtsg::app {

/// One line of JSON: version, commit, compiler, features (what the build has), modules (what is there), the kernels
/// that this processor gets, and the versions of libraries. It loads all modules.
std::string versionAsJson();

}  // namespace rtsg::app
