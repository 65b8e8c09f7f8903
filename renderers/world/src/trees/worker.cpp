// Runs jobs one after another, on a thread that starts with the first.
#include "worker.h"

#include <system_error>
#include <utility>

namespace rtsg {

Worker::~Worker() {
    {
        const std::lock_guard lock(mutex_);
        stop_ = true;
        for (const auto& job : queue_) job->run_ = nullptr;  // it may share the object that holds the job
        queue_.clear();
    }
    wake_.notify_all();
    if (thread_.joinable()) thread_.join();
}

std::shared_ptr<const Worker::Job> Worker::start(std::function<void()> run) {
    auto job = std::make_shared<Job>();
    job->run_ = std::move(run);
    {
        const std::lock_guard lock(mutex_);
        queue_.push_back(job);
    }
    try {
        if (threaded_ && !thread_.joinable()) thread_ = std::thread([this] { loop(); });
    } catch (const std::system_error&) {
        threaded_ = false;  // the system has no more
    }
    wake_.notify_one();
    return job;
}

void Worker::wait(const Job& job) {
    std::unique_lock lock(mutex_);
    if (!threaded_)
        while (!job.done() && !queue_.empty()) runFirst(lock);
    finished_.wait(lock, [&] { return job.done(); });
}

void Worker::runFirst(std::unique_lock<std::mutex>& lock) {
    const std::shared_ptr<Job> job = std::move(queue_.front());
    queue_.pop_front();
    lock.unlock();
    try {
        job->run_();
    } catch (...) {
        job->failed_ = true;
    }
    job->run_ = nullptr;  // the objects that it shared go with it
    lock.lock();
    job->done_.store(true, std::memory_order_release);
    finished_.notify_all();
}

void Worker::loop() {
    std::unique_lock lock(mutex_);
    for (;;) {
        wake_.wait(lock, [&] { return stop_ || !queue_.empty(); });
        if (stop_) return;
        runFirst(lock);
    }
}

}  // namespace rtsg
