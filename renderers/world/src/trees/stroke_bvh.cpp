// Builds and refits the trees over lines and points.
#include "stroke_bvh.h"

#include <array>
#include <cmath>
#include <numeric>

namespace rtsg::bvh {

namespace {

using Box = TreeView::Box;
constexpr std::size_t kStrokeBins = 16;
constexpr double kSpoiltStrokes =
    1.5;  // a refitted tree's cost over that of the built one, from which on it is built anew

Box boxOf(const StrokeBvh::Stroke& s) {
    return {glm::min(s.a, s.b), glm::max(s.a, s.b)};
}
/// Boxes without volume have a weight, too, since a stroke has a width whoever looks.
double weightOf(const Box& box) {
    const Vec3d size = glm::max(Vec3d(box.upper - box.lower), Vec3d(0));
    return size.x * size.y + size.y * size.z + size.z * size.x + 1e-3 * glm::dot(size, size);
}

}  // namespace

/// Cuts ranges of an order in two until they fit into leaves.
struct StrokeBvh::Builder {
    struct Part {
        std::uint32_t begin, end;
        Box box;
        std::uint32_t size() const { return end - begin; }
    };
    std::vector<Box> boxes;
    std::vector<Vec3f> centers;
    std::vector<std::uint32_t> order;

    Part partOf(std::uint32_t begin, std::uint32_t end) const {
        Part part{begin, end, {}};
        for (std::uint32_t i = begin; i < end; ++i) part.box.extend(boxes[order[i]]);
        return part;
    }
    /// `level`: far down the tree parts are halved at any cost, so that its depth stays bounded.
    void split(const Part& part, std::size_t level, Part& a, Part& b) {
        Vec3f lower(HUGE_VALF), upper(-HUGE_VALF);
        for (std::uint32_t i = part.begin; i < part.end; ++i) {
            lower = glm::min(lower, centers[order[i]]), upper = glm::max(upper, centers[order[i]]);
        }
        const Vec3f size = upper - lower;
        const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
        std::uint32_t middle = part.begin + part.size() / 2;
        const auto first = order.begin() + part.begin, last = order.begin() + part.end;
        std::size_t bestBin = 0;
        const float scale = kStrokeBins * (1 - 1e-5f) / size[axis];
        const auto binOf = [&](std::uint32_t i) {
            return static_cast<std::size_t>((centers[i][axis] - lower[axis]) * scale);
        };
        if (size[axis] > 0 && std::isfinite(scale) && level < TreeView::kMaxLevels / 2) {
            std::array<Box, kStrokeBins> bins;
            std::array<std::uint32_t, kStrokeBins> counts{};
            for (auto i = first; i != last; ++i) bins[binOf(*i)].extend(boxes[*i]), ++counts[binOf(*i)];
            std::array<double, kStrokeBins> right{};
            Box sum;
            std::uint32_t n = 0;
            for (std::size_t k = kStrokeBins - 1; k > 0; --k) {
                sum.extend(bins[k]), n += counts[k];
                right[k] = n > 0 ? weightOf(sum) * n : 0;
            }
            sum = {}, n = 0;
            double best = HUGE_VAL;
            for (std::size_t k = 1; k < kStrokeBins; ++k) {
                sum.extend(bins[k - 1]), n += counts[k - 1];
                if (n == 0 || n == part.size()) continue;
                if (const double total = weightOf(sum) * n + right[k]; total < best) best = total, bestBin = k;
            }
        }
        if (bestBin > 0)
            middle = static_cast<std::uint32_t>(
                std::partition(first, last, [&](std::uint32_t i) { return binOf(i) < bestBin; }) - order.begin());
        else
            std::nth_element(first, order.begin() + middle, last,
                             [&](std::uint32_t x, std::uint32_t y) { return centers[x][axis] < centers[y][axis]; });
        a = partOf(part.begin, middle), b = partOf(middle, part.end);
    }
};

void StrokeBvh::read(const Mesh& mesh, const WorldFromLocal* placed) {
    const auto toWorld = [&](Vec3f p) { return placed ? Vec3f(*placed * glm::dvec4(Vec3d(p), 1)) : p; };
    for (Stroke& s : strokes_) s.a = toWorld(mesh.vertex(s.number, 0)), s.b = toWorld(mesh.vertex(s.number, 1));
}

double StrokeBvh::cost() const {
    double sum = 0;
    for (const TreeView::Node& node : nodes_)
        for (std::uint32_t i = 0; i < 8; ++i)
            if (node.child[i] != TreeView::kNone) sum += weightOf(node.box(i));
    return sum / std::max(weightOf(box_), 1e-300);
}

void StrokeBvh::refit() {
    // Children come after their parents.
    for (std::size_t n = nodes_.size(); n-- > 0;) {
        TreeView::Node& node = nodes_[n];
        for (std::uint32_t i = 0; i < 8; ++i) {
            const std::uint32_t child = node.child[i];
            if (child == TreeView::kNone) continue;
            Box box;
            if (child & TreeView::kLeaf) {
                for (std::uint32_t k = 0; k < countOf(child); ++k) box.extend(boxOf(strokes_[firstOf(child) + k]));
            } else {
                for (std::uint32_t k = 0; k < 8; ++k)
                    if (nodes_[child].child[k] != TreeView::kNone) box.extend(nodes_[child].box(k));
            }
            node.setBox(i, box);
        }
    }
    box_ = {};
    for (const Stroke& s : strokes_) box_.extend(boxOf(s));
}

std::shared_ptr<const StrokeBvh> StrokeBvh::of(const Mesh& mesh, const StrokeBvh* before,
                                               const WorldFromLocal* placed) {
    if (before && before->strokes_.size() == mesh.strokeCount) {
        auto refitted = std::make_shared<StrokeBvh>(*before);
        refitted->read(mesh, placed);
        refitted->refit();
        if (refitted->cost() <= kSpoiltStrokes * before->builtCost_) return refitted;
    }
    auto created = std::make_shared<StrokeBvh>();
    StrokeBvh& bvh = *created;
    Builder builder;
    const std::uint32_t count = mesh.strokeCount;
    bvh.strokes_.resize(count);
    for (std::uint32_t i = 0; i < count; ++i) bvh.strokes_[i].number = i;
    bvh.read(mesh, placed);
    builder.order.resize(count);
    std::iota(builder.order.begin(), builder.order.end(), 0u);
    for (const Stroke& s : bvh.strokes_) {
        builder.boxes.push_back(boxOf(s));
        builder.centers.push_back(.5f * s.a + .5f * s.b);
        bvh.box_.extend(builder.boxes.back());
    }
    struct Work {
        Builder::Part part;
        std::uint32_t node;
        std::size_t level;
    };
    const auto newNode = [&] {
        bvh.nodes_.emplace_back();
        for (std::uint32_t i = 0; i < 8; ++i) bvh.nodes_.back().clear(i);
        return static_cast<std::uint32_t>(bvh.nodes_.size() - 1);
    };
    std::vector<Work> stack;
    if (count > 0) stack.push_back({builder.partOf(0, count), newNode(), 1});
    while (!stack.empty()) {
        const Work work = stack.back();
        stack.pop_back();
        std::array<Builder::Part, 8> parts{work.part};
        std::size_t parted = 1;
        while (parted < 8) {
            std::size_t largest = 8;
            for (std::size_t i = 0; i < parted; ++i)
                if (parts[i].size() > kMaxInLeaf &&
                    (largest == 8 || weightOf(parts[i].box) > weightOf(parts[largest].box)))
                    largest = i;
            if (largest == 8) break;
            const Builder::Part whole = parts[largest];
            builder.split(whole, work.level, parts[largest], parts[parted++]);
        }
        for (std::uint32_t i = 0; i < parted; ++i) {
            const Builder::Part& part = parts[i];
            std::uint32_t child = TreeView::kLeaf | (part.begin * kMaxInLeaf + part.size() - 1);
            if (part.size() > kMaxInLeaf) {
                child = newNode();
                stack.push_back({part, child, work.level + 1});
            }
            bvh.nodes_[work.node].setBox(i, part.box);
            bvh.nodes_[work.node].child[i] = child;
        }
    }
    std::vector<Stroke> sorted(count);
    for (std::uint32_t i = 0; i < count; ++i) sorted[i] = bvh.strokes_[builder.order[i]];
    bvh.strokes_ = std::move(sorted);
    bvh.builtCost_ = bvh.cost();
    return created;
}

}  // namespace rtsg::bvh
