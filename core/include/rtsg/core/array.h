// Immutable, shared, padded arrays: the storage of every MF field, string and image.
//
// Invariant: the elements of an array that more than one owner holds never change. The last element is
// followed by at least 16 readable zero bytes, so that Embree may load it with a wide read in place.
// Threading: copying and destroying are atomic; writing is for the sole owner only.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <initializer_list>
#include <new>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

namespace rtsg {

namespace detail {

/// Lies directly before the elements, and is aligned to 16 bytes as they are.
struct ArrayHeader {
    std::atomic<std::uint32_t> owners{1};
    std::uint32_t elementSize = 0;
    std::uint64_t size = 0;                                               // elements
    std::uint64_t capacity = 0;                                           // elements
    void (*destroyElements)(void* first, std::uint64_t count) = nullptr;  // null when trivial
};
static_assert(sizeof(ArrayHeader) == 32);
constexpr std::size_t kArrayPadding = 16;

ArrayHeader* allocateArray(std::size_t elementSize, std::uint64_t capacity);
void destroyArray(ArrayHeader* header) noexcept;

inline void retain(ArrayHeader* header) noexcept {
    if (header) header->owners.fetch_add(1, std::memory_order_relaxed);
}
inline void release(ArrayHeader* header) noexcept {
    if (header && header->owners.fetch_sub(1, std::memory_order_acq_rel) == 1) destroyArray(header);
}

}  // namespace detail

/// An array that is one pointer wide; an empty one is a null pointer. Equality compares elements.
template <class T>
class Array {
  public:
    using value_type = T;

    Array() noexcept = default;
    Array(const Array& other) noexcept : header_(other.header_) { detail::retain(header_); }
    Array(Array&& other) noexcept : header_(std::exchange(other.header_, nullptr)) {}
    Array& operator=(Array other) noexcept {
        std::swap(header_, other.header_);
        return *this;
    }
    ~Array() { detail::release(header_); }

    explicit Array(std::span<const T> elements) { append(elements); }
    Array(std::initializer_list<T> elements) : Array(std::span<const T>(elements.begin(), elements.size())) {}

    /// Makes `size` value-initialised elements, which mutableData() lets the sole owner write.
    static Array ofSize(std::size_t size) {
        Array result;
        result.resize(size);
        return result;
    }

    /// Takes over a header whose elements follow it in memory of std::malloc, padded with zeros.
    static Array adopt(detail::ArrayHeader* header) noexcept {
        Array result;
        result.header_ = header;
        return result;
    }

    std::size_t size() const noexcept { return header_ ? header_->size : 0; }
    bool empty() const noexcept { return size() == 0; }
    const T* data() const noexcept { return header_ ? reinterpret_cast<const T*>(header_ + 1) : nullptr; }
    const T& operator[](std::size_t index) const noexcept { return data()[index]; }
    const T& back() const noexcept { return data()[size() - 1]; }
    const T* begin() const noexcept { return data(); }
    const T* end() const noexcept { return data() + size(); }
    std::span<const T> span() const noexcept { return {data(), size()}; }
    bool sameStorage(const Array& other) const noexcept { return header_ == other.header_; }

    /// Each call that writes first makes this the sole owner, by a copy if the elements are shared.
    T* mutableData() {
        makeSole(size());
        return header_ ? reinterpret_cast<T*>(header_ + 1) : nullptr;
    }
    void reserve(std::size_t capacity) {
        if (capacity > (header_ ? header_->capacity : 0)) makeSole(capacity);
    }
    void push_back(T element) {
        const std::size_t count = size();
        if (!header_ || count == header_->capacity || shared()) makeSole(count < 4 ? 4 : count + count / 2);
        new (reinterpret_cast<T*>(header_ + 1) + count) T(std::move(element));
        ++header_->size;
    }
    /// Appends copies; the elements must not be this array's own.
    void append(std::span<const T> elements) {
        const std::size_t count = size();
        if (elements.empty()) return;
        const std::size_t wanted = count + elements.size();
        if (!header_ || wanted > header_->capacity || shared())
            makeSole(wanted < count + count / 2 ? count + count / 2 : wanted);
        T* target = reinterpret_cast<T*>(header_ + 1) + count;
        if constexpr (std::is_trivially_copyable_v<T>) {
            std::memcpy(static_cast<void*>(target), elements.data(), elements.size_bytes());
            header_->size = wanted;
        } else {
            for (const T& element : elements) {
                new (target++) T(element);
                ++header_->size;
            }
        }
    }
    void resize(std::size_t count) {
        if (count == size()) return;
        if (count == 0) {
            *this = Array();
            return;
        }
        makeSole(count);
        T* first = reinterpret_cast<T*>(header_ + 1);
        if (const std::size_t before = header_->size; before > count) {
            while (header_->size > count) first[--header_->size].~T();
            std::memset(static_cast<void*>(first + count), 0, (before - count) * sizeof(T));  // the padding's zeros
        }
        while (header_->size < count) new (first + header_->size++) T();
    }
    void insert(std::size_t index, T element) {
        push_back(std::move(element));
        T* first = reinterpret_cast<T*>(header_ + 1);
        const std::size_t last = size() - 1;
        if constexpr (std::is_trivially_copyable_v<T>) {
            const T added = first[last];
            std::memmove(static_cast<void*>(first + index + 1), first + index, (last - index) * sizeof(T));
            first[index] = added;
        } else {
            for (std::size_t i = last; i > index; --i) std::swap(first[i], first[i - 1]);
        }
    }
    void erase(std::size_t index) {
        T* first = mutableData();
        const std::size_t last = size() - 1;
        if constexpr (std::is_trivially_copyable_v<T>) {
            if (index < last)
                std::memmove(static_cast<void*>(first + index), first + index + 1, (last - index) * sizeof(T));
        } else {
            for (std::size_t i = index; i < last; ++i) first[i] = std::move(first[i + 1]);
        }
        resize(last);
    }

    friend bool operator==(const Array& a, const Array& b) noexcept {
        if (a.header_ == b.header_) return true;
        if (a.size() != b.size()) return false;
        for (std::size_t i = 0; i < a.size(); ++i)
            if (!(a[i] == b[i])) return false;
        return true;
    }

    detail::ArrayHeader* header() const noexcept { return header_; }

  private:
    bool shared() const noexcept { return header_ && header_->owners.load(std::memory_order_acquire) > 1; }

    void makeSole(std::size_t capacity) {
        const std::size_t count = size();
        if (header_ && !shared() && header_->capacity >= capacity) return;
        if (capacity == 0) return;
        Array fresh;
        fresh.header_ = detail::allocateArray(sizeof(T), capacity < count ? count : capacity);
        if constexpr (!std::is_trivially_destructible_v<T>)
            fresh.header_->destroyElements = [](void* first, std::uint64_t n) {
                for (std::uint64_t i = 0; i < n; ++i) static_cast<T*>(first)[i].~T();
            };
        T* target = reinterpret_cast<T*>(fresh.header_ + 1);
        if constexpr (std::is_trivially_copyable_v<T>) {
            if (count) std::memcpy(static_cast<void*>(target), data(), count * sizeof(T));
        } else {
            for (std::size_t i = 0; i < count; ++i) new (target + i) T(data()[i]);
        }
        fresh.header_->size = count;
        std::swap(header_, fresh.header_);
    }

    detail::ArrayHeader* header_ = nullptr;
};

/// A UTF-8 text, immutable and shared; one pointer wide.
class String {
  public:
    String() noexcept = default;
    String(std::string_view text) : chars_(std::span<const char>(text.data(), text.size())) {}
    String(const char* text) : String(std::string_view(text)) {}
    String(const std::string& text) : String(std::string_view(text)) {}

    std::string_view view() const noexcept { return {chars_.data(), chars_.size()}; }
    operator std::string_view() const noexcept { return view(); }
    bool empty() const noexcept { return chars_.empty(); }
    std::size_t size() const noexcept { return chars_.size(); }
    std::string str() const { return std::string(view()); }
    const Array<char>& chars() const noexcept { return chars_; }

    friend bool operator==(const String& a, const String& b) noexcept { return a.view() == b.view(); }

  private:
    Array<char> chars_;
};

}  // namespace rtsg
