// StrokeBvh: the lines or points of one mesh, with a tree over them that any eye's rays can use.
//
// They are some pixels wide, so how thick they are depends on who looks, from where: a tree that held them thick, as
// Embree's does, would have to be built anew for each eye and whenever one moves. This one holds them without any
// width, and rays are cones that meet its boxes: a box is met where it, grown by the width at that distance, is.
// Invariant: never changes once made; equal strokes elsewhere get a tree of the same shape, or a new one when that has
// become bad, and give the same hits. Threading: const.
// Source: Amanatides 1984 (cones); binned as in Wald 2007, eight children a node as in tree_view.h.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include <rtsg/renderers/instance_delta.h>
#include <rtsg/renderers/mesh.h>

#include "tree_view.h"

namespace rtsg::bvh {

class StrokeBvh {
  public:
    struct alignas(32) Stroke {
        Vec3f a{0};
        std::uint32_t number = 0;
        Vec3f b{0};
        float unused = 0;
    };
    static constexpr std::uint32_t kMaxInLeaf = 4;

    /// Those of the mesh, in its own frame or, with `placed`, in the one that leads to. `before`: of an earlier state
    /// of the mesh, or null.
    static std::shared_ptr<const StrokeBvh> of(const Mesh& mesh, const StrokeBvh* before,
                                               const WorldFromLocal* placed = nullptr);

    /// The root first. A leaf's child is kLeaf, its first stroke and how many follow that one.
    const std::vector<TreeView::Node>& nodes() const { return nodes_; }
    const std::vector<Stroke>& strokes() const { return strokes_; }
    static std::uint32_t firstOf(std::uint32_t leaf) { return (leaf & ~TreeView::kLeaf) / kMaxInLeaf; }
    static std::uint32_t countOf(std::uint32_t leaf) { return leaf % kMaxInLeaf + 1; }
    const TreeView::Box& box() const { return box_; }
    std::size_t bytes() const {
        return nodes_.capacity() * sizeof(TreeView::Node) + strokes_.capacity() * sizeof(Stroke);
    }

  private:
    struct Builder;
    void read(const Mesh& mesh, const WorldFromLocal* placed);
    void refit();
    double cost() const;

    std::vector<TreeView::Node> nodes_;
    std::vector<Stroke> strokes_;  // in the order of the leaves
    TreeView::Box box_;
    double builtCost_ = 0;
};

}  // namespace rtsg::bvh
