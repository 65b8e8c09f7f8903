// The uniform theory of diffraction by smooth convex bodies, and the series of a sphere.
#include "diffraction_detour.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <vector>

#include "edges/diffraction_wedge.h"

#include "diffraction_surface_waves.h"

namespace rtsg {
namespace {

using Complex = std::complex<double>;
constexpr double kRoundPi = std::numbers::pi;
constexpr Complex kRoundI(0, 1);
/// By how much places are lifted: as shares of the height of that layer and of the radius, fitted to the series; and in
/// metres, the bound that direct sound has.
constexpr double kLift = 0.15, kMaxLift = 0.5, kNearest = 0.01;
/// exp(-i pi / 4)
const Complex kRoundEighth(std::numbers::sqrt2 / 2, -std::numbers::sqrt2 / 2);

/// F(kl a a / 2) / (2 sqrt(pi) a), also where a is 0.
Complex roundTransition(double kl, double a) {
    if (std::abs(a) > 1e-7) return diffractionTransition(0.5 * kl * a * a) / (2 * std::sqrt(kRoundPi) * a);
    return std::sqrt(0.125 * kl) * (a < 0 ? -1 : 1) / kRoundEighth;
}

}  // namespace

double RoundPath::distance() const {
    // Not by the cosine: of places next to each other nothing but rounding would be left.
    const double apart = sourceRadius - receiverRadius, half = std::sin(angle / 2);
    return std::sqrt(apart * apart + 4 * sourceRadius * receiverRadius * half * half + along * along);
}

Detour::Detour(const RoundPath& path) : path_(path) {
    const double a = path.radius, s = path.sourceRadius, r = path.receiverRadius;
    const double fromSource = std::acos(std::min(1.0, a / s)), fromReceiver = std::acos(std::min(1.0, a / r));
    phase_ = path.angle - fromSource - fromReceiver;
    lit_ = phase_ < 0;
    if (lit_) {
        findMirror();
    } else {
        // Nearer than 1e-6 of the radius all is as there.
        before_ = std::sqrt(std::max(1e-6, (s / a) * (s / a) - 1)) * a;
        after_ = std::sqrt(std::max(1e-6, (r / a) * (r / a) - 1)) * a;
        over_ = a * phase_;
        firstAngle_ = fromSource;
        lastAngle_ = path.angle - fromReceiver;
    }
    const double flat = before_ + over_ + after_;
    length_ = std::hypot(flat, path.along);
    slope_ = path.along / flat;
    sine_ = flat / length_;
}

/// Finds the place on the surface at which both angles are the same.
void Detour::findMirror() {
    const double a = path_.radius, s = path_.sourceRadius, r = path_.receiverRadius;
    /// Below 0 where the angle to the source is larger than the one to the listener.
    const auto apart = [&](double off) {
        const double other = path_.angle - off;
        return r * std::sin(other) * (s * std::cos(off) - a) - (r * std::cos(other) - a) * s * std::sin(off);
    };
    // Regula falsi; an end that stays counts half, as in the Illinois method.
    double low = 0, high = path_.angle, atLow = apart(low), atHigh = apart(high), middle = 0.5 * path_.angle;
    for (int i = 0, stayed = 0; i < 60 && high - low > 1e-15 && atLow > 0 && atHigh < 0; ++i) {
        middle = (low * atHigh - high * atLow) / (atHigh - atLow);
        const double at = apart(middle);
        if (std::abs(at) < 1e-16 * s * r) break;
        if (at > 0) {
            low = middle;
            atLow = at;
            if (stayed == 1) atHigh *= 0.5;
            stayed = 1;
        } else {
            high = middle;
            atHigh = at;
            if (stayed == -1) atLow *= 0.5;
            stayed = -1;
        }
    }
    firstAngle_ = lastAngle_ = middle;
    const auto to = [&](double radius, double off) {
        const double half = std::sin(off / 2);
        return std::max(1e-3 * a, std::sqrt((radius - a) * (radius - a) + 4 * radius * a * half * half));
    };
    before_ = to(s, firstAngle_);
    after_ = to(r, path_.angle - firstAngle_);
    const double across = s * std::sin(firstAngle_), off = s * std::cos(firstAngle_) - a,
                 pathLength = std::hypot(across, off);
    cosine_ = std::max(1e-7, pathLength > 0 ? off / pathLength : 1.0);
}

double Detour::lengthBy(double offset) const {
    const double first = before_ + 0.5 * over_, last = after_ + 0.5 * over_;
    return std::hypot(first, middleAlong() + offset) + std::hypot(last, path_.along - middleAlong() - offset);
}

double Detour::size(double waveNumber) const {
    return std::cbrt(0.5 * waveNumber * sine_ * path_.radius);
}

Complex Detour::dark(double waveNumber) const {
    const double a = path_.radius, first = before_ / sine_, last = after_ / sine_, m = size(waveNumber);
    // How wide it has become across: on a sphere it comes together again behind it, to no less than a wave.
    double width = length_;
    Complex turned = 1;
    if (path_.sphere) {
        width = (before_ + after_) * std::cos(phase_) + (a - before_ * after_ / a) * std::sin(phase_);
        if (width < 0) turned = kRoundI;
        width = std::max(std::abs(width), path_.sourceRadius * path_.receiverRadius / (a * (1 + waveNumber * a)));
    }
    const Complex along = surfaceFunction(m * phase_) -
                          roundTransition(waveNumber * first * last / (first + last), phase_ * sine_) * (sine_ / m);
    return -kRoundEighth * turned * (m / sine_) * along * std::sqrt(2 / (waveNumber * first * last * width));
}

double Detour::light(double waveNumber) const {
    const double off = 2 * size(waveNumber) * cosine_;
    return lit_ ? off * off / (1 + off * off) : 0;
}

Complex Detour::lightBy(double waveNumber, double mirrors) const {
    const double first = before_ / sine_, last = after_ / sine_, m = size(waveNumber), xi = -2 * m * cosine_;
    const double cosine = cosine_ * sine_;
    const Complex edge = roundTransition(waveNumber * first * last / (first + last), -2 * cosine) * (sine_ / m);
    const double fraction = 1 - (1 - mirrors) * light(waveNumber);
    // The poles of the mirror and of the edge of the shadow cancel each other.
    const double pole = 0.5 / (std::sqrt(kRoundPi) * xi);
    const Complex surface = surfaceFunction(xi) - pole;
    const Complex along = fraction * surface + (pole - edge);
    const double flat = before_ + after_;
    const double wide = (flat + 2 * before_ * after_ / (path_.radius * cosine_)) / sine_;
    const double width = path_.sphere ? flat + 2 * before_ * after_ * cosine_ / path_.radius : length_;
    return -kRoundEighth * std::sqrt(-4 / xi) * std::polar(1.0, -xi * xi * xi / 12) * along / std::sqrt(wide * width);
}

/// A point inside a small part of the layer in which waves creep along a rigid surface hears the same as one at that
/// height, because the field does not change across the layer; the theory does not hold on the surface itself.
Complex Detour::pressure(double waveNumber, double mirrors) const {
    const double a = path_.radius,
                 lowest = a * (1 + std::min(kMaxLift, kLift / std::cbrt(2 * std::pow(waveNumber * a, 2))));
    if (std::min(path_.sourceRadius, path_.receiverRadius) >= lowest) return by(waveNumber, mirrors);
    RoundPath up = path_;
    up.sourceRadius = std::max(up.sourceRadius, lowest);
    up.receiverRadius = std::max(up.receiverRadius, lowest);
    const Detour above(up);
    const auto straight = [&](const RoundPath& path, double length) {
        const double distance = path.distance();
        return std::polar(1 / std::max(distance, kNearest), -waveNumber * (distance - length));
    };
    const Complex fraction = above.by(waveNumber, mirrors) / straight(up, above.length_);
    return (fraction + (above.lit_ && !lit_ ? 1.0 : 0.0)) * straight(path_, length_);
}

Complex Detour::by(double waveNumber, double mirrors) const {
    return lit_ ? lightBy(waveNumber, mirrors) : dark(waveNumber);
}

namespace {

/// Spherical Hankel functions of the second kind, of orders up to `last`, as far as they are numbers.
std::vector<Complex> hankels(double x, std::size_t last) {
    std::vector<Complex> h{kRoundI * std::polar(1 / x, -x), Complex(-x, 1) * std::polar(1 / (x * x), -x)};
    for (std::size_t n = 1; n < last; ++n) h.push_back((2.0 * static_cast<double>(n) + 1) / x * h[n] - h[n - 1]);
    return h;
}

/// Spherical Bessel functions by Miller's rule.
std::vector<double> bessels(double x, std::size_t last) {
    const std::size_t from = last + 20 + static_cast<std::size_t>(x);
    std::vector<double> j(from + 2);
    j[from] = 1e-280;
    for (std::size_t n = from; n >= 1; --n) {
        j[n - 1] = (2.0 * static_cast<double>(n) + 1) / x * j[n] - j[n + 1];
        if (std::abs(j[n - 1]) > 1e200)
            for (std::size_t k = n - 1; k <= from; ++k) j[k] *= 1e-200;
    }
    const double j0 = std::sin(x) / x, j1 = j0 / x - std::cos(x) / x;
    const double scale = std::abs(j0) > std::abs(j1) ? j0 / j[0] : j1 / j[1];
    for (double& value : j) value *= scale;
    return j;
}

}  // namespace

Complex rigidSphereField(const RoundPath& path, double waveNumber) {
    const double k = waveNumber, x = k * path.radius;
    // By the radii alone terms fall with the order as powers of this; where both touch the sphere not all count.
    const double fall = std::log(path.sourceRadius * path.receiverRadius / (path.radius * path.radius));
    const double maximum = x + 12 + 8 * std::cbrt(x) + 30 / std::max(0.05, fall);
    const auto last = static_cast<std::size_t>(maximum);
    const std::vector<double> j = bessels(x, last + 2);
    const std::vector<Complex> h = hankels(x, last + 2), s = hankels(k * path.sourceRadius, last + 2),
                               r = hankels(k * path.receiverRadius, last + 2);
    const double cosine = std::cos(path.angle);
    double legendre = 1, before = 0;
    Complex sum = 0;
    for (std::size_t n = 0; n <= last; ++n) {
        const auto order = static_cast<double>(n);
        const double slope = order / x * j[n] - j[n + 1];
        const Complex outward = order / x * h[n] - h[n + 1], term = slope / outward * s[n] * r[n];
        if (!std::isfinite(term.real()) || !std::isfinite(term.imag())) break;
        sum += (2 * order + 1) * legendre * term;
        const double next = ((2 * order + 1) * cosine * legendre - order * before) / (order + 1);
        before = legendre;
        legendre = next;
    }
    return kRoundI * k * sum;
}

}  // namespace rtsg
