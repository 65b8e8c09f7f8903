// The JavaScript context of one thread, its clockwork that stops runaway programs, and what is running in it now.
//
// SpiderMonkey allows one context a thread and insists that it is used and destroyed there; engines of several scenes
// on one thread share it. Threading: everything on the thread that made it, but for the watch.
#pragma once

#include <atomic>
#include <condition_variable>
#include <mutex>
#include <thread>
#include <unordered_map>

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
    JS::HandleObject global;
    NodeId self;                                 // the Script
    const std::vector<NodeId>* loose = nullptr;  // while what variables hold is looked for: of these, sorted
};

class Runtime {
  public:
    /// The calling thread's; null if SpiderMonkey refuses to start.
    static std::shared_ptr<Runtime> ofThisThread(std::size_t heapLimit);
    /// Why it is null.
    static std::string whyNone();
    ~Runtime();
    Runtime(const Runtime&) = delete;
    Runtime& operator=(const Runtime&) = delete;

    JSContext* context() const { return context_; }
    bool onOwnThread() const { return std::this_thread::get_id() == thread_; }
    Call* current = nullptr;
    int depth = 0;

    /// From here on the running program has `seconds`. False, and none may run, once the process ends.
    bool startWatch(double seconds);
    /// Nanoseconds since then, by the wall's clock, at `now` of steadyNow().
    std::int64_t stopWatch(std::int64_t now);
    /// Whether a program runs. Any thread may ask.
    bool isRunning() const { return deadline_ != 0; }
    /// The process is in exit(), and the library has been ended or is about to be.
    static bool hasEnded();
    enum class Excess { none, time, memory, process };
    /// Why the watch had to stop the last program; asking forgets it.
    Excess takeExcess() { return std::exchange(excess_, Excess::none); }
    /// Whether programs that take `more` bytes stay within the limit, if need be after a collection.
    bool hasRoomFor(std::size_t more);
    /// False, with the excess noted, if they are beyond it at `now`, or were a little before.
    bool withinMemory(std::int64_t now);

    /// A global object for a program, with the prelude's names in it; `self` is its Script. Null without memory.
    JSObject* newGlobal(NodeId self);
    /// The controller of a program (prelude.js): functions that call into it. Null with an exception pending.
    /// Precondition: a call of this program is current.
    JSObject* newController(JS::HandleObject global);
    /// Compiles a program, once for all that have the same text, and runs it in the current realm. False with an
    /// exception pending.
    bool run(const std::string& source);
    /// The prelude's own realm, in whose compartment those of programs are.
    JSObject* library() const { return *library_; }
    /// The name of something in a program's global object: defined if it is the prelude's, fenced in if need be.
    static bool onResolve(JSContext* cx, JS::HandleObject global, JS::HandleId id, bool* resolved);
    /// Slots of a program's global object: its controller, the Script's number, and the fields that the call has
    /// touched (prelude.js).
    static constexpr std::uint32_t kControllerSlot = 0, kSelfSlot = 1, kTouchedSlot = 2;

    /// A whole collection, after which only what programs can still get at is there. Precondition: none runs.
    void collect();

    Jobs& jobs() { return *jobs_; }

  private:
    Runtime() = default;
    bool start(std::size_t heapLimit);
    bool startLibrary();
    bool evaluateOwn(const char* name, std::string_view source, JS::HandleValue bridge, JS::MutableHandleObject result);
    bool putUpFence(JS::HandleObject global, JS::HandleId id);
    void watch(const std::stop_token& stop);
    static bool onInterrupt(JSContext* cx);

    JSContext* context_ = nullptr;
    std::thread::id thread_ = std::this_thread::get_id();
    std::atomic<std::int64_t> deadline_ = 0;   // steady clock's nanoseconds; 0: nothing runs
    std::int64_t limit_ = 0, firstLook_ = -1;  // of the call that runs, and its thread's time; nanoseconds
    std::size_t heapLimit_ = 0;
    Excess excess_ = Excess::none;
    std::unique_ptr<Jobs> jobs_;
    std::unique_ptr<JS::PersistentRootedObject> library_;  // the global object of its realm
    std::unique_ptr<JS::PersistentRootedObject> prelude_, names_, fences_, fenced_;
    std::unordered_map<std::string, RefPtr<JS::Stencil>> compiled_;
    std::size_t compiledBytes_ = 0;  // of their texts
    std::unique_ptr<Memory> memory_;
    std::mutex mutex_;
    std::condition_variable_any wakeUp_;
    std::atomic<bool> watcherSleeps_ = false;  // until it is woken; else it looks by itself every now and then
    std::jthread watcher_;
};

/// The scene's functions as a script's prelude calls them, as properties of one object. Null when memory runs out.
JSObject* newBridge(JSContext* cx);

}  // namespace rtsg::script
