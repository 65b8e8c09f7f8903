// Counts the work that goes on without the interpreter's lock.
#include "unlocked.h"

#include <atomic>

#include "errors.h"

namespace py = pybind11;

namespace rtsg::python {

namespace {
std::atomic<bool> ending = false;
std::atomic<int> underway = 0;
constexpr std::chrono::milliseconds kLook{50};
constexpr int kPatience = 500;  // of 10 ms
}  // namespace

Unlocked::Unlocked() {
    if (ending) raise(DiagnosticCode("application"), "the interpreter ends", "Closed");
    ++underway;
    released_.emplace();
}

Unlocked::~Unlocked() {
    released_.reset();
    --underway;
}

bool Interruption::operator()() {
    if (ending) return true;
    if (std::this_thread::get_id() != caller_) return false;
    if (raised_) return true;
    const auto now = std::chrono::steady_clock::now();
    if (now - looked_ < kLook) return false;
    looked_ = now;
    const py::gil_scoped_acquire lock;
    raised_ = PyErr_CheckSignals() != 0;
    return raised_;
}

void Interruption::raise() const {
    if (PyErr_Occurred() || PyErr_CheckSignals() != 0) throw py::error_already_set();
    if (ending) python::raise(DiagnosticCode("application"), "the interpreter ends", "Closed");
}

bool mayWork() {
    return !ending;
}

void endWork() {
    ending = true;
    const py::gil_scoped_release without;
    for (int i = 0; i < kPatience && underway > 0; ++i) std::this_thread::sleep_for(std::chrono::milliseconds(10));
}

}  // namespace rtsg::python
