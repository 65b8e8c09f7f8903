// LogCheck: steps a replay and notes where the log first was incomplete or a state differed from the recorded one.
//
// Invariant: it notes only what lies between the states before and after a step, not what Replayer::seek() jumped over.
// Threading: the replayer's thread. The replayer must outlive this.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include <rtsg/sync/replay.h>

namespace rtsg {

class LogCheck {
  public:
    explicit LogCheck(Replayer& replayer)
        : replayer_(replayer),
          gaps_(replayer.frames() > 0 ? replayer.gaps() : 0),
          unclosed_(replayer.unclosedSessions()) {}

    /// Does what Replayer::step() does, and notes what it finds.
    Result<bool> step();
    /// Call it at the log's end to also check that each session was closed in order.
    void expectClosed();
    /// The first problem: missing frames, damaged bytes, pieces in the wrong order, a record that could not be applied,
    /// or a state with another hash.
    const std::optional<Divergence>& first() const { return first_; }
    /// The same without damage that cost no state, as in a keyframe that the frames make unnecessary.
    const std::optional<Divergence>& firstLoss() const { return loss_; }

  private:
    void noteDamage(std::uint64_t frame, const LogDamage& damage);
    void note(std::uint64_t frame, std::string text);
    void noteGap(std::uint64_t before, bool arrived);
    std::string openEnd(std::uint64_t last, std::uint64_t next) const;

    Replayer& replayer_;
    std::uint64_t gaps_ = 0, unclosed_ = 0;
    std::optional<Divergence> first_, loss_;
    std::optional<Divergence> damage_;   // damage that the last step passed over
    std::optional<Divergence> openEnd_;  // the first session that was not closed before another one
};

}  // namespace rtsg
