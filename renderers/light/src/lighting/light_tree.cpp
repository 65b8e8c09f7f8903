// Builds the tree, and descends it.
#include "light_tree.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <iterator>

#include "mesh/simd8.h"

namespace rtsg::trace {

using namespace simd;

namespace {

F8 sinOf(F8 cosine) {
    return simd::sqrt(max(1 - cosine * cosine, all(0)));
}

}  // namespace

LightTree::LightTree(std::span<const Cluster> emitters, float minimum) : branches_(emitters.size()), minimum_(minimum) {
    for (std::uint32_t emitter = 0; emitter < emitters.size(); ++emitter)
        if (emitters[emitter].power > 0) {
            order_.push_back({emitters[emitter].bounds.center(), emitter});
            const Vec3f& falloff = emitters[emitter].falloff;
            squaresOnly_ = squaresOnly_ && falloff.x == 0 && falloff.y == 0;
        }
    if (order_.empty()) return;
    nodes_.reserve(order_.size() / 4 + 1);
    nodes_.emplace_back();
    build(emitters, 0, order_.size(), 0, 0, 0);
    order_ = {};
}

LightTree::Cluster LightTree::join(const Cluster& a, const Cluster& b) {
    Cluster result = a;
    result.bounds.extend(b.bounds.min);
    result.bounds.extend(b.bounds.max);
    result.power += b.power;
    result.falloff = glm::min(a.falloff, b.falloff);
    if (a.cosCone <= -1 || b.cosCone <= -1) {
        result.cosCone = -1;
        return result;
    }
    const float angleA = std::acos(std::clamp(a.cosCone, -1.0f, 1.0f)),
                angleB = std::acos(std::clamp(b.cosCone, -1.0f, 1.0f)),
                between = std::acos(std::clamp(glm::dot(a.axis, b.axis), -1.0f, 1.0f));
    // A little more than needed, as these are rounded.
    constexpr float kSlack = 1e-3f;
    const float pi = 3.14159265f;
    if (between + angleB <= angleA) return result;
    if (between + angleA <= angleB) {
        result.axis = b.axis, result.cosCone = b.cosCone;
        return result;
    }
    const float angle = (between + angleA + angleB) / 2 + kSlack;
    const Vec3f across = b.axis - glm::dot(a.axis, b.axis) * a.axis;
    const float length = glm::length(across);
    if (angle >= pi || !(length > 1e-6f)) {
        result.cosCone = length > 1e-6f || glm::dot(a.axis, b.axis) < 0 ? -1.0f : std::cos(std::min(angle, pi));
        return result;
    }
    const float rotation = angle - angleA;
    result.axis = glm::normalize(std::cos(rotation) * a.axis + std::sin(rotation) * (across / length));
    result.cosCone = std::cos(angle);
    return result;
}

void LightTree::Node::set(std::size_t child, const Cluster& cluster) {
    const Vec3f center = cluster.bounds.center(), diagonal = cluster.bounds.size() * 0.5f;
    centerX[child] = center.x, centerY[child] = center.y, centerZ[child] = center.z;
    radiusSquared[child] = glm::dot(diagonal, diagonal) * 1.0001f;
    radius[child] = std::sqrt(radiusSquared[child]);
    axisX[child] = cluster.axis.x, axisY[child] = cluster.axis.y, axisZ[child] = cluster.axis.z;
    cosCone[child] = cluster.cosCone, power[child] = cluster.power;
    constant[child] = cluster.falloff.x, linear[child] = cluster.falloff.y, square[child] = cluster.falloff.z;
    sinCone[child] = std::sqrt(std::max(1 - cluster.cosCone * cluster.cosCone, 0.0f));
}

/// Sorts by the longest side of the middles' box as far as needed; returns where the second half begins.
std::size_t LightTree::halve(std::size_t first, std::size_t last) {
    Bounds centers;
    for (std::size_t i = first; i < last; ++i) centers.extend(order_[i].middle);
    const Vec3f size = centers.size();
    const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
    const std::size_t half = first + (last - first) / 2;
    const auto at = [&](std::size_t i) { return order_.begin() + static_cast<std::ptrdiff_t>(i); };
    std::nth_element(at(first), at(half), at(last), [axis](const Placed& a, const Placed& b) {
        const float x = a.middle[axis], y = b.middle[axis];
        return x != y ? x < y : a.emitter < b.emitter;
    });
    return half;
}

// Halves three times where there are more than eight, so that no way is longer than 21 nodes.
LightTree::Cluster LightTree::build(std::span<const Cluster> emitters, std::size_t first, std::size_t last,
                                    std::uint32_t node, std::uint32_t depth, std::uint64_t branches) {
    std::array<std::size_t, kWide + 1> ends{first, last};
    std::size_t parts = 1;
    if (last - first <= kWide) {
        for (parts = 0; parts < last - first; ++parts) ends[parts] = first + parts;
        ends[parts] = last;
    } else {
        for (; parts < kWide; parts *= 2) {
            for (std::size_t i = parts; i > 0; --i) ends[2 * i] = ends[i];
            for (std::size_t i = 0; i < parts; ++i) ends[2 * i + 1] = halve(ends[2 * i], ends[2 * i + 2]);
        }
    }
    Cluster whole;
    nodes_[node].count = static_cast<std::uint8_t>(parts);
    for (std::size_t part = 0; part < parts; ++part) {
        const std::uint64_t on = branches | std::uint64_t{part} << (3 * depth);
        Cluster cluster;
        if (ends[part + 1] - ends[part] == 1) {
            const std::uint32_t emitter = order_[ends[part]].emitter;
            cluster = emitters[emitter];
            branches_[emitter] = on;
            nodes_[node].next[part] = emitter;
            nodes_[node].leaves |= static_cast<std::uint8_t>(1u << part);
        } else {
            const auto below = static_cast<std::uint32_t>(nodes_.size());
            nodes_[node].next[part] = below;
            nodes_.emplace_back();
            cluster = build(emitters, ends[part], ends[part + 1], below, depth + 1, on);
        }
        nodes_[node].set(part, cluster);
        whole = part == 0 ? cluster : join(whole, cluster);
    }
    return whole;
}

/// Estimates of the light from there that are 0 only where nothing can come. A cosine is cut at 1, as if of the most
/// favourable direction, after the sine of the sphere around a cluster, as the point sees it, is added: cos a + sin b
/// is 0 where the angle a is a right one and b more, as the cosine of a - b would be, for one root less.
[[gnu::always_inline]] inline F8 LightTree::importance(const Clusters& c, const V8& point, const V8& normal) const {
    constexpr float kMin = 1e-12f;   // m^2
    constexpr float kSlack = 1e-4f;  // of the rounded cosines
    const V8 towards = c.center - point;
    const F8 distanceSquared = dot(towards, towards), inverse = 1 / max(distanceSquared, all(kMin));
    const F8 perMetre = simd::sqrt(inverse), reach = c.radius * perMetre + kSlack;
    const F8 lit = dot(towards, normal) * perMetre + reach;
    const F8 cosAxis = dot(towards, c.axis) * -perMetre;
    // A triangle's cone, or all directions, has no sine.
    F8 cosLeft = cosAxis * c.cosCone;
    if (any(c.sinCone != 0.0f)) cosLeft += sinOf(cosAxis) * c.sinCone;
    const F8 shines = select(cosAxis >= c.cosCone - kSlack, all(1), cosLeft + reach);
    const auto cut = [](F8 cosine) { return min(max(cosine, all(0)), all(1)); };
    // From inside a cluster it seems as far as its edge is.
    const F8 farSquared = max(distanceSquared, c.radiusSquared);
    F8 falloff = c.square * farSquared;
    if (!squaresOnly_) falloff += c.constant + c.linear * simd::sqrt(farSquared);
    const F8 seen = select(distanceSquared > c.radiusSquared, cut(lit) * cut(shines), all(1));
    return min(c.power * seen / max(falloff, all(minimum_)), all(1e36f));  // so that no sum is infinite
}

inline LightTree::Clusters LightTree::allOf(const Node& node) {
    return {{load(node.centerX), load(node.centerY), load(node.centerZ)},
            {load(node.axisX), load(node.axisY), load(node.axisZ)},
            load(node.radius),
            load(node.radiusSquared),
            load(node.cosCone),
            load(node.sinCone),
            load(node.power),
            load(node.constant),
            load(node.linear),
            load(node.square)};
}

inline LightTree::Clusters LightTree::oneOf(const Node& node, std::size_t i) {
    return {{all(node.centerX[i]), all(node.centerY[i]), all(node.centerZ[i])},
            {all(node.axisX[i]), all(node.axisY[i]), all(node.axisZ[i])},
            all(node.radius[i]),
            all(node.radiusSquared[i]),
            all(node.cosCone[i]),
            all(node.sinCone[i]),
            all(node.power[i]),
            all(node.constant[i]),
            all(node.linear[i]),
            all(node.square[i])};
}

namespace {

// Sums are made in one order for one surface and for eight, so that both choose alike.

/// The sums of each of eight numbers and all numbers before it.
F8 sumsUpTo(F8 x) {
    const F8 none{};
    x += __builtin_shufflevector(none, x, 0, 8, 9, 10, 11, 12, 13, 14);
    x += __builtin_shufflevector(none, x, 0, 1, 8, 9, 10, 11, 12, 13);
    return x + __builtin_shufflevector(none, x, 0, 1, 2, 3, 8, 9, 10, 11);
}
/// The same of eight times `count` numbers.
void sumsUpTo(F8* x, std::size_t count) {
    for (std::size_t step = 1; step < count; step *= 2)
        for (std::size_t i = count; i-- > step;) x[i] += x[i - step];
}

constexpr float kBelowOne = 0x1.fffffep-1f;

I8 lanesOf8(std::uint32_t bits) {
    return ((I8{} + static_cast<std::int32_t>(bits)) & I8{1, 2, 4, 8, 16, 32, 64, 128}) != 0;
}
/// Picks one of eight numbers for each lane.
I8 oneEach(const std::uint32_t* numbers, I8 which) {
#ifdef __AVX2__
    __m256i from, order;
    std::memcpy(&from, numbers, sizeof from), std::memcpy(&order, &which, sizeof order);
    from = _mm256_permutevar8x32_epi32(from, order);
    std::memcpy(&which, &from, sizeof which);
#else
    for (int lane = 0; lane < 8; ++lane) which[lane] = static_cast<std::int32_t>(numbers[which[lane]]);
#endif
    return which;
}

}  // namespace

/// The importances of all eight, and in `before` the sums of those before each and of all; `above`: a bit for each that
/// is not 0.
struct LightTree::Fractions {
    alignas(32) float each[kWide], before[kWide + 8];
    std::uint32_t above;
    float sum() const { return before[kWide]; }
};

[[gnu::always_inline]] inline LightTree::Fractions LightTree::fractions(const Node& node, const Vec3f& point,
                                                                        const Vec3f& normal) const {
    const F8 result = importance(allOf(node), {all(point.x), all(point.y), all(point.z)},
                                 {all(normal.x), all(normal.y), all(normal.z)});
    Fractions s;
    store(s.each, result);
    s.before[0] = 0;
    store(s.before + 1, sumsUpTo(result));
    s.above = laneBits(result > 0.0f);
    return s;
}

LightTree::Choice LightTree::sample(const Vec3f& point, const Vec3f& normal, float u) const {
    if (nodes_.empty()) return {};
    Step step{0, u, 1};
    while (!descend(step, point, normal)) {
    }
    return {step.next, step.probability};
}

/// One node further down, without branches on where to, which nobody could foresee. Returns whether it ends there.
bool LightTree::descend(Step& step, const Vec3f& point, const Vec3f& normal) const {
    const Node& node = nodes_[step.next];
    const Fractions s = fractions(node, point, normal);
    if (!(s.sum() > 0)) {
        step = {kNone, 0, 0};
        return true;
    }
    const float at = step.u * s.sum();
    const auto passed = static_cast<std::uint32_t>(std::popcount(laneBits(load(s.before + 1) <= at)));
    const std::uint32_t child = std::min(passed, static_cast<std::uint32_t>(std::bit_width(s.above)) - 1);
    step.u = std::min(std::max(at - s.before[child], 0.0f) / s.each[child], kBelowOne);
    step.probability *= s.each[child] / s.sum();
    step.next = node.next[child];
    return (node.leaves >> child & 1u) != 0;
}

// The root is one for all: its clusters are looked at one after the other, by eight surfaces each. Below it they part,
// and each goes a step in turn: none waits for the one before.
LightTree::Choices LightTree::sample(const V8& point, const V8& normal, F8 u, std::uint32_t lanes) const {
    Choices result;
    std::fill(std::begin(result.emitter), std::end(result.emitter), kNone);
    store(result.probability, all(0));
    if (nodes_.empty() || !lanes) return result;
    const Node& root = nodes_[0];
    F8 each[kWide], sums[kWide];
    I8 last{};
    std::size_t i = 0;
    do {  // there is one at least
        sums[i] = each[i] = importance(oneOf(root, i), point, normal);
        last = each[i] > 0.0f ? I8{} + static_cast<std::int32_t>(i) : last;
    } while (++i < root.count);
    sumsUpTo(sums, root.count);
    const F8 sum = sums[root.count - 1], at = u * sum;
    I8 child{};
    for (i = 0; i < root.count; ++i) child -= sums[i] <= at;
    child = child < last ? child : last;
    F8 chosen = each[0], before = all(0);
    for (i = 1; i < root.count; ++i) {
        const I8 here = child == static_cast<std::int32_t>(i);
        chosen = select(here, each[i], chosen), before = select(here, sums[i - 1], before);
    }
    const I8 found = (sum > 0.0f) & lanesOf8(lanes);
    const I8 next = found ? oneEach(root.next, child) : I8{} + static_cast<std::int32_t>(kNone);
    std::memcpy(result.emitter, &next, sizeof next);
    store(result.probability, select(sum > 0.0f, chosen / sum, all(0)));
    const I8 isNode = (((I8{} + root.leaves) >> child) & 1) == 0;
    std::uint32_t below = laneBits(found & isNode);
    if (!below) return result;
    alignas(32) float rest[8];
    store(rest, min(max(at - before, all(0)) / chosen, all(kBelowOne)));
    alignas(32) float p[3][8], n[3][8];
    store(p[0], point.x), store(p[1], point.y), store(p[2], point.z);
    store(n[0], normal.x), store(n[1], normal.y), store(n[2], normal.z);
    Step steps[8];
    for (std::uint32_t some = below; some; some &= some - 1) {
        const int lane = std::countr_zero(some);
        steps[lane] = {result.emitter[lane], rest[lane], result.probability[lane]};
    }
    while (below)
        for (std::uint32_t some = below; some; some &= some - 1) {
            const int lane = std::countr_zero(some);
            Step& step = steps[lane];
            if (!descend(step, {p[0][lane], p[1][lane], p[2][lane]}, {n[0][lane], n[1][lane], n[2][lane]})) continue;
            result.emitter[lane] = step.next, result.probability[lane] = step.probability;
            below &= ~(1u << lane);
        }
    return result;
}

float LightTree::probability(std::uint32_t emitter, const Vec3f& point, const Vec3f& normal) const {
    float probability = 1;
    std::uint32_t at = 0;
    for (std::uint64_t branches = branches_[emitter];; branches >>= 3) {
        const Node& node = nodes_[at];
        const Fractions s = fractions(node, point, normal);
        if (!(s.sum() > 0)) return 0;
        const std::size_t child = branches & 7u;
        probability *= s.each[child] / s.sum();
        if (node.leaves >> child & 1u) return node.next[child] == emitter ? probability : 0.0f;
        at = node.next[child];
    }
}

}  // namespace rtsg::trace
