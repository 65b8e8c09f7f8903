// Crew: threads that stand by to run the parts of a job beside the one that has it.
//
// Each part is run once, by whoever gets to it first: with no helper awake, the caller runs them all, so a machine that
// is busy elsewhere costs little. Helpers look out for the next job for some fifty microseconds before they sleep, and
// for a millisecond or two between attend() and dismiss(). Threading: run(), attend(), dismiss() and the destructor on
// one thread; parts on any.
#pragma once

#include <atomic>
#include <cstdint>
#include <exception>
#include <memory>
#include <thread>
#include <vector>

namespace rtsg {

class ThreadTeam {
  public:
    /// The caller's thread among them; `threads` >= 2. Fewer, where the system has no more.
    explicit ThreadTeam(unsigned threads);
    ~ThreadTeam();
    ThreadTeam(const ThreadTeam&) = delete;
    ThreadTeam& operator=(const ThreadTeam&) = delete;

    unsigned threads() const { return static_cast<unsigned>(helpers_.size()) + 1; }
    /// More than threads, so that one that begins late takes less.
    unsigned parts() const { return parts_; }
    /// Jobs will come soon, one after the other, with work of the caller's own in between: helpers wake, and stay
    /// awake.
    void attend();
    void dismiss() { attending_.store(false, std::memory_order_relaxed); }
    /// Calls job(part) for every part. Returns when all have ended, or throws what one of them threw.
    template <class Job>
    void run(const Job& job) {
        runPlain([](const void* what, unsigned part) { (*static_cast<const Job*>(what))(part); }, &job);
    }

  private:
    using PlainJob = void (*)(const void*, unsigned);
    void runPlain(PlainJob job, const void* what);
    void help(unsigned number);
    void call();
    /// Looks out for a turn after `seen`; asleep, once it has for long enough.
    std::uint32_t awaitNext(std::uint32_t seen) const;
    void takeParts(std::uint32_t round, unsigned number);

    unsigned parts_;
    PlainJob job_ = nullptr;
    const void* what_ = nullptr;
    std::exception_ptr failure_;
    std::atomic<bool> failed_{false};
    std::atomic<std::uint32_t> round_{0};  // one more with every job
    std::atomic<std::uint32_t> calls_{0};  // one more whenever sleepers are to look again
    std::atomic<unsigned> left_{0};        // parts that have not come to an end
    std::atomic<bool> stop_{false}, attending_{false};
    std::unique_ptr<std::atomic<std::uint32_t>[]> taken_;  // by part: the last turn in which somebody took it
    std::vector<std::thread> helpers_;
};

}  // namespace rtsg
