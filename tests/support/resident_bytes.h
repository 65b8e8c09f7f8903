// Memory that this process has in use, as the system counts it.
#pragma once

#include <cstddef>
#include <fstream>

#include <unistd.h>

namespace rtsg::test {

inline std::size_t residentBytes() {
    std::ifstream statm("/proc/self/statm");
    std::size_t pages = 0;
    statm >> pages >> pages;
    return pages * static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
}

}  // namespace rtsg::test
