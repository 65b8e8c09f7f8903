#include "bench.h"

#include <algorithm>
#include <ctime>

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
double wallSeconds() {
    return clockSeconds(CLOCK_MONOTONIC);
}

double median(std::vector<double> values) {
    if (values.empty()) return 0;
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

}  // namespace rtsg::bench
