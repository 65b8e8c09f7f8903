// DeltaQueue: deltas of instances on their way from the scene's thread to the one that makes pictures.
//
// Invariant: taking them in order gives what following the scene at once would have given. If nobody takes them they
// are merged, so that they hold no more than the scene does. Threading: add() and newest() on the scene's thread,
// take() on any other, one at a time; neither waits for the other's work.
#pragma once

#include <cstdint>
#include <deque>
#include <mutex>
#include <optional>
#include <vector>

#include <rtsg/renderers/instance_delta.h>

namespace rtsg {

class DeltaQueue {
  public:
    static constexpr std::size_t kMax = 256;

    /// Adds a delta that concerns instances; deltas that do not are not counted.
    void add(const InstanceDelta& delta);
    /// Deltas that were added since the start.
    std::uint64_t newest() const { return newest_; }
    /// Takes the deltas up to the number `last` that were not yet taken, in order. Null if later ones have been taken
    /// already, or if these have been merged with later ones.
    std::optional<std::vector<InstanceDelta>> take(std::uint64_t last);

  private:
    struct Entry {
        std::uint64_t first = 0, last = 0;  // numbers of the deltas in it
        InstanceDelta delta;
    };
    std::mutex mutex_;
    std::deque<Entry> entries_;
    std::uint64_t newest_ = 0, taken_ = 0;
};

/// Deltas that follow each other as one; of its removed instances the slots alone count.
InstanceDelta mergedDelta(const std::vector<const InstanceDelta*>& deltas);

}  // namespace rtsg
