// The tree and the pages of a view in which some objects have moved.
#include "moved_top.h"

#include <algorithm>

namespace rtsg::bvh {

std::vector<TopLeaf> leavesOf(const TopView& view) {
    const TreeView& tree = view.tree();
    std::vector<TopLeaf> leaves;
    if (tree.empty()) return leaves;
    leaves.reserve(tree.size());
    std::vector<std::uint32_t> open{TreeView::kRoot};
    while (!open.empty()) {
        const std::uint32_t at = open.back();
        open.pop_back();
        const TreeView::Node& node = tree.nodePages()[at >> TreeView::kPageBits][at & (TreeView::kPerPage - 1)];
        for (std::uint32_t i = 0; i < 8; ++i) {
            if (node.child[i] == TreeView::kNone) continue;
            if (node.child[i] & TreeView::kLeaf)
                leaves.push_back({node.child[i] & ~TreeView::kLeaf, node.box(i)});
            else
                open.push_back(node.child[i]);
        }
    }
    std::ranges::sort(leaves, {}, &TopLeaf::object);
    return leaves;
}

InstanceTree::Box localBox(const TopObject& object) {
    RTCBounds bounds{};
    rtcGetSceneBounds(object.scene, &bounds);
    return {{bounds.lower_x, bounds.lower_y, bounds.lower_z}, {bounds.upper_x, bounds.upper_y, bounds.upper_z}};
}

MovedTop::MovedTop(const TopView& now, std::span<const TopLeaf> leaves, std::span<const Move> moves) : view_(now) {
    constexpr std::size_t kPerPage = TopView::kObjectsPerPage;
    std::uint32_t last = now.mainObject_ == TreeView::kNone ? 0 : now.mainObject_;
    for (const TopLeaf& leaf : leaves) {
        tree_.set(leaf.object, leaf.box);
        last = std::max(last, leaf.object);
    }
    pages_.assign(now.objects_, now.objects_ + (leaves.empty() ? 0 : last / kPerPage + 1));
    std::size_t copied = pages_.size();  // the page that was copied last
    for (const Move& move : moves) {
        const std::size_t page = move.object / kPerPage;
        if (page != copied) {
            own_.push_back(std::make_unique<TopObject[]>(kPerPage));
            std::copy_n(pages_[page], kPerPage, own_.back().get());
            pages_[page] = own_.back().get();
            copied = page;
        }
        own_.back()[move.object % kPerPage] = move.as;
        tree_.set(move.object, move.box);
    }
    tree_.commit();
    view_.tree_ = tree_;
    if (!pages_.empty()) view_.objects_ = pages_.data();
}

}  // namespace rtsg::bvh
