// ByteBuffer: a growing array of bytes that keeps its memory between uses, so the steady state allocates nothing.
//
// Invariant: size() <= capacity(). Bytes past size() are undefined; unlike std::vector, nothing is cleared.
// Threading: none of its own.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <new>
#include <span>
#include <utility>

namespace rtsg {

class ByteBuffer {
  public:
    ByteBuffer() = default;
    ByteBuffer(ByteBuffer&& other) noexcept { swap(other); }
    ByteBuffer& operator=(ByteBuffer&& other) noexcept {
        swap(other);
        return *this;
    }
    ByteBuffer(const ByteBuffer&) = delete;
    ByteBuffer& operator=(const ByteBuffer&) = delete;
    ~ByteBuffer() { std::free(data_); }

    std::byte* data() { return data_; }
    const std::byte* data() const { return data_; }
    std::size_t size() const { return size_; }
    std::size_t capacity() const { return capacity_; }
    bool empty() const { return size_ == 0; }
    std::span<const std::byte> bytes() const { return {data_, size_}; }
    void clear() { size_ = 0; }

    /// Makes room for `count` more bytes and returns where they start. Call advance() or setEnd() after writing them.
    std::byte* room(std::size_t count) {
        if (capacity_ - size_ < count) grow(count);
        return data_ + size_;
    }
    void advance(std::size_t count) { size_ += count; }
    void setEnd(const std::byte* end) { size_ = static_cast<std::size_t>(end - data_); }
    void append(const void* source, std::size_t count) {
        if (count == 0) return;
        std::memcpy(room(count), source, count);
        size_ += count;
    }
    void append(std::span<const std::byte> source) { append(source.data(), source.size()); }
    /// Little endian, because every machine that RTSG supports is.
    template <class T>
    void put(T number) {
        append(&number, sizeof(number));
    }
    void putVarint(std::uint64_t number) {
        std::byte* at = room(10);
        while (number >= 0x80) {
            *at++ = static_cast<std::byte>(number | 0x80);
            number >>= 7;
        }
        *at++ = static_cast<std::byte>(number);
        setEnd(at);
    }
    /// Gives memory back if less than half of it is used. Call it for buffers that are kept for long.
    void fit() {
        if (capacity_ <= kMin || size_ >= capacity_ - capacity_ / 2) return;
        const std::size_t wanted = size_ < kMin ? kMin : size_;
        if (void* moved = std::realloc(data_, wanted)) {
            data_ = static_cast<std::byte*>(moved);
            capacity_ = wanted;
        }
    }
    void swap(ByteBuffer& other) noexcept {
        std::swap(data_, other.data_);
        std::swap(size_, other.size_);
        std::swap(capacity_, other.capacity_);
    }

  private:
    static constexpr std::size_t kMin = 256;

    void grow(std::size_t count) {
        std::size_t wanted = size_ + count;
        if (wanted < capacity_ + capacity_ / 2) wanted = capacity_ + capacity_ / 2;
        if (wanted < kMin) wanted = kMin;
        void* moved = std::realloc(data_, wanted);
        if (!moved) throw std::bad_alloc();
        data_ = static_cast<std::byte*>(moved);
        capacity_ = wanted;
    }

    std::byte* data_ = nullptr;
    std::size_t size_ = 0, capacity_ = 0;
};

}  // namespace rtsg
