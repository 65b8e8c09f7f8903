// Building the tree, and the way down it.
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

LightTree::LightTree(std::span<const Cluster> things, float least) : ways_(things.size()), least_(least) {
    for (std::uint32_t thing = 0; thing < things.size(); ++thing)
        if (things[thing].power > 0) {
            order_.push_back(thing);
            const Vec3f& falloff = things[thing].falloff;
            squaresOnly_ = squaresOnly_ && falloff.x == 0 && falloff.y == 0;
        }
    if (order_.empty()) return;
    nodes_.emplace_back();
    build(things, 0, order_.size(), 0, 0, 0);
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
    const float turn = angle - angleA;
    result.axis = glm::normalize(std::cos(turn) * a.axis + std::sin(turn) * (across / length));
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
std::size_t LightTree::halve(std::span<const Cluster> things, std::size_t first, std::size_t last) {
    Bounds centers;
    const auto middle = [&](std::uint32_t thing) { return things[thing].bounds.center(); };
    for (std::size_t i = first; i < last; ++i) centers.extend(middle(order_[i]));
    const Vec3f size = centers.size();
    const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
    const std::size_t half = first + (last - first) / 2;
    const auto at = [&](std::size_t i) { return order_.begin() + static_cast<std::ptrdiff_t>(i); };
    std::nth_element(at(first), at(half), at(last), [&](std::uint32_t a, std::uint32_t b) {
        const float x = middle(a)[axis], y = middle(b)[axis];
        return x != y ? x < y : a < b;
    });
    return half;
}

// Halves three times where there are more than eight, so that no way is longer than 21 nodes.
LightTree::Cluster LightTree::build(std::span<const Cluster> things, std::size_t first, std::size_t last,
                                    std::uint32_t node, std::uint32_t depth, std::uint64_t way) {
    std::array<std::size_t, kWide + 1> ends{first, last};
    std::size_t parts = 1;
    if (last - first <= kWide) {
        for (parts = 0; parts < last - first; ++parts) ends[parts] = first + parts;
        ends[parts] = last;
    } else {
        for (; parts < kWide; parts *= 2) {
            for (std::size_t i = parts; i > 0; --i) ends[2 * i] = ends[i];
            for (std::size_t i = 0; i < parts; ++i) ends[2 * i + 1] = halve(things, ends[2 * i], ends[2 * i + 2]);
        }
    }
    Cluster whole;
    nodes_[node].count = static_cast<std::uint8_t>(parts);
    for (std::size_t part = 0; part < parts; ++part) {
        const std::uint64_t on = way | std::uint64_t{part} << (3 * depth);
        Cluster cluster;
        if (ends[part + 1] - ends[part] == 1) {
            const std::uint32_t thing = order_[ends[part]];
            cluster = things[thing];
            ways_[thing] = on;
            nodes_[node].next[part] = thing;
            nodes_[node].leaves |= static_cast<std::uint8_t>(1u << part);
        } else {
            const auto below = static_cast<std::uint32_t>(nodes_.size());
            nodes_[node].next[part] = below;
            nodes_.emplace_back();
            cluster = build(things, ends[part], ends[part + 1], below, depth + 1, on);
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
    constexpr float kLeast = 1e-12f;  // m^2
    constexpr float kSlack = 1e-4f;   // of the rounded cosines
    const V8 towards = c.center - point;
    const F8 distanceSquared = dot(towards, towards), inverse = 1 / max(distanceSquared, all(kLeast));
    const F8 perMetre = simd::sqrt(inverse), reach = c.radius * perMetre + kSlack;
    const F8 lit = dot(towards, normal) * perMetre + reach;
    const F8 cosAxis = dot(towards, c.axis) * -perMetre;
    const F8 cosLeft = cosAxis * c.cosCone + sinOf(cosAxis) * c.sinCone;
    const F8 shines = select(cosAxis >= c.cosCone - kSlack, all(1), cosLeft + reach);
    const auto cut = [](F8 cosine) { return min(max(cosine, all(0)), all(1)); };
    // From inside a cluster it seems as far as its edge is.
    const F8 farSquared = max(distanceSquared, c.radiusSquared);
    F8 falloff = c.square * farSquared;
    if (!squaresOnly_) falloff += c.constant + c.linear * simd::sqrt(farSquared);
    const F8 seen = select(distanceSquared > c.radiusSquared, cut(lit) * cut(shines), all(1));
    return min(c.power * seen / max(falloff, all(least_)), all(1e36f));  // so that no sum is infinite
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

/// In one order for one surface and for eight, so that both choose alike.
template <class Float>
Float sumOf(const Float* each) {
    return ((each[0] + each[4]) + (each[2] + each[6])) + ((each[1] + each[5]) + (each[3] + each[7]));
}

constexpr float kBelowOne = 0x1.fffffep-1f;

}  // namespace

/// `above`: a bit for each that is not 0.
[[gnu::always_inline]] inline float LightTree::importance(const Node& node, const Vec3f& point, const Vec3f& normal,
                                                          float* each, std::uint32_t& above) const {
    const F8 result = importance(allOf(node), {all(point.x), all(point.y), all(point.z)},
                                 {all(normal.x), all(normal.y), all(normal.z)});
    store(each, result);
    above = laneBits(result > 0.0f);
    return sumOf(each);
}

LightTree::Choice LightTree::sample(const Vec3f& point, const Vec3f& normal, float u) const {
    if (nodes_.empty()) return {};
    return sampleBelow(0, point, normal, u, 1);
}

LightTree::Choice LightTree::sampleBelow(std::uint32_t at, const Vec3f& point, const Vec3f& normal, float u,
                                         float probability) const {
    for (;;) {
        const Node& node = nodes_[at];
        alignas(32) float each[kWide];
        std::uint32_t above = 0;
        const float sum = importance(node, point, normal, each, above);
        if (!(sum > 0)) return {};
        float left = u * sum;
        std::size_t child = 0;
        const auto last = static_cast<std::size_t>(std::bit_width(above)) - 1;
        while (child < last && !(left < each[child])) left -= each[child++];
        u = std::min(std::max(left, 0.0f) / each[child], kBelowOne);
        probability *= each[child] / sum;
        if (node.leaves >> child & 1u) return {node.next[child], probability};
        at = node.next[child];
    }
}

// The root is one for all: its clusters are looked at one after the other, by eight surfaces each. Below it they part.
LightTree::Choices LightTree::sample(const V8& point, const V8& normal, F8 u, std::uint32_t lanes) const {
    Choices result;
    std::fill(std::begin(result.thing), std::end(result.thing), kNone);
    store(result.probability, all(0));
    if (nodes_.empty() || !lanes) return result;
    const Node& root = nodes_[0];
    F8 each[kWide];
    for (std::size_t i = root.count; i < kWide; ++i) each[i] = all(0);
    I8 last{};
    for (std::size_t i = 0; i < root.count; ++i) {
        each[i] = importance(oneOf(root, i), point, normal);
        last = each[i] > 0.0f ? I8{} + static_cast<std::int32_t>(i) : last;
    }
    const F8 sum = sumOf(each);
    F8 left = u * sum, chosen = all(1);
    I8 child{}, searching = ~I8{};
    for (std::size_t i = 0; i < root.count; ++i) {
        const I8 number = I8{} + static_cast<std::int32_t>(i), here = searching & ((left < each[i]) | (number == last));
        chosen = select(here, each[i], chosen), child = here ? number : child;
        searching &= ~here;
        left = select(searching, left - each[i], left);
    }
    alignas(32) float rest[8], x[8], y[8], z[8];
    alignas(32) std::int32_t children[8];
    store(rest, min(max(left, all(0)) / chosen, all(kBelowOne)));
    store(result.probability, chosen / sum);
    std::memcpy(children, &child, sizeof children);
    std::uint32_t below = lanes & laneBits(sum > 0.0f);
    for (std::uint32_t some = below; some; some &= some - 1) {
        const int lane = std::countr_zero(some);
        result.thing[lane] = root.next[children[lane]];
        if (root.leaves >> children[lane] & 1u) below &= ~(1u << lane);
    }
    if (!below) return result;
    const V8& n = normal;
    alignas(32) float nx[8], ny[8], nz[8];
    store(x, point.x), store(y, point.y), store(z, point.z), store(nx, n.x), store(ny, n.y), store(nz, n.z);
    for (; below; below &= below - 1) {
        const int i = std::countr_zero(below);
        const Choice choice =
            sampleBelow(result.thing[i], {x[i], y[i], z[i]}, {nx[i], ny[i], nz[i]}, rest[i], result.probability[i]);
        result.thing[i] = choice.thing, result.probability[i] = choice.probability;
    }
    return result;
}

float LightTree::probability(std::uint32_t thing, const Vec3f& point, const Vec3f& normal) const {
    float probability = 1;
    std::uint32_t at = 0;
    for (std::uint64_t way = ways_[thing];; way >>= 3) {
        const Node& node = nodes_[at];
        alignas(32) float each[kWide];
        std::uint32_t above = 0;
        const float sum = importance(node, point, normal, each, above);
        if (!(sum > 0)) return 0;
        const std::size_t child = way & 7u;
        probability *= each[child] / sum;
        if (node.leaves >> child & 1u) return node.next[child] == thing ? probability : 0.0f;
        at = node.next[child];
    }
}

}  // namespace rtsg::trace
