// Numbers gathered one behind the other, until an array takes over the memory they are in.
//
// Invariant: a long list is there once, and is not copied: what grows is remapped where the system can do that. Few
// numbers need no memory of their own until then. Threading: one thread at a time.
#pragma once

#include <algorithm>
#include <array>
#include <cstdlib>
#include <cstring>
#include <new>
#include <span>

#include <sys/mman.h>
#include <unistd.h>

#include <rtsg/core/array.h>

namespace rtsg::detail {

template <class S>
class GatheredNumbers {
  public:
    GatheredNumbers() = default;
    GatheredNumbers(const GatheredNumbers&) = delete;
    GatheredNumbers& operator=(const GatheredNumbers&) = delete;
    ~GatheredNumbers() { std::free(memory_); }

    std::size_t size() const { return size_; }
    /// Room for the next numbers, at least `least`. Throws std::bad_alloc.
    std::span<S> room(std::size_t minimum) {
        if (capacity_ - size_ < minimum) grow(size_ + minimum);
        return {data() + size_, capacity_ - size_};
    }
    /// So many have been put there.
    void took(std::size_t count) { size_ += count; }
    void push(S number) {
        room(1)[0] = number;
        ++size_;
    }
    void append(std::span<const S> numbers) {
        if (numbers.empty()) return;
        std::memcpy(room(numbers.size()).data(), numbers.data(), numbers.size_bytes());
        size_ += numbers.size();
    }
    /// All that make up whole elements; nothing is left here.
    template <class T>
    Array<T> finish() {
        constexpr std::size_t each = sizeof(T) / sizeof(S);
        const std::size_t count = size_ / each;
        Array<T> result;
        if (memory_ && count) {
            const std::size_t bytes = count * sizeof(T);
            void* const exact = std::realloc(memory_, sizeof(ArrayHeader) + bytes + kArrayPadding);
            if (!exact) throw std::bad_alloc();
            memory_ = nullptr;
            std::memset(static_cast<std::byte*>(exact) + sizeof(ArrayHeader) + bytes, 0, kArrayPadding);
            auto* header = new (exact) ArrayHeader;
            header->elementSize = sizeof(T);
            header->size = header->capacity = count;
            result = Array<T>::adopt(header);
        } else if (count) {
            result = Array<T>::ofSize(count);
            std::memcpy(static_cast<void*>(result.mutableData()), few_.data(), count * sizeof(T));
        }
        size_ = 0;
        capacity_ = kFew;
        return result;
    }

  private:
    static constexpr std::size_t kFew = 1024;
    static constexpr std::size_t kManyBytes = std::size_t{4} << 20;
    /// glibc may put up to 32 MiB where they have to be copied to grow.
    static constexpr std::size_t kRemappedBytes = std::size_t{33} << 20;

    S* data() {
        return memory_ ? reinterpret_cast<S*>(static_cast<std::byte*>(memory_) + sizeof(ArrayHeader)) : few_.data();
    }
    void grow(std::size_t minimum) {
        // Memory that nobody has written to takes no pages yet: much room costs nothing, and seldom has to be copied.
        const std::size_t times = capacity_ < std::size_t{1} << 23 ? 4 : 2;
        std::size_t capacity = std::max(minimum, times * capacity_);
        if (capacity > kManyBytes / sizeof(S)) capacity = std::max(capacity, kRemappedBytes / sizeof(S));
        if (capacity > (SIZE_MAX / 2 - sizeof(ArrayHeader) - kArrayPadding) / sizeof(S)) throw std::bad_alloc();
        void* const larger = std::realloc(memory_, sizeof(ArrayHeader) + capacity * sizeof(S) + kArrayPadding);
        if (!larger) throw std::bad_alloc();
        const bool first = !memory_;
        memory_ = larger;
        capacity_ = capacity;
        if (first && size_) std::memcpy(data(), few_.data(), size_ * sizeof(S));
        if (capacity >= kRemappedBytes / sizeof(S)) askForLargePages();
    }
    /// With small pages, the system would take a third of the time to hand them out.
    void askForLargePages() {
        const auto page = std::uintptr_t(::sysconf(_SC_PAGESIZE));
        const std::uintptr_t intoPage = reinterpret_cast<std::uintptr_t>(memory_) % page;
        ::madvise(static_cast<std::byte*>(memory_) - intoPage, capacity_ * sizeof(S), MADV_HUGEPAGE);
    }

    void* memory_ = nullptr;  // a header's room, then the numbers
    std::size_t size_ = 0, capacity_ = kFew;
    std::array<S, kFew> few_;
};

}  // namespace rtsg::detail
