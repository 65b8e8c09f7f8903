// Descriptor: an open file or socket of the system, closed with its owner. Wakeup: one by which other threads end a
// wait in poll().
//
// Threading: a descriptor on one thread at a time; raise() of a wakeup on any.
#pragma once

#include <cstdint>
#include <utility>

#include <sys/eventfd.h>
#include <unistd.h>

namespace rtsg {

class Descriptor {
  public:
    /// Negative: none.
    explicit Descriptor(int number = -1) : number_(number) {}
    Descriptor(Descriptor&& other) noexcept : number_(other.release()) {}
    Descriptor& operator=(Descriptor&& other) noexcept {
        std::swap(number_, other.number_);
        return *this;
    }
    ~Descriptor() { close(); }

    int get() const { return number_; }
    explicit operator bool() const { return number_ >= 0; }
    /// From now on the caller closes it.
    [[nodiscard]] int release() { return std::exchange(number_, -1); }
    void close() {
        if (number_ >= 0) ::close(release());
    }

  private:
    int number_;
};

/// An eventfd.
class Wakeup {
  public:
    /// What poll() waits for. Negative: the system has no more, and polls have to look now and then.
    int get() const { return counter_.get(); }
    /// It is readable from now on.
    void raise() const { static_cast<void>(::eventfd_write(counter_.get(), 1)); }
    /// It is not, until it is raised anew. Returns whether it was.
    bool clear() const {
        eventfd_t ignored = 0;
        return ::eventfd_read(counter_.get(), &ignored) == 0;
    }

  private:
    Descriptor counter_{::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)};
};

}  // namespace rtsg
