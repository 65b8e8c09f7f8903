// HeldFile: bytes in memory behind a descriptor, which nobody can change once they are complete.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>

namespace rtsg::fetch {

class HeldFile {
  public:
    /// An empty one; valid() is false if the system gives none.
    HeldFile();
    ~HeldFile();
    HeldFile(HeldFile&& other) noexcept
        : descriptor_(std::exchange(other.descriptor_, -1)), size_(std::exchange(other.size_, 0)) {}
    HeldFile& operator=(HeldFile&& other) noexcept {
        std::swap(descriptor_, other.descriptor_);
        std::swap(size_, other.size_);
        return *this;
    }
    HeldFile(const HeldFile&) = delete;
    HeldFile& operator=(const HeldFile&) = delete;

    bool valid() const { return descriptor_ >= 0; }
    /// False if there is no room.
    bool append(std::string_view bytes);
    /// From now on nobody can change it. False if the system refuses.
    bool seal();
    std::uint64_t size() const { return size_; }
    /// A descriptor of its own for somebody, at the beginning; -1 if the system gives none.
    int opened() const;
    std::string bytes() const;

  private:
    int descriptor_ = -1;
    std::uint64_t size_ = 0;
};

}  // namespace rtsg::fetch
