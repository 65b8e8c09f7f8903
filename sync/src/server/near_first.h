// What one slow peer gets first: of frames merged for it those changes that are near the viewer, and those of views and
// sounds; the rest later.
//
// It keeps a scene that is what the peer has once all that was sent has arrived, so that each set has the hash of the
// scene that it leads to. Of frames merged into one up to state m the first set leads to m - 1: a state with that
// number in which values that can wait are as they were before. The second set brings these, and leads to m. What waits
// is merged with what follows, and goes at the latest after kLongestWait. Only values wait, of aspects that are seen:
// never nodes, references, names, routes. Invariant: what a set leads to, and then all that waits, is the scene that
// the frames lead to; checked whenever nothing is left to wait. It costs the memory of one more scene. Threading: one
// thread.
#pragma once

#include <chrono>
#include <memory>
#include <span>
#include <unordered_set>
#include <vector>

#include <rtsg/core/scene.h>

namespace rtsg {

class NearFirst {
  public:
    using Clock = std::chrono::steady_clock;
    static constexpr std::chrono::milliseconds kLongestWait{1000};

    /// `whole`: as the peer has it now.
    static Result<std::unique_ptr<NearFirst>> of(const Scene& whole);

    std::uint64_t state() const { return scene_.sequence(); }
    /// Something waits: the peer's scene is none that the origin was ever in.
    bool waits() const { return later_.to != 0; }

    /// The next set for the peer. `frames`: in order, those after the last ones that were given here. `origin`: the
    /// scene in their last state or a later one; says what is near. `budget`: bytes that go now, about; `all`: nothing
    /// waits any longer. Error: the frames do not follow, or lead elsewhere than they say.
    Result<std::shared_ptr<const ChangeSet>> next(std::span<const ChangeSet> frames, const Scene& origin,
                                                  std::uint64_t budget, bool all, Clock::time_point now);

  private:
    NearFirst() { scene_.setBehavioursEnabled(false); }
    bool canWait(const Change& change, const Scene& origin) const;
    void findCarriers(const Scene& origin);
    void split(ChangeSet& set, const Scene& origin, std::uint64_t budget);

    Scene scene_;
    ChangeSet later_;  // `to` is 0: nothing
    Clock::time_point waitingSince_{};
    std::unordered_set<std::uint32_t> carriers_;  // nodes that move a viewer or a sound
    bool carriersKnown_ = false;
};

}  // namespace rtsg
