// The filter of live pictures: five rounds of a wavelet over the light that surfaces get, wider each time, which stops
// at edges and at differences that noise does not explain.
#include <rtsg/renderers/denoise.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <rtsg/renderers/light_tracer.h>
#include <rtsg/renderers/parallel_for.h>

namespace rtsg {

const std::uint32_t kLayersOfDenoising = kDepth | kNormal | kAlbedo;

namespace {

constexpr int kRounds = 5;
constexpr float kLeastAlbedo = 0.02f;
// From Schied et al.: how far light may differ, in standard deviations of its noise, and normals, as a power of their
// cosine.
constexpr float kLightRange = 4, kNormalPower = 64;

float luminance(const Vec3f& c) {
    return 0.2126f * c.r + 0.7152f * c.g + 0.0722f * c.b;
}

/// A channel of a layer, by its name; null if there is none.
struct Channel {
    const float* first = nullptr;
    std::size_t stride = 1;
    float operator[](std::size_t pixel) const { return first[pixel * stride]; }
};
Channel findChannel(const Picture& picture, std::string_view name) {
    for (const PictureLayer& layer : picture.layers)
        for (std::size_t c = 0; c < layer.channels.size(); ++c)
            if (layer.channels[c] == name) return {layer.values.data() + c, layer.channels.size()};
    return {};
}

class Filter {
  public:
    explicit Filter(Picture& picture)
        : picture_(picture),
          width_(picture.width),
          height_(picture.height),
          depth_(findChannel(picture, "Z")),
          normal_{findChannel(picture, "N.X"), findChannel(picture, "N.Y"), findChannel(picture, "N.Z")},
          albedo_{findChannel(picture, "albedo.R"), findChannel(picture, "albedo.G"),
                  findChannel(picture, "albedo.B")} {}

    bool hasLayers() const {
        bool all = depth_.first != nullptr;
        for (int c = 0; c < 3; ++c) all = all && normal_[c].first && albedo_[c].first;
        return all;
    }

    void run() {
        const std::size_t count = picture_.pixels.size();
        light_.resize(count), variance_.resize(count), slope_.resize(count), kinds_.resize(count);
        std::vector<Vec3f> nextLight(count);
        std::vector<float> nextVariance(count);
        eachRow([&](int y) { sort(y); });
        eachRow([&](int y) { prepare(y); });
        eachRow([&](int y) { estimate(y); });
        for (int round = 0; round < kRounds; ++round) {
            eachRow([&](int y) {
                for (int x = 0; x < width_; ++x) smooth(x, y, 1 << round, nextLight, nextVariance);
            });
            light_.swap(nextLight), variance_.swap(nextVariance);
        }
        for (std::size_t i = 0; i < count; ++i)
            if (isSurface(i)) picture_.pixels[i] = Vec4f(light_[i] * colorOf(i), picture_.pixels[i].a);
    }

  private:
    template <class F>
    void eachRow(const F& row) {
        parallelFor(static_cast<std::size_t>(height_), [&](std::size_t y) { row(static_cast<int>(y)); });
    }
    std::size_t at(int x, int y) const {
        return static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x);
    }
    bool inside(int x, int y) const { return x >= 0 && y >= 0 && x < width_ && y < height_; }
    bool isSurface(std::size_t i) const { return std::isfinite(depth_[i]) && depth_[i] > 0; }
    Vec3f normalOf(std::size_t i) const { return {normal_[0][i], normal_[1][i], normal_[2][i]}; }
    Vec3f colorOf(std::size_t i) const {
        return glm::max(Vec3f(albedo_[0][i], albedo_[1][i], albedo_[2][i]), Vec3f(kLeastAlbedo));
    }

    bool isDark(std::size_t i) const {
        return isSurface(i) && std::max({albedo_[0][i], albedo_[1][i], albedo_[2][i]}) < kLeastAlbedo;
    }
    /// Light from a black surface is its own emission, and tells nothing about light on its neighbours. A pixel at its
    /// edge shows both, and stays as it is.
    void sort(int y) {
        for (int x = 0; x < width_; ++x) {
            const std::size_t i = at(x, y);
            kinds_[i] = isDark(i) ? Kind::dark : Kind::lit;
            if (kinds_[i] == Kind::dark) continue;
            const float own = luminance(Vec3f(picture_.pixels[i]));
            for (int dy = -1; dy <= 1; ++dy)
                for (int dx = -1; dx <= 1; ++dx) {
                    if (!inside(x + dx, y + dy)) continue;
                    const std::size_t q = at(x + dx, y + dy);
                    if (isDark(q) && luminance(Vec3f(picture_.pixels[q])) > own) kinds_[i] = Kind::rim;
                }
        }
    }

    /// The light without the surface's colour, and how fast the depth changes from pixel to pixel.
    void prepare(int y) {
        for (int x = 0; x < width_; ++x) {
            const std::size_t i = at(x, y);
            const Vec3f value(picture_.pixels[i]);
            for (int c = 0; c < 3; ++c) light_[i][c] = std::isfinite(value[c]) ? value[c] / colorOf(i)[c] : 0.0f;
            float slope[2] = {0, 0};
            for (int axis = 0; axis < 2; ++axis) {
                float least = INFINITY;  // an edge is on one side of a pixel only
                for (const int step : {-1, 1}) {
                    const int nx = x + (axis == 0 ? step : 0), ny = y + (axis == 1 ? step : 0);
                    if (inside(nx, ny) && isSurface(at(nx, ny)))
                        least = std::min(least, std::abs(depth_[at(nx, ny)] - depth_[i]));
                }
                if (std::isfinite(least)) slope[axis] = least;
            }
            slope_[i] = {slope[0], slope[1]};
        }
    }

    /// Whether q, `away` pixels from p, is of the same surface: a share.
    float alike(std::size_t p, std::size_t q, Vec2f away) const {
        if (!isSurface(q)) return 0;
        if (p != q && (kinds_[p] != kinds_[q] || kinds_[p] == Kind::rim)) return 0;
        const float expected = slope_[p].x * std::abs(away.x) + slope_[p].y * std::abs(away.y);
        const float far = std::abs(depth_[p] - depth_[q]) / (expected + 1e-3f * std::abs(depth_[p]) + 1e-20f);
        const float cosine = std::clamp(glm::dot(normalOf(p), normalOf(q)), 0.0f, 1.0f);
        return std::exp(-far) * std::pow(cosine, kNormalPower);
    }

    /// The variance of a pixel's light, by those around it on its surface.
    void estimate(int y) {
        for (int x = 0; x < width_; ++x) {
            const std::size_t p = at(x, y);
            variance_[p] = 0;
            if (!isSurface(p)) continue;
            float weights = 0, mean = 0, squares = 0;
            for (int dy = -3; dy <= 3; ++dy)
                for (int dx = -3; dx <= 3; ++dx) {
                    if (!inside(x + dx, y + dy)) continue;
                    const std::size_t q = at(x + dx, y + dy);
                    const float w = alike(p, q, Vec2f(dx, dy)), l = luminance(light_[q]);
                    weights += w, mean += w * l, squares += w * l * l;
                }
            if (!(weights > 0)) continue;
            mean /= weights;
            variance_[p] = std::max(squares / weights - mean * mean, 0.0f);
        }
    }

    /// The deviation over three by three pixels, so that one lucky pixel does not stop the filter.
    float deviationAt(int x, int y) const {
        float sum = 0, weights = 0;
        for (int dy = -1; dy <= 1; ++dy)
            for (int dx = -1; dx <= 1; ++dx) {
                if (!inside(x + dx, y + dy)) continue;
                const float w = static_cast<float>((2 - std::abs(dx)) * (2 - std::abs(dy)));
                sum += w * variance_[at(x + dx, y + dy)], weights += w;
            }
        return std::sqrt(sum / weights);
    }

    void smooth(int x, int y, int step, std::vector<Vec3f>& light, std::vector<float>& variance) const {
        constexpr float kKernel[5] = {1 / 16.0f, 1 / 4.0f, 3 / 8.0f, 1 / 4.0f, 1 / 16.0f};
        const std::size_t p = at(x, y);
        light[p] = light_[p], variance[p] = variance_[p];
        if (!isSurface(p)) return;
        const float range = kLightRange * deviationAt(x, y) + 1e-6f, own = luminance(light_[p]);
        Vec3f sum(0);
        float weights = 0, squares = 0;
        for (int j = -2; j <= 2; ++j)
            for (int i = -2; i <= 2; ++i) {
                const int nx = x + i * step, ny = y + j * step;
                if (!inside(nx, ny)) continue;
                const std::size_t q = at(nx, ny);
                const float w = kKernel[i + 2] * kKernel[j + 2] * alike(p, q, Vec2f(i * step, j * step)) *
                                (step > 1 ? std::exp(-std::abs(luminance(light_[q]) - own) / range) : 1.0f);
                sum += w * light_[q], weights += w, squares += w * w * variance_[q];
            }
        light[p] = sum / weights, variance[p] = squares / (weights * weights);
    }

    enum class Kind : std::uint8_t { lit, dark, rim };

    Picture& picture_;
    const int width_, height_;
    std::vector<Kind> kinds_;
    Channel depth_, normal_[3], albedo_[3];
    std::vector<Vec3f> light_;
    std::vector<float> variance_;
    std::vector<Vec2f> slope_;
};

}  // namespace

Result<> denoise(Picture& picture) {
    if (picture.space != ColorSpace::linear) return fail("only pictures of light are denoised, not display values");
    if (!picture.interval.empty()) return fail("a picture whose error is known is not denoised");
    Filter filter(picture);
    if (!filter.hasLayers()) return fail("a picture is denoised by its depth, normal and albedo, which it has not");
    filter.run();
    return {};
}

}  // namespace rtsg
