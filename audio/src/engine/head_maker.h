// HeadMaker: computes the responses of spheres (Hrtf::sphere) on a thread of its own while sound goes on.
//
// Computing one takes longer than a block lasts. Threading: ask() and take() on one other thread; they never wait.
#pragma once

#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>

#include <rtsg/audio/hrtf.h>

namespace rtsg {

class HeadMaker {
  public:
    explicit HeadMaker(int sampleRate);
    ~HeadMaker();
    HeadMaker(const HeadMaker&) = delete;
    HeadMaker& operator=(const HeadMaker&) = delete;

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
    void run();

    const int sampleRate_;
    std::mutex mutex_;
    std::condition_variable wake_;
    std::optional<Size> asked_;
    std::optional<Created> created_;
    bool stop_ = false;
    std::thread thread_;
};

}  // namespace rtsg
