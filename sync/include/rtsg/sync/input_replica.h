// InputReplica: a scene that gets only the input of each frame of another scene, and computes the rest itself.
//
// Invariant: while it is exact() the scene is in a state of the origin, with the same hash, which is counted with the
// node types of the stream's writer if they are others. A frame that comes out different is noticed at once. Inputs are
// then refused until a snapshot and its run state repair the scene. Threading: one thread, which owns the scene.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include <rtsg/core/change.h>
#include <rtsg/core/diagnostic.h>
#include <rtsg/core/scene.h>
#include <rtsg/sync/change_codec.h>

namespace rtsg {

class InputReplica {
  public:
    /// `scene` must be empty or in the state from which the stream goes on, and must outlive the replica. Its
    /// behaviours are switched on. The application's deterministic behaviours must be registered with it as with the
    /// origin; others need not be. `states` decodes the stream's states. It must outlive the replica, and is needed if
    /// the stream may be of another build: it then counts the origin's hash.
    explicit InputReplica(Scene& scene, ChangeDecoder* states = nullptr);

    /// Takes the next set of the stream, decoded or from the origin's bus: an input, a run state (from == to), or
    /// changes. True if the scene is now in the set's state with its hash; if it is false, why() gives the reason. An
    /// error means that the set made no sense; the replica is then no longer exact.
    Result<bool> take(std::shared_ptr<const ChangeSet> set);

    /// False until the first state with a run state has come, and after a divergence. Then only a snapshot helps.
    bool exact() const { return exact_; }
    const std::string& why() const { return why_; }

    struct Statistics {
        std::uint64_t run = 0;          // frames computed here, with the origin's hash
        std::uint64_t applied = 0;      // frames and snapshots whose changes were applied
        std::uint64_t divergences = 0;  // frames that came out with another hash
    };
    const Statistics& statistics() const { return statistics_; }

  private:
    Result<bool> run(const ChangeSet& set);
    Result<bool> applyChanges(std::shared_ptr<const ChangeSet> set);
    bool lost(std::string why);
    Hash128 hashAtWriter() const;

    Scene& scene_;
    ChangeDecoder* states_ = nullptr;
    bool exact_ = false;
    std::string why_;
    Statistics statistics_;
};

}  // namespace rtsg
