// The system's steady clock, and one that goes on as it is told.
#include "clock.h"

#include <algorithm>
#include <ctime>

#include <poll.h>

namespace rtsg {

namespace {

class SteadyClock : public Clock {
  public:
    time_point now() const override { return std::chrono::steady_clock::now(); }
    int wait(std::span<pollfd> items, duration maximum) override {
        const auto whole = std::chrono::floor<std::chrono::seconds>(std::max(maximum, duration::zero()));
        const auto rest = std::chrono::nanoseconds(std::max(maximum, duration::zero()) - whole);
        const timespec time = {static_cast<std::time_t>(whole.count()), static_cast<long>(rest.count())};
        return ::ppoll(items.data(), items.size(), &time, nullptr);
    }
    bool isStepped() const override { return false; }
};

}  // namespace

Clock& steadyClock() {
    static SteadyClock clock;
    return clock;
}

int VirtualClock::wait(std::span<pollfd> items, duration maximum) {
    const int ready = ::poll(items.data(), items.size(), 0);
    if (ready == 0) advance(maximum);
    return ready;
}

}  // namespace rtsg
