// The cells of a sky and the choice among them.
#include "sky_light.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <rtsg/renderers/parallel_for.h>
#include <rtsg/renderers/space_texture.h>

namespace rtsg::trace {

namespace {

constexpr std::size_t kLeastCells = 32, kMostCells = 512;
constexpr std::size_t kPlaces = 2;  // that are looked at in a cell, across and down

/// How large a part of a side is, seen from the middle of its cube, for each part of it: d omega / (ds dt).
float spreadAt(Vec2f st) {
    const Vec2f on = 2.0f * st - 1.0f;
    const float squared = 1 + glm::dot(on, on);
    return 4 / (squared * std::sqrt(squared));
}

float luminance(const Vec3f& color) {
    const float y = 0.2126f * color.r + 0.7152f * color.g + 0.0722f * color.b;
    return std::isfinite(y) ? std::clamp(y, 0.0f, 1e20f) : 0.0f;
}

/// The first entry that is above `u`; one that has a share.
std::size_t pick(const float* sums, std::size_t count, float u) {
    const auto at = static_cast<std::size_t>(std::upper_bound(sums, sums + count, u) - sums);
    if (at < count) return at;
    std::size_t last = count - 1;  // rounding: the last one with a share
    while (last > 0 && !(sums[last] > sums[last - 1])) --last;
    return last;
}

/// Where between two sums `u` lies, [0, 1).
float inside(const float* sums, std::size_t at, float u) {
    const float before = at > 0 ? sums[at - 1] : 0.0f;
    return std::clamp((u - before) / (sums[at] - before), 0.0f, 0x1.fffffep-1f);
}

std::size_t detailOf(const Sky& sky) {
    int most = 0;
    for (const auto& picture : sky.panorama)
        if (picture) most = std::max({most, picture->width(), picture->height()});
    return static_cast<std::size_t>(most);
}

}  // namespace

SkyLight::SkyLight(const Sky& sky)
    : SkyLight([&](const Vec3f& d) { return Vec3f(sky.color(d, ColorSpace::linear)); }, detailOf(sky),
               sky.localFromWorld) {}

SkyLight::SkyLight(const std::function<Vec3f(const Vec3f&)>& radiance, std::size_t detail,
                   const glm::mat3& localFromWorld)
    : cells_(std::clamp(detail, kLeastCells, kMostCells)), localFromWorld_(localFromWorld) {
    rows_.resize(6 * cells_);
    within_.resize(rows_.size() * cells_);
    std::vector<float> peaks(rows_.size());
    const glm::mat3 worldFromLocal = glm::transpose(localFromWorld);
    const auto step = 1 / static_cast<float>(cells_ * kPlaces);
    parallelFor(rows_.size(), [&](std::size_t row) {
        const auto side = static_cast<CubeSide>(row / cells_);
        double sum = 0;
        for (std::size_t cell = 0; cell < cells_; ++cell) {
            float light = 0;
            for (std::size_t place = 0; place < kPlaces * kPlaces; ++place) {
                const auto across = cell * kPlaces + place % kPlaces, down = row % cells_ * kPlaces + place / kPlaces;
                const Vec2f st((static_cast<float>(across) + .5f) * step, (static_cast<float>(down) + .5f) * step);
                const float y = luminance(radiance(worldFromLocal * cubeDirection(side, st)));
                light += y * spreadAt(st);
                peaks[row] = std::max(peaks[row], y);
            }
            sum += double{light} * step * step;
            within_[row * cells_ + cell] = static_cast<float>(sum);
        }
        rows_[row] = static_cast<float>(sum);
        if (sum > 0)
            for (std::size_t cell = 0; cell < cells_; ++cell) within_[row * cells_ + cell] /= static_cast<float>(sum);
    });
    double total = 0;
    for (float& row : rows_) row = static_cast<float>(total += double{row});
    if (!(total > 0)) return;
    for (float& row : rows_) row /= static_cast<float>(total);
    unevenness_ = static_cast<float>(double{*std::ranges::max_element(peaks)} * 4 * std::numbers::pi / total);
}

float SkyLight::densityOn(Vec2f st, std::size_t row, std::size_t cell) const {
    const float* within = &within_[row * cells_];
    const float share =
        (rows_[row] - (row > 0 ? rows_[row - 1] : 0)) * (within[cell] - (cell > 0 ? within[cell - 1] : 0));
    return share * static_cast<float>(cells_ * cells_) / spreadAt(st);
}

SkyLight::Choice SkyLight::sample(float u, float v) const {
    if (!(unevenness_ > 0)) return {};
    const std::size_t row = pick(rows_.data(), rows_.size(), v), cell = pick(&within_[row * cells_], cells_, u);
    const auto n = static_cast<float>(cells_);
    const Vec2f st((static_cast<float>(cell) + inside(&within_[row * cells_], cell, u)) / n,
                   (static_cast<float>(row % cells_) + inside(rows_.data(), row, v)) / n);
    const Vec3f direction = cubeDirection(static_cast<CubeSide>(row / cells_), st);
    return {glm::transpose(localFromWorld_) * direction, densityOn(st, row, cell)};
}

float SkyLight::density(const Vec3f& direction) const {
    if (!(unevenness_ > 0)) return 0;
    const CubePlace place = cubePlace(localFromWorld_ * direction);
    const auto at = [&](float x) {
        return std::min(static_cast<std::size_t>(std::max(x, 0.0f) * static_cast<float>(cells_)), cells_ - 1);
    };
    return densityOn(place.st, static_cast<std::size_t>(place.side) * cells_ + at(place.st.y), at(place.st.x));
}

}  // namespace rtsg::trace
