// PlainMerges: merges frames without a scene, if each one changes all fields that the one before changed, as in motion.
//
// The merged frame is then the last one, starting at the first one's state. Many peers fall behind together from a few
// states, so results are kept for a while.
// Threading: one thread.
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

    /// Merges consecutive frames of the stream with the number `part`. Null if they are not of that kind, or so many
    /// that comparing them takes long; that result is kept, too.
    SharedRecord merge(std::uint32_t part, std::span<const SharedRecord> frames);
    void clear() { created_.clear(); }

  private:
    struct Created {
        std::uint32_t part = 0;
        std::uint64_t from = 0, to = 0;
        Hash128 hash;         // of the state `to`
        SharedRecord record;  // null if the frames could not be merged
    };
    SharedRecord make(std::span<const SharedRecord> frames) const;

    std::shared_ptr<RecordPool> pool_;
    std::deque<Created> created_;  // the newest first
};

}  // namespace rtsg
