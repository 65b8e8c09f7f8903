// Clocks and medians for all benches, and the bare baselines that several share.
#include "bench.h"

#include <algorithm>
#include <charconv>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <sstream>

#include <malloc.h>
#include <unistd.h>

namespace rtsg::bench {

namespace {

double clockSeconds(clockid_t clock) {
    timespec t{};
    clock_gettime(clock, &t);
    return static_cast<double>(t.tv_sec) + static_cast<double>(t.tv_nsec) * 1e-9;
}

}  // namespace

double cpuSeconds() {
    return clockSeconds(CLOCK_PROCESS_CPUTIME_ID);
}
double threadSeconds() {
    return clockSeconds(CLOCK_THREAD_CPUTIME_ID);
}
double stolenSeconds() {
    // "cpu", then user, nice, system, idle, iowait, irq, softirq, steal in ticks (proc(5)).
    std::ifstream file("/proc/stat");
    std::string name;
    double ticks = 0;
    file >> name;
    for (int i = 0; i < 8; ++i) file >> ticks;
    return file ? ticks / static_cast<double>(::sysconf(_SC_CLK_TCK)) : 0;
}
bool isInstalled(const std::string& program) {
    const char* path = std::getenv("PATH");
    std::istringstream folders(path ? path : "");
    for (std::string folder; std::getline(folders, folder, ':');)
        if (::access((folder + '/' + program).c_str(), X_OK) == 0) return true;
    return false;
}

double wallSeconds() {
    return clockSeconds(CLOCK_MONOTONIC);
}

double residentBytes() {
    malloc_trim(0);
    std::ifstream in("/proc/self/statm");
    double total = 0, resident = 0;
    in >> total >> resident;
    return resident * static_cast<double>(sysconf(_SC_PAGESIZE));
}

double median(std::vector<double> values) {
    if (values.empty()) return 0;
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

double cpuClockSeconds() {
    static const double cost = [] {
        std::vector<double> times;
        for (int i = 0; i < 1000; ++i) {
            const double start = cpuSeconds();
            times.push_back(cpuSeconds() - start);
        }
        return median(times);
    }();
    return cost;
}

double fromCharsSeconds(const std::string& text) {
    const double start = cpuSeconds();
    const char *p = text.data(), *end = p + text.size();
    double sum = 0;
    while (p < end) {
        float value = 0;
        const auto result = std::from_chars(p, end, value);
        if (result.ec == std::errc()) {
            sum += static_cast<double>(value);
            p = result.ptr;
        } else {
            ++p;
        }
    }
    keep(sum);
    return cpuSeconds() - start;
}

}  // namespace rtsg::bench
