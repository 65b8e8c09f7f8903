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
    /// `scene` is the one whose sets these are. It knows the types of nodes that went and came back, as they do in
    /// parts of scenes; without a scene, types are looked up among the built-in ones and those that the sets define.
    ChangeSet take(const Scene* scene = nullptr);
    /// Does the same into a set whose memory is used again; the composer uses its own memory again, too.
    void take(ChangeSet& into, const Scene* scene = nullptr);

  private:
    struct State;
    std::unique_ptr<State> state_;
};

ChangeSet compose(std::span<const std::shared_ptr<const ChangeSet>> sets);

}  // namespace rtsg
