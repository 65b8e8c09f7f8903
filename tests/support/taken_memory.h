// Measures the most memory that a function takes beyond that of the process, by running it in a process of its own.
#pragma once

#include <cstddef>
#include <cstdint>
#include <fstream>
#include <string>

#include <sys/wait.h>
#include <unistd.h>

#include "resident_bytes.h"

namespace rtsg::test {

constexpr std::size_t kMegabyte = 1 << 20;

/// Where memory cannot be judged so: sanitizers have some of their own.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool kMemoryIsOurs = false;
#else
constexpr bool kMemoryIsOurs = true;
#endif

/// The highest resident set of this process, bytes.
inline std::size_t maxResident() {
    std::ifstream status("/proc/self/status");
    for (std::string line; std::getline(status, line);)
        if (line.starts_with("VmHWM:")) return std::stoull(line.substr(6)) * 1024;
    return SIZE_MAX;
}

/// Bytes; SIZE_MAX if `work()` was false or did not come back. Precondition: no other thread runs.
template <class Work>
std::size_t takenBy(const Work& work) {
    int ends[2];
    if (::pipe(ends) != 0) return SIZE_MAX;
    const pid_t child = ::fork();
    if (child == 0) {
        const std::size_t before = residentBytes();
        const std::size_t taken = work() ? maxResident() - before : SIZE_MAX;
        [[maybe_unused]] const ssize_t written = ::write(ends[1], &taken, sizeof(taken));
        ::_exit(0);
    }
    ::close(ends[1]);
    std::size_t taken = SIZE_MAX;
    if (::read(ends[0], &taken, sizeof(taken)) != ssize_t{sizeof(taken)}) taken = SIZE_MAX;
    ::close(ends[0]);
    ::waitpid(child, nullptr, 0);
    return taken;
}

}  // namespace rtsg::test
