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
    struct Place {
        std::shared_ptr<const T> value;
        mutable std::atomic<std::uint64_t> left{0};
        std::uint64_t came = 0;  // when it is not current any more
        bool isUsed = false, isCurrent = false;
    };

  public:
    HandOver() { places_[0].isUsed = places_[0].isCurrent = true; }
    HandOver(const HandOver&) = delete;
    HandOver& operator=(const HandOver&) = delete;

    /// Null: there is no object any more. False: no place is free, and get() returns the old object.
    bool put(std::shared_ptr<const T> next) {
        tidy();
        for (std::size_t i = 0; i < kPlaces; ++i) {
            if (places_[i].isUsed) continue;
            Place& place = places_[i];
            place.isUsed = true;
            place.value = std::move(next);
            place.left.store(0, std::memory_order_relaxed);
            const std::uint64_t before = word_.exchange(std::uint64_t{i} << kCountBits, std::memory_order_acq_rel);
            Place& old = places_[before >> kCountBits];
            old.came = before & kCountMask;
            old.isCurrent = false;
            place.isCurrent = true;
            tidy();
            return true;
        }
        return false;
    }
    /// Releases old objects that nobody reads any more.
    void tidy() {
        for (Place& place : places_) {
            if (!place.isUsed || place.isCurrent) continue;
            if (place.left.load(std::memory_order_acquire) != place.came) continue;
            place.value.reset();
            place.isUsed = false;
        }
    }
    /// The object that was put last; null before.
    std::shared_ptr<const T> get() const { return Visit(*this).value(); }

    /// A reader at a place: the object there stays until the reader leaves.
    class Visit {
      public:
        explicit Visit(const HandOver& all)
            : place_(all.places_[all.word_.fetch_add(1, std::memory_order_acquire) >> kCountBits]) {}
        ~Visit() { place_.left.fetch_add(1, std::memory_order_release); }
        Visit(const Visit&) = delete;
        Visit& operator=(const Visit&) = delete;
        const std::shared_ptr<const T>& value() const { return place_.value; }

      private:
        const Place& place_;
    };

    static constexpr std::size_t kPlaces = 16;

  private:
    static constexpr unsigned kCountBits = 56;
    static constexpr std::uint64_t kCountMask = (std::uint64_t{1} << kCountBits) - 1;
    std::array<Place, kPlaces> places_;
    mutable std::atomic<std::uint64_t> word_{0};
};

}  // namespace rtsg
