// News: reports about those who connect, limited in number however often they try.
//
// Threading: any thread.
#pragma once

#include <cstdint>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "sockets/rare_warning.h"

namespace rtsg::web {

class News {
  public:
    /// Refused clients may ask again for ever.
    void add(std::string text) {
        constexpr std::size_t kMax = 100;
        const std::scoped_lock lock(mutex_);
        auto reported = mirror::reportedOf(++count_, std::move(text));
        if (reported && texts_.size() < kMax) texts_.push_back(std::move(*reported));
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
