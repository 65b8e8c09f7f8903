// Versions: knows which states of a world are still read, and so which data may be written in place.
//
// A serial counts the versions made. Data that are written carry it as their stamp, so a version whose serial is above
// the stamp may read them: then the writer copies first, and keeps what it takes out of use until nobody can read it.
// Invariant: at most kMax versions at a time; one pins what it was made of, and nothing that came later. Embree's
// masks cannot be copied, so they hold four bits (the kinds of rays) for each of eight epochs: a version's rays carry
// the bits of the epoch in which it was made, and whoever changes a mask leaves the bits of held epochs alone. (Embree
// reads a mask in one word while we write it: the bits that a reader looks at stay what they are.) Threading:
// everything on the writer's thread, release() on any.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

namespace rtsg::bvh {

class Versions {
  public:
    static constexpr std::size_t kMax = 7;
    static constexpr unsigned kEpochs = 8, kKinds = 4;
    static_assert(kMax < kEpochs && kEpochs * kKinds <= 32, "an epoch is always free, and each has bits of its own");

    /// The kinds of rays that a mask lets through, in every epoch.
    static constexpr std::uint32_t inAllEpochs(std::uint32_t kinds) { return (kinds & 15u) * 0x11111111u; }

    /// The number of versions so far: the stamp of data written now.
    std::uint64_t serial() const { return serial_; }
    bool anyHeld() const { return newest_ != 0; }
    /// Whether a version that is still in use reads data that were last written at `stamp`.
    bool sees(std::uint64_t stamp) const { return newest_ > stamp; }
    /// Whether one was made with a serial above `from` and up to `to`.
    bool sees(std::uint64_t from, std::uint64_t to) const {
        for (const Holder& holder : holders_)
            if (holder.serial > from && holder.serial <= to) return true;
        return false;
    }

    /// Makes another version of the present data; returns its number below kMax, or kMax if too many are held.
    std::size_t hold();
    /// Its reader has done: nothing of it is read any more.
    void release(std::size_t number) { holders_[number].isRead.store(false, std::memory_order_release); }
    /// Finds the versions that have been released; until the next call the answer stays the same. Returns whether there
    /// were any.
    bool refresh();

    /// Keeps a thing that was in use from `stamp` until the serial was `until` while somebody can see it.
    void retire(std::uint64_t stamp, std::uint64_t until, std::shared_ptr<const void> object) {
        if (sees(stamp, until)) retired_.push_back({stamp, until, std::move(object)});
    }
    /// Retired things that nobody sees any more, after refresh().
    std::vector<std::shared_ptr<const void>> takeUnseen();

    /// The shift of the mask bits of the present epoch.
    unsigned maskShift() const { return epoch_ * kKinds; }
    /// The bits of all held versions.
    std::uint32_t heldBits() const { return heldBits_; }
    /// To be called before a mask that somebody may see is changed: from now on rays carry bits that nobody holds.
    void leaveHeldEpoch();

  private:
    struct Holder {
        std::atomic<bool> isRead{false};
        std::uint64_t serial = 0;  // 0: not held, as the writer knows
        unsigned epoch = 0;
    };
    struct Retired {
        std::uint64_t from, to;
        std::shared_ptr<const void> object;
    };
    void findHeld();

    std::array<Holder, kMax> holders_;
    std::vector<Retired> retired_;
    std::uint64_t serial_ = 0, newest_ = 0;
    std::uint32_t heldBits_ = 0;
    unsigned epoch_ = 0;
};

}  // namespace rtsg::bvh
