// The light of an EnvironmentLight: as it is, gathered for matte surfaces, and blurred for rough ones.
#include "environment.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <rtsg/renderers/parallel_for.h>

namespace rtsg::trace {

namespace {

constexpr float kPiFloat = std::numbers::pi_v<float>;

/// By how much the cosine's convolution multiplies harmonics of each degree (Ramamoorthi & Hanrahan 2001, equation 8).
constexpr float kCosine[9] = {kPiFloat,     2 * kPiFloat / 3, 2 * kPiFloat / 3, 2 * kPiFloat / 3, kPiFloat / 4,
                              kPiFloat / 4, kPiFloat / 4,     kPiFloat / 4,     kPiFloat / 4};

std::array<float, 9> harmonicsAt(const Vec3f& d) {
    return {0.28209479f,
            0.48860251f * d.y,
            0.48860251f * d.z,
            0.48860251f * d.x,
            1.0925484f * d.x * d.y,
            1.0925484f * d.y * d.z,
            0.31539157f * (3 * d.z * d.z - 1),
            1.0925484f * d.x * d.z,
            0.54627422f * (d.x * d.x - d.y * d.y)};
}

/// A part of the sphere of directions.
struct Cell {
    Vec3f direction;
    float solid = 0;  // steradian
};
/// All of it, in `side` x `side` parts to each side of the cube.
std::vector<Cell> cellsOf(std::size_t side) {
    std::vector<Cell> cells;
    cells.reserve(6 * side * side);
    const auto n = static_cast<float>(side);
    for (std::size_t i = 0; i < 6 * side * side; ++i) {
        const Vec2f st((static_cast<float>(i % side) + .5f) / n, (static_cast<float>(i / side % side) + .5f) / n);
        const Vec2f on = 2.0f * st - 1.0f;
        const float squared = 1 + glm::dot(on, on);
        cells.push_back({cubeDirection(static_cast<CubeSide>(i / (side * side)), st),
                         4 / (squared * std::sqrt(squared)) / (n * n)});
    }
    return cells;
}

/// The harmonics of a light under which matte surfaces show what `shown` says.
template <class F>
Harmonics lightBehind(const F& shown) {
    Harmonics light{};
    for (const Cell& cell : cellsOf(32)) {
        const std::array<float, 9> y = harmonicsAt(cell.direction);
        const Vec3f value = shown(cell.direction) * cell.solid;
        for (std::size_t i = 0; i < 9; ++i) light[i] += value * (y[i] * kPiFloat / kCosine[i]);
    }
    return light;
}

Vec3f usableLight(const Vec4f& color) {
    Vec3f result;
    for (int c = 0; c < 3; ++c) result[c] = std::isfinite(color[c]) ? std::clamp(color[c], 0.0f, 1e20f) : 0.0f;
    return result;
}

/// The angle of a picture's side: that of a cube spans a quarter turn, a panorama a half and a whole one.
float sideOf(const SpaceTexture& picture) {
    return picture.layers().size() == 6 ? kPiFloat / 2 : kPiFloat * std::numbers::sqrt2_v<float>;
}

/// `width`: radians.
Vec3f lookUp(const SpaceTexture& picture, const Vec3f& direction, float width) {
    return usableLight(picture.sample(direction, width / sideOf(picture), {}, ColorSpace::linear));
}

/// The i-th of `count` points that fill a square evenly (Hammersley's).
Vec2f evenly(std::uint32_t i, std::uint32_t count) {
    std::uint32_t bits = i;
    bits = (bits << 16u) | (bits >> 16u);
    bits = ((bits & 0x55555555u) << 1u) | ((bits & 0xAAAAAAAAu) >> 1u);
    bits = ((bits & 0x33333333u) << 2u) | ((bits & 0xCCCCCCCCu) >> 2u);
    bits = ((bits & 0x0F0F0F0Fu) << 4u) | ((bits & 0xF0F0F0F0u) >> 4u);
    bits = ((bits & 0x00FF00FFu) << 8u) | ((bits & 0xFF00FF00u) >> 8u);
    return {(static_cast<float>(i) + .5f) / static_cast<float>(count), static_cast<float>(bits) * 0x1p-32f};
}

}  // namespace

Vec3f sumOf(const Harmonics& coefficients, const Vec3f& direction) {
    const std::array<float, 9> y = harmonicsAt(direction);
    Vec3f sum(0);
    for (std::size_t i = 0; i < 9; ++i) sum += coefficients[i] * y[i];
    return glm::max(sum, Vec3f(0));
}

template <class F>
Environment::Grid::Grid(std::size_t side, const F& valueAt) : side_(side), values_(6 * side * side) {
    const auto last = static_cast<float>(side - 1);
    parallelFor(6 * side, [&](std::size_t row) {
        for (std::size_t x = 0; x < side; ++x)
            values_[row * side + x] =
                valueAt(cubeDirection(static_cast<CubeSide>(row / side),
                                      {static_cast<float>(x) / last, static_cast<float>(row % side) / last}));
    });
}

Vec3f Environment::Grid::at(const Vec3f& direction) const {
    const CubePosition onCube = cubePosition(direction);
    const Vec2f on = glm::clamp(onCube.st, Vec2f(0), Vec2f(1)) * static_cast<float>(side_ - 1);
    const auto x = std::min(static_cast<std::size_t>(on.x), side_ - 2),
               y = std::min(static_cast<std::size_t>(on.y), side_ - 2);
    const float fx = on.x - static_cast<float>(x), fy = on.y - static_cast<float>(y);
    const Vec3f* row = &values_[(static_cast<std::size_t>(onCube.side) * side_ + y) * side_ + x];
    return (row[0] * (1 - fx) + row[1] * fx) * (1 - fy) + (row[side_] * (1 - fx) + row[side_ + 1] * fx) * fy;
}

Environment::Environment(Source source) : source_(std::move(source)) {
    if (source_.specular) return;
    if (source_.diffuse) {
        low_ = lightBehind([&](const Vec3f& d) { return lookUp(*source_.diffuse, d, kPiFloat / 64); });
    } else if (source_.irradiance) {
        low_ = *source_.irradiance;
        for (std::size_t i = 0; i < 9; ++i) (*low_)[i] /= kCosine[i];
    }
}

Vec3f Environment::radiance(const Vec3f& direction, float width) const {
    if (source_.specular) return lookUp(*source_.specular, direction, width);
    return low_ ? sumOf(*low_, direction) : Vec3f(1);
}

Vec3f Environment::radianceInPicture(std::size_t side, Vec2f point, float width) const {
    const SpaceTexture& picture = *source_.specular;
    return usableLight(picture.sampleSide(side, point, width / sideOf(picture), {}, ColorSpace::linear));
}

std::size_t Environment::detail() const {
    if (!source_.specular) return low_ ? 8 : 0;
    int maximum = 0;
    for (const auto& layer : source_.specular->layers())
        if (layer) maximum = std::max({maximum, layer->height(), layer->width() / 2});
    return static_cast<std::size_t>(maximum);
}

Environment::Grid Environment::convolved() const {
    constexpr std::size_t kCells = 32;
    std::vector<Cell> cells = cellsOf(kCells);
    std::vector<Vec3f> light(cells.size());
    parallelFor(cells.size(), [&](std::size_t i) {
        light[i] = radiance(cells[i].direction, kPiFloat / 2 / kCells) * (cells[i].solid / kPiFloat);
    });
    return {25, [&](const Vec3f& normal) {
                Vec3f sum(0);
                for (std::size_t i = 0; i < cells.size(); ++i)
                    sum += light[i] * std::max(glm::dot(normal, cells[i].direction), 0.0f);
                return sum;
            }};
}

Vec3f Environment::matte(const Vec3f& normal) const {
    if (source_.diffuse) return lookUp(*source_.diffuse, normal, 0);
    if (source_.irradiance) return sumOf(*source_.irradiance, normal) / kPiFloat;
    if (isEven()) return Vec3f(1);
    findMatte();
    return matte_->at(normal);
}

/// Each is chosen by its area there, and weighted by the cosine of the reflected direction.
std::vector<Environment::Facet> Environment::facetsOf(float roughness) {
    constexpr std::uint32_t kFacets = 64;
    const float alpha = roughness * roughness, a2 = alpha * alpha;
    std::vector<Facet> result;
    for (std::uint32_t i = 0; i < kFacets; ++i) {
        const Vec2f u = evenly(i, kFacets);
        const float cosine = std::sqrt((1 - u.x) / (1 + (a2 - 1) * u.x)),
                    sine = std::sqrt(std::max(1 - cosine * cosine, 0.0f)), weight = 2 * cosine * cosine - 1;
        if (!(weight > 0)) continue;
        const float angle = 2 * kPiFloat * u.y;
        const float d = cosine * cosine * (a2 - 1) + 1, density = a2 / (kPiFloat * d * d) / 4;
        const float width = std::sqrt(1 / (density * static_cast<float>(kFacets)));
        result.push_back(
            {sine * std::cos(angle), sine * std::sin(angle), cosine, weight, std::min(width, kPiFloat / 2)});
    }
    return result;
}

Vec3f Environment::spread(const Vec3f& direction, const std::vector<Facet>& facets) const {
    const Vec3f across = glm::normalize(
                    glm::cross(std::abs(direction.y) < .9f ? Vec3f(0, 1, 0) : Vec3f(1, 0, 0), direction)),
                along = glm::cross(direction, across);
    Vec3f sum(0);
    float weights = 0;
    for (const Facet& f : facets) {
        const Vec3f facet = across * f.across + along * f.along + direction * f.outwards;
        sum += f.weight * radiance(2 * f.outwards * facet - direction, f.width);
        weights += f.weight;
    }
    return weights > 0 ? sum / weights : radiance(direction);
}

void Environment::findMatte() const {
    std::call_once(matteOnce_, [this] { apart([this] { matte_.emplace(convolved()); }); });
}

void Environment::findBlurred() const {
    const auto find = [this] {
        for (int level = 1; level <= kLevels; ++level) {
            const float r = static_cast<float>(level) / kLevels;
            const std::vector<Facet> facets = facetsOf(r);
            blurred_.emplace_back(r < .4f ? 65 : 33, [&](const Vec3f& d) { return spread(d, facets); });
        }
    };
    std::call_once(blurredOnce_, [&] { apart(find); });
}

void Environment::prepare(bool glossy) const {
    if (isEven()) return;
    if (!source_.diffuse && !source_.irradiance) findMatte();
    if (glossy) findBlurred();
}

Vec3f Environment::blurred(const Vec3f& direction, float roughness) const {
    if (isEven()) return Vec3f(1);
    findBlurred();
    const float at = std::clamp(roughness, 0.0f, 1.0f) * kLevels;
    const int low = std::min(static_cast<int>(at), kLevels - 1);
    const auto of = [&](int level) {
        return level == 0 ? radiance(direction) : blurred_[static_cast<std::size_t>(level - 1)].at(direction);
    };
    const float fraction = at - static_cast<float>(low);
    return of(low) * (1 - fraction) + of(low + 1) * fraction;
}

}  // namespace rtsg::trace
