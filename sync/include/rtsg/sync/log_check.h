// Log check: steps a replay, and notes where the log first was not whole, or a state not the one recorded.
//
// Invariant: what is noted lies between the state that a step began with and the one that it led to; nothing that the
// replay jumped over before (Replayer::seek) is. Threading: the replayer's thread; the replayer must outlive this.
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

    /// As Replayer::step().
    Result<bool> step();
    /// At the log's end, for those who ask for all of it: whether each of its sessions was closed in order.
    void expectClosed();
    /// Frames that are missing, bytes that are damaged, pieces in another order, a record that could not be applied, a
    /// state with another hash: whatever came first.
    const std::optional<Divergence>& first() const { return first_; }
    /// As first(), but not for bytes whose damage cost no state: those of a keyframe that frames lead past.
    const std::optional<Divergence>& firstLoss() const { return loss_; }

  private:
    void noteDamage(std::uint64_t frame, const LogDamage& damage);
    void note(std::uint64_t frame, std::string text);
    void noteGap(std::uint64_t before, bool arrived);
    std::string openEnd(std::uint64_t last, std::uint64_t next) const;

    Replayer& replayer_;
    std::uint64_t gaps_ = 0, unclosed_ = 0;
    std::optional<Divergence> first_, loss_;
    std::optional<Divergence> damage_;   // that the last step went over
    std::optional<Divergence> openEnd_;  // the first session that another follows without its having been closed
};

}  // namespace rtsg
