// Merges frames without a scene, where each gives anew all that the one before gave: as those of a scene in motion do.
//
// Then what several frames come to is what the last of them says, from the state on that the first one starts at. Many
// peers fall behind together, from some few states on, so what was made is kept for a while. Threading: one thread.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <span>

#include "history.h"

namespace rtsg {

class PlainMerges {
  public:
    explicit PlainMerges(std::shared_ptr<RecordPool> pool) : pool_(std::move(pool)) {}

    /// Frames of one stream that follow one another, merged; null if it is not so easy, or if they are so many that it
    /// takes long, which is remembered as well. `part`: the number of the stream.
    SharedRecord merge(std::uint32_t part, std::span<const SharedRecord> frames);
    void clear() { made_.clear(); }

  private:
    struct Made {
        std::uint32_t part = 0;
        std::uint64_t from = 0, to = 0;
        Hash128 hash;         // of the state `to`
        SharedRecord record;  // null: it is not so easy
    };
    SharedRecord make(std::span<const SharedRecord> frames) const;

    std::shared_ptr<RecordPool> pool_;
    std::deque<Made> made_;  // the newest first
};

}  // namespace rtsg
