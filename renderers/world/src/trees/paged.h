// Paged: an array in pages; versions keep the old pages that are overwritten later.
//
// Invariant: a page that a held version sees (versions.h) is never written; write() puts a copy in its place first. So
// to freeze the array is to copy its list of pages, and a change costs the copy of a page at most.
// Threading: one thread writes; frozen lists of pages are read on any.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <type_traits>
#include <vector>

#include "versions.h"

namespace rtsg::bvh {

template <class T, std::size_t N>
class Paged {
  public:
    static constexpr std::size_t kPerPage = N;

    /// Without versions everything is written in place. They outlive this.
    explicit Paged(const Versions* versions) : versions_(versions) {}
    Paged(const Paged&) = delete;
    Paged& operator=(const Paged&) = delete;

    std::size_t size() const { return size_; }
    bool empty() const { return size_ == 0; }
    const T& operator[](std::size_t i) const { return pages_[i / N][i % N]; }
    /// Valid as long as no version is made.
    T& write(std::size_t i) {
        const std::size_t page = i / N;
        if (versions_ && versions_->sees(stamps_[page])) [[unlikely]]
            replace(page);
        return pages_[page][i % N];
    }
    /// Grows to at least this size; elements added to an existing page have its old content.
    void grow(std::size_t size) {
        while (pages_.size() * N < size) {
            owners_.push_back(newPage());
            pages_.push_back(owners_.back().get());
            stamps_.push_back(stamp());
        }
        size_ = std::max(size_, size);
    }
    void clear() { size_ = 0; }

    /// Changes with grow() and write().
    const T* const* pages() const { return pages_.data(); }
    void freezeInto(std::vector<const T*>& pages) const { pages.assign(pages_.begin(), pages_.end()); }
    /// After Versions::refresh(): pages that nobody sees any more are used again.
    void sweep() {
        std::erase_if(retired_, [&](Retired& r) {
            if (versions_->sees(r.from, r.to)) return false;
            if (free_.size() <= pages_.size()) {
                if constexpr (!std::is_trivially_destructible_v<T>) std::fill_n(r.page.get(), N, T{});
                free_.push_back(std::move(r.page));
            }
            return true;
        });
    }
    std::size_t bytes() const {
        return (owners_.size() + retired_.size() + free_.size()) * N * sizeof(T) +
               pages_.capacity() * (sizeof(T*) + sizeof(Page) + sizeof(std::uint64_t));
    }

  private:
    using Page = std::unique_ptr<T[]>;
    struct Retired {
        std::uint64_t from, to;
        Page page;
    };
    std::uint64_t stamp() const { return versions_ ? versions_->serial() : 0; }
    Page newPage() {
        if (free_.empty()) return std::make_unique<T[]>(N);
        Page page = std::move(free_.back());
        free_.pop_back();
        return page;
    }
    void replace(std::size_t i) {
        Page page = newPage();
        std::copy_n(pages_[i], N, page.get());
        retired_.push_back({stamps_[i], stamp(), std::exchange(owners_[i], std::move(page))});
        pages_[i] = owners_[i].get();
        stamps_[i] = stamp();
    }

    const Versions* versions_;
    std::vector<T*> pages_;
    std::vector<Page> owners_;  // of pages_
    std::vector<std::uint64_t> stamps_;
    std::vector<Retired> retired_;
    std::vector<Page> free_;
    std::size_t size_ = 0;
};

}  // namespace rtsg::bvh
