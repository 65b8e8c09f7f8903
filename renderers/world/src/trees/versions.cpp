// Keeps the list of held versions and of the data that only they still use.
#include "versions.h"

#include <algorithm>

namespace rtsg::bvh {

std::size_t Versions::hold() {
    for (std::size_t i = 0; i < kMax; ++i) {
        Holder& holder = holders_[i];
        if (holder.serial != 0) continue;
        holder.serial = ++serial_;
        holder.epoch = epoch_;
        holder.isRead.store(true, std::memory_order_relaxed);
        findHeld();
        return i;
    }
    return kMax;
}

bool Versions::refresh() {
    bool anyGone = false;
    for (Holder& holder : holders_) {
        if (holder.serial == 0 || holder.isRead.load(std::memory_order_acquire)) continue;
        holder.serial = 0;
        anyGone = true;
    }
    if (anyGone) findHeld();
    return anyGone;
}

void Versions::findHeld() {
    newest_ = 0;
    heldBits_ = 0;
    for (const Holder& holder : holders_) {
        if (holder.serial == 0) continue;
        newest_ = std::max(newest_, holder.serial);
        heldBits_ |= 15u << (holder.epoch * kKinds);
    }
}

std::vector<std::shared_ptr<const void>> Versions::takeUnseen() {
    std::vector<std::shared_ptr<const void>> unseen;
    std::erase_if(retired_, [&](Retired& r) {
        if (sees(r.from, r.to)) return false;
        unseen.push_back(std::move(r.object));
        return true;
    });
    return unseen;
}

void Versions::leaveHeldEpoch() {
    // There are more epochs than versions.
    while (heldBits_ >> maskShift() & 1u) epoch_ = (epoch_ + 1) % kEpochs;
}

}  // namespace rtsg::bvh
