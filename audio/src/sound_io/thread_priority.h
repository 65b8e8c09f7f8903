// ThreadPriority: sets the priority of the calling thread for a scope, as far as the system allows.
//
// Work with deadlines goes first: with real-time priority if that is permitted, otherwise with the best nice value. If
// the system first divides its cores among sessions, only the former keeps sound from waiting for other threads of its
// own program. Threading: one thread.
#pragma once

#include <sched.h>
#include <sys/resource.h>

#include <cstdint>

namespace rtsg {

class ThreadPriority {
  public:
    /// soonWithThreads: threads that are started meanwhile have it too, and keep it. Else they have the usual one.
    enum class Kind : std::uint8_t { usual, soon, soonWithThreads };

    explicit ThreadPriority(Kind kind) : nice_(::getpriority(PRIO_PROCESS, 0)), policy_(::sched_getscheduler(0)) {
        ::sched_getparam(0, &parameter_);
        set(kind);
    }
    ~ThreadPriority() {
        ::sched_setscheduler(0, policy_, &parameter_);
        static_cast<void>(::setpriority(PRIO_PROCESS, 0, nice_));
    }
    ThreadPriority(const ThreadPriority&) = delete;
    ThreadPriority& operator=(const ThreadPriority&) = delete;

    static void set(Kind kind) {
        sched_param parameter{};
        // Linux takes a thread's priority for that of a process whose number is 0.
        if (kind == Kind::usual) {
            ::sched_setscheduler(0, SCHED_OTHER, &parameter);
            static_cast<void>(::setpriority(PRIO_PROCESS, 0, 0));
            return;
        }
        parameter.sched_priority = 1;
        if (::sched_setscheduler(0, kind == Kind::soon ? SCHED_RR | SCHED_RESET_ON_FORK : SCHED_RR, &parameter) == 0)
            return;
        constexpr int kNice = -11;
        static_cast<void>(::setpriority(PRIO_PROCESS, 0, kNice));
    }

  private:
    int nice_, policy_;
    sched_param parameter_{};
};

}  // namespace rtsg
