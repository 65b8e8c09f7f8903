// The cells of a sky's pictures, the choice among them, and their colours.
#include "sky_light.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>

#include <rtsg/renderers/parallel_for.h>
#include <rtsg/renderers/space_texture.h>

namespace rtsg::trace {

namespace {

constexpr std::size_t kMinCells = 32, kMaxCells = 512, kMaxOfPanorama = 1024;

/// Light of a sky's pictures alone.
FarLight ofPictures(const Sky& sky) {
    FarLight result;
    for (const auto& picture : sky.panorama)
        if (picture)
            result.detail =
                std::max(result.detail, static_cast<std::size_t>(std::max(picture->width(), picture->height())));
    result.localFromWorld = sky.localFromWorld;
    result.inPicture = [&sky](std::size_t side, Vec2f point, float footprint) {
        const auto& picture = sky.panorama[side];
        if (!picture) return Vec3f(0);
        // A texture's footprint is a share of the mean of its sides: here no pixel of the longer must be passed over.
        const auto w = static_cast<float>(picture->width()), h = static_cast<float>(picture->height());
        const float wide = footprint * std::max(w, h) / std::sqrt(w * h);
        const TextureAccess access{TextureWrap::clamp, TextureWrap::clamp, true};
        const Vec4f texel = picture->sample(point.x, point.y, wide, access, ColorSpace::linear);
        return Vec3f(texel) * (texel.a);
    };
    return result;
}

}  // namespace

SkyCells::SkyCells(const FarLight& of) : shape_(of.shape) {
    const bool cube = shape_ == FarLight::Shape::cube;
    down_ = std::clamp(of.detail, kMinCells, cube ? kMaxCells : kMaxOfPanorama);
    across_ = cube ? down_ : 2 * down_;
    rows_.resize(cube ? 6 * down_ : down_);
    within_.resize(rows_.size() * across_);
    const std::vector<float> looks = lookAround(of);
    const std::size_t columns = 2 * across_ + 1;
    parallelFor(rows_.size(), [&](std::size_t row) {
        const float* upper = &looks[(row / down_ * (2 * down_ + 1) + row % down_ * 2) * columns];
        double sum = 0;
        for (std::size_t cell = 0; cell < across_; ++cell) {
            double light = 0;  // by the trapezoidal rule
            for (std::size_t i = 0; i < 9; ++i)
                light +=
                    double{upper[i / 3 * columns + 2 * cell + i % 3]} * (i / 3 == 1 ? 2 : 1) * (i % 3 == 1 ? 2 : 1);
            sum += light / 16 / static_cast<double>(across_ * down_);
            within_[row * across_ + cell] = static_cast<float>(sum);
        }
        rows_[row] = static_cast<float>(sum);
        if (sum > 0)
            for (std::size_t cell = 0; cell < across_; ++cell) within_[row * across_ + cell] /= static_cast<float>(sum);
    });
    double total = 0;
    for (float& row : rows_) row = static_cast<float>(total += double{row});
    if (!(total > 0)) return;
    for (float& row : rows_) row /= static_cast<float>(total);
    light_ = total;
}

/// Corners count, as what reaches a little into a cell is seen at its edge alone.
std::vector<float> SkyCells::lookAround(const FarLight& of) {
    const Vec2f step = .5f / Vec2f(across_, down_),
                inside = step / 64.0f;  // the very edge is the next side's, or a pole
    const std::size_t columns = 2 * across_ + 1, lines = 2 * down_ + 1;
    std::vector<float> looks(rows_.size() / down_ * lines * columns), peaks(rows_.size() / down_ * lines);
    parallelFor(peaks.size(), [&](std::size_t line) {
        const std::size_t side = line / lines;
        const bool round = shape_ == FarLight::Shape::panorama;
        float spread = 0;  // of all of a panorama's line
        for (std::size_t column = 0; column < columns; ++column) {
            const Vec2f st = glm::clamp(Vec2f(column, line % lines) * step, inside, 1.0f - inside);
            const float y = skyLuminance(of.inPicture ? of.inPicture(side, st, step.y)
                                                      : of.radiance(directionAt(side * down_, st), step.y));
            if (!round || column == 0) spread = spreadAt(st);
            looks[line * columns + column] = y * spread;
            peaks[line] = std::max(peaks[line], y);
        }
    });
    peak_ = *std::ranges::max_element(peaks);
    return looks;
}

Vec3f SkyCells::directionAt(std::size_t row, Vec2f st) const {
    if (shape_ == FarLight::Shape::cube) return cubeDirection(static_cast<CubeSide>(row / down_), st);
    // From the nearer pole, so that a place beside it keeps its digits.
    const float rotation = 2 * std::numbers::pi_v<float> * (st.x - .5f);
    const bool above = st.y > .5f;
    const float angle = std::numbers::pi_v<float> * (above ? 1 - st.y : st.y), sine = std::sin(angle);
    return {sine * std::sin(rotation), above ? std::cos(angle) : -std::cos(angle), -sine * std::cos(rotation)};
}

/// How large a part of the picture is, seen from its middle, for each part of it: d omega / (ds dt).
float SkyCells::spreadAt(Vec2f st) const {
    constexpr float kPi = std::numbers::pi_v<float>;
    if (shape_ == FarLight::Shape::panorama) return 2 * kPi * kPi * std::sin(kPi * std::min(st.y, 1 - st.y));
    const Vec2f on = 2.0f * st - 1.0f;
    const float squared = 1 + glm::dot(on, on);
    return 4 / (squared * std::sqrt(squared));
}

float SkyCells::densityOn(Vec2f st, std::size_t row, std::size_t cell) const {
    const float* within = &within_[row * across_];
    const float fraction =
        (rows_[row] - (row > 0 ? rows_[row - 1] : 0)) * (within[cell] - (cell > 0 ? within[cell - 1] : 0));
    return fraction > 0 ? fraction * static_cast<float>(across_ * down_) / spreadAt(st) : 0;
}

SkyBands::Choice SkyCells::sample(float u, float v) const {
    const std::size_t row = pickFraction(rows_, v);
    const std::span<const float> within(&within_[row * across_], across_);
    const std::size_t cell = pickFraction(within, u);
    const Vec2f st((static_cast<float>(cell) + insideFraction(within, cell, u)) / static_cast<float>(across_),
                   (static_cast<float>(row % down_) + insideFraction(rows_, row, v)) / static_cast<float>(down_));
    return {directionAt(row, st), densityOn(st, row, cell)};
}

float SkyCells::density(const Vec3f& direction) const {
    std::size_t side = 0;
    Vec2f st;
    if (shape_ == FarLight::Shape::cube) {
        const CubePosition onCube = cubePosition(direction);
        side = static_cast<std::size_t>(onCube.side), st = onCube.st;
    } else {
        st = panoramaPosition(direction);
    }
    const auto at = [](float x, std::size_t cells) {
        return std::min(static_cast<std::size_t>(std::max(x, 0.0f) * static_cast<float>(cells)), cells - 1);
    };
    return densityOn(st, side * down_ + at(st.y, down_), at(st.x, across_));
}

SkyLight::SkyLight(const Sky* sky, const std::vector<FarLight>& more) {
    double light = 0;
    float peak = 0;
    const auto add = [&](const FarLight& far) {
        Part part{SkyCells(far), far.localFromWorld};
        if (!(part.cells.light() > 0)) return;
        light += part.cells.light(), peak += part.cells.peak();
        parts_.push_back(std::move(part));
    };
    for (const FarLight& far : more) add(far);
    if (sky) {
        if (const FarLight pictures = ofPictures(*sky); pictures.detail > 0) add(pictures);
        bands_ = SkyBands(*sky);
        bandsFromWorld_ = sky->localFromWorld;
        light += bands_.light(), peak += bands_.peak();
    }
    if (!(light > 0)) return;
    bandsFraction_ = static_cast<float>(bands_.light() / light);
    for (Part& part : parts_) part.fraction = static_cast<float>(part.cells.light() / light);
    unevenness_ = static_cast<float>(double{peak} * 4 * std::numbers::pi / light);
}

SkyLight::Choice SkyLight::sample(float u, float v) const {
    if (!(unevenness_ > 0)) return {};
    float before = 0;
    // The last one with a share takes what rounding leaves.
    for (std::size_t i = 0; i < parts_.size(); ++i) {
        const Part& part = parts_[i];
        const bool last = i + 1 == parts_.size() && !(bandsFraction_ > 0);
        if (!last && v >= before + part.fraction) {
            before += part.fraction;
            continue;
        }
        const Choice choice = part.cells.sample(u, std::min((v - before) / part.fraction, 0x1.fffffep-1f));
        const Vec3f direction = glm::transpose(part.localFromWorld) * choice.direction;
        if (part.fraction == 1) return {direction, choice.density};
        return {direction, density(direction)};
    }
    const Choice choice = bands_.sample(u, std::min((v - before) / bandsFraction_, 0x1.fffffep-1f));
    const Vec3f direction = glm::transpose(bandsFromWorld_) * choice.direction;
    if (bandsFraction_ == 1) return {direction, choice.density};
    return {direction, density(direction)};
}

float SkyLight::density(const Vec3f& direction) const {
    if (!(unevenness_ > 0)) return 0;
    float sum = bandsFraction_ > 0 ? bandsFraction_ * bands_.density(bandsFromWorld_ * direction) : 0;
    for (const Part& part : parts_) sum += part.fraction * part.cells.density(part.localFromWorld * direction);
    return sum;
}

bool SkyTable::holds(const Sky* sky, const std::vector<FarLight>& more) const {
    const auto same = [](const FarLight& a, const FarLight& b) {
        return a.shape == b.shape && a.detail == b.detail && a.localFromWorld == b.localFromWorld &&
               a.source == b.source && a.color == b.color;
    };
    return last_ && (sky ? sky_ == *sky : !sky_) && std::ranges::equal(more, more_, same);
}

std::shared_ptr<const SkyLight> SkyTable::of(SkyTable* table, const Sky* sky, std::vector<FarLight> more) {
    if (!table) return std::make_shared<const SkyLight>(sky, more);
    {
        const std::scoped_lock lock(table->mutex_);
        if (table->holds(sky, more)) return table->last_;
    }
    // Outside, as several threads make it, and one of them might come here for another picture.
    auto created = std::make_shared<const SkyLight>(sky, more);
    const std::scoped_lock lock(table->mutex_);
    table->sky_ = sky ? std::optional<Sky>(*sky) : std::nullopt;
    for (FarLight& far : more) far.radiance = nullptr, far.inPicture = nullptr;
    table->more_ = std::move(more);
    return table->last_ = std::move(created);
}

}  // namespace rtsg::trace
