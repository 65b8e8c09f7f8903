// rtsg assemble --live: joins pictures of a served scene of tiles that mirrors draw, and writes or streams them.
// Threading: the main thread.
#pragma once

#include <string>

namespace rtsg::app {

struct LiveAssembly {
    std::string address, tiles, out, duration;
    bool insecure = false, json = false;
};

/// Returns the program's status. Throws UsageError.
int assembleLive(const LiveAssembly& options);

}  // namespace rtsg::app
