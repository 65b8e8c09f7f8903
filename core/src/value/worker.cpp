// Runs jobs one after another, on a thread that starts with the first.
#include <rtsg/core/worker.h>

#include <algorithm>
#include <condition_variable>
#include <cstdio>
#include <deque>
#include <exception>
#include <mutex>
#include <string>
#include <system_error>
#include <thread>
#include <utility>

#include <fmt/format.h>
#include <pthread.h>

namespace rtsg {

struct Worker::State {
    std::string name;
    std::atomic<bool> stops{false};
    mutable std::mutex mutex;  // guards the rest
    std::condition_variable wake, finished;
    std::deque<std::shared_ptr<Job>> queue;
    bool threaded = true, isBusy = false;
    char thrown[160] = {};  // the first exception: there may be no memory for a string
    // The owner's own.
    std::function<void()> wakeJob;
    std::thread thread;

    /// With `mutex` held: the job never runs.
    void drop(Job& job) {
        job.failed_ = true;
        job.done_.store(true, std::memory_order_release);
        finished.notify_all();
    }
    /// What a job shares goes without `mutex`, since that may be what holds the worker.
    void dropWaiting(std::unique_lock<std::mutex>& lock) {
        for (;;) {
            const auto found = std::ranges::find_if(queue, [](const auto& job) { return !job->alwaysBegins_; });
            if (found == queue.end()) return;
            const std::shared_ptr<Job> job = std::move(*found);
            queue.erase(found);
            drop(*job);
            lock.unlock();
            job->run_ = nullptr;
            lock.lock();
        }
    }

    void runFirst(std::unique_lock<std::mutex>& lock) {
        const std::shared_ptr<Job> job = std::move(queue.front());
        queue.pop_front();
        isBusy = true;
        lock.unlock();
        char why[sizeof(thrown)] = {};
        try {
            job->run_();
        } catch (const std::exception& e) {
            std::snprintf(why, sizeof(why), "%s", e.what());
            job->failed_ = true;
        } catch (...) {
            std::snprintf(why, sizeof(why), "an exception without a text");
            job->failed_ = true;
        }
        job->run_ = nullptr;  // the objects that it shared go with it
        lock.lock();
        if (job->failed_ && !thrown[0]) std::snprintf(thrown, sizeof(thrown), "%s", why);
        isBusy = false;
        job->done_.store(true, std::memory_order_release);
        finished.notify_all();
    }

    void loop() {
        ::pthread_setname_np(::pthread_self(), name.c_str());
        std::unique_lock lock(mutex);
        for (;;) {
            wake.wait(lock, [this] { return stops || !queue.empty(); });
            if (stops) dropWaiting(lock);  // while stop() does
            if (queue.empty()) return;
            runFirst(lock);
        }
    }
};

Worker::Worker(std::string_view name, bool threaded) : state_(std::make_shared<State>()) {
    state_->name = name.substr(0, 15);
    state_->threaded = threaded;
}

Worker::~Worker() {
    stop();
}

std::shared_ptr<const Worker::Job> Worker::add(std::function<void()> run, bool instead, bool alwaysBegins) {
    State& s = *state_;
    auto job = std::make_shared<Job>();
    job->alwaysBegins_ = alwaysBegins;
    {
        std::unique_lock lock(s.mutex);
        if (s.stops) {
            s.drop(*job);
            return job;
        }
        if (instead) s.dropWaiting(lock);
        if ((s.threaded || alwaysBegins) && !s.thread.joinable()) try {
                s.thread = std::thread([state = state_] { state->loop(); });
            } catch (const std::system_error&) {
                if (alwaysBegins) throw;
                s.threaded = false;
            }
        job->run_ = std::move(run);
        s.queue.push_back(job);
    }
    s.wake.notify_all();
    return job;
}

std::shared_ptr<const Worker::Job> Worker::start(std::function<void()> run) {
    return add(std::move(run), false, false);
}

std::shared_ptr<const Worker::Job> Worker::startInstead(std::function<void()> run) {
    return add(std::move(run), true, false);
}

std::shared_ptr<const Worker::Job> Worker::run(std::function<void()> body, std::function<void()> wake) {
    if (wake) state_->wakeJob = std::move(wake);
    return add(std::move(body), false, true);
}

void Worker::wait(const Job& job) {
    State& s = *state_;
    std::unique_lock lock(s.mutex);
    if (!s.threaded)
        while (!job.done() && !s.queue.empty()) s.runFirst(lock);
    s.finished.wait(lock, [&] { return job.done(); });
}

void Worker::finish() {
    State& s = *state_;
    std::unique_lock lock(s.mutex);
    if (!s.threaded)
        while (!s.queue.empty()) s.runFirst(lock);
    s.finished.wait(lock, [&] { return s.queue.empty() && !s.isBusy; });
}

void Worker::stop() {
    const std::shared_ptr<State> s = state_;  // a job that is dropped may hold what holds this
    {
        std::unique_lock lock(s->mutex);
        s->stops = true;
        s->dropWaiting(lock);
    }
    s->wake.notify_all();
    if (!s->thread.joinable()) return;
    if (s->wakeJob) s->wakeJob();
    if (s->thread.get_id() == std::this_thread::get_id())
        s->thread.detach();  // it ends with this job
    else
        s->thread.join();
}

bool Worker::idle() const {
    const std::lock_guard lock(state_->mutex);
    return state_->queue.empty() && !state_->isBusy;
}

Result<> Worker::failure(std::string_view what, std::source_location reporter) const {
    const std::lock_guard lock(state_->mutex);
    if (!state_->thrown[0]) return {};
    Diagnostic failure;
    failure.text = fmt::format("{}: {}", what, state_->thrown);
    failure.code = DiagnosticCode::of(reporter);  // that of who asks
    return std::unexpected(std::move(failure));
}

bool Worker::stops() const {
    return state_->stops;
}

bool Worker::pause(std::chrono::steady_clock::duration time) const {
    State& s = *state_;
    std::unique_lock lock(s.mutex);
    return !s.wake.wait_for(lock, time, [&] { return s.stops.load(); });
}

}  // namespace rtsg
