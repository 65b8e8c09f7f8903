// Ring: a queue that is searched by number and keeps its memory: it does not allocate unless it grows beyond its
// largest size so far. Threading: one thread per object.
#pragma once

#include <cstddef>
#include <utility>
#include <vector>

namespace rtsg {

template <class T>
class Ring {
  public:
    std::size_t size() const { return size_; }
    bool empty() const { return size_ == 0; }
    T& operator[](std::size_t i) { return items_[(first_ + i) & (items_.size() - 1)]; }
    const T& operator[](std::size_t i) const { return items_[(first_ + i) & (items_.size() - 1)]; }
    T& front() { return (*this)[0]; }
    const T& front() const { return (*this)[0]; }
    T& back() { return (*this)[size_ - 1]; }
    const T& back() const { return (*this)[size_ - 1]; }
    void clear() { first_ = size_ = 0; }
    void push_back(const T& item) {
        if (size_ == items_.size()) grow();
        ++size_;
        back() = item;
    }
    void pop_back() { --size_; }
    void dropFirst() {
        first_ = (first_ + 1) & (items_.size() - 1);
        --size_;
    }

  private:
    void grow() {
        std::vector<T> larger(items_.empty() ? 16 : 2 * items_.size());
        for (std::size_t i = 0; i < size_; ++i) larger[i] = (*this)[i];
        items_ = std::move(larger);
        first_ = 0;
    }

    std::vector<T> items_;  // as many as a power of two, or none
    std::size_t first_ = 0, size_ = 0;
};

}  // namespace rtsg
