// TreeView: the tree over the boxes of instances as rays meet it.
//
// Eight children a node: a single ray meets eight boxes at once; a packet whose directions agree in sign meets them as
// one interval, others ray by ray. Nodes lie in pages, so that a version of a changing tree shares what has not
// changed. Invariant: for every object whose box a ray's segment meets, the leaf is called (boxes and tests are
// conservative). Threading: const; whoever owns the pages says how long they stay as they are (InstanceTree,
// versions.h). Source: Wald, Benthin, Boulos 2008 (wide trees); Boulos et al. 2006 (interval traversal).
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>

#include <rtsg/renderers/ray.h>

#include "mesh/simd8.h"

namespace rtsg::bvh {

inline float smallest(simd::F8 v) {
    v = simd::min(v, __builtin_shufflevector(v, v, 4, 5, 6, 7, 0, 1, 2, 3));
    v = simd::min(v, __builtin_shufflevector(v, v, 2, 3, 0, 1, 6, 7, 4, 5));
    return std::min(v[0], v[1]);
}
inline float largest(simd::F8 v) {
    return -smallest(-v);
}

class TreeView {
  public:
    static constexpr std::uint32_t kNone = 0xFFFFFFFF;

    struct Box {
        Vec3f lower{HUGE_VALF}, upper{-HUGE_VALF};
        void extend(const Box& b) { lower = glm::min(lower, b.lower), upper = glm::max(upper, b.upper); }
        float area() const {
            const Vec3f s = glm::max(upper - lower, Vec3f(0));
            return s.x * s.y + s.y * s.z + s.z * s.x;
        }
        friend bool operator==(const Box&, const Box&) = default;
    };

    // For traversals elsewhere:
    static constexpr std::uint32_t kLeaf = 0x80000000, kRoot = 0, kPageBits = 4, kPerPage = 1 << kPageBits;
    static constexpr std::size_t kMaxLevels = 28, kStack = kMaxLevels * 7 + 8;
    struct alignas(32) Node {
        float bounds[2][3][8];   // lower and upper, by axis, by child; inverted where there is none
        std::uint32_t child[8];  // a node, or an object and kLeaf; kNone
        std::uint32_t parent = kNone, lane = 0;
        void setBox(std::uint32_t i, const Box& b) {
            for (int k = 0; k < 3; ++k) bounds[0][k][i] = b.lower[k], bounds[1][k][i] = b.upper[k];
        }
        Box box(std::uint32_t i) const {
            return {{bounds[0][0][i], bounds[0][1][i], bounds[0][2][i]},
                    {bounds[1][0][i], bounds[1][1][i], bounds[1][2][i]}};
        }
        void clear(std::uint32_t i) { setBox(i, Box{}), child[i] = kNone; }
    };
    // A few units in the last place beyond the three roundings of (bound - origin) * reciprocal.
    static constexpr float kCloser = 1 - 0x1p-21f, kFarther = 1 + 0x1p-21f;
    static constexpr float kSmall = 1e-18f;  // Embree's own limit
    /// By page, then by place in the page.
    const Node* const* nodePages() const { return pages_; }
    std::size_t nodeCount() const { return nodeCount_; }
    /// The same tree in other pages.
    TreeView in(const Node* const* pages) const {
        TreeView view = *this;
        view.pages_ = pages;
        return view;
    }

    bool empty() const { return count_ == 0; }
    /// Objects.
    std::size_t size() const { return count_; }

    /// Calls leaf(object), which returns the segment's new end; a negative one ends the search.
    template <class Leaf>
    void traverse(const Ray& ray, Leaf leaf) const;
    /// Calls leaf(object) for those whose box comes within `radius` of the point, roughly from near to far; it returns
    /// the radius from then on.
    template <class Leaf>
    void traverseNear(const Vec3f& point, float radius, Leaf leaf) const;
    /// Calls leaf(object, lanes) with all-ones for the lanes that meet its box; it lowers rays.tMax itself. `active`
    /// and the packet's tMax tell the lanes still searching: a lane whose tMax is below its tMin is done.
    template <class Leaf>
    void traverse(const RayPacket16& rays, const std::int32_t* active, Leaf leaf) const;

  protected:
    const Node* const* pages_ = nullptr;
    std::size_t nodeCount_ = 0, count_ = 0;

  private:
    struct Packet;
    /// For a few objects, all below the root: the packet's interval would cost more than it saves.
    template <class Leaf>
    void traverseRoot(const Packet& packet, const RayPacket16& rays, Leaf& leaf) const;

    const Node& node(std::uint32_t i) const { return pages_[i >> kPageBits][i & (kPerPage - 1)]; }
    static float safeReciprocal(float d) { return 1 / (std::abs(d) < kSmall ? std::copysign(kSmall, d) : d); }
    static simd::F8 safeReciprocal(simd::F8 d) {
        const simd::F8 small = simd::all(kSmall), zero{};
        return 1.0f / simd::select((d < small) & (d > -small), simd::select(d < zero, -small, small), d);
    }
};

template <class Leaf>
void TreeView::traverse(const Ray& ray, Leaf leaf) const {
    if (nodeCount_ == 0) return;
    const Vec3f reciprocal(safeReciprocal(ray.direction.x), safeReciprocal(ray.direction.y),
                           safeReciprocal(ray.direction.z));
    const simd::F8 ox = simd::all(ray.origin.x), oy = simd::all(ray.origin.y), oz = simd::all(ray.origin.z);
    const simd::F8 rx = simd::all(reciprocal.x), ry = simd::all(reciprocal.y), rz = simd::all(reciprocal.z);
    const int sx = reciprocal.x < 0, sy = reciprocal.y < 0, sz = reciprocal.z < 0;
    const simd::F8 tMin = simd::all(ray.tMin);
    float tMax = ray.tMax;
    // Distance and child in one number, ordered as distances are: those are never negative.
    std::array<std::uint64_t, kStack> stack;
    std::size_t top = 0;
    std::uint32_t current = kRoot;
    for (;;) {
        if (current & kLeaf) {
            tMax = leaf(current & ~kLeaf);
            if (tMax < 0) return;
        } else {
            const Node& n = node(current);
            const simd::F8 near =
                simd::max(simd::max((simd::load(n.bounds[sx][0]) - ox) * rx, (simd::load(n.bounds[sy][1]) - oy) * ry),
                          simd::max((simd::load(n.bounds[sz][2]) - oz) * rz, tMin)) *
                kCloser;
            const simd::F8 far = simd::min(simd::min((simd::load(n.bounds[1 - sx][0]) - ox) * rx,
                                                     (simd::load(n.bounds[1 - sy][1]) - oy) * ry),
                                           simd::min((simd::load(n.bounds[1 - sz][2]) - oz) * rz, simd::all(tMax))) *
                                 kFarther;
            std::uint32_t mask = simd::laneBits(near <= far);
            if (mask) {
                alignas(32) float nears[8];
                simd::store(nears, near);
                const auto next = [&] {
                    const auto i = static_cast<std::uint32_t>(std::countr_zero(mask));
                    mask &= mask - 1;
                    return std::uint64_t{std::bit_cast<std::uint32_t>(nears[i])} << 32 | n.child[i];
                };
                // Only the nearest is picked; sorting the others costs more than it saves.
                std::uint64_t best = next();
                while (mask) {  // NOLINT(bugprone-infinite-loop): next() takes a bit out
                    const std::uint64_t other = next();
                    stack[top++] = std::max(best, other);
                    best = std::min(best, other);
                }
                current = static_cast<std::uint32_t>(best);
                continue;
            }
        }
        const std::uint64_t end = std::uint64_t{std::bit_cast<std::uint32_t>(tMax)} << 32 | 0xFFFFFFFF;
        do {
            if (top == 0) return;
            --top;
        } while (stack[top] > end);
        current = static_cast<std::uint32_t>(stack[top]);
    }
}

template <class Leaf>
void TreeView::traverseNear(const Vec3f& point, float radius, Leaf leaf) const {
    if (nodeCount_ == 0) return;
    constexpr float margin = 1 - 0x1p-20f;  // for the roundings of a distance
    std::array<std::pair<float, std::uint32_t>, kStack> stack;
    std::size_t top = 0;
    stack[top++] = {0.0f, kRoot};
    while (top > 0) {
        const auto [distance, current] = stack[--top];
        if (distance > radius) continue;
        if (current & kLeaf) {
            radius = leaf(current & ~kLeaf);
            continue;
        }
        const Node& n = node(current);
        simd::F8 squared{};
        for (int k = 0; k < 3; ++k) {
            const simd::F8 p = simd::all(point[k]), zero{};
            const simd::F8 d =
                simd::max(simd::max(simd::load(n.bounds[0][k]) - p, p - simd::load(n.bounds[1][k])), zero);
            squared += d * d;
        }
        alignas(32) float distances[8];
        simd::store(distances, simd::sqrt(squared) * margin);
        const std::size_t first = top;
        for (std::uint32_t i = 0; i < 8; ++i)
            if (n.child[i] != kNone && distances[i] <= radius) stack[top++] = {distances[i], n.child[i]};
        std::sort(stack.begin() + static_cast<std::ptrdiff_t>(first), stack.begin() + static_cast<std::ptrdiff_t>(top),
                  [](const auto& a, const auto& b) { return a.first > b.first; });
    }
}

/// A packet as the tree sees it: its rays, and an interval around them.
struct TreeView::Packet {
    simd::F8 origin[3][2], reciprocal[3][2], tMin[2];
    simd::I8 active[2];
    bool agrees = true;  // all directions alike in sign
    bool negative[3];
    float originLow[3], originHigh[3], reciprocalLow[3], reciprocalHigh[3], start, end;

    Packet(const RayPacket16& rays, const std::int32_t* lanes) {
        const float* origins[] = {rays.originX, rays.originY, rays.originZ};
        const float* directions[] = {rays.directionX, rays.directionY, rays.directionZ};
        for (int h = 0; h < 2; ++h) {
            std::memcpy(&active[h], lanes + 8 * h, sizeof(simd::I8));
            tMin[h] = simd::load(rays.tMin + 8 * h);
            for (int k = 0; k < 3; ++k) {
                origin[k][h] = simd::load(origins[k] + 8 * h);
                reciprocal[k][h] = safeReciprocal(simd::load(directions[k] + 8 * h));
            }
        }
    }
    bool anyActive() const { return simd::laneBits(active[0] | active[1]) != 0; }
    /// Computes the interval that meetAll() needs.
    void findInterval(const RayPacket16& rays) {
        for (int k = 0; k < 3; ++k) {
            simd::F8 low = simd::all(HUGE_VALF), high = -low, rLow = low, rHigh = high;
            for (int h = 0; h < 2; ++h) {
                low = simd::min(low, simd::select(active[h], origin[k][h], low));
                high = simd::max(high, simd::select(active[h], origin[k][h], high));
                rLow = simd::min(rLow, simd::select(active[h], reciprocal[k][h], rLow));
                rHigh = simd::max(rHigh, simd::select(active[h], reciprocal[k][h], rHigh));
            }
            originLow[k] = smallest(low), originHigh[k] = largest(high);
            reciprocalLow[k] = smallest(rLow), reciprocalHigh[k] = largest(rHigh);
            negative[k] = reciprocalHigh[k] < 0;
            agrees = agrees && (reciprocalLow[k] > 0 || negative[k]);
        }
        simd::F8 first = simd::all(HUGE_VALF);
        for (int h = 0; h < 2; ++h) first = simd::min(first, simd::select(active[h], tMin[h], first));
        start = smallest(first);
        shorten(rays);
    }
    void shorten(const RayPacket16& rays) {
        simd::F8 last = simd::all(-HUGE_VALF);
        for (int h = 0; h < 2; ++h)
            last = simd::max(last, simd::select(active[h], simd::load(rays.tMax + 8 * h), last));
        end = largest(last);
    }
    /// A bit per child that some ray may meet, and a lower bound of where.
    std::uint32_t meetAll(const Node& n, simd::F8& near) const {
        near = simd::all(start);
        simd::F8 far = simd::all(end);
        for (int k = 0; k < 3; ++k) {
            const simd::F8 entry = simd::load(n.bounds[negative[k]][k]), exit = simd::load(n.bounds[!negative[k]][k]);
            const simd::F8 rLow = simd::all(reciprocalLow[k]), rHigh = simd::all(reciprocalHigh[k]), zero{};
            // The products' bounds over all origins and reciprocals of the packet.
            const simd::F8 a = entry - simd::all(negative[k] ? originLow[k] : originHigh[k]);
            const simd::F8 b = exit - simd::all(negative[k] ? originHigh[k] : originLow[k]);
            near = simd::max(near, a * simd::select(a >= zero, rLow, rHigh));
            far = simd::min(far, b * simd::select(b >= zero, rHigh, rLow));
        }
        near *= simd::all(kCloser);
        return simd::laneBits(near <= far * simd::all(kFarther));
    }
    /// Which rays meet the box of one child; the nearest distance of those, or infinity.
    float meet(const Node& n, std::uint32_t i, const float* tMax, std::int32_t* lanes) const {
        simd::F8 nearest = simd::all(HUGE_VALF);
        for (int h = 0; h < 2; ++h) {
            simd::F8 low = tMin[h], high = simd::load(tMax + 8 * h);
            for (int k = 0; k < 3; ++k) {
                const simd::F8 a = (simd::all(n.bounds[0][k][i]) - origin[k][h]) * reciprocal[k][h];
                const simd::F8 b = (simd::all(n.bounds[1][k][i]) - origin[k][h]) * reciprocal[k][h];
                low = simd::max(low, simd::min(a, b));
                high = simd::min(high, simd::max(a, b));
            }
            low *= simd::all(kCloser);
            const simd::I8 hit = (low <= high * simd::all(kFarther)) & active[h];
            nearest = simd::min(nearest, simd::select(hit, low, simd::all(HUGE_VALF)));
            std::memcpy(lanes + 8 * h, &hit, sizeof hit);
        }
        return smallest(nearest);
    }
};

template <class Leaf>
void TreeView::traverseRoot(const Packet& packet, const RayPacket16& rays, Leaf& leaf) const {
    alignas(64) std::int32_t lanes[16];
    const Node& root = node(kRoot);
    std::array<std::uint64_t, 8> order;
    std::size_t count = 0;
    for (std::uint32_t i = 0; i < 8; ++i) {
        if (root.child[i] == kNone) continue;
        const float near = packet.meet(root, i, rays.tMax, lanes);
        if (near == HUGE_VALF) continue;
        const std::uint64_t entry = std::uint64_t{std::bit_cast<std::uint32_t>(near)} << 32 | i;
        std::size_t at = count++;
        for (; at > 0 && order[at - 1] > entry; --at) order[at] = order[at - 1];
        order[at] = entry;
    }
    for (std::size_t k = 0; k < count; ++k) {
        const auto i = static_cast<std::uint32_t>(order[k]);
        if (packet.meet(root, i, rays.tMax, lanes) < HUGE_VALF) leaf(root.child[i] & ~kLeaf, lanes);
    }
}

template <class Leaf>
void TreeView::traverse(const RayPacket16& rays, const std::int32_t* active, Leaf leaf) const {
    if (nodeCount_ == 0) return;
    Packet packet(rays, active);
    if (!packet.anyActive()) return;
    if (nodeCount_ == 1) return traverseRoot(packet, rays, leaf);
    packet.findInterval(rays);
    alignas(64) std::int32_t lanes[16];
    // Distance and place (node and lane, where the box is) in one number, as for single rays.
    std::array<std::uint64_t, kStack> stack;
    std::size_t top = 0;
    alignas(32) float nears[8];
    std::uint32_t current = kRoot;
    for (;;) {
        const Node& n = node(current);
        std::uint32_t mask = 0;
        if (packet.agrees) {
            simd::F8 near;
            mask = packet.meetAll(n, near);
            simd::store(nears, near);
        } else {
            for (std::uint32_t i = 0; i < 8; ++i) {
                nears[i] = n.child[i] == kNone ? HUGE_VALF : packet.meet(n, i, rays.tMax, lanes);
                mask |= static_cast<std::uint32_t>(nears[i] < HUGE_VALF) << i;
            }
        }
        const auto next = [&] {
            const auto i = static_cast<std::uint32_t>(std::countr_zero(mask));
            mask &= mask - 1;
            return std::uint64_t{std::bit_cast<std::uint32_t>(nears[i])} << 32 | (current << 3 | i);
        };
        std::uint64_t entry;
        if (mask) {
            entry = next();
            const std::size_t first = top;
            while (mask) {  // NOLINT(bugprone-infinite-loop): next() takes a bit out
                // Sorted, nearest on top: a packet's visit costs more than the sorting.
                const std::uint64_t other = next();
                std::uint64_t farther = std::max(entry, other);
                entry = std::min(entry, other);
                std::size_t at = top++;
                for (; at > first && stack[at - 1] < farther; --at) stack[at] = stack[at - 1];
                stack[at] = farther;
            }
        } else {
            if (top == 0) return;
            entry = stack[--top];
        }
        for (;; entry = stack[--top]) {
            if (entry >> 32 <= std::bit_cast<std::uint32_t>(packet.end)) {
                const Node& holder = node(static_cast<std::uint32_t>(entry) >> 3);
                const std::uint32_t lane = entry & 7, child = holder.child[lane];
                if (!(child & kLeaf)) {
                    current = child;
                    break;
                }
                if (packet.meet(holder, lane, rays.tMax, lanes) < HUGE_VALF) {
                    leaf(child & ~kLeaf, lanes);
                    packet.shorten(rays);
                    if (packet.end < packet.start) return;
                }
            }
            if (top == 0) return;
        }
    }
}

}  // namespace rtsg::bvh
