// Makes the head that was asked for last.
#include "head_maker.h"

#include <new>
#include <utility>

#include "sound_io/thread_priority.h"

namespace rtsg {

void HeadMaker::ask(const Size& size) {
    worker_.startInstead([this, size] {
        const ThreadPriority usual(ThreadPriority::Kind::usual);  // whoever started it
        Created created{size, nullptr};
        try {
            created.head = Hrtf::sphere(sampleRate_, size.radius, size.speedOfSound);
        } catch (const std::bad_alloc&) {
            created.head = nullptr;  // the one that there is goes on
        }
        const std::lock_guard lock(mutex_);
        created_ = std::move(created);
    });
}

std::optional<HeadMaker::Created> HeadMaker::take() {
    const std::lock_guard lock(mutex_);
    return std::exchange(created_, std::nullopt);
}

}  // namespace rtsg
