// MovedTop: a top in which some objects have been moved compared with the top that it was made from.
//
// Invariant: it answers as a Top would in which they had been moved there. The parts that it shares with the other one
// (groups, BVHs, pages without moved objects) must outlive it. Made from scratch: its tree holds every object.
// Threading: const once made; several may be made of one view at a time.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "top.h"

namespace rtsg::bvh {

/// An object of the tree, and the box that it has there.
struct TopLeaf {
    std::uint32_t object = 0;
    InstanceTree::Box box;
};

/// Those of a view but for its main one, which is in no tree.
std::vector<TopLeaf> leavesOf(const TopView& view);

/// The box of an object's content, in its own frame.
InstanceTree::Box localBox(const TopObject& object);

class MovedTop {
  public:
    struct Move {
        std::uint32_t object = 0;
        TopObject as;           // the object at its new place
        InstanceTree::Box box;  // of that
    };
    /// `leaves`: of `now`; `moves`: of some of them, in the order of their numbers.
    MovedTop(const TopView& now, std::span<const TopLeaf> leaves, std::span<const Move> moves);
    MovedTop(const MovedTop&) = delete;
    MovedTop& operator=(const MovedTop&) = delete;

    const TopView& view() const { return view_; }

  private:
    InstanceTree tree_;
    std::vector<const TopObject*> pages_;
    std::vector<std::unique_ptr<TopObject[]>> own_;  // pages with moved objects
    TopView view_;
};

}  // namespace rtsg::bvh
