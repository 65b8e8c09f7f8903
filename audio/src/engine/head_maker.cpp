// A thread that makes the head that was asked for last.
#include "head_maker.h"

#include <new>
#include <utility>

#include "sound_io/thread_priority.h"

namespace rtsg {

HeadMaker::HeadMaker(int sampleRate) : sampleRate_(sampleRate), thread_([this] { run(); }) {}

HeadMaker::~HeadMaker() {
    {
        const std::lock_guard lock(mutex_);
        stop_ = true;
    }
    wake_.notify_one();
    thread_.join();
}

void HeadMaker::ask(const Size& size) {
    {
        const std::lock_guard lock(mutex_);
        asked_ = size;
    }
    wake_.notify_one();
}

std::optional<HeadMaker::Created> HeadMaker::take() {
    const std::lock_guard lock(mutex_);
    return std::exchange(created_, std::nullopt);
}

void HeadMaker::run() {
    const ThreadPriority usual(ThreadPriority::Kind::usual);  // whoever started it
    for (;;) {
        Size size;
        {
            std::unique_lock lock(mutex_);
            wake_.wait(lock, [&] { return stop_ || asked_; });
            if (stop_) return;
            size = *std::exchange(asked_, std::nullopt);
        }
        Created created{size, nullptr};
        try {
            created.head = Hrtf::sphere(sampleRate_, size.radius, size.speedOfSound);
        } catch (const std::bad_alloc&) {
            created.head = nullptr;  // the one that there is goes on
        }
        const std::lock_guard lock(mutex_);
        created_ = std::move(created);
    }
}

}  // namespace rtsg
