// NearFirst: chooses the changes of merged frames that one slow peer gets first: those near the viewer, and those of
// views and sounds.
//
// It keeps a scene that equals the peer's scene once everything sent has arrived, so that each set has the right hash.
// Of frames merged up to state m the first set leads to state m - 1, in which values that can wait are as before. The
// second set brings those and leads to m. Values that wait are merged with later ones, and are sent after kLongestWait
// at the latest. Only values of visible aspects wait; nodes, references, names and routes never do.
// Invariant: a set and then all that waits lead to the same scene as the frames. This is checked whenever nothing is
// left to wait. It costs the memory of one more scene.
// Threading: one thread.
#pragma once

#include <chrono>
#include <memory>
#include <span>
#include <unordered_set>
#include <vector>

#include <rtsg/core/scene.h>

#include "transport/clock.h"

namespace rtsg {

class NearFirst {
  public:
    static constexpr std::chrono::milliseconds kLongestWait{1000};

    /// `whole` is the scene as the peer has it now.
    static Result<std::unique_ptr<NearFirst>> of(const Scene& whole);

    std::uint64_t state() const { return scene_.sequence(); }
    /// True if something waits. The peer's scene is then one that the origin never had.
    bool waits() const { return later_.to != 0; }

    /// Returns the next set for the peer. `frames` are those after the frames of the last call, in order. `origin` is
    /// the scene in their last state or a later one; it tells what is near. `budget` is about how many bytes may be
    /// sent now; with `all` nothing waits any longer. Error: the frames do not follow, or lead to another state than
    /// they say.
    Result<std::shared_ptr<const ChangeSet>> next(std::span<const ChangeSet> frames, const Scene& origin,
                                                  std::uint64_t budget, bool all, Clock::time_point now);

  private:
    NearFirst() { scene_.setBehavioursEnabled(false); }
    bool canWait(const Change& change, const Scene& origin) const;
    void findCarriers(const Scene& origin);
    void split(ChangeSet& set, const Scene& origin, std::uint64_t budget);

    Scene scene_;
    ChangeSet later_;  // nothing if `to` is 0
    Clock::time_point waitingSince_{};
    std::unordered_set<std::uint32_t> carriers_;  // nodes that move a viewer or a sound
    bool carriersKnown_ = false;
};

}  // namespace rtsg
