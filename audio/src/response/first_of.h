// Selects the best of very many values without keeping all of them.
//
// Threading: one thread per object.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace rtsg {

/// Keeps the first few, in order, of many items that are told one after the other; among equals those told earlier.
template <class Item, class Before>
class FirstOf {
  public:
    FirstOf(std::size_t count, Before before) : count_(count), before_(before) {}

    void add(const Item& item) {
        ++reported_;
        if (full_ && !before_(item, last_)) return;
        items_.push_back(item);
        if (items_.size() >= 4 * count_) sort();
    }
    const std::vector<Item>& sorted() {
        sort();
        return items_;
    }
    std::size_t reported() const { return reported_; }
    /// The last item that is kept: only items before it still count. At first there is none.
    const Item& last() const { return last_; }

  private:
    void sort() {
        std::stable_sort(items_.begin(), items_.end(), before_);
        if (items_.size() < count_) return;
        items_.erase(items_.begin() + static_cast<std::ptrdiff_t>(count_), items_.end());
        last_ = items_.back();
        full_ = true;
    }

    std::size_t count_, reported_ = 0;
    Before before_;
    std::vector<Item> items_;
    Item last_{};
    bool full_ = false;
};

}  // namespace rtsg
