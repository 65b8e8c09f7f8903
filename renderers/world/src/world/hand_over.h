// HandOver: passes the newest object from the thread that makes it to any number of others. Nobody waits for anybody.
//
// The newest object lies in one of a few places; one word says in which, and how many readers have come for it there. A
// reader counts itself in by one addition, copies the pointer, and counts itself out at the place. The writer puts the
// next object into a place that as many readers have left as have come to. Invariant: a place is written only while no
// reader can be at it. A reader that is stopped in between costs its place, nothing else; when all places are so taken,
// put() changes nothing and says so. Threading: put() and tidy() on one thread; get() on any.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>

namespace rtsg {

template <class T>
class HandOver {
    struct Entry {
        std::shared_ptr<const T> value;
        mutable std::atomic<std::uint64_t> left{0};
        std::uint64_t came = 0;  // when it is not current any more
        bool isUsed = false, isCurrent = false;
    };

  public:
    HandOver() { entries_[0].isUsed = entries_[0].isCurrent = true; }
    HandOver(const HandOver&) = delete;
    HandOver& operator=(const HandOver&) = delete;

    /// Null: there is no object any more. False: no place is free, and get() returns the old object.
    bool put(std::shared_ptr<const T> next) {
        tidy();
        for (std::size_t i = 0; i < kEntries; ++i) {
            if (entries_[i].isUsed) continue;
            Entry& entry = entries_[i];
            entry.isUsed = true;
            entry.value = std::move(next);
            entry.left.store(0, std::memory_order_relaxed);
            const std::uint64_t before = word_.exchange(std::uint64_t{i} << kCountBits, std::memory_order_acq_rel);
            Entry& old = entries_[before >> kCountBits];
            old.came = before & kCountMask;
            old.isCurrent = false;
            entry.isCurrent = true;
            tidy();
            return true;
        }
        return false;
    }
    /// Releases old objects that nobody reads any more.
    void tidy() {
        for (Entry& entry : entries_) {
            if (!entry.isUsed || entry.isCurrent) continue;
            if (entry.left.load(std::memory_order_acquire) != entry.came) continue;
            entry.value.reset();
            entry.isUsed = false;
        }
    }
    /// The object that was put last; null before.
    std::shared_ptr<const T> get() const { return Visit(*this).value(); }

    /// A reader at a place: the object there stays until the reader leaves.
    class Visit {
      public:
        explicit Visit(const HandOver& all)
            : entry_(all.entries_[all.word_.fetch_add(1, std::memory_order_acquire) >> kCountBits]) {}
        ~Visit() { entry_.left.fetch_add(1, std::memory_order_release); }
        Visit(const Visit&) = delete;
        Visit& operator=(const Visit&) = delete;
        const std::shared_ptr<const T>& value() const { return entry_.value; }

      private:
        const Entry& entry_;
    };

    static constexpr std::size_t kEntries = 16;

  private:
    static constexpr unsigned kCountBits = 56;
    static constexpr std::uint64_t kCountMask = (std::uint64_t{1} << kCountBits) - 1;
    std::array<Entry, kEntries> entries_;
    mutable std::atomic<std::uint64_t> word_{0};
};

}  // namespace rtsg
