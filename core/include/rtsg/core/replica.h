// Replica: a copy of a scene for another thread, which reads it and follows the original at its own pace.
//
// With replicas frames overlap: while one thread runs the cascade of frame N+1, others draw, play, mirror or log their
// copies, each at the state that it has reached. A copy costs its nodes and its changes; arrays are shared. Invariant:
// scene() is always in a state that the original had, with its hash; nothing is lost, however slow a thread is.
// Threading: make it on the original's thread; everything else, the copy included, belongs to the one thread that calls
// it first. It may outlive the original, which then no longer changes. Destroy it on its own thread, or when that has
// ended.
#pragma once

#include <memory>
#include <string>

#include <rtsg/core/bus.h>
#include <rtsg/core/diagnostic.h>
#include <rtsg/core/scene.h>

namespace rtsg {

class Replica {
  public:
    explicit Replica(Scene& origin);
    ~Replica();
    Replica(const Replica&) = delete;
    Replica& operator=(const Replica&) = delete;

    /// The copy; subscribers attach to its bus. Its behaviours are off. Empty before the first poll() or drain().
    Scene& scene();
    /// Catches up with all changes as one set, as pictures and sound need it. Returns true if there were any.
    bool poll();
    /// Catches up set by set, as logs need it. Returns the number of sets. If more sets wait than the bus keeps, some
    /// come merged.
    std::size_t drain();

    /// False if a set could not be applied: failure() then says why, and the copy stays at its state.
    bool attached() const;
    std::string failure() const;

  private:
    struct Follower;
    std::unique_ptr<Follower> follower_;
    Attachment attachment_;
};

}  // namespace rtsg
