// Voxels copied out of a texture's layers, and looked up.
#include "voxels.h"

#include <algorithm>
#include <cmath>

namespace rtsg::trace {

namespace {

constexpr float kByte = 1 / 255.0f;

float scaleOf(const std::vector<std::uint8_t>&) {
    return kByte;
}
float scaleOf(const std::vector<float>&) {
    return 1;
}

/// The four numbers of a voxel; null of `p` is not asked.
template <class Number>
Vec4f expand(const Number* p, int components, float scale) {
    const auto n = [&](int i) { return static_cast<float>(p[i]) * scale; };
    switch (components) {
        case 1:
            return {n(0), n(0), n(0), 1};
        case 2:
            return {n(0), n(0), n(0), n(1)};
        case 3:
            return {n(0), n(1), n(2), 1};
        default:
            return {n(0), n(1), n(2), n(3)};
    }
}

}  // namespace

/// The eight voxels around a place, and how much each counts.
struct VoxelGrid::Cell {
    std::size_t offset[8];
    float weight[8];
};

std::shared_ptr<const VoxelGrid> VoxelGrid::of(std::shared_ptr<const SpaceTexture> texture, std::string& problem) {
    if (texture->isCube()) {
        problem = "a cube map has no voxels";
        return nullptr;
    }
    auto grid = std::make_shared<VoxelGrid>();
    const SpaceTexture::Layers& layers = texture->layers();
    grid->size_ = {layers[0]->width(), layers[0]->height(), static_cast<int>(layers.size())};
    grid->components_ = 1;
    bool fine = false;
    for (const auto& layer : layers) {
        grid->components_ = std::max(grid->components_, std::clamp(layer->channels(), 1, 4));
        fine = fine || layer->bytesPerPixel() > 4;
    }
    const std::size_t count = grid->offset(0, 0, grid->size_.z);
    fine ? grid->numbers_.reserve(count) : grid->bytes_.reserve(count);
    TextureAccess access;
    access.wrapS = access.wrapT = TextureWrap::clamp;
    access.smooth = false;
    const Vec2f step = 1.0f / Vec2f(static_cast<float>(grid->size_.x), static_cast<float>(grid->size_.y));
    for (const auto& layer : layers)
        for (int y = 0; y < grid->size_.y; ++y)
            for (int x = 0; x < grid->size_.x; ++x) {
                const Vec4f v = layer->sample((static_cast<float>(x) + .5f) * step.x,
                                              (static_cast<float>(y) + .5f) * step.y, 0, access, ColorSpace::display);
                for (int c = 0; c < grid->components_; ++c) {
                    const float number = grid->components_ == 2 && c == 1 ? v.a : v[c];
                    if (fine)
                        grid->numbers_.push_back(std::isfinite(number) ? number : 0);
                    else
                        grid->bytes_.push_back(static_cast<std::uint8_t>(std::lround(number * 255)));
                }
            }
    grid->texture_ = std::move(texture);
    return grid;
}

VoxelGrid::Cell VoxelGrid::cellOf(const Vec3f& position) const {
    int low[3], high[3];
    float fraction[3];
    for (int k = 0; k < 3; ++k) {
        const float at =
            std::clamp(position[k] * static_cast<float>(size_[k]) - .5f, 0.0f, static_cast<float>(size_[k] - 1));
        low[k] = static_cast<int>(at);
        high[k] = std::min(low[k] + 1, size_[k] - 1);
        fraction[k] = at - static_cast<float>(low[k]);
    }
    Cell cell;
    for (int i = 0; i < 8; ++i) {
        cell.offset[i] = offset(i & 1 ? high[0] : low[0], i & 2 ? high[1] : low[1], i & 4 ? high[2] : low[2]);
        cell.weight[i] = (i & 1 ? fraction[0] : 1 - fraction[0]) * (i & 2 ? fraction[1] : 1 - fraction[1]) *
                         (i & 4 ? fraction[2] : 1 - fraction[2]);
    }
    return cell;
}

template <class Number>
Vec4f VoxelGrid::mix(const std::vector<Number>& from, const Cell& cell) const {
    Vec4f sum(0);
    for (int i = 0; i < 8; ++i) sum += cell.weight[i] * expand(from.data() + cell.offset[i], components_, 1.0f);
    const float scale = scaleOf(from);
    if (components_ == 1 || components_ == 3) return {Vec3f(sum) * scale, 1};
    return sum * scale;
}

template <class Number>
float VoxelGrid::mixValues(const std::vector<Number>& from, const Cell& cell) const {
    float sum = 0;
    for (int i = 0; i < 8; ++i) {
        const Number* p = from.data() + cell.offset[i];
        const float value = components_ < 3
                                ? static_cast<float>(p[0])
                                : (static_cast<float>(p[0]) + static_cast<float>(p[1]) + static_cast<float>(p[2])) / 3;
        sum += cell.weight[i] * value;
    }
    return sum * scaleOf(from);
}

Vec4f VoxelGrid::at(const Vec3f& position) const {
    const Cell cell = cellOf(position);
    return bytes_.empty() ? mix(numbers_, cell) : mix(bytes_, cell);
}

Vec4f VoxelGrid::nearest(const Vec3f& position) const {
    const auto of = [&](int k) {
        return std::clamp(static_cast<int>(std::floor(position[k] * static_cast<float>(size_[k]))), 0, size_[k] - 1);
    };
    const std::size_t at = offset(of(0), of(1), of(2));
    return bytes_.empty() ? expand(numbers_.data() + at, components_, 1)
                          : expand(bytes_.data() + at, components_, kByte);
}

float VoxelGrid::value(const Vec3f& position) const {
    const Cell cell = cellOf(position);
    return bytes_.empty() ? mixValues(numbers_, cell) : mixValues(bytes_, cell);
}

Vec3f VoxelGrid::gradient(const Vec3f& position) const {
    Vec3f result(0);
    for (int k = 0; k < 3; ++k) {
        // Half a voxel's middle from the edge the difference is one to the inside.
        const float n = static_cast<float>(size_[k]), at = position[k] * n;
        const float before = std::clamp(at - 1, .5f, n - .5f), after = std::clamp(at + 1, .5f, n - .5f);
        if (!(after > before)) continue;
        Vec3f a = position, b = position;
        a[k] = before / n, b[k] = after / n;
        result[k] = (value(b) - value(a)) / (after - before);
    }
    return result;
}

}  // namespace rtsg::trace
