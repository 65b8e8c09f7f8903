// The rings of a Background's colours and the choice among them.
#include "sky_bands.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <rtsg/renderers/space_texture.h>

namespace rtsg::trace {

namespace {

/// Places and weights of Gauss and Legendre on [0, 1].
constexpr double kGaussPositions[4] = {0.069431844202974, 0.330009478207572, 0.669990521792428, 0.930568155797026};
constexpr double kGaussWeights[4] = {0.173927422568727, 0.326072577431273, 0.326072577431273, 0.173927422568727};

/// The angles from the zenith where colours may break, 0, pi and the horizon among them, ascending.
std::vector<double> breaksOf(const Sky& sky) {
    std::vector<double> breaks{0, std::numbers::pi / 2, std::numbers::pi};
    const auto add = [&](double angle) {
        if (angle > 0 && angle < std::numbers::pi) breaks.push_back(angle);
    };
    for (const float angle : sky.skyAngles) add(double{angle});
    if (!sky.groundColors.empty())
        for (const float angle : sky.groundAngles) add(std::numbers::pi - double{angle});
    std::ranges::sort(breaks);
    breaks.erase(std::ranges::unique(breaks).begin(), breaks.end());
    return breaks;
}

/// The share of the colours that shows at this angle from the zenith; pictures may hide them.
double shownAt(const Sky& sky, double angle) {
    constexpr int kLooks = 64;
    constexpr double kMin = 1.0 / kLooks;  // there may be a gap between the looks
    if (std::ranges::none_of(sky.panorama, [](const auto& picture) { return picture != nullptr; })) return 1;
    if (std::ranges::all_of(sky.panorama, [](const auto& picture) { return picture && !picture->hasAlpha(); }))
        return 0;
    double clear = 0;
    for (int look = 0; look < kLooks; ++look) {
        const double rotation = 2 * std::numbers::pi * look / kLooks;
        const CubePosition onCube = cubePosition(
            Vec3f(Vec3d(std::sin(angle) * std::cos(rotation), std::cos(angle), std::sin(angle) * std::sin(rotation))));
        const auto& picture = sky.panorama[static_cast<std::size_t>(onCube.side)];
        const TextureAccess access{TextureWrap::clamp, TextureWrap::clamp, true};
        clear += picture ? 1 - double{picture->sample(onCube.st.x, onCube.st.y, 1.0f / kLooks, access).a} : 1;
    }
    return std::max(clear / kLooks, kMin);
}

/// The colours alone, whatever hides them.
struct SkyColors {
    Sky sky;
    explicit SkyColors(const Sky& of) : sky(of) { sky.panorama = {}, sky.localFromWorld = glm::mat3(1); }
    double at(double angle) const {
        const Vec3f direction(Vec3d(std::sin(angle), std::cos(angle), 0));
        return double{skyLuminance(Vec3f(sky.color(direction, ColorSpace::linear)))};
    }
};

}  // namespace

std::size_t pickFraction(std::span<const float> sums, float u) {
    const auto at = static_cast<std::size_t>(std::ranges::upper_bound(sums, u) - sums.begin());
    if (at < sums.size()) return at;
    std::size_t last = sums.size() - 1;  // rounding: the last one with a share
    while (last > 0 && !(sums[last] > sums[last - 1])) --last;
    return last;
}

float insideFraction(std::span<const float> sums, std::size_t at, float u) {
    const float before = at > 0 ? sums[at - 1] : 0.0f;
    return std::clamp((u - before) / (sums[at] - before), 0.0f, 0x1.fffffep-1f);
}

float skyLuminance(const Vec3f& color) {
    const float y = 0.2126f * color.r + 0.7152f * color.g + 0.0722f * color.b;
    return std::isfinite(y) ? std::clamp(y, 0.0f, 1e20f) : 0.0f;
}

SkyBands::SkyBands(const Sky& sky) {
    constexpr std::size_t kCuts = 16, kMany = 64;
    const SkyColors colors(sky);
    const std::vector<double> breaks = breaksOf(sky);
    const std::size_t cuts = breaks.size() > kMany ? 2 : kCuts;
    std::vector<double> light;
    const auto addRing = [&](double from, double to) {
        double sum = 0;
        for (int i = 0; i < 4; ++i) {
            const double angle = from + kGaussPositions[i] * (to - from), y = colors.at(angle);
            sum += kGaussWeights[i] * y * std::sin(angle);
            peak_ = std::max(peak_, static_cast<float>(y));
        }
        const double shown = sum > 0 ? shownAt(sky, (from + to) / 2) : 0;
        light.push_back(2 * std::numbers::pi * (to - from) * sum * shown);
        const auto halfSine = [](double angle) { return static_cast<float>(std::pow(std::sin(angle / 2), 2)); };
        const bool above = to <= std::numbers::pi / 2;
        rings_.push_back(
            {halfSine(above ? from : std::numbers::pi - to), halfSine(above ? to : std::numbers::pi - from), 0});
        if (above) ++above_;
    };
    for (std::size_t i = 0; i + 1 < breaks.size(); ++i)
        for (std::size_t cut = 0; cut < cuts; ++cut) {
            const double step = (breaks[i + 1] - breaks[i]) / static_cast<double>(cuts);
            addRing(breaks[i] + step * static_cast<double>(cut),
                    cut + 1 == cuts ? breaks[i + 1] : breaks[i] + step * static_cast<double>(cut + 1));
        }
    std::reverse(rings_.begin() + static_cast<std::ptrdiff_t>(above_), rings_.end());
    std::reverse(light.begin() + static_cast<std::ptrdiff_t>(above_), light.end());
    for (const double part : light) light_ += part;
    if (!(light_ > 0)) {
        light_ = 0, peak_ = 0;
        return;
    }
    double sum = 0;
    for (const double part : light) sums_.push_back(static_cast<float>((sum += part) / light_));
    for (std::size_t i = 0; i < rings_.size(); ++i) {
        Ring& ring = rings_[i];
        ends_.push_back(ring.to);
        const float fraction = sums_[i] - (i > 0 ? sums_[i - 1] : 0);
        // A ring's solid angle is 4 pi times the growth of the square of that sine.
        if (ring.to > ring.from)
            ring.density = fraction / (4 * static_cast<float>(std::numbers::pi) * (ring.to - ring.from));
    }
}

SkyBands::Choice SkyBands::sample(float u, float v) const {
    if (!(light_ > 0)) return {};
    const std::size_t at = pickFraction(sums_, v);
    const Ring& ring = rings_[at];
    const float squared = ring.from + (ring.to - ring.from) * insideFraction(sums_, at, v);
    const float sine = 2 * std::sqrt(squared * (1 - squared)), cosine = 1 - 2 * squared;
    const float angle = 2 * static_cast<float>(std::numbers::pi) * u;
    return {{sine * std::cos(angle), at < above_ ? cosine : -cosine, sine * std::sin(angle)}, ring.density};
}

float SkyBands::density(const Vec3f& d) const {
    if (!(light_ > 0)) return 0;
    const float squared = (d.x * d.x + d.z * d.z) / (2 * (1 + std::abs(d.y)));
    const auto first = ends_.begin() + static_cast<std::ptrdiff_t>(d.y < 0 ? above_ : 0),
               last = d.y < 0 ? ends_.end() : ends_.begin() + static_cast<std::ptrdiff_t>(above_);
    const auto at = std::min(std::upper_bound(first, last, squared), last - 1);
    return rings_[static_cast<std::size_t>(at - ends_.begin())].density;
}

}  // namespace rtsg::trace
