// Worker: a thread for work that may take longer than a frame, such as building a BVH anew.
//
// Invariant: jobs run one at a time, in the order in which they came. A job may outlive the object that started it, so
// it must own or share all that it uses. Exceptions of a job are caught: the job counts as done and failed.
// Threading: start(), wait() and the destructor on one thread; Job's members on any.
#pragma once

#include <atomic>
#include <condition_variable>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <thread>

namespace rtsg {

class Worker {
  public:
    class Job {
      public:
        /// Whether the job is done; its results may be read once this is true.
        bool done() const { return done_.load(std::memory_order_acquire); }
        bool failed() const { return failed_; }

      private:
        friend class Worker;
        std::function<void()> run_;
        std::atomic<bool> done_{false};
        bool failed_ = false;
    };

    /// Without a thread, or if the system has no more threads, a job runs when somebody waits for it.
    explicit Worker(bool threaded = true) : threaded_(threaded) {}
    /// Waits for the job under way; those behind it never run.
    ~Worker();
    Worker(const Worker&) = delete;
    Worker& operator=(const Worker&) = delete;

    std::shared_ptr<const Job> start(std::function<void()> run);
    void wait(const Job& job);

  private:
    void loop();
    void runFirst(std::unique_lock<std::mutex>& lock);

    bool threaded_;
    std::mutex mutex_;
    std::condition_variable wake_, finished_;
    std::deque<std::shared_ptr<Job>> queue_;
    bool stop_ = false;
    std::thread thread_;  // started with the first job
};

}  // namespace rtsg
