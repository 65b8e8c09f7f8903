// One thread that runs the work of others, and never ends, since a graphics context cannot be given away.
#include "graphics_thread.h"

#include <condition_variable>
#include <exception>
#include <mutex>
#include <thread>
#include <utility>

namespace rtsg {

namespace {

class GraphicsThread {
  public:
    GraphicsThread() : thread_([this] { follow(); }) { thread_.detach(); }

    void run(const std::function<void()>& work) {
        if (std::this_thread::get_id() == own_) return work();
        const std::scoped_lock turnLock(round_);
        std::unique_lock lock(mutex_);
        work_ = &work;
        news_.notify_all();
        news_.wait(lock, [this] { return !work_; });
        if (auto thrown = std::exchange(thrown_, nullptr)) std::rethrow_exception(thrown);
    }

  private:
    [[noreturn]] void follow() {
        std::unique_lock lock(mutex_);
        for (;;) {
            news_.wait(lock, [this] { return work_ != nullptr; });
            lock.unlock();
            try {
                (*work_)();
            } catch (...) {
                thrown_ = std::current_exception();
            }
            lock.lock();
            work_ = nullptr;
            news_.notify_all();
        }
    }

    std::mutex round_, mutex_;
    std::condition_variable news_;
    const std::function<void()>* work_ = nullptr;
    std::exception_ptr thrown_;
    std::thread thread_;
    const std::thread::id own_ = thread_.get_id();
};

}  // namespace

void onGraphicsThread(const std::function<void()>& work) {
    // It stays: what uses it may come after everything else at the end of a process.
    static auto* const one = new GraphicsThread;
    one->run(work);
}

}  // namespace rtsg
