// Judges a denoised picture tile by tile, with samples that are not part of it.
#include <rtsg/renderers/path_preview.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <utility>
#include <vector>

#include <rtsg/renderers/parallel_for.h>

#include "denoise_filter.h"

namespace rtsg {

namespace {

constexpr int kTile = 16;
constexpr double kAnew = 1.5;  // the filter runs again once there are so many times the samples
/// The filter is trusted to lower the squared error so far, however well it looks.
constexpr double kMaxGain = 16;

struct Half {
    Picture mean;
    int samples = 0;

    void add(Picture picture, int more) {
        if (samples == 0) {
            mean = std::move(picture);
        } else {
            const float weight = static_cast<float>(more) / static_cast<float>(samples + more);
            for (std::size_t i = 0; i < mean.pixels.size(); ++i)
                mean.pixels[i] += weight * (picture.pixels[i] - mean.pixels[i]);
        }
        samples += more;
    }
};

/// Sums over a tile's pixels: estimates of the squared errors of the plain mean and of the denoised one.
struct TileErrors {
    double plain = 0, denoised = 0;
};

float squareOf(Vec3f v) {
    return glm::dot(v, v);
}

}  // namespace

struct PathPreview::Impl {
    explicit Impl(float w) : white(w) {}

    const float white;
    Half halves[2];
    Picture guide;     // its layers alone count
    Picture filtered;  // empty: nothing has been filtered yet
    int filteredAt = 0;
    int tilesX = 0, tilesY = 0;
    std::vector<TileErrors> errors;  // when there were filteredAt samples
    double denoised = 0;

    int samples() const { return halves[0].samples + halves[1].samples; }
    Vec3f shown(const Vec4f& pixel) const { return glm::clamp(Vec3f(pixel), 0.0f, white); }

    Picture mean() const {
        const Half &a = halves[0], &b = halves[1];
        if (b.samples == 0) return a.mean;
        Picture both = a.mean;
        const float weight = static_cast<float>(b.samples) / static_cast<float>(samples());
        for (std::size_t i = 0; i < both.pixels.size(); ++i)
            both.pixels[i] += weight * (b.mean.pixels[i] - both.pixels[i]);
        return both;
    }

    bool isDue() const {
        return !guide.layers.empty() && halves[0].samples == halves[1].samples && halves[0].samples > 0 &&
               samples() >= kAnew * filteredAt;
    }
    void filter(const std::function<bool()>& goesOn) {
        Picture a = halves[0].mean, b = halves[1].mean;
        const auto done = denoiseHalves(guide, a, b, goesOn);
        if (!done || !*done) return;
        judge(a, b);
        for (std::size_t i = 0; i < a.pixels.size(); ++i) a.pixels[i] = .5f * (a.pixels[i] + b.pixels[i]);
        filtered = std::move(a);
        filteredAt = samples();
    }
    /// Each half, denoised, beside the other one, whose own noise is taken off.
    void judge(const Picture& a, const Picture& b) {
        tilesX = (a.width + kTile - 1) / kTile, tilesY = (a.height + kTile - 1) / kTile;
        std::vector<TileErrors> own(static_cast<std::size_t>(tilesX) * static_cast<std::size_t>(tilesY));
        parallelFor(own.size(), [&](std::size_t tile) {
            const int x0 = static_cast<int>(tile) % tilesX * kTile, y0 = static_cast<int>(tile) / tilesX * kTile;
            for (int y = y0; y < std::min(y0 + kTile, a.height); ++y)
                for (int x = x0; x < std::min(x0 + kTile, a.width); ++x) {
                    const Vec3f plainA = shown(halves[0].mean.at(x, y)), plainB = shown(halves[1].mean.at(x, y));
                    const float apart = squareOf(plainA - plainB);
                    const float off = squareOf(shown(a.at(x, y)) - plainB) + squareOf(shown(b.at(x, y)) - plainA);
                    own[tile].plain += double{apart} / 4, own[tile].denoised += double{off - apart} / 2;
                }
        });
        smooth(own);
    }
    /// Few pixels know their noise badly: a tile is judged with those around it.
    void smooth(const std::vector<TileErrors>& own) {
        errors.assign(own.size(), {});
        for (int y = 0; y < tilesY; ++y)
            for (int x = 0; x < tilesX; ++x)
                for (int dy = -1; dy <= 1; ++dy)
                    for (int dx = -1; dx <= 1; ++dx) {
                        if (x + dx < 0 || y + dy < 0 || x + dx >= tilesX || y + dy >= tilesY) continue;
                        const double fraction = (2 - std::abs(dx)) * (2 - std::abs(dy)) / 16.0;
                        const TileErrors& from =
                            own[static_cast<std::size_t>(y + dy) * static_cast<std::size_t>(tilesX) +
                                static_cast<std::size_t>(x + dx)];
                        TileErrors& to = errors[static_cast<std::size_t>(y) * static_cast<std::size_t>(tilesX) +
                                                static_cast<std::size_t>(x)];
                        to.plain += fraction * from.plain, to.denoised += fraction * from.denoised;
                    }
    }

    /// 1 for tiles where the denoised picture is the better one by now, else 0.
    std::vector<float> choices() const {
        const double since = static_cast<double>(filteredAt) / samples();
        std::vector<float> all;
        for (const TileErrors& one : errors)
            all.push_back(std::max(one.denoised, one.plain / kMaxGain) < one.plain * since ? 1.0f : 0.0f);
        return all;
    }
    void putIn(Picture& picture) {
        const std::vector<float> choice = choices();
        const auto of = [&](int tx, int ty) {
            return choice[static_cast<std::size_t>(std::clamp(ty, 0, tilesY - 1)) * static_cast<std::size_t>(tilesX) +
                          static_cast<std::size_t>(std::clamp(tx, 0, tilesX - 1))];
        };
        std::vector<double> fractions(static_cast<std::size_t>(picture.height));
        parallelFor(fractions.size(), [&](std::size_t row) {
            const int y = static_cast<int>(row);
            const float v = (static_cast<float>(y) + .5f) / kTile - .5f, down = v - std::floor(v);
            const int ty = static_cast<int>(std::floor(v));
            for (int x = 0; x < picture.width; ++x) {
                const float u = (static_cast<float>(x) + .5f) / kTile - .5f, right = u - std::floor(u);
                const int tx = static_cast<int>(std::floor(u));
                const float fraction = std::lerp(std::lerp(of(tx, ty), of(tx + 1, ty), right),
                                                 std::lerp(of(tx, ty + 1), of(tx + 1, ty + 1), right), down);
                picture.at(x, y) += fraction * (filtered.at(x, y) - picture.at(x, y));
                fractions[row] += double{fraction};
            }
        });
        for (const double fraction : fractions) denoised += fraction / static_cast<double>(picture.pixels.size());
    }
};

PathPreview::PathPreview(float white) : impl_(std::make_unique<Impl>(white)) {}
PathPreview::~PathPreview() = default;
PathPreview::PathPreview(PathPreview&&) noexcept = default;
PathPreview& PathPreview::operator=(PathPreview&&) noexcept = default;

void PathPreview::clear() {
    impl_ = std::make_unique<Impl>(impl_->white);
}

Result<> PathPreview::add(Picture picture, int samples) {
    Impl& s = *impl_;
    const Picture& first = s.halves[0].mean;
    if (picture.space != ColorSpace::linear) return fail("only pictures of light are denoised, not display values");
    if (!picture.interval.empty()) return fail("a picture whose error is known is not denoised");
    if (s.samples() > 0 && (picture.width != first.width || picture.height != first.height))
        return fail("samples of a picture of another size");
    if (!picture.layers.empty()) {
        s.guide.width = picture.width, s.guide.height = picture.height;
        s.guide.layers = std::exchange(picture.layers, {});
    }
    s.halves[s.halves[1].samples < s.halves[0].samples ? 1 : 0].add(std::move(picture), samples);
    return {};
}

int PathPreview::samples() const {
    return impl_->samples();
}
int PathPreview::wanted(int maximum) const {
    const int a = impl_->halves[0].samples, b = impl_->halves[1].samples;
    // A picture of one sample takes the middle of each pixel, so only the first ones do.
    const int next = a != b ? std::abs(a - b) : a == 0 ? 1 : std::max(2, a + b);
    return std::clamp(next, 1, std::max(1, maximum));
}
Picture PathPreview::mean() const {
    return impl_->mean();
}

Picture PathPreview::best(const std::function<bool()>& goesOn) {
    Impl& s = *impl_;
    if (s.isDue()) s.filter(goesOn);
    Picture picture = s.mean();
    s.denoised = 0;
    if (s.filteredAt > 0) s.putIn(picture);
    return picture;
}
double PathPreview::denoised() const {
    return impl_->denoised;
}

double PathPreview::noise() const {
    const Impl& s = *impl_;
    if (s.halves[1].samples == 0) return 0;
    // The variance of a mean whose weights follow the numbers of samples.
    const double a = s.halves[0].samples, b = s.halves[1].samples, fraction = a * b / ((a + b) * (a + b));
    double squares = 0, sum = 0;
    for (std::size_t i = 0; i < s.halves[0].mean.pixels.size(); ++i) {
        const Vec3f one = s.shown(s.halves[0].mean.pixels[i]), two = s.shown(s.halves[1].mean.pixels[i]);
        squares += double{squareOf(one - two)};
        sum += (a * (double{one.r} + one.g + one.b) + b * (double{two.r} + two.g + two.b)) / (a + b);
    }
    const auto count = 3.0 * static_cast<double>(s.halves[0].mean.pixels.size());
    return sum > 0 ? std::sqrt(fraction * squares / count) / (sum / count) : 0;
}

}  // namespace rtsg
