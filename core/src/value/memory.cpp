// Finds how much memory the process holds, by /proc, and how much the machine has.
#include <rtsg/core/machine.h>

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <fstream>
#include <string>

#include <fcntl.h>
#include <malloc.h>
#include <unistd.h>

namespace rtsg {

namespace {

std::uint64_t pageSize() {
    static const auto size = static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
    return size;
}

/// The memory limit of the process's control group (cgroup v2); the largest number if there is none.
std::uint64_t groupLimit() {
    std::uint64_t minimum = UINT64_MAX;
    const auto take = [&](const std::string& folder) {
        std::ifstream file(folder + "/memory.max");
        std::uint64_t bytes = 0;
        if (file >> bytes) minimum = std::min(minimum, bytes);  // "max" is no number
    };
    std::ifstream own("/proc/self/cgroup");
    for (std::string line; std::getline(own, line);)
        if (line.starts_with("0::")) take("/sys/fs/cgroup" + line.substr(3));
    take("/sys/fs/cgroup");
    return minimum;
}

std::uint64_t usualLimit() {
    const std::uint64_t machine = static_cast<std::uint64_t>(::sysconf(_SC_PHYS_PAGES)) * pageSize();
    return std::min(machine, groupLimit()) / 4 * 3;
}

std::atomic<std::uint64_t>& limit() {
    static std::atomic<std::uint64_t> bytes = usualLimit();
    return bytes;
}

std::atomic<std::uint64_t>& inFiles() {
    static std::atomic<std::uint64_t> bytes = 0;
    return bytes;
}

}  // namespace

void countFileInMemory(std::int64_t bytes) {
    inFiles() += static_cast<std::uint64_t>(bytes);
}

std::uint64_t heldMemory() {
    const int file = ::open("/proc/self/statm", O_RDONLY | O_CLOEXEC);
    if (file < 0) return inFiles();
    char text[128] = {};
    const ssize_t got = ::read(file, text, sizeof(text) - 1);
    ::close(file);
    if (got <= 0) return inFiles();
    // "size resident ...", in pages.
    const std::string all(text);
    const std::size_t space = std::min(all.find(' '), all.size() - 1);
    return std::strtoull(all.c_str() + space, nullptr, 10) * pageSize() + inFiles();
}

std::uint64_t memoryLimit() {
    return limit();
}

void setMemoryLimit(std::uint64_t bytes) {
    limit() = bytes;
}

Result<> mayHold(std::uint64_t more) {
    const std::uint64_t maximum = memoryLimit();
    const auto fits = [&] {
        const std::uint64_t held = heldMemory();
        return held <= maximum && more <= maximum - held;
    };
    if (fits()) return {};
    // The allocator keeps freed memory, and it still counts as ours.
    ::malloc_trim(0);
    if (fits()) return {};
    return fail("the process would hold more than " + std::to_string(maximum) +
                " bytes; --limit memory=N raises this if there is so much");
}

}  // namespace rtsg
