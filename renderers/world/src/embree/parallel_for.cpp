// Parallel loops on oneTBB, with their start and end told to ThreadSanitizer.
#include "rtsg/renderers/parallel_for.h"

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>

#include <rtsg/core/module.h>

#if defined(RTSG_NOTIFY_TSAN)
#include <sanitizer/tsan_interface.h>
#endif

namespace rtsg::delayed {
extern DelayedLibrary tbb;
}

namespace rtsg {
namespace {

// The packaged oneTBB is not instrumented: ThreadSanitizer sees neither that writes before a loop are visible in its
// iterations, nor that these have ended when the loop returns. These two calls tell it so; in other builds they cost
// nothing.
#if defined(RTSG_NOTIFY_TSAN)
void notifyReached(const char& point) {
    __tsan_release(const_cast<char*>(&point));
}
void notifySeen(const char& point) {
    __tsan_acquire(const_cast<char*>(&point));
}
#else
void notifyReached(const char&) {}
void notifySeen(const char&) {}
#endif

/// The start and the end of a loop, or of work that another thread may take over.
class Section {
  public:
    Section() { notifyReached(start_); }
    ~Section() { notifySeen(end_); }
    Section(const Section&) = delete;
    Section& operator=(const Section&) = delete;

    /// One call within it.
    class Part {
      public:
        explicit Part(const Section& section) : section_(section) { notifySeen(section_.start_); }
        ~Part() { notifyReached(section_.end_); }
        Part(const Part&) = delete;
        Part& operator=(const Part&) = delete;

      private:
        const Section& section_;
    };

  private:
    char start_ = 0;
    char end_ = 0;
};

/// Without it one thread does all.
bool hasLibrary() {
    return delayed::tbb.load().has_value() && !delayed::tbb.hasEnded();
}

}  // namespace

unsigned availableThreads() {
    if (!hasLibrary()) return 1;
    return static_cast<unsigned>(std::max(1, tbb::this_task_arena::max_concurrency()));
}

void parallelFor(std::size_t count, const std::function<void(std::size_t)>& body) {
    if (!hasLibrary()) {
        for (std::size_t i = 0; i < count; ++i) body(i);
        return;
    }
    const Section loop;
    tbb::parallel_for(std::size_t{0}, count, [&](std::size_t i) {
        const Section::Part iteration(loop);
        body(i);
    });
}

void withThreads(unsigned threads, const std::function<void()>& work) {
    if (!hasLibrary()) return work();
    // No more than there are: oneTBB would only warn.
    const unsigned available = availableThreads();
    tbb::task_arena arena(static_cast<int>(threads == 0 ? available : std::min(threads, available)));
    const Section section;
    arena.execute([&] {
        const Section::Part whole(section);
        work();
    });
}

void apart(const std::function<void()>& work) {
    if (!hasLibrary()) return work();
    tbb::this_task_arena::isolate([&] { work(); });
}

}  // namespace rtsg
