// Worker: a thread with a name, and the jobs that it runs one after another.
//
// Invariant: jobs run one at a time, in the order in which they came. An exception of a job ends that job only, and
// failure() reports the first one. A job that may run when its owner is gone owns or shares all that it uses.
// Threading: stops(), pause() and Job's members on any thread; all else on one thread at a time. The destructor may run
// within a job: then nobody waits for that job.
#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <source_location>
#include <string_view>

#include <rtsg/core/diagnostic.h>

namespace rtsg {

class Worker {
  public:
    class Job {
      public:
        /// Whether the job is done, or never will be; its results may be read once this is true.
        bool done() const { return done_.load(std::memory_order_acquire); }
        /// Once it is done: an exception has ended it, or it was dropped before it began.
        bool failed() const { return failed_; }

      private:
        friend class Worker;
        std::function<void()> run_;
        std::atomic<bool> done_{false};
        bool failed_ = false;
        bool alwaysBegins_ = false;
    };

    /// The first 15 bytes of `name` are what the system shows of the thread, which starts with the first job.
    explicit Worker(std::string_view name, bool threaded = true);
    /// As stop().
    ~Worker();
    Worker(const Worker&) = delete;
    Worker& operator=(const Worker&) = delete;

    /// Puts a job behind the others. Without a thread, or if the system has no more, it runs when somebody waits for
    /// it. After stop() it is dropped.
    std::shared_ptr<const Job> start(std::function<void()> run);
    /// As start(), and drops the jobs that have not begun.
    std::shared_ptr<const Job> startInstead(std::function<void()> run);
    /// As start(), for a job that has to have a thread, such as one that lasts until stops(). It is not dropped, unless
    /// it comes after stop(): it begins, and sees that it is to end. stop() calls `wake`, so that the job looks. Throws
    /// std::system_error if the system has no more threads.
    std::shared_ptr<const Job> run(std::function<void()> body, std::function<void()> wake = {});
    /// Returns once the job is done, or dropped.
    void wait(const Job& job);
    /// Waits for all jobs.
    void finish();
    /// Drops the jobs of start() that have not begun, asks the others to end, and waits for them. Nothing runs any
    /// more.
    void stop();
    /// No job is under way, and none waits.
    bool idle() const;
    /// What `what` ended by, if a job has thrown: "WHAT: REASON".
    Result<> failure(std::string_view what, std::source_location reporter = std::source_location::current()) const;

    /// For jobs: whether they are to end soon.
    bool stops() const;
    /// For jobs: waits so long, or until they are to end. Returns false if they are.
    bool pause(std::chrono::steady_clock::duration time) const;

  private:
    struct State;
    std::shared_ptr<const Job> add(std::function<void()> run, bool instead, bool alwaysBegins);
    std::shared_ptr<State> state_;  // shared with the thread
};

}  // namespace rtsg
