// The fields of a point source beside a rigid sphere and a rigid cylinder without ends, by their series: in double
// precision, with Bessel functions of complex arguments of its own.
#pragma once

#include <algorithm>
#include <cmath>
#include <complex>
#include <vector>

namespace rtsg::test {

using RoundValue = std::complex<double>;

/// Bessel's J and Hankel's H of the second kind, orders 0 to `last`, of an argument with no imaginary part above 0.
struct CylinderFunctions {
    CylinderFunctions(RoundValue z, int last) : j(static_cast<std::size_t>(last) + 2), h(j.size()) {
        const RoundValue i(0, 1);
        const double size = std::abs(z);
        const int from = std::max(last + 2, static_cast<int>(size)) + 30 + static_cast<int>(6 * std::cbrt(size + last));
        // Miller's rule, and exp(i z) = J0 + 2 sum i^k J_k.
        std::vector<RoundValue> all(static_cast<std::size_t>(from) + 2);
        all[static_cast<std::size_t>(from)] = 1e-280;
        for (std::size_t n = static_cast<std::size_t>(from); n >= 1; --n) {
            all[n - 1] = 2.0 * static_cast<double>(n) / z * all[n] - all[n + 1];
            if (std::abs(all[n - 1]) > 1e200)
                for (std::size_t k = n - 1; k < all.size(); ++k) all[k] *= 1e-200;
        }
        RoundValue sum = all[0], phase = 1;
        for (std::size_t n = 1; n < all.size(); ++n) sum += 2.0 * (phase *= i) * all[n];
        const RoundValue scale = std::exp(i * z) / sum;
        for (RoundValue& value : all) value *= scale;
        std::copy_n(all.begin(), j.size(), j.begin());
        first(z, all);
        for (std::size_t n = 1; n + 1 < h.size(); ++n) h[n + 1] = 2.0 * static_cast<double>(n) / z * h[n] - h[n - 1];
    }
    /// For order m at z.
    RoundValue jSlope(int m, RoundValue z) const { return slope(j, m, z); }
    RoundValue hSlope(int m, RoundValue z) const { return slope(h, m, z); }

    std::vector<RoundValue> j, h;

  private:
    static RoundValue slope(const std::vector<RoundValue>& f, int m, RoundValue z) {
        return static_cast<double>(m) / z * f[static_cast<std::size_t>(m)] - f[static_cast<std::size_t>(m) + 1];
    }
    void first(RoundValue z, const std::vector<RoundValue>& all) {
        const RoundValue i(0, 1);
        if (std::abs(z) < 2) {
            // Neumann's series of Y0; Y1 by the Wronskian.
            RoundValue even = 0;
            for (std::size_t k = 1; 2 * k < all.size(); ++k)
                even += (k % 2 ? -1.0 : 1.0) * all[2 * k] / static_cast<double>(k);
            const RoundValue y0 = 2 / M_PI * (std::log(z / 2.0) + 0.57721566490153286) * all[0] - 4 / M_PI * even;
            h[0] = all[0] - i * y0;
            h[1] = all[1] - i * (all[1] * y0 - 2.0 / (M_PI * z)) / all[0];
            return;
        }
        // Steed's continued fraction of H' / H, for its conjugate.
        const RoundValue zz = std::conj(z);
        RoundValue fraction = 2.0 * (zz + i), c = fraction, d = 0;
        for (int k = 2; k < 2000; ++k) {
            const double a = (k - 0.5) * (k - 0.5);
            const RoundValue b = 2.0 * (zz + static_cast<double>(k) * i);
            d = 1.0 / (b + a * d);
            c = b + a / c;
            fraction *= c * d;
            if (std::abs(c * d - 1.0) < 1e-16) break;
        }
        const RoundValue ratio = std::conj(-0.5 / zz + i + i / zz * (0.25 / fraction));
        h[0] = -2.0 * i / (M_PI * z) / (all[0] * ratio + all[1]);
        h[1] = -ratio * h[0];
    }
};

/// A source and a listener beside a body about the z axis, or about 0; `angle` as seen from there.
struct BesideRound {
    double radius = 1, source = 2, listener = 2, angle = M_PI, along = 0;

    double distance() const {
        return std::sqrt(source * source + listener * listener - 2 * source * listener * std::cos(angle) +
                         along * along);
    }
    bool isLit() const { return angle < std::acos(radius / source) + std::acos(radius / listener); }
};

/// Re the source in the open at 1 m; time as exp(i w t).
inline RoundValue besideRigidCylinder(const BesideRound& at, double k) {
    const RoundValue i(0, 1);
    const double d = at.distance(), a = at.radius, r = at.source, q = at.listener, z = std::abs(at.along);
    // Over all wave numbers along the axis, a little off the real ones so that no branch is met.
    const double maximum = std::sqrt(k * k + std::pow(34 / (r + q - 2 * a), 2));
    const double off = std::min(.3 * k, 2 / std::max(z, .2 * d));
    const int steps = static_cast<int>(std::ceil(maximum / std::min(.25 / std::hypot(r + q, z), off / 6)));
    const double step = maximum / steps;
    RoundValue sum = 0;
    for (int n = z == 0 ? 0 : -steps; n <= steps; ++n) {
        const double bend = std::tanh(n * step / off);
        const RoundValue kz(n * step, off * bend), slope(1, 1 - bend * bend);
        RoundValue across = std::sqrt(k * k - kz * kz);
        if (across.imag() > 0) across = -across;
        const double size = std::abs(across * a);
        const int last = std::max(static_cast<int>(size + 8 * std::cbrt(size) + 14),
                                  static_cast<int>(std::min(300.0, 40 / std::log(r * q / (a * a)))));
        const CylinderFunctions on(across * a, last), s(across * r, last), l(across * q, last);
        RoundValue all = 0;
        for (int m = 0; m <= last; ++m) {
            const auto o = static_cast<std::size_t>(m);
            const RoundValue term = on.jSlope(m, across * a) / on.hSlope(m, across * a) * s.h[o] * l.h[o];
            if (!std::isfinite(std::abs(term))) break;
            all += (m == 0 ? 1.0 : 2.0) * std::cos(m * at.angle) * term;
        }
        sum += (z == 0 && n > 0 ? 2.0 : 1.0) * step * slope * all * std::exp(-i * kz * z);
    }
    return std::polar(1 / d, -k * d) + i / 2.0 * sum;
}

inline RoundValue besideRigidSphere(const BesideRound& at, double k) {
    const RoundValue i(0, 1);
    const double d = at.distance(), x = k * at.radius;
    // Hankel functions of the second kind upwards; on the sphere J' / H' = 1 - i Y' / H' would lose digits.
    const int last =
        static_cast<int>(x + 12 + 8 * std::cbrt(x) + 40 / std::log(at.source * at.listener / (at.radius * at.radius)));
    const auto hankels = [&](double y) {
        std::vector<RoundValue> h{i * std::polar(1 / y, -y), RoundValue(-y, 1) * std::polar(1 / (y * y), -y)};
        for (int n = 1; n < last + 2; ++n)
            h.push_back((2.0 * n + 1) / y * h[static_cast<std::size_t>(n)] - h[static_cast<std::size_t>(n) - 1]);
        return h;
    };
    const std::vector<RoundValue> on = hankels(x), s = hankels(k * at.source), l = hankels(k * at.listener);
    RoundValue sum = 0;
    for (int n = 0; n <= last; ++n) {
        const auto o = static_cast<std::size_t>(n);
        const auto order = static_cast<unsigned>(n);
        const double slope = n / x * std::sph_bessel(order, x) - std::sph_bessel(order + 1, x);
        const RoundValue outward = n / x * on[o] - on[o + 1], term = slope / outward * s[o] * l[o];
        if (!std::isfinite(std::abs(term))) break;
        sum += (2.0 * n + 1) * std::legendre(order, std::cos(at.angle)) * term;
    }
    return std::polar(1 / d, -k * d) + i * k * sum;
}

/// Two rigid cylinders along z, and a source and a listener at one height.
struct BesideTwo {
    struct SurfacePoint {
        double x = 0, y = 0;
        double to(const SurfacePoint& other) const { return std::hypot(other.x - x, other.y - y); }
        double angle(const SurfacePoint& other) const { return std::atan2(other.y - y, other.x - x); }
    };
    SurfacePoint centers[2];
    double radii[2]{};
    SurfacePoint source, listener;
};

/// Re the source in the open at 1 m: what each throws back from the other one, again and again, by Graf's theorem.
inline RoundValue besideTwoCylinders(const BesideTwo& at, double k) {
    const RoundValue i(0, 1);
    const double d = at.source.to(at.listener), apart = at.centers[0].to(at.centers[1]);
    double minimum = 1e9, longest = d;
    for (const int c : {0, 1}) {
        const double r = at.source.to(at.centers[c]), q = at.listener.to(at.centers[c]);
        minimum = std::min(minimum, r + q - 2 * at.radii[c]);
        longest = std::max(longest, r + q + 2 * apart);
    }
    const double maximum = std::sqrt(k * k + std::pow(30 / minimum, 2)), off = .3 * k;
    const int steps = static_cast<int>(std::ceil(maximum / std::min(.4 / longest, off / 6)));
    const double step = maximum / steps;
    RoundValue sum = 0;
    for (int n = 0; n <= steps; ++n) {
        const double bend = std::tanh(n * step / off);
        const RoundValue kz(n * step, off * bend), slope(1, 1 - bend * bend);
        RoundValue across = std::sqrt(k * k - kz * kz);
        if (across.imag() > 0) across = -across;
        const double size = std::abs(across) * std::max(at.radii[0], at.radii[1]);
        const int last = static_cast<int>(size + 6 * std::cbrt(size) + 12);
        const auto order = [last](int m) { return static_cast<std::size_t>(m + last); };
        // Also for negative orders.
        const auto hankel = [](const std::vector<RoundValue>& h, int m) {
            return (m < 0 && m % 2 != 0 ? -1.0 : 1.0) * h[static_cast<std::size_t>(std::abs(m))];
        };
        std::vector<RoundValue> reflects[2], coming[2], heard[2];
        const CylinderFunctions between(across * apart, 2 * last);
        for (const int c : {0, 1}) {
            const CylinderFunctions on(across * at.radii[c], last + 1);
            const CylinderFunctions s(across * at.source.to(at.centers[c]), last + 1);
            const CylinderFunctions l(across * at.listener.to(at.centers[c]), last + 1);
            const double toS = at.centers[c].angle(at.source), toL = at.centers[c].angle(at.listener);
            for (int m = -last; m <= last; ++m) {
                const int sized = std::abs(m);
                const RoundValue z = across * at.radii[c];
                reflects[c].push_back(-on.jSlope(sized, z) / on.hSlope(sized, z));
                coming[c].push_back(hankel(s.h, m) * std::polar(1.0, -m * toS));
                heard[c].push_back(hankel(l.h, m) * std::polar(1.0, m * toL));
            }
        }
        std::vector<RoundValue> now[2] = {coming[0], coming[1]};
        RoundValue all = 0;
        for (int bounce = 0; bounce < 60; ++bounce) {
            std::vector<RoundValue> next[2];
            RoundValue more = 0;
            for (const int c : {0, 1}) {
                const double phase = at.centers[c].angle(at.centers[1 - c]);
                for (int m = -last; m <= last; ++m) {
                    now[c][order(m)] *= reflects[c][order(m)];
                    more += now[c][order(m)] * heard[c][order(m)];
                }
                std::vector<RoundValue>& other = next[1 - c];
                other.assign(static_cast<std::size_t>(2 * last + 1), 0);
                for (int m = -last; m <= last; ++m)
                    for (int o = -last; o <= last; ++o)
                        other[order(o)] +=
                            now[c][order(m)] * hankel(between.h, m - o) * std::polar(1.0, (m - o) * phase);
            }
            all += more;
            for (const int c : {0, 1}) now[c] = next[c];
            if (std::abs(more) < 1e-7 * std::abs(all)) break;
        }
        sum += (n > 0 ? 2.0 : 1.0) * step * slope * all;
    }
    return std::polar(1 / d, -k * d) - i / 2.0 * sum;
}

}  // namespace rtsg::test
