// Builds the coarse tree over a mesh's triangles, and follows the areas of its boxes.
#include "bvh_watch.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include <rtsg/renderers/parallel_for.h>

namespace rtsg::bvh {

namespace {

constexpr std::size_t kBranching = 8, kLeaf = 16;
/// Its reciprocal still fits into a float; no ray finds anything so small (coordinates of 1e-17 m).
constexpr double kNoArea = 1e-34;

// Four lanes, the last of which is ignored: arrays are padded, so a wide read of the last element is safe.
using Lanes = float __attribute__((vector_size(16)));

struct BinBox {
    Lanes low{HUGE_VALF, HUGE_VALF, HUGE_VALF, HUGE_VALF}, high = -low;
    void extend(Lanes p) {
        low = p < low ? p : low;
        high = p > high ? p : high;
    }
    void extend(const BinBox& b) {
        low = b.low < low ? b.low : low;
        high = b.high > high ? b.high : high;
    }
    float area() const {
        const Lanes s = high - low;
        return s[0] * s[1] + s[1] * s[2] + s[2] * s[0];
    }
};

Lanes loadPoint(const Vec3f* point) {
    Lanes lanes;
    std::memcpy(&lanes, point, sizeof lanes);
    return lanes;
}

/// A node while Embree's builder works; the memory is the builder's.
struct BuiltNode {
    std::uint32_t count = 0;  // children, or triangles of a leaf
    bool isLeaf = false;
    std::array<BuiltNode*, kBranching> child{};
    std::array<std::uint32_t, kLeaf> triangle{};
};

BuiltNode* allocate(RTCThreadLocalAllocator allocator) {
    void* memory = rtcThreadLocalAlloc(allocator, sizeof(BuiltNode), alignof(BuiltNode));
    return new (memory) BuiltNode;
}
void* createNode(RTCThreadLocalAllocator allocator, unsigned count, void*) {
    BuiltNode* node = allocate(allocator);
    node->count = count;
    return node;
}
void setChildren(void* node, void** children, unsigned count, void*) {
    for (unsigned i = 0; i < count; ++i) static_cast<BuiltNode*>(node)->child[i] = static_cast<BuiltNode*>(children[i]);
}
void setBounds(void*, const RTCBounds**, unsigned, void*) {}
void* createLeaf(RTCThreadLocalAllocator allocator, const RTCBuildPrimitive* primitives, std::size_t count, void*) {
    BuiltNode* node = allocate(allocator);
    node->isLeaf = true;
    node->count = static_cast<std::uint32_t>(std::min(count, kLeaf));
    for (std::uint32_t i = 0; i < node->count; ++i) node->triangle[i] = primitives[i].primID;
    return node;
}

}  // namespace

BvhWatch::BvhWatch(RTCDevice device, const Mesh& mesh) {
    std::vector<RTCBuildPrimitive> primitives(mesh.triangleCount);
    for (std::uint32_t t = 0; t < mesh.triangleCount; ++t) {
        BinBox box;
        for (std::uint32_t c = 0; c < 3; ++c) box.extend(loadPoint(&mesh.positions[mesh.vertexIndex(t, c)]));
        primitives[t] = {box.low[0], box.low[1], box.low[2], 0, box.high[0], box.high[1], box.high[2], t};
    }
    RTCBVH bvh = rtcNewBVH(device);
    RTCBuildArguments arguments = rtcDefaultBuildArguments();
    arguments.byteSize = sizeof arguments;
    arguments.buildQuality = RTC_BUILD_QUALITY_MEDIUM;
    arguments.maxBranchingFactor = kBranching;
    arguments.maxDepth = 64;
    arguments.sahBlockSize = 4;
    arguments.minLeafSize = kLeaf / 2;
    arguments.maxLeafSize = kLeaf;
    arguments.bvh = bvh;
    arguments.primitives = primitives.data();
    arguments.primitiveCount = arguments.primitiveArrayCapacity = primitives.size();
    arguments.createNode = createNode;
    arguments.setNodeChildren = setChildren;
    arguments.setNodeBounds = setBounds;
    arguments.createLeaf = createLeaf;
    const BuiltNode* root = nullptr;
    // On this thread alone: the frame wants the other cores.
    withThreads(1, [&] { root = static_cast<const BuiltNode*>(rtcBuildBVH(&arguments)); });

    struct Visit {
        const BuiltNode* node;
        bool done;
    };
    std::vector<Visit> stack;
    if (root) stack.push_back({root, false});
    while (!stack.empty()) {
        const auto [node, done] = stack.back();
        stack.pop_back();
        if (node->isLeaf) {
            const std::size_t begin = vertices_.size();
            for (std::uint32_t i = 0; i < node->count; ++i)
                for (std::uint32_t c = 0; c < 3; ++c) vertices_.push_back(mesh.vertexIndex(node->triangle[i], c));
            const auto first = vertices_.begin() + static_cast<std::ptrdiff_t>(begin);
            std::sort(first, vertices_.end());
            vertices_.erase(std::unique(first, vertices_.end()), vertices_.end());
            leafEnd_.push_back(static_cast<std::uint32_t>(vertices_.size()));
            children_.push_back(0);
        } else if (done) {
            children_.push_back(static_cast<std::uint8_t>(node->count));
        } else {
            stack.push_back({node, true});
            for (std::uint32_t i = 0; i < node->count; ++i) stack.push_back({node->child[i], false});
        }
    }
    rtcReleaseBVH(bvh);
    vertices_.shrink_to_fit();
    area_.resize(children_.size());
    const double rootArea = findAreas(mesh.positions);
    fraction_.resize(children_.size());
    for (std::size_t i = 0; i < fraction_.size(); ++i) {
        fraction_[i] = rootArea > kNoArea ? static_cast<float>(double{area_[i]} / rootArea) : 0;
        builtCost_ += double{fraction_[i]};
    }
}

double BvhWatch::findAreas(const Array<Vec3f>& positions) const {
    if (children_.empty()) return 0;
    std::vector<BinBox> stack;
    stack.reserve(512);
    std::size_t leaf = 0, vertex = 0;
    const Vec3f* points = positions.data();
    for (std::size_t i = 0; i < children_.size(); ++i) {
        BinBox box;
        if (children_[i] == 0) {
            for (const std::size_t end = leafEnd_[leaf++]; vertex < end; ++vertex)
                box.extend(loadPoint(points + vertices_[vertex]));
        } else {
            for (int k = children_[i]; k > 0; --k) {
                box.extend(stack.back());
                stack.pop_back();
            }
        }
        area_[i] = box.area();
        stack.push_back(box);
    }
    return double{area_.back()};
}

BvhWatch::Look BvhWatch::look(const Array<Vec3f>& positions) const {
    const double rootArea = findAreas(positions);
    // A point or a line: no ray will hit it, with any tree.
    if (!(rootArea > kNoArea)) return {builtCost_, 0};
    if (!(builtCost_ > 0)) return {1, HUGE_VAL};
    const auto scale = static_cast<float>(1 / rootArea);
    // In eight sums, which the compiler may keep in registers side by side.
    std::array<float, 8> cost{}, change{};
    std::size_t i = 0;
    for (; i + 8 <= fraction_.size(); i += 8)
        for (std::size_t k = 0; k < 8; ++k) {
            const float fraction = area_[i + k] * scale;
            cost[k] += fraction;
            change[k] += std::abs(fraction - fraction_[i + k]);
        }
    Look result;
    for (; i < fraction_.size(); ++i) {
        cost[0] += area_[i] * scale;
        change[0] += std::abs(area_[i] * scale - fraction_[i]);
    }
    for (std::size_t k = 0; k < 8; ++k) result.cost += double{cost[k]}, result.change += double{change[k]};
    result.change /= std::min(result.cost, builtCost_);
    return result;
}

}  // namespace rtsg::bvh
