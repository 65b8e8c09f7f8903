// ChangeComposer: makes one set of several that follow one another.
//
// Invariant: applying the one set has the effect of applying the several in turn. Threading: one thread at a time.
#pragma once

#include <memory>
#include <span>

#include <rtsg/core/change.h>

namespace rtsg {

class Scene;

/// Merges consecutive sets into one. The cost grows with the size of the sets.
class ChangeComposer {
  public:
    ChangeComposer();
    ~ChangeComposer();
    /// Precondition: set.from is the previous set's to.
    void add(const ChangeSet& set);
    bool empty() const;
    /// Returns the merged set. `scene` is the scene whose sets these are; it knows the types of nodes that went and
    /// came back, as happens in parts of scenes. Without a scene, types are looked up among the built-in ones and those
    /// that the sets define.
    ChangeSet take(const Scene* scene = nullptr);
    /// Does the same into an existing set, and reuses the memory of that set and of the composer.
    void take(ChangeSet& into, const Scene* scene = nullptr);

  private:
    struct State;
    std::unique_ptr<State> state_;
};

ChangeSet compose(std::span<const std::shared_ptr<const ChangeSet>> sets);

}  // namespace rtsg
