// Work without the interpreter's lock, and its end by Ctrl-C or because the interpreter ends.
//
// Invariant: no work of these libraries is under way once endWork() has returned, so that no thread asks for the lock
// of an interpreter that is gone. Threading: Unlocked begins and ends with the lock, on one thread.
#pragma once

#include <pybind11/pybind11.h>

#include <chrono>
#include <optional>
#include <thread>

namespace rtsg::python {

/// While it lives, the thread does not hold the interpreter's lock. Throws when the interpreter is about to end.
class Unlocked {
  public:
    Unlocked();
    ~Unlocked();
    Unlocked(const Unlocked&) = delete;
    Unlocked& operator=(const Unlocked&) = delete;

  private:
    std::optional<pybind11::gil_scoped_release> released_;
};

template <class Work>
auto unlocked(Work&& work) {
    const Unlocked without;
    return work();
}

/// Called now and then by long work, on any thread. Checks for signals on the thread that made this, at most every 50
/// ms; exceptions of their handlers are raised by raise().
class Interruption {
  public:
    /// True: the work is to end.
    bool operator()();
    /// With the lock, after the work.
    void raise() const;

  private:
    const std::thread::id caller_ = std::this_thread::get_id();
    std::chrono::steady_clock::time_point looked_ = std::chrono::steady_clock::now();
    bool raised_ = false;
};

/// Unlocked does not throw yet.
bool mayWork();
/// From now on Unlocked throws; waits for work under way, five seconds at most.
void endWork();

}  // namespace rtsg::python
