// LogThread: what those have in common that write a log on a thread of their own, for a scene that does not wait.
//
// Invariant: once the thread has ended, whatever it ended by, `ended` is true and nobody waits for a state any more. A
// log that ends early gets no index, so readers can tell. Threading: as the members say.
#pragma once

#include <atomic>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <functional>
#include <limits>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

#include <fmt/format.h>

#include <rtsg/core/worker.h>
#include <rtsg/sync/log.h>

namespace rtsg {

struct LogThread {
    using Acknowledged = std::function<void(std::uint64_t start, std::uint64_t state)>;
    virtual ~LogThread() = default;

    std::string file;
    std::unique_ptr<LogWriter> log;  // used by the thread only
    std::atomic<bool> ended{false};
    std::atomic<std::uint64_t> acknowledged{0}, merged{0}, bytes{0};
    mutable std::mutex mutex;  // guards the next four
    std::uint64_t starts = 0;  // how often the scene in the file has started over
    Acknowledged heard;
    Result<> result;
    char thrown[160] = {};  // the thread's exception: there may be no memory for a string

    /// On the thread: writes until the worker stops or something goes wrong.
    virtual Result<> follow() = 0;
    /// On the thread, before the log is closed: nothing more reaches it.
    virtual void detach() {}
    /// On the thread, once the log is closed or abandoned, and before `ended` is true.
    virtual void release() {}
    /// On the thread, with `mutex` held, when `ended` is true: wakes those who wait.
    virtual void afterEnd() = 0;

    /// The result of the thread, whether it has ended or still runs.
    Result<> outcome() const {
        const std::scoped_lock lock(mutex);
        if (!thrown[0]) return result;
        return fail(fmt::format("the recorder's thread has ended: {}", thrown), {}, file);
    }
    std::string failure() const {
        const Result<> how = outcome();
        return how ? "" : how.error().format();
    }
    /// With `mutex` held: reports to those who wait for states that will never be in the file.
    void reportEnd() const {
        constexpr std::uint64_t kAny = std::numeric_limits<std::uint64_t>::max();
        if (heard) heard(kAny, kAny);
    }
    void run() {
        Result<> how;
        char why[sizeof(thrown)] = {};
        try {
            how = follow();
            detach();
            if (how)
                how = log->close();
            else
                log->abandon();
        } catch (const std::exception& e) {
            std::snprintf(why, sizeof(why), "%s", e.what());
            log->abandon();
        }
        release();
        const std::scoped_lock lock(mutex);
        std::snprintf(thrown, sizeof(thrown), "%s", why);
        result = std::move(how);
        bytes = log->bytes();
        ended = true;
        reportEnd();
        afterEnd();
    }
};

}  // namespace rtsg
