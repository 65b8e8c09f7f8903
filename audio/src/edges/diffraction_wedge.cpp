// The coefficients of the uniform theory of diffraction for rigid wedges.
#include "diffraction_wedge.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <span>

namespace rtsg {
namespace {

using Complex = std::complex<double>;
constexpr double kPi = std::numbers::pi;
constexpr Complex kI(0, 1);
/// exp(i pi / 4)
const Complex kEighth(std::numbers::sqrt2 / 2, std::numbers::sqrt2 / 2);

/// a / b of finite numbers: the library's looks after infinities, at several times the cost.
Complex quotient(const Complex& a, const Complex& b) {
    const double scale = 1 / std::norm(b);
    return {(a.real() * b.real() + a.imag() * b.imag()) * scale, (a.imag() * b.real() - a.real() * b.imag()) * scale};
}

/// erfc(z) for z on the diagonal: its series near 0, its continued fraction beyond.
Complex complementaryError(Complex z) {
    if (std::abs(z) < 2.5) {
        Complex sum = z, term = z;
        for (int n = 1; n < 80; ++n) {
            term *= -z * z / static_cast<double>(n);
            sum += term / static_cast<double>(2 * n + 1);
        }
        return 1.0 - 2 / std::sqrt(kPi) * sum;
    }
    // Enough terms that the next ones are below rounding.
    Complex fraction = z;
    for (int n = static_cast<int>(340 / std::norm(z)) + 3; n >= 1; --n) fraction = z + quotient(0.5 * n, fraction);
    return std::exp(-z * z) / (std::sqrt(kPi) * fraction);
}

Complex wave(double waveNumber, double distance) {
    return std::polar(1 / distance, -waveNumber * distance);
}

}  // namespace

namespace {

/// exp(i r r) erfc(r exp(i pi / 4)) from r = 0 to kEnd, which does not turn: by cubics between places.
class SmoothError {
  public:
    static constexpr int kEnd = 8;

    SmoothError() {
        for (int i = 0; i <= kEnd * kSteps; ++i) {
            const double r = static_cast<double>(i) / kSteps;
            const Complex value = std::polar(1.0, r * r) * complementaryError(kEighth * r);
            const Complex slope = 2.0 * kI * r * value - 2 / std::sqrt(kPi) * kEighth;
            points_[static_cast<std::size_t>(i)] = {value, slope / static_cast<double>(kSteps)};
        }
    }

    Complex at(double r) const {
        const auto i = std::min(static_cast<std::size_t>(r * kSteps), points_.size() - 2);
        const WedgePoint &a = points_[i], &b = points_[i + 1];
        const double t = r * kSteps - static_cast<double>(i), rest = 1 - t;
        return rest * rest * ((1 + 2 * t) * a.value + t * a.slope) +
               t * t * ((1 + 2 * rest) * b.value - rest * b.slope);
    }

  private:
    static constexpr int kSteps = 64;  // to 2e-9
    struct WedgePoint {
        Complex value, slope;
    };
    std::array<WedgePoint, kEnd * kSteps + 1> points_;
};

}  // namespace

Complex diffractionTransition(double x) {
    static const SmoothError smooth;
    if (!(x > 0)) return 0;
    const double root = std::sqrt(x);
    if (root < SmoothError::kEnd) return kI * std::conj(kEighth) * std::sqrt(kPi) * root * smooth.at(root);
    // The asymptotic series, whose next term is below 3e-9.
    const Complex each = 0.5 * kI / x;
    Complex sum = 1;
    for (const double factor : {11.0, 9.0, 7.0, 5.0, 3.0, 1.0}) sum = 1.0 + factor * each * sum;
    return sum;
}

Complex fresnelBeyond(double x) {
    if (!(x > 1e-12)) return 1;
    return diffractionTransition(x) * std::polar(1 / std::sqrt(kPi * x), -kPi / 4);
}

double WedgePath::pathLengthBy(double offset) const {
    const double fraction = sourceRadius / (sourceRadius + receiverRadius);
    return std::hypot(sourceRadius, along * fraction + offset) +
           std::hypot(receiverRadius, along * (1 - fraction) - offset);
}

double WedgePath::distanceAt(double angle) const {
    // Not by the cosine: of places next to each other nothing but rounding would be left.
    const double apart = sourceRadius - receiverRadius, half = std::sin(angle / 2);
    return std::sqrt(apart * apart + 4 * sourceRadius * receiverRadius * half * half + along * along);
}

WedgeTerm::WedgeTerm(double n, double beta, double sign) {
    // The whole number that comes nearest to 2 pi n N - beta = sign pi.
    const double rotations = std::round((beta + sign * kPi) / (2 * kPi * n)), angle = (kPi + sign * beta) / (2 * n);
    const double off = sign * (beta - 2 * kPi * n * rotations) + kPi;  // from the boundary, sign pi beyond it
    const double epsilon = std::remainder(off, 2 * kPi);
    if (std::abs(epsilon) < 1e-6 && std::abs(std::sin(angle)) < 1e-5) {
        limit_ = epsilon <= 0 ? -n : n;  // on the boundary itself it is dark
        epsilon_ = std::abs(epsilon);
        return;
    }
    const double cosine = std::cos((2 * kPi * n * rotations - beta) / 2);
    cotangent_ = 1 / std::tan(angle);
    angle_ = 2 * cosine * cosine;
}

Complex WedgeTerm::at(double kl) const {
    if (limit_ != 0) return limit_ * (std::sqrt(2 * kPi * kl) - 2 * kl * epsilon_ * kEighth) * kEighth;
    return cotangent_ * diffractionTransition(kl * angle_);
}

WedgeBend::WedgeBend(const WedgePath& path) {
    const double n = path.opening / kPi, rs = path.sourceRadius, rr = path.receiverRadius;
    const double pathLength = path.shortestPath(), toEdge = pathLength * rs / (rs + rr), fromEdge = pathLength - toEdge;
    const double sine = (rs + rr) / pathLength;
    length_ = toEdge * fromEdge / pathLength * sine * sine;
    strength_ = 1 / (2 * n * std::sqrt(2 * kPi * toEdge * fromEdge * pathLength) * sine);
    const double difference = path.receiverAngle - path.sourceAngle, sum = path.receiverAngle + path.sourceAngle;
    terms_ = {WedgeTerm(n, difference, 1), WedgeTerm(n, difference, -1), WedgeTerm(n, sum, 1), WedgeTerm(n, sum, -1)};
}

WedgeBend::Beside WedgeBend::at(double waveNumber) const {
    const Complex strength = -std::conj(kEighth) * (strength_ / std::sqrt(waveNumber));
    const double kl = waveNumber * length_;
    return {strength * (terms_[0].at(kl) + terms_[1].at(kl)), strength * (terms_[2].at(kl) + terms_[3].at(kl))};
}

WedgeField wedgeField(const WedgePath& path, double waveNumber) {
    const double difference = path.receiverAngle - path.sourceAngle, sum = path.receiverAngle + path.sourceAngle;
    WedgeField field;
    if (std::abs(difference) < kPi) field.direct = wave(waveNumber, path.distanceAt(difference));
    if (sum < kPi) field.mirrored = wave(waveNumber, path.distanceAt(sum));
    // For the other face, with angles counted from it.
    const double other = 2 * path.opening - sum;
    if (other < kPi) field.mirrored += wave(waveNumber, path.distanceAt(other));
    const WedgeBend::Beside beside = WedgeBend(path).at(waveNumber);
    const Complex turned = std::polar(1.0, -waveNumber * path.shortestPath());
    field.besideDirect = turned * beside.direct;
    field.besideMirrored = turned * beside.mirrored;
    return field;
}

namespace {

/// For points at complex lengths. For the lowest wave number, the farthest from the real axis is kLast / k sqrt(2)
/// away. The nearest is kSmall away, relative to the smaller one of wave length and excess length.
constexpr double kLast = 24, kSmall = 0.004, kMin = 1e-9;
constexpr std::size_t kMaxNodes = 64;

/// The integrand over an edge by the length of the way, without its phase; where the way's length is complex, too.
class EdgeIntegrand {
  public:
    explicit EdgeIntegrand(const WedgePath& path)
        : index_(kPi / path.opening),
          twice_(2 * path.sourceRadius * path.receiverRadius),
          shortest_(path.shortestPath()) {
        const double difference = path.receiverAngle - path.sourceAngle, sum = path.receiverAngle + path.sourceAngle;
        angles_ = {index_ * (kPi + difference), index_ * (kPi - difference), index_ * (kPi + sum),
                   index_ * (kPi - sum)};
        for (std::size_t i = 0; i < 4; ++i) {
            sines_[i] = std::sin(angles_[i]);
            cosines_[i] = std::cos(angles_[i]);
        }
    }

    /// At the length `way` - i `down`, where `past` is the difference of the former to the shortest path; down > 0.
    WedgeEnd at(double past, double down) const {
        const Complex longer(past, -down), less = longer * (longer + 2 * shortest_) / twice_;  // cosh - 1
        // This is the root that goes on from real lengths, for which cosh is above 1.
        Complex sinh = root(less * (less + 2.0));
        if (sinh.imag() > 0) sinh = -sinh;
        const Complex exponential = 1.0 + less + sinh;
        const double angle = index_ * std::atan2(exponential.imag(), exponential.real());
        const double size = std::exp(0.5 * index_ * std::log(std::norm(exponential)));
        const Complex power(size * std::cos(angle), size * std::sin(angle)), by = 0.5 * (power + quotient(1.0, power));
        const Complex factor = quotient(-index_ / (2 * kPi * twice_), sinh);
        const auto part = [&](std::size_t i) { return quotient(sines_[i], by - cosines_[i]); };
        return {factor * (part(0) + part(1)), factor * (part(2) + part(3))};
    }

  private:
    /// The library's looks after infinities, at several times the cost.
    static Complex root(const Complex& z) {
        const double large = std::sqrt(0.5 * (std::sqrt(std::norm(z)) + std::abs(z.real())));
        if (!(large > 0)) return 0;
        const double small = 0.5 * z.imag() / large;
        return z.real() >= 0 ? Complex(large, small) : Complex(std::abs(small), std::copysign(large, z.imag()));
    }

    double index_, twice_, shortest_;
    std::array<double, 4> angles_{}, sines_{}, cosines_{};
};

/// exp(-kLast 2^(-m / 2)).
double fallen(std::size_t m) {
    static const auto table = [] {
        std::array<double, 2 * kMaxNodes> result{};
        for (std::size_t i = 0; i < result.size(); ++i)
            result[i] = std::exp(-kLast * std::exp2(-0.5 * static_cast<double>(i)));
        return result;
    }();
    return table[m];
}

}  // namespace

void wedgeBeyond(const WedgePath& path, double waveNumber, double pathLength, std::span<WedgeEnd> ends) {
    // Integrates along complex lengths way - i u, on which the integrand decays as exp(-k u) without oscillation. There
    // is no singularity on that side, except for the shortest path; `past` is the distance from it. Uses trapezoids in
    // log u, whose errors decrease as exp(-pi^2 / step). All wave numbers share one set of points, because steps of u
    // are two of theirs.
    const EdgeIntegrand integrand(path);
    const double past = std::max(0.0, pathLength - path.shortestPath());
    const double highest = waveNumber * std::exp2(0.5 * static_cast<double>(ends.size() - 1));
    const double minimum = std::max(kSmall * std::min(1 / highest, past), kMin / highest);
    std::ranges::fill(ends, WedgeEnd{});
    double down = kLast / waveNumber;
    for (std::size_t node = 0; node < kMaxNodes; ++node, down *= 0.5) {
        // Below the last place the integrand is taken to go on like 1, or at the shortest way like 1 / sqrt(u).
        const bool last = down < minimum || node + 1 == kMaxNodes;
        const double rest = last ? (down > past ? 1 / (std::numbers::sqrt2 - 1) : 1.0) : 0.0;
        const WedgeEnd here = integrand.at(past, down);
        const Complex weight = -kI * (std::numbers::ln2 * down * (1 + rest));
        const Complex direct = weight * here.besideDirect, mirrored = weight * here.besideMirrored;
        for (std::size_t i = 0; i < std::min(ends.size(), 2 * node + 1); ++i) {
            const double fraction = fallen(2 * node - i);
            ends[i].besideDirect += fraction * direct;
            ends[i].besideMirrored += fraction * mirrored;
        }
        if (last) break;
    }
}

namespace {

/// The measure of how far a wedge's transition has gone; 0 at the nearest boundary.
double fromBoundary(const TwoWedgePath::Wedge& wedge) {
    const double n = wedge.opening / kPi;
    double minimum = 2;
    for (const double beta : {wedge.out - wedge.in, wedge.out + wedge.in})
        for (const double sign : {1.0, -1.0}) {
            const double rotations = std::round((beta + sign * kPi) / (2 * kPi * n));
            const double cosine = std::cos((2 * kPi * n * rotations - beta) / 2);
            minimum = std::min(minimum, 2 * cosine * cosine);
        }
    return minimum;
}

Complex coefficient(const TwoWedgePath::Wedge& wedge, double length, double waveNumber, double mirrors) {
    const double n = wedge.opening / kPi, kl = waveNumber * length;
    const auto part = [&](double beta) { return WedgeTerm(n, beta, 1).at(kl) + WedgeTerm(n, beta, -1).at(kl); };
    return -std::conj(kEighth) / (2 * n * std::sqrt(2 * kPi * waveNumber) * wedge.sine) *
           (part(wedge.out - wedge.in) + mirrors * part(wedge.out + wedge.in));
}

}  // namespace

void setDistances(TwoWedgePath& path, double toFirst, double across, double fromSecond, double between) {
    const double a = toFirst, w = across, b = fromSecond;
    const double first = path.first.sine * path.first.sine, second = path.second.sine * path.second.sine;
    path.pathLength = a + w + b;
    path.first.whole = a * (w + b) / path.pathLength * first;
    path.second.whole = (a + w) * b / path.pathLength * second;
    // How the length of the way grows with the places on both edges: second derivatives.
    const double determinant = first * (1 / a + 1 / w) * second * (1 / w + 1 / b) - between * between / (w * w);
    const double alongFirst = first * (1 / a + 1 / (w + b)), alongSecond = second * (1 / (a + w) + 1 / b);
    // Chosen so that at the boundary of the second edge half of the first edge's wave is left, and the other way round.
    path.second.part = std::pow(w * b / (w + b), 2) * determinant / alongFirst;
    path.first.part = std::pow(a * w / (a + w), 2) * determinant / alongSecond;
    path.spreading = path.first.sine * path.second.sine / (a * w * b * std::sqrt(determinant));
}

double nearerToSecond(const TwoWedgePath& path) {
    const double first = path.first.whole * fromBoundary(path.first);
    const double second = path.second.whole * fromBoundary(path.second);
    return first + second > 0 ? first / (first + second) : 0.5;
}

Complex twoWedgeField(const TwoWedgePath& path, double waveNumber, double mirrorsFirst, double mirrorsSecond) {
    // The one nearer to its boundary has the shorter distance; from the one to the other all is smooth.
    const double near = nearerToSecond(path), far = 1 - near, first = near * near / (near * near + far * far);
    const auto both = [&](double firstLength, double secondLength) {
        return coefficient(path.first, firstLength, waveNumber, mirrorsFirst) *
               coefficient(path.second, secondLength, waveNumber, mirrorsSecond);
    };
    Complex bent = 0;
    if (first > 1e-4) bent += first * both(path.first.whole, path.second.part);
    if (first < 1 - 1e-4) bent += (1 - first) * both(path.first.part, path.second.whole);
    // On a face sound and its mirror image are one: both edges have counted it twice.
    const double once = path.onOneFace ? 1 / (1 + (mirrorsFirst + mirrorsSecond) / 2) : 1;
    return once * path.spreading * std::polar(1.0, -waveNumber * path.pathLength) * bent;
}

}  // namespace rtsg
