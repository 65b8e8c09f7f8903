// HeadMaker: computes the responses of spheres (Hrtf::sphere) on a thread of its own while sound goes on.
//
// Computing one takes longer than a block lasts. Threading: ask() and take() on one other thread; they never wait.
#pragma once

#include <memory>
#include <mutex>
#include <optional>

#include <rtsg/audio/hrtf.h>
#include <rtsg/core/worker.h>

namespace rtsg {

class HeadMaker {
  public:
    explicit HeadMaker(int sampleRate) : sampleRate_(sampleRate) {}

    /// The parameters of Hrtf::sphere().
    struct Size {
        double radius = 0, speedOfSound = 0;
    };
    struct Created {
        Size size;
        std::shared_ptr<const Hrtf> head;
    };
    /// Asks for a head. A request that is not begun yet is replaced.
    void ask(const Size& size);
    /// The newest result since the last call; it has no head if there was no memory for one.
    std::optional<Created> take();

  private:
    const int sampleRate_;
    std::mutex mutex_;
    std::optional<Created> created_;
    Worker worker_{"rtsg head"};  // last: its jobs use the others
};

}  // namespace rtsg
