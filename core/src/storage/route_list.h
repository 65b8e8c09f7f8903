// RouteList: routes at one end, in the order in which they were made; adding, finding and removing one costs the same
// among a hundred thousand as among ten.
//
// A removed route leaves a hole (an entry without a node), so that places stay; holes go once they are half of the
// list. Most ends have one route: FewRoutes holds that in place, so that an event that follows it reads no list.
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <span>
#include <unordered_map>
#include <vector>

#include <rtsg/core/scene.h>

namespace rtsg {

/// T: equality comparable, with a NodeId that is none in T(), named by nodeOf(T&).
template <class T>
class RouteList {
  public:
    /// With holes.
    const std::vector<T>& items() const { return items_; }
    bool empty() const { return items_.size() == holes_; }
    bool contains(const T& item) const { return find(item) != kNone; }
    void add(const T& item) {
        items_.push_back(item);
        if (!index_.empty())
            index_.emplace(item, items_.size() - 1);
        else if (items_.size() > kFew)
            index();
    }
    bool remove(const T& item) {
        const std::size_t slot = find(item);
        if (slot == kNone) return false;
        if (!index_.empty()) {
            auto [at, end] = index_.equal_range(item);
            while (at->second != slot) ++at;
            index_.erase(at);
        }
        items_[slot] = T();
        if (slot + 1 == items_.size()) {
            items_.pop_back();
        } else if (++holes_; 2 * holes_ > items_.size()) {
            std::erase(items_, T());
            holes_ = 0;
            index_.clear();
            if (items_.size() > kFew) index();
        }
        return true;
    }

  private:
    static constexpr std::size_t kFew = 32, kNone = SIZE_MAX;  // beyond a few, hashing beats a linear search
    struct Hash {
        std::size_t operator()(const T& item) const { return item.hash(); }
    };
    std::size_t find(const T& item) const {
        if (index_.empty()) {
            const auto found = std::ranges::find(items_, item);
            return found == items_.end() ? kNone : static_cast<std::size_t>(found - items_.begin());
        }
        const auto found = index_.find(item);
        return found == index_.end() ? kNone : found->second;
    }
    void index() {
        for (std::size_t i = 0; i < items_.size(); ++i)
            if (!(items_[i] == T())) index_.emplace(items_[i], i);
    }

    std::vector<T> items_;
    std::size_t holes_ = 0;
    std::unordered_multimap<T, std::size_t, Hash> index_;  // empty while there are few
};

/// The first route in place, the list of all once there have been two.
template <class T>
class FewRoutes {
  public:
    /// With holes. Valid until a route comes or goes.
    std::span<const T> items() const {
        if (many_) return many_->items();
        return {&one_, one_ == T() ? std::size_t{0} : 1};
    }
    /// The one route there is, if there never was another; else null.
    const T* only() const { return many_ || one_ == T() ? nullptr : &one_; }
    bool empty() const { return many_ ? many_->empty() : one_ == T(); }
    bool contains(const T& item) const { return many_ ? many_->contains(item) : one_ == item; }
    void add(const T& item) {
        if (!many_ && one_ == T()) {
            one_ = item;
            return;
        }
        if (!many_) {
            many_ = std::make_unique<RouteList<T>>();
            many_->add(one_);
        }
        many_->add(item);
    }
    bool remove(const T& item) {
        if (many_) return many_->remove(item);
        if (!(one_ == item)) return false;
        one_ = T();
        return true;
    }

  private:
    std::unique_ptr<RouteList<T>> many_;  // stays, so that places do
    T one_;                               // while there is no list
};

}  // namespace rtsg
