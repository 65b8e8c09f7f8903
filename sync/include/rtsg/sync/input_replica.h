// InputReplica: a scene that is given only what came into each frame of another, and computes the rest itself.
//
// Invariant: while it is exact() the scene is in a state of the origin's, hash by hash. A frame that comes out
// otherwise is noticed at once; from then on inputs are refused until a snapshot (and its run state) repairs it.
// Threading: one thread, which owns the scene.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include <rtsg/core/change.h>
#include <rtsg/core/diagnostic.h>
#include <rtsg/core/scene.h>

namespace rtsg {

class InputReplica {
  public:
    /// `scene`: empty, or in the state from which the stream goes on; its behaviours are switched on. Behaviours of the
    /// application that are declared deterministic have to be registered with it as with the origin; others need not
    /// be. Must outlive the replica.
    explicit InputReplica(Scene& scene);

    /// The next set of the stream: an input, a run state (from == to), or changes, as decoded or as the origin's bus
    /// gives them. True if the scene is in the set's state, with its hash; false if it is not, and why() says so. An
    /// error means that the set made no sense; the replica is then no longer exact.
    Result<bool> take(std::shared_ptr<const ChangeSet> set);

    /// False until the first state with a run state, and after a divergence: then only a snapshot helps.
    bool exact() const { return exact_; }
    const std::string& why() const { return why_; }

    struct Statistics {
        std::uint64_t run = 0;          // frames computed here, with the origin's hash
        std::uint64_t applied = 0;      // frames and snapshots whose changes were given
        std::uint64_t divergences = 0;  // frames that came out with another hash
    };
    const Statistics& statistics() const { return statistics_; }

  private:
    Result<bool> run(const ChangeSet& set);
    Result<bool> applyChanges(std::shared_ptr<const ChangeSet> set);
    bool lost(std::string why);

    Scene& scene_;
    bool exact_ = false;
    std::string why_;
    Statistics statistics_;
};

}  // namespace rtsg
