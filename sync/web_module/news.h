// News: reports about those who connect, limited in number however often they try.
//
// Threading: any thread.
#pragma once

#include <bit>
#include <cstdint>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

namespace rtsg::web {

class News {
  public:
    /// Refused clients may ask again for ever. So of many messages only each that doubles their number is kept.
    void add(std::string text) {
        constexpr std::uint64_t kAllTold = 8;
        constexpr std::size_t kMost = 100;
        const std::scoped_lock lock(mutex_);
        const std::uint64_t by = ++count_;
        if (by > kAllTold && !std::has_single_bit(by)) return;
        if (by > kAllTold) text += "; " + std::to_string(by) + " such things by now";
        if (texts_.size() < kMost) texts_.push_back(std::move(text));
    }
    std::vector<std::string> take() {
        const std::scoped_lock lock(mutex_);
        return std::exchange(texts_, {});
    }

  private:
    std::mutex mutex_;
    std::vector<std::string> texts_;
    std::uint64_t count_ = 0;
};

}  // namespace rtsg::web
