// One thread that runs the work of others, and never ends, since a graphics context cannot be given away.
#include "graphics_thread.h"

#include <exception>

#include <rtsg/core/worker.h>

namespace rtsg {

void onGraphicsThread(const std::function<void()>& work) {
    // It stays: what uses it may come after everything else at the end of a process.
    static auto* const worker = new Worker("rtsg graphics");
    static thread_local bool isOwn = false;
    if (isOwn) return work();
    std::exception_ptr thrown;
    worker->wait(*worker->run([&] {
        isOwn = true;
        try {
            work();
        } catch (...) {
            thrown = std::current_exception();
        }
    }));
    if (thrown) std::rethrow_exception(thrown);
}

}  // namespace rtsg
