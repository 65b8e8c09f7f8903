// The filter of live pictures: five rounds of a wavelet over the light that surfaces get, wider each time, which stops
// at edges and at differences that noise does not explain. Eight pixels of a row go at a time.
#include <rtsg/renderers/denoise.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <utility>
#include <vector>

#include <rtsg/renderers/light_tracer.h>
#include <rtsg/renderers/parallel_for.h>

#include "denoise_filter.h"
#include "mesh/simd8.h"

namespace rtsg {

const std::uint32_t kLayersOfDenoising = kDepth | kNormal | kAlbedo;

namespace {

using simd::all;
using simd::F8;
using simd::I8;
using simd::load;
using simd::store;

constexpr int kRounds = 5, kLanes = 8;
constexpr int kBeside = 2 << (kRounds - 1);  // pixels that the last round looks to either side
constexpr float kMinAlbedo = 0.02f;
// From Schied et al.: how far light may differ, in standard deviations of its noise; normals go by the 64th power of
// their cosine.
constexpr float kLightRange = 4;
constexpr float kMaxLight = 1e15f;  // its square is a number, too
constexpr float kLog2E = 1.44269504f;

// The kind of a pixel's content, as a number for comparisons in lanes: no surface, a lit surface, a black one, or a
// pixel with both.
constexpr float kNone = 0, kLit = 1, kDark = 2, kRim = 3;

template <class F>
F luminance(F r, F g, F b) {
    return 0.2126f * r + 0.7152f * g + 0.0722f * b;
}
float luminance(const Vec3f& c) {
    return luminance(c.r, c.g, c.b);
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

using Plane = std::vector<float>;

/// Light without the surface's colour, and the variance of its luminance.
struct LightPlanes {
    Plane r, g, b, variance;
    void resize(std::size_t size) {
        for (Plane* plane : {&r, &g, &b, &variance}) plane->assign(size, 0);
    }
    F8 luminanceAt(std::size_t i) const { return luminance(load(&r[i]), load(&g[i]), load(&b[i])); }
};

/// One picture, or two of the same by independent samples.
class Filter {
  public:
    Filter(const Picture& guide, std::vector<Picture*> pictures, std::function<bool()> goesOn)
        : pictures_(std::move(pictures)),
          goesOn_(std::move(goesOn)),
          width_(guide.width),
          height_(guide.height),
          stride_((static_cast<std::size_t>(width_) + kLanes - 1) / kLanes * kLanes + 2 * std::size_t{kBeside}),
          depthOf_(findChannel(guide, "Z")),
          normalOf_{findChannel(guide, "N.X"), findChannel(guide, "N.Y"), findChannel(guide, "N.Z")},
          albedoOf_{findChannel(guide, "albedo.R"), findChannel(guide, "albedo.G"), findChannel(guide, "albedo.B")} {}

    bool hasLayers() const {
        bool found = depthOf_.first != nullptr;
        for (int c = 0; c < 3; ++c) found = found && normalOf_[c].first && albedoOf_[c].first;
        return found;
    }

    /// False: it was given up, and the pictures are as they were.
    bool run() {
        const std::size_t size = stride_ * static_cast<std::size_t>(height_);
        for (Plane* plane : {&depth_, &normal_[0], &normal_[1], &normal_[2], &kind_, &slope_[0], &slope_[1]})
            plane->assign(size, 0);
        light_.resize(pictures_.size()), next_.resize(pictures_.size());
        for (LightPlanes& light : light_) light.resize(size);
        for (LightPlanes& light : next_) light.resize(size);
        eachRow([&](int y) { sort(y); });
        eachRow([&](int y) { prepare(y); });
        eachRow([&](int y) { eachEight(y, [&](int x) { estimate(x, y); }); });
        for (int round = 0; round < kRounds; ++round) {
            eachRow([&](int y) { eachEight(y, [&](int x) { smooth(x, y, 1 << round); }); });
            std::swap(light_, next_);
            if (goesOn_ && !goesOn_()) return false;
        }
        for (std::size_t k = 0; k < pictures_.size(); ++k) eachRow([&](int y) { show(y, light_[k], *pictures_[k]); });
        return true;
    }

  private:
    template <class F>
    void eachRow(const F& row) {
        parallelFor(static_cast<std::size_t>(height_), [&](std::size_t y) { row(static_cast<int>(y)); });
    }
    /// Calls with the first of each eight pixels among which there is a surface.
    template <class F>
    void eachEight(int y, const F& eight) const {
        for (int x = 0; x < width_; x += kLanes)
            if (simd::any(load(&kind_[at(x, y)]) != kNone)) eight(x);
    }
    /// The index of a pixel in a picture, and in the planes here, whose rows have padding.
    std::size_t pixelAt(int x, int y) const {
        return static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x);
    }
    std::size_t at(int x, int y) const {
        return static_cast<std::size_t>(y) * stride_ + static_cast<std::size_t>(x + kBeside);
    }
    bool inside(int x, int y) const { return x >= 0 && y >= 0 && x < width_ && y < height_; }
    bool isSurface(std::size_t pixel) const { return std::isfinite(depthOf_[pixel]) && depthOf_[pixel] > 0; }
    Vec3f colorOf(std::size_t i) const {
        return glm::max(Vec3f(albedoOf_[0][i], albedoOf_[1][i], albedoOf_[2][i]), Vec3f(kMinAlbedo));
    }
    bool isDark(std::size_t i) const {
        return isSurface(i) && std::max({albedoOf_[0][i], albedoOf_[1][i], albedoOf_[2][i]}) < kMinAlbedo;
    }
    float shownAt(std::size_t pixel) const {
        float sum = 0;
        for (const Picture* picture : pictures_) sum += luminance(Vec3f(picture->pixels[pixel]));
        return sum;
    }

    /// Light from a black surface is its own emission, and tells nothing about light on its neighbours. A pixel at its
    /// edge shows both, and stays as it is.
    void sort(int y) {
        for (int x = 0; x < width_; ++x) {
            const std::size_t i = pixelAt(x, y);
            if (!isSurface(i)) continue;
            float& kind = kind_[at(x, y)];
            kind = isDark(i) ? kDark : kLit;
            depth_[at(x, y)] = depthOf_[i];
            for (int c = 0; c < 3; ++c) normal_[c][at(x, y)] = normalOf_[c][i];
            if (kind == kDark) continue;
            const float own = shownAt(i);
            for (int dy = -1; dy <= 1; ++dy)
                for (int dx = -1; dx <= 1; ++dx) {
                    if (!inside(x + dx, y + dy)) continue;
                    const std::size_t q = pixelAt(x + dx, y + dy);
                    if (isDark(q) && shownAt(q) > own) kind = kRim;
                }
        }
    }

    /// The light without the surface's colour, and how fast the depth changes from pixel to pixel.
    void prepare(int y) {
        for (int x = 0; x < width_; ++x) {
            const std::size_t i = pixelAt(x, y), p = at(x, y);
            const Vec3f color = colorOf(i);
            for (std::size_t k = 0; k < pictures_.size(); ++k) {
                const Vec3f value(pictures_[k]->pixels[i]);
                Plane* const to[] = {&light_[k].r, &light_[k].g, &light_[k].b};
                for (int c = 0; c < 3; ++c)
                    (*to[c])[p] = std::isfinite(value[c]) ? std::min(value[c] / color[c], kMaxLight) : 0.0f;
            }
            if (kind_[p] == kNone) continue;
            for (int axis = 0; axis < 2; ++axis) {
                float minimum = INFINITY;  // an edge is on one side of a pixel only
                for (const int step : {-1, 1}) {
                    const int nx = x + (axis == 0 ? step : 0), ny = y + (axis == 1 ? step : 0);
                    if (inside(nx, ny) && kind_[at(nx, ny)] != kNone)
                        minimum = std::min(minimum, std::abs(depth_[at(nx, ny)] - depth_[p]));
                }
                if (std::isfinite(minimum)) slope_[axis][p] = minimum;
            }
        }
    }

    /// Eight pixels of a row, from p on.
    struct Own {
        Own(const Filter& f, std::size_t p)
            : depth(load(&f.depth_[p])),
              normal{load(&f.normal_[0][p]), load(&f.normal_[1][p]), load(&f.normal_[2][p])},
              kind(load(&f.kind_[p])),
              slope{load(&f.slope_[0][p]), load(&f.slope_[1][p])} {}
        F8 depth;
        simd::V8 normal;
        F8 kind, slope[2];
    };
    /// Whether those from q on, `away` pixels from p, are of the same surface: 2 to the power of -`far`, by `share`.
    struct Alike {
        F8 far, fraction;
    };
    Alike alike(const Own& own, std::size_t q, int awayX, int awayY) const {
        const F8 kind = load(&kind_[q]);
        if (awayX == 0 && awayY == 0) return {all(0), simd::select(kind != kNone, all(1), all(0))};
        const I8 same = (kind == own.kind) & (kind != kNone) & (kind != kRim);
        const F8 expected =
            own.slope[0] * static_cast<float>(std::abs(awayX)) + own.slope[1] * static_cast<float>(std::abs(awayY));
        const F8 off = simd::absolute(own.depth - load(&depth_[q]));
        const F8 far = kLog2E * off / (expected + 1e-3f * simd::absolute(own.depth) + 1e-20f);
        const simd::V8 normal{load(&normal_[0][q]), load(&normal_[1][q]), load(&normal_[2][q])};
        F8 cosine = simd::min(simd::max(simd::dot(own.normal, normal), all(0)), all(1));
        for (int i = 0; i < 6; ++i) cosine *= cosine;
        return {far, simd::select(same, cosine, all(0))};
    }

    /// The variance of light: of one picture that of those around a pixel on its surface, of two by their difference.
    void estimate(int x, int y) {
        const Own own(*this, at(x, y));
        F8 weights = all(0), mean = all(0), squares = all(0);
        for (int dy = -3; dy <= 3; ++dy) {
            if (y + dy < 0 || y + dy >= height_) continue;
            for (int dx = -3; dx <= 3; ++dx) {
                const std::size_t q = at(x + dx, y + dy);
                const Alike like = alike(own, q, dx, dy);
                const F8 w = like.fraction * simd::exp2Of(-like.far), l = light_[0].luminanceAt(q);
                weights += w;
                if (pictures_.size() > 1) {
                    const F8 difference = l - light_[1].luminanceAt(q);
                    squares += w * difference * difference * .5f;
                } else {
                    mean += w * l, squares += w * l * l;
                }
            }
        }
        const F8 scale = simd::select(weights > 0.0f, 1.0f / weights, all(0));
        mean *= scale, squares = simd::max(squares * scale - mean * mean, all(0));
        if (pictures_.size() > 1) {  // a pixel that is luckier than those around it is as uncertain as it shows
            const std::size_t p = at(x, y);
            const F8 difference = light_[0].luminanceAt(p) - light_[1].luminanceAt(p);
            squares = simd::max(squares, difference * difference * .5f);
        }
        for (LightPlanes& light : light_) store(&light.variance[at(x, y)], squares);
    }
    /// The deviation over three by three pixels, so that one lucky pixel does not stop the filter.
    F8 deviationAt(const Plane& variance, int x, int y) const {
        F8 sum = all(0), weights = all(0);
        for (int dy = -1; dy <= 1; ++dy) {
            if (y + dy < 0 || y + dy >= height_) continue;
            for (int dx = -1; dx <= 1; ++dx) {
                const std::size_t q = at(x + dx, y + dy);
                const float w = static_cast<float>((2 - std::abs(dx)) * (2 - std::abs(dy)));
                const F8 there = simd::select(load(&kind_[q]) != kNone, all(w), all(0));
                sum += there * load(&variance[q]), weights += there;
            }
        }
        return simd::sqrt(sum / simd::max(weights, all(1e-6f)));
    }

    void smooth(int x, int y, int step) {
        // In proportion to the light, and above 0 where there is none.
        constexpr float kRounding = 1e-6f, kMin = 1e-30f;
        constexpr float kKernel[5] = {1 / 16.0f, 1 / 4.0f, 3 / 8.0f, 1 / 4.0f, 1 / 16.0f};
        struct Sum {
            F8 r = all(0), g = all(0), b = all(0), weights = all(0), variance = all(0);
        };
        const std::size_t p = at(x, y);
        const Own own(*this, p);
        // How much of light that differs goes. One picture's first round looks at all, or its lucky pixels would stay.
        const bool byLight = step > 1 || pictures_.size() > 1;
        Sum sums[2];
        F8 narrow[2], shown[2];
        for (std::size_t k = 0; k < pictures_.size(); ++k) {
            shown[k] = light_[k].luminanceAt(p);
            narrow[k] = kLog2E / (kLightRange * deviationAt(light_[k].variance, x, y) + kRounding * shown[k] + kMin);
        }
        for (int j = -2; j <= 2; ++j) {
            if (y + j * step < 0 || y + j * step >= height_) continue;
            for (int i = -2; i <= 2; ++i) {
                const std::size_t q = at(x + i * step, y + j * step);
                const Alike like = alike(own, q, i * step, j * step);
                const F8 fraction = kKernel[i + 2] * kKernel[j + 2] * like.fraction;
                for (std::size_t k = 0; k < pictures_.size(); ++k) {
                    const F8 r = load(&light_[k].r[q]), g = load(&light_[k].g[q]), b = load(&light_[k].b[q]);
                    F8 far = like.far;
                    if (byLight) far += simd::absolute(luminance(r, g, b) - shown[k]) * narrow[k];
                    const F8 w = fraction * simd::exp2Of(-far);
                    Sum& sum = sums[k];
                    sum.r += w * r, sum.g += w * g, sum.b += w * b, sum.weights += w;
                    sum.variance += w * w * load(&light_[k].variance[q]);
                }
            }
        }
        for (std::size_t k = 0; k < pictures_.size(); ++k) {
            const Sum& sum = sums[k];
            const F8 scale = simd::select(sum.weights > 0.0f, 1.0f / sum.weights, all(0));
            LightPlanes& to = next_[k];
            store(&to.r[p], sum.r * scale), store(&to.g[p], sum.g * scale), store(&to.b[p], sum.b * scale);
            store(&to.variance[p], sum.variance * scale * scale);
        }
    }

    void show(int y, const LightPlanes& light, Picture& picture) const {
        for (int x = 0; x < width_; ++x) {
            const std::size_t i = pixelAt(x, y), p = at(x, y);
            if (kind_[p] == kNone) continue;
            picture.pixels[i] = Vec4f(Vec3f(light.r[p], light.g[p], light.b[p]) * colorOf(i), picture.pixels[i].a);
        }
    }

    const std::vector<Picture*> pictures_;
    const std::function<bool()> goesOn_;
    const int width_, height_;
    const std::size_t stride_;
    const Channel depthOf_, normalOf_[3], albedoOf_[3];
    Plane depth_, normal_[3], kind_, slope_[2];
    std::vector<LightPlanes> light_, next_;
};

Result<> check(const Picture& picture) {
    if (picture.space != ColorSpace::linear) return fail("only pictures of light are denoised, not display values");
    if (!picture.interval.empty()) return fail("a picture whose error is known is not denoised");
    return {};
}

}  // namespace

Result<> denoise(Picture& picture) {
    if (auto ok = check(picture); !ok) return ok;
    Filter filter(picture, {&picture}, {});
    if (!filter.hasLayers()) return fail("a picture is denoised by its depth, normal and albedo, which it has not");
    (void)filter.run();
    return {};
}

Result<bool> denoiseHalves(const Picture& guide, Picture& first, Picture& second, const std::function<bool()>& goesOn) {
    for (const Picture* half : {&first, &second}) {
        if (auto ok = check(*half); !ok) return std::unexpected(ok.error());
        if (half->width != guide.width || half->height != guide.height)
            return fail("two pictures of one size are denoised together");
    }
    Filter filter(guide, {&first, &second}, goesOn);
    if (!filter.hasLayers()) return fail("a picture is denoised by its depth, normal and albedo, which it has not");
    return filter.run();
}

}  // namespace rtsg
