// Hands out parts by a word for each, which says in which turn it was taken last.
#include "thread_team.h"

#include <system_error>
#include <utility>

namespace rtsg {

namespace {

void pause() {
#if defined(__x86_64__) || defined(__i386__)
    __builtin_ia32_pause();
#else
    std::this_thread::yield();
#endif
}

constexpr int kLooks = 2000, kLooksAttending = 100'000;

}  // namespace

ThreadTeam::ThreadTeam(unsigned threads)
    : parts_(2 * threads), taken_(std::make_unique<std::atomic<std::uint32_t>[]>(std::size_t{2} * threads)) {
    try {
        for (unsigned i = 1; i < threads; ++i) helpers_.emplace_back([this, i] { help(i); });
    } catch (const std::system_error&) {
        return;  // there are as many as there may be; the caller alone is enough
    }
}

ThreadTeam::~ThreadTeam() {
    stop_.store(true);
    round_.fetch_add(1);
    call();
    for (std::thread& helper : helpers_) helper.join();
}

/// One that is late, in a turn that is over, finds nothing: all its parts have been taken.
void ThreadTeam::takeParts(std::uint32_t round, unsigned number) {
    // Each begins elsewhere, and at the same part every time: its data may still be in its cache.
    for (unsigned i = 0; i < parts_; ++i) {
        const unsigned part = (2 * number + i) % parts_;
        std::uint32_t last = round - 1;
        if (!taken_[part].compare_exchange_strong(last, round, std::memory_order_acq_rel)) continue;
        try {
            job_(what_, part);
        } catch (...) {
            if (!failed_.exchange(true)) failure_ = std::current_exception();
        }
        left_.fetch_sub(1, std::memory_order_acq_rel);
    }
}

void ThreadTeam::call() {
    calls_.fetch_add(1, std::memory_order_release);
    calls_.notify_all();
}

void ThreadTeam::attend() {
    attending_.store(true, std::memory_order_relaxed);
    call();
}

std::uint32_t ThreadTeam::awaitNext(std::uint32_t seen) const {
    for (;;) {
        // Before the turn is looked at: a call that comes with a new one, after this, ends the sleep before it begins.
        const std::uint32_t calls = calls_.load(std::memory_order_acquire);
        for (int i = 0; i < (attending_.load(std::memory_order_relaxed) ? kLooksAttending : kLooks); ++i) {
            if (const std::uint32_t round = round_.load(std::memory_order_acquire); round != seen) return round;
            pause();
        }
        calls_.wait(calls, std::memory_order_acquire);
    }
}

void ThreadTeam::help(unsigned number) {
    for (std::uint32_t seen = 0;;) {
        seen = awaitNext(seen);
        if (stop_.load()) return;
        takeParts(seen, number);
    }
}

void ThreadTeam::runPlain(PlainJob job, const void* what) {
    job_ = job;
    what_ = what;
    left_.store(parts_, std::memory_order_relaxed);
    const std::uint32_t round = round_.load(std::memory_order_relaxed) + 1;
    round_.store(round, std::memory_order_release);
    call();
    takeParts(round, 0);
    for (int looks = 0; left_.load(std::memory_order_acquire) != 0; ++looks)
        if (looks < kLooks)
            pause();
        else
            std::this_thread::yield();
    if (failed_.exchange(false)) std::rethrow_exception(std::exchange(failure_, nullptr));
}

}  // namespace rtsg
