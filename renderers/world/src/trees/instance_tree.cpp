// Keeps the tree over the boxes of instances in step with them.
#include "instance_tree.h"

#include <cmath>
#include <limits>

namespace rtsg::bvh {

namespace {

constexpr int kBins = 16;
/// Trees this much costlier than when they were built are built anew.
constexpr double kSpoilt = 1.4;

}  // namespace

void InstanceTree::set(std::uint32_t object, const Box& box) {
    if (object >= objects_.size()) objects_.resize(std::max<std::size_t>(object + 1, objects_.size() * 3 / 2));
    ObjectState& o = objects_[object];
    if (!o.present) {
        o.present = true;
        ++count_;
        ++inserted_;
    }
    o.box = box;
    if (!std::exchange(o.dirty, true)) dirty_.push_back(object);
}

void InstanceTree::remove(std::uint32_t object) {
    if (object >= objects_.size() || !objects_[object].present) return;
    ObjectState& o = objects_[object];
    o.present = false;
    --count_;
    ++changesSinceBuild_;
    if (o.node != kNone)
        take(object);
    else
        --inserted_;
}

void InstanceTree::commit() {
    std::erase_if(dirty_, [&](std::uint32_t object) {
        objects_[object].dirty = false;
        return !objects_[object].present;
    });
    changesSinceBuild_ += dirty_.size();
    if (count_ == 0) {
        nodes_.clear();
        freeNodes_.clear();
    } else if (nodes_.empty() || inserted_ * 4 > count_) {
        build();
    } else {
        const bool many = dirty_.size() * 4 > count_;
        for (const std::uint32_t object : dirty_) {
            ObjectState& o = objects_[object];
            if (o.node == kNone) {
                insert(object);
                continue;
            }
            // One that has left its neighbours finds new ones; else its node would grow across the scene.
            if (!many && o.node != kRoot && hasStrayed(o)) {
                take(object);
                insert(object);
                continue;
            }
            nodes_.write(o.node).setBox(o.lane, o.box);
            if (!many) refitUp(o.node);
        }
        if (many) refitAll();
        const bool spoilt = cost() > kSpoilt * builtCost_ && changesSinceBuild_ * 8 > count_;
        if (spoilt || tooDeep_) build();
    }
    dirty_.clear();
    inserted_ = 0;
    pages_ = nodes_.pages();
    nodeCount_ = nodes_.size();
    bounds_ = nodes_.empty() ? Box{} : boxOf(kRoot);
    only_ = kNone;
    if (count_ == 1)
        for (std::uint32_t i = 0; i < 8; ++i)
            if (nodes_[kRoot].child[i] != kNone) only_ = nodes_[kRoot].child[i] & ~kLeaf;
}

bool InstanceTree::hasStrayed(const ObjectState& o) const {
    Box others;
    for (std::uint32_t i = 0; i < 8; ++i)
        if (i != o.lane) others.extend(nodes_[o.node].box(i));
    const Vec3f moved = glm::abs((o.box.lower + o.box.upper) * .5f - o.anchor);
    const Vec3f near = (others.upper - others.lower) + (o.box.upper - o.box.lower);
    return moved.x + moved.y + moved.z > near.x + near.y + near.z;
}

InstanceTree::Box InstanceTree::boxOf(std::uint32_t node) const {
    Box box;
    for (std::uint32_t i = 0; i < 8; ++i) box.extend(nodes_[node].box(i));
    return box;
}

/// Expected number of nodes that a ray meets, but for a factor.
double InstanceTree::cost() const {
    const double root = boxOf(kRoot).area();
    return root > 0 ? area_ / root : 0;
}

std::uint32_t InstanceTree::newNode(std::uint32_t parent, std::uint32_t lane) {
    std::uint32_t node;
    if (freeNodes_.empty()) {
        node = static_cast<std::uint32_t>(nodes_.size());
        nodes_.grow(node + std::size_t{1});
    } else {
        node = freeNodes_.back();
        freeNodes_.pop_back();
    }
    Node& n = nodes_.write(node);
    for (std::uint32_t i = 0; i < 8; ++i) n.clear(i);
    n.parent = parent;
    n.lane = lane;
    return node;
}

void InstanceTree::putChild(std::uint32_t node, std::uint32_t lane, std::uint32_t child, const Box& box) {
    Node& n = nodes_.write(node);
    n.child[lane] = child;
    n.setBox(lane, box);
    if (child & kLeaf) {
        objects_[child & ~kLeaf].node = node;
        objects_[child & ~kLeaf].lane = lane;
        objects_[child & ~kLeaf].anchor = (box.lower + box.upper) * .5f;
    } else {
        Node& below = nodes_.write(child);
        below.parent = node;
        below.lane = lane;
    }
}

void InstanceTree::refitUp(std::uint32_t node) {
    while (nodes_[node].parent != kNone) {
        const std::uint32_t parent = nodes_[node].parent, lane = nodes_[node].lane;
        const Box before = nodes_[parent].box(lane), now = boxOf(node);
        if (before == now) return;
        area_ += double{now.area()} - double{before.area()};
        nodes_.write(parent).setBox(lane, now);
        node = parent;
    }
}

void InstanceTree::refitAll() {
    area_ = 0;
    // Depth first with the children done when a node is left; parents may lie anywhere in the array.
    std::vector<std::pair<std::uint32_t, bool>>& stack = refitting_;
    stack.assign(1, {kRoot, false});
    while (!stack.empty()) {
        const auto [node, done] = stack.back();
        stack.pop_back();
        if (done) {
            const Box box = boxOf(node);
            area_ += box.area();
            if (nodes_[node].parent != kNone) nodes_.write(nodes_[node].parent).setBox(nodes_[node].lane, box);
            continue;
        }
        stack.emplace_back(node, true);
        for (const std::uint32_t child : nodes_[node].child)
            if (child != kNone && !(child & kLeaf)) stack.emplace_back(child, false);
    }
    area_ -= boxOf(kRoot).area();
}

void InstanceTree::insert(std::uint32_t object) {
    const Box& box = objects_[object].box;
    std::uint32_t node = kRoot;
    for (std::size_t level = 1;; ++level) {
        if (level >= kMaxLevels - 1) tooDeep_ = true;  // built anew before a ray sees it
        const Node& n = nodes_[node];
        std::uint32_t best = 0, empty = kNone;
        float minimum = HUGE_VALF;
        for (std::uint32_t i = 0; i < 8; ++i) {
            if (n.child[i] == kNone) {
                empty = i;
                continue;
            }
            const Box old = n.box(i);
            Box grown = old;
            grown.extend(box);
            // Going into a leaf costs a node, otherwise the growth of the box. Among boxes that need not grow, the
            // smallest is taken.
            const float extra = n.child[i] & kLeaf ? grown.area() : grown.area() - old.area() + 1e-3f * old.area();
            if (extra < minimum) minimum = extra, best = i;
        }
        // An empty place is taken unless a child has room for it at next to no cost.
        if (empty != kNone && (node == kRoot || n.child[best] & kLeaf || minimum > .1f * box.area())) {
            putChild(node, empty, object | kLeaf, box);
            break;
        }
        const std::uint32_t child = n.child[best];
        if (!(child & kLeaf)) {
            node = child;
            continue;
        }
        const Box other = n.box(best);
        const std::uint32_t pair = newNode(node, best);
        putChild(node, best, pair, other);
        putChild(pair, 0, child, other);
        putChild(pair, 1, object | kLeaf, box);
        area_ += other.area();
        node = pair;
        break;
    }
    refitUp(node);
}

void InstanceTree::take(std::uint32_t object) {
    ObjectState& o = objects_[object];
    std::uint32_t node = o.node;
    nodes_.write(node).clear(o.lane);
    o.node = kNone;
    // A node with one child left gives it to its parent.
    while (node != kRoot) {
        const Node& n = nodes_[node];
        std::uint32_t children = 0, last = 0;
        for (std::uint32_t i = 0; i < 8; ++i)
            if (n.child[i] != kNone) ++children, last = i;
        if (children > 1) break;
        const std::uint32_t parent = n.parent, lane = n.lane;
        area_ -= nodes_[parent].box(lane).area();
        if (children == 1) {
            const Box box = n.box(last);
            putChild(parent, lane, n.child[last], box);
        } else {
            nodes_.write(parent).clear(lane);
        }
        freeNodes_.push_back(node);
        node = parent;
        if (children == 1) break;
    }
    refitUp(node);
}

/// Objects order_[begin] to order_[end], and the box around them.
struct InstanceTree::Part {
    std::uint32_t begin, end;
    Box box;
};

InstanceTree::Part InstanceTree::partOf(std::uint32_t begin, std::uint32_t end) const {
    Part part{begin, end, {}};
    for (std::uint32_t i = begin; i < end; ++i) part.box.extend(objects_[order_[i]].box);
    return part;
}

/// Divides a part where the surface-area heuristic over `kBins` slices says so; far down the tree in halves at any
/// cost, so that the depth stays bounded.
void InstanceTree::split(const Part& part, std::size_t level, Part& a, Part& b) {
    const auto center = [&](std::uint32_t object) { return objects_[object].box.lower + objects_[object].box.upper; };
    Vec3f lower(HUGE_VALF), upper(-HUGE_VALF);
    for (std::uint32_t i = part.begin; i < part.end; ++i) {
        const Vec3f c = center(order_[i]);
        lower = glm::min(lower, c), upper = glm::max(upper, c);
    }
    const Vec3f size = upper - lower;
    int bestAxis = -1, bestBin = 0;
    float bestCost = HUGE_VALF;
    for (int axis = 0; axis < 3 && level < kMaxLevels / 2; ++axis) {
        const float scale = kBins * (1 - 1e-5f) / size[axis];
        if (!(size[axis] > 0) || !std::isfinite(scale)) continue;  // hardly any size: no bins
        std::array<Box, kBins> boxes;
        std::array<std::uint32_t, kBins> counts{};
        for (std::uint32_t i = part.begin; i < part.end; ++i) {
            const auto bin = static_cast<std::size_t>((center(order_[i])[axis] - lower[axis]) * scale);
            boxes[bin].extend(objects_[order_[i]].box);
            ++counts[bin];
        }
        std::array<float, kBins> right{};
        Box sum;
        std::uint32_t n = 0;
        for (std::size_t k = kBins - 1; k > 0; --k) {
            sum.extend(boxes[k]);
            n += counts[k];
            right[k] = sum.area() * static_cast<float>(n);
        }
        sum = {}, n = 0;
        for (std::size_t k = 1; k < kBins; ++k) {
            sum.extend(boxes[k - 1]);
            n += counts[k - 1];
            if (n == 0 || n == part.end - part.begin) continue;
            const float total = sum.area() * static_cast<float>(n) + right[k];
            if (total < bestCost) bestCost = total, bestAxis = axis, bestBin = static_cast<int>(k);
        }
    }
    std::uint32_t middle = part.begin + (part.end - part.begin) / 2;
    const auto first = order_.begin() + part.begin, last = order_.begin() + part.end;
    if (bestAxis >= 0) {
        const float scale = kBins * (1 - 1e-5f) / size[bestAxis];
        const auto at = std::partition(first, last, [&](std::uint32_t object) {
            return static_cast<int>((center(object)[bestAxis] - lower[bestAxis]) * scale) < bestBin;
        });
        middle = part.begin + static_cast<std::uint32_t>(at - first);
    } else {
        const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
        std::nth_element(first, first + (middle - part.begin), last,
                         [&](std::uint32_t x, std::uint32_t y) { return center(x)[axis] < center(y)[axis]; });
    }
    a = partOf(part.begin, middle);
    b = partOf(middle, part.end);
}

void InstanceTree::build() {
    ++builds_;
    nodes_.clear();
    freeNodes_.clear();
    tooDeep_ = false;
    order_.clear();
    for (std::uint32_t i = 0; i < objects_.size(); ++i)
        if (objects_[i].present) order_.push_back(i);

    struct Work {
        Part part;
        std::uint32_t node;
        std::size_t level;
    };
    const auto all = static_cast<std::uint32_t>(order_.size());
    std::vector<Work> stack{{partOf(0, all), newNode(kNone, 0), 1}};
    area_ = 0;
    while (!stack.empty()) {
        const Work work = stack.back();
        stack.pop_back();
        std::array<Part, 8> parts{work.part};
        std::size_t count = 1;
        while (count < 8) {
            // A part that fits into one node is not split, so that nodes are well filled; it is split if it is all that
            // there is.
            const std::uint32_t enough = work.part.end - work.part.begin <= 8 ? 1 : 8;
            std::size_t largest = 8;
            for (std::size_t i = 0; i < count; ++i)
                if (parts[i].end - parts[i].begin > enough &&
                    (largest == 8 || parts[i].box.area() > parts[largest].box.area()))
                    largest = i;
            if (largest == 8) break;
            const Part whole = parts[largest];
            split(whole, work.level, parts[largest], parts[count++]);
        }
        for (std::uint32_t i = 0; i < count; ++i) {
            const Part& part = parts[i];
            if (part.end - part.begin == 1) {
                putChild(work.node, i, order_[part.begin] | kLeaf, part.box);
                continue;
            }
            const std::uint32_t child = newNode(work.node, i);
            putChild(work.node, i, child, part.box);
            area_ += part.box.area();
            stack.push_back({part, child, work.level + 1});
        }
    }
    builtCost_ = std::max(cost(), 1e-3);
    changesSinceBuild_ = 0;
}

}  // namespace rtsg::bvh
