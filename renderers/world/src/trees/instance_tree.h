// InstanceTree: a tree over the boxes of instances that follows each change in logarithmic time.
//
// It stands where Embree would want a scene of instances, whose commit is linear in their number (53 ms for 100,000),
// or scenes of instances nested in user geometries, which cost rays 20 to 100 % (measured on 10^3 to 10^5 spheres).
// Built by binned surface area; built anew when changes have spoilt it. How rays meet it: tree_view.h.
// Invariant: after commit() the view is complete; a held version's pages are not written.
// Threading: const while traced; frozen views of it go on while it changes (versions.h).
// Source: Wald 2007 (binning).
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "paged.h"
#include "tree_view.h"

namespace rtsg::bvh {

class InstanceTree : public TreeView {
  public:
    explicit InstanceTree(const Versions* versions = nullptr) : nodes_(versions) {}

    /// Puts the object in, or moves it. Takes effect with commit().
    void set(std::uint32_t object, const Box& box);
    void remove(std::uint32_t object);
    void commit();

    /// The one object when size() is 1.
    std::uint32_t only() const { return only_; }
    const Box& bounds() const { return bounds_; }
    std::size_t bytes() const { return nodes_.bytes() + objects_.capacity() * sizeof(ObjectState); }
    std::size_t builds() const { return builds_; }

    /// A view that stays as it is; its list of pages is kept in `pages`.
    TreeView freeze(std::vector<const Node*>& pages) const {
        nodes_.freezeInto(pages);
        return in(pages.data());
    }
    /// After Versions::refresh(), when somebody has let go.
    void sweep() { nodes_.sweep(); }

  private:
    struct ObjectState {
        Box box;
        std::uint32_t node = kNone, lane = 0;
        Vec3f anchor{0};  // centre when it got its place in the tree
        bool present = false, dirty = false;
    };

    struct Part;
    void build();
    Part partOf(std::uint32_t begin, std::uint32_t end) const;
    void split(const Part& part, std::size_t level, Part& a, Part& b);
    std::uint32_t newNode(std::uint32_t parent, std::uint32_t lane);
    void putChild(std::uint32_t node, std::uint32_t lane, std::uint32_t child, const Box& box);
    bool hasStrayed(const ObjectState& object) const;
    void insert(std::uint32_t object);
    void take(std::uint32_t object);
    /// Makes the boxes above `node` right again.
    void refitUp(std::uint32_t node);
    void refitAll();
    Box boxOf(std::uint32_t node) const;
    double cost() const;

    Paged<Node, kPerPage> nodes_;  // the root first
    std::vector<std::uint32_t> freeNodes_;
    std::vector<ObjectState> objects_;
    std::vector<std::uint32_t> dirty_, order_;
    std::vector<std::pair<std::uint32_t, bool>> refitting_;  // kept for its memory
    Box bounds_;
    std::size_t inserted_ = 0, changesSinceBuild_ = 0, builds_ = 0;
    std::uint32_t only_ = kNone;
    double area_ = 0, builtCost_ = 0;
    bool tooDeep_ = false;
};

}  // namespace rtsg::bvh
