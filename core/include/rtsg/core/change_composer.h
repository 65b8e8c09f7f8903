// ChangeComposer: makes one set of several that follow one another.
//
// Invariant: to apply the one has the effect of applying them in turn. Threading: one thread at a time.
#pragma once

#include <memory>
#include <span>

#include <rtsg/core/change.h>

namespace rtsg {

class Scene;

/// Merges consecutive sets into one with the same effect as applying them in turn. Cost grows with the sets.
class ChangeComposer {
  public:
    ChangeComposer();
    ~ChangeComposer();
    /// Precondition: set.from == the previous set's to.
    void add(const ChangeSet& set);
    bool empty() const;
    /// `scene`, which the sets are of, knows the types of nodes that went and came again, as those of parts of scenes
    /// do; without one these are found among built-in types and those that the sets define.
    ChangeSet take(const Scene* scene = nullptr);
    /// As above into a set whose memory is used again; so is the composer's own.
    void take(ChangeSet& into, const Scene* scene = nullptr);

  private:
    struct State;
    std::unique_ptr<State> state_;
};

ChangeSet compose(std::span<const std::shared_ptr<const ChangeSet>> sets);

}  // namespace rtsg
