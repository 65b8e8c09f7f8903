// Replica: a copy of a scene for another thread, which reads it and follows the original at its own pace.
//
// This is how frames overlap: while one thread runs the cascade of frame N+1, others picture, sound, mirror or log
// their copies, each at the state that it has reached. A copy costs its nodes and what changes; arrays are shared.
// Invariant: scene() is always in a state that the original had, with its hash; nothing is lost, whoever is slow.
// Threading: made on the original's thread; everything else, the copy included, belongs to the one thread that calls
// it first. May outlive the original, which is then at rest. Destroy it on its own thread, or when that has ended.
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
    /// Catches up with everything that has happened, as one set: what pictures and sound want. True if there was any.
    bool poll();
    /// Catches up set by set: what logs want. Returns their number. Sets come merged all the same once more of them
    /// wait than the bus keeps.
    std::size_t drain();

    /// False when a set could not be applied; failure() then says why, and the copy stays where it is.
    bool attached() const;
    std::string failure() const;

  private:
    struct Follower;
    std::unique_ptr<Follower> follower_;
    Attachment attachment_;
};

}  // namespace rtsg
