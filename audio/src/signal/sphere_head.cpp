// The head that is a rigid sphere: Rayleigh's series for a wave from far away.
#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <mutex>
#include <numbers>
#include <span>
#include <tuple>
#include <vector>

#include <rtsg/audio/hrtf.h>

#include "fft.h"
#include "fractional_delay.h"
#include "hrtf_impl.h"

namespace rtsg {
namespace {

/// Samples before that in which a response begins: room for what rings before it.
constexpr std::size_t kSphereLead = 24;
/// Angles between the ear and where sound comes from, half a degree apart: on the far side a tone's two ways round
/// change within a few degrees.
constexpr std::size_t kSphereAngles = 360;

/// By order of the series: the factor of Legendre's polynomial at each frequency, and the first frequency at which it
/// counts.
struct SphereOrder {
    std::vector<double> real, imaginary;
    std::size_t first = 0;
};

/// Waves go with e^(i w t): (2 m + 1) i^m (-i / x^2) / h'_m(x), h: spherical Hankel functions of the second kind, x:
/// the radius in wave lengths times 2 pi. Source: Morse and Ingard, Theoretical Acoustics, 8.2.
std::vector<SphereOrder> ordersOf(std::size_t bins, double step) {
    constexpr double kMin = 1e-9;
    std::vector<SphereOrder> orders;
    for (std::size_t k = 1; k < bins; ++k) {
        const double x = static_cast<double>(k) * step;
        std::complex<double> before = std::polar(1 / x, std::numbers::pi / 2 - x);  // h_0
        std::complex<double> now = before * std::complex<double>(1 / x, 1);         // h_1
        std::complex<double> angle(0, -1);
        for (std::size_t m = 0;; ++m) {
            const double order = static_cast<double>(m);
            // The derivative from h_m and h_(m+1): h'_m = m / x h_m - h_(m+1).
            const std::complex<double> slope = order / x * before - now;
            const std::complex<double> factor = (2 * order + 1) / (x * x) * angle / slope;
            if (order > x && std::abs(factor) < kMin) break;
            if (orders.size() <= m) orders.push_back({std::vector<double>(bins), std::vector<double>(bins), k});
            orders[m].real[k] = factor.real();
            orders[m].imaginary[k] = factor.imag();
            before = std::exchange(now, (2 * order + 3) / x * now - before);
            angle *= std::complex<double>(0, 1);
        }
    }
    return orders;
}

/// By bin, for a cosine of the angle.
std::vector<std::complex<double>> pressureAt(double cosine, std::span<const SphereOrder> orders, std::size_t bins) {
    std::vector<double> real(bins), imaginary(bins);
    double before = 0, now = 1;
    for (std::size_t m = 0; m < orders.size(); ++m) {
        const SphereOrder& order = orders[m];
        for (std::size_t k = order.first; k < bins; ++k) {
            real[k] += now * order.real[k];
            imaginary[k] += now * order.imaginary[k];
        }
        const double n = static_cast<double>(m);
        before = std::exchange(now, ((2 * n + 1) * cosine * now - n * before) / (n + 1));
    }
    std::vector<std::complex<double>> pressure(bins, 1);
    for (std::size_t k = 1; k < bins; ++k) pressure[k] = {real[k], imaginary[k]};
    return pressure;
}

thread_local std::uint64_t spheresComputed = 0;

class SphereHead final : public Hrtf::Impl {
  public:
    SphereHead(int sampleRate, double seconds) {
        rate = sampleRate;
        sphereSeconds = seconds;
        lead = kSphereLead;
        early =
            static_cast<std::size_t>(std::ceil(Hrtf::kLongestRadius * sampleRate)) + kSphereLead + SincTable::kHalf + 1;
        lineDelay = static_cast<double>(early) - lead;
        // Sound that goes round the head has faded by then.
        constexpr double kRadii = 14;
        length = kSphereLead + static_cast<std::size_t>(std::ceil(kRadii * seconds * sampleRate)) + SincTable::kHalf;
        const RealFft fft(RealFft::sizeFor(2 * length));
        const double step = 2 * std::numbers::pi * sampleRate / static_cast<double>(fft.size());
        const std::vector<SphereOrder> orders = ordersOf(fft.bins(), step * seconds);
        std::vector<float> samples(fft.size());
        RealFft::Spectrum spectrum(fft.bins());
        responses_.resize((kSphereAngles + 1) * length);
        for (std::size_t a = 0; a <= kSphereAngles; ++a) {
            const double angle = std::numbers::pi * static_cast<double>(a) / kSphereAngles;
            const std::vector<std::complex<double>> pressure = pressureAt(std::cos(angle), orders, fft.bins());
            const double delay =
                sphereEarDelay(std::cos(angle), 1, seconds, 1) - static_cast<double>(kSphereLead) / rate;
            for (std::size_t k = 0; k < fft.bins(); ++k) {
                const double kept = keptOf(static_cast<double>(k) / static_cast<double>(fft.bins() - 1));
                spectrum[k] = kept * pressure[k] * std::polar(1.0, step * static_cast<double>(k) * delay);
            }
            fft.inverse(spectrum, samples);
            std::copy_n(samples.begin(), length, responses_.begin() + static_cast<std::ptrdiff_t>(a * length));
        }
    }

    std::array<double, 2> raw(const glm::dvec3& direction, float* room, const float*& responses) const override {
        std::array<double, 2> delays{};
        for (int e = 0; e < 2; ++e) {
            const double towards = std::clamp(e == 0 ? -direction.x : direction.x, -1.0, 1.0);
            readAt(std::acos(towards) * kSphereAngles / std::numbers::pi, room + static_cast<std::size_t>(e) * length);
            delays[static_cast<std::size_t>(e)] = sphereDelay(direction, e);
        }
        responses = room;
        return delays;
    }

  private:
    /// The share that is kept of a frequency, given as a share of half the sample rate. It falls to 0, so that
    /// responses ring no longer than there is room.
    static double keptOf(double fraction) {
        constexpr double kFrom = 0.9;
        const double c = std::cos(std::clamp((fraction - kFrom) / (1 - kFrom), 0.0, 1.0) * std::numbers::pi / 2);
        return c * c;
    }

    /// Cubic between the angles; beyond both ends they come back.
    void readAt(double step, float* to) const {
        const auto whole = std::min(static_cast<std::ptrdiff_t>(step), static_cast<std::ptrdiff_t>(kSphereAngles) - 1);
        const auto u = static_cast<float>(step - static_cast<double>(whole));
        const std::array<float, 4> weights{u * (-0.5f + u * (1 - 0.5f * u)), 1 + u * u * (1.5f * u - 2.5f),
                                           u * (0.5f + u * (2 - 1.5f * u)), u * u * (0.5f * u - 0.5f)};
        std::array<const float*, 4> from{};
        for (std::ptrdiff_t k = 0; k < 4; ++k) {
            const std::ptrdiff_t last = kSphereAngles, at = std::abs(whole - 1 + k);
            from[static_cast<std::size_t>(k)] =
                responses_.data() + static_cast<std::size_t>(at > last ? 2 * last - at : at) * length;
        }
        for (std::size_t i = 0; i < length; ++i)
            to[i] =
                weights[0] * from[0][i] + weights[1] * from[1][i] + weights[2] * from[2][i] + weights[3] * from[3][i];
    }

    std::vector<float> responses_;  // by angle
};

}  // namespace

std::uint64_t spheresComputedHere() {
    return spheresComputed;
}

std::shared_ptr<const Hrtf> Hrtf::sphere(int sampleRate, double radius, double speedOfSound) {
    constexpr std::size_t kKept = 16;
    static std::mutex mutex;
    static std::vector<std::tuple<int, double, std::shared_ptr<const Hrtf>>> kept;
    const double seconds = std::clamp(radius / speedOfSound, 1e-5, kLongestRadius);
    const std::lock_guard lock(mutex);
    for (const auto& [rate, size, head] : kept)
        if (rate == sampleRate && size == seconds) return head;
    if (kept.size() == kKept) kept.erase(kept.begin());
    std::shared_ptr<const Hrtf> head(new Hrtf(std::make_unique<SphereHead>(sampleRate, seconds)));
    ++spheresComputed;
    kept.emplace_back(sampleRate, seconds, head);
    return head;
}

}  // namespace rtsg
