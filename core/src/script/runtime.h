// The JavaScript context of one thread, its clockwork that stops runaway programs, and what is running in it now.
//
// SpiderMonkey allows one context a thread and insists that it is used and destroyed there; engines of several scenes
// on one thread share it. Threading: everything on the thread that made it, but for the watch.
#pragma once

#include <atomic>
#include <condition_variable>
#include <mutex>
#include <thread>

#include <rtsg/core/behaviour.h>

#include "jobs.h"
#include "memory.h"

namespace rtsg::script {

/// One call into a program; the natives find the scene through it.
struct Call {
    Scene& scene;
    Cascade* cascade;  // null: nothing may be changed (shutdown)
    const ScriptOptions& options;
    double now;
};

class Runtime {
  public:
    /// The calling thread's; null if SpiderMonkey refuses to start.
    static std::shared_ptr<Runtime> ofThisThread(std::size_t heapLimit);
    ~Runtime();
    Runtime(const Runtime&) = delete;
    Runtime& operator=(const Runtime&) = delete;

    JSContext* context() const { return context_; }
    bool onOwnThread() const { return std::this_thread::get_id() == thread_; }
    Call* current = nullptr;
    int depth = 0;

    /// From here on the running program has `seconds`.
    void startWatch(double seconds);
    void stopWatch();
    enum class Excess { none, time, memory };
    /// Why the watch had to stop the last program; asking forgets it.
    Excess takeExcess() { return std::exchange(excess_, Excess::none); }
    /// Whether programs that take `more` bytes stay within the limit, if need be after a collection.
    bool hasRoomFor(std::size_t more);
    /// False, with the excess noted, if they are beyond it now.
    bool withinMemory();

    /// Evaluates one of our own libraries in the current realm; it is parsed once a context, whatever the number of
    /// realms. False with an exception pending.
    enum class Library { prelude, fences };
    bool evaluate(Library library, JS::MutableHandleValue result);

    /// An empty global object, in whose compartment those of programs are made.
    JSObject* anchor() const { return *anchor_; }

    Jobs& jobs() { return *jobs_; }

  private:
    Runtime() = default;
    bool start(std::size_t heapLimit);
    void watch(const std::stop_token& stop);
    static bool onInterrupt(JSContext* cx);

    JSContext* context_ = nullptr;
    std::thread::id thread_ = std::this_thread::get_id();
    std::atomic<std::int64_t> deadline_ = 0;  // steady clock's nanoseconds; 0: nothing runs
    std::size_t heapLimit_ = 0;
    Excess excess_ = Excess::none;
    std::unique_ptr<Jobs> jobs_;
    RefPtr<JS::Stencil> libraries_[2];
    std::unique_ptr<JS::PersistentRootedObject> anchor_;
    std::unique_ptr<Memory> memory_;
    std::mutex mutex_;
    std::condition_variable_any wakeUp_;
    std::atomic<bool> watcherSleeps_ = false;  // until it is woken; else it looks by itself every now and then
    std::jthread watcher_;
};

/// The scene's functions as a script's prelude calls them, as properties of one object. Null when memory runs out.
JSObject* newBridge(JSContext* cx);

}  // namespace rtsg::script
