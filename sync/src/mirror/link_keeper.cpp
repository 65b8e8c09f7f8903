// The thread that reads for clients that do not look; it is there while there are connections.
#include "link_keeper.h"

#include <chrono>
#include <system_error>

#include "zmtp_link.h"

namespace rtsg {

namespace {

constexpr std::chrono::milliseconds kRound{100};

}  // namespace

LinkKeeper& LinkKeeper::ofProgram() {
    static LinkKeeper keeper;
    return keeper;
}

void LinkKeeper::add(ZmtpLink& link) {
    const std::scoped_lock lock(mutex_);
    links_.insert(&link);
    if (thread_.joinable()) return;
    try {
        thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
    } catch (const std::system_error&) {
        return;  // no more threads: clients get what the system keeps for them
    }
}

void LinkKeeper::remove(ZmtpLink& link) {
    std::jthread last;  // ends behind the lock, which it takes itself
    const std::scoped_lock lock(mutex_);
    links_.erase(&link);
    if (links_.empty()) last.swap(thread_);
}

void LinkKeeper::run(const std::stop_token& stop) {
    std::unique_lock lock(mutex_);
    while (!stop.stop_requested()) {
        wake_.wait_for(lock, stop, kRound, [] { return false; });
        if (stop.stop_requested()) return;
        for (ZmtpLink* link : links_) link->keep(ZmtpLink::Clock::now());
    }
}

}  // namespace rtsg
