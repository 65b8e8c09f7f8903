// The coefficients of the uniform theory of diffraction for rigid wedges.
#include <rtsg/audio/wedge.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>

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
    // So many terms that the next are below rounding.
    Complex fraction = z;
    for (int n = static_cast<int>(340 / std::norm(z)) + 3; n >= 1; --n) fraction = z + quotient(0.5 * n, fraction);
    return std::exp(-z * z) / (std::sqrt(kPi) * fraction);
}

/// cot((pi + sign beta) / 2 n) F(k L a(beta)), by its limit where the one is infinite and the other nothing.
Complex term(double n, double beta, double sign, double kl) {
    // The whole number that comes nearest to 2 pi n N - beta = sign pi.
    const double turns = std::round((beta + sign * kPi) / (2 * kPi * n));
    const double off = sign * (beta - 2 * kPi * n * turns) + kPi;  // from the boundary, sign pi beyond it
    const double epsilon = std::remainder(off, 2 * kPi);
    if (std::abs(epsilon) < 1e-6 && std::abs(std::sin((kPi + sign * beta) / (2 * n))) < 1e-5) {
        const double side = epsilon <= 0 ? -1 : 1;  // on the boundary itself it is dark
        return n * (std::sqrt(2 * kPi * kl) * side - 2 * kl * epsilon * kEighth) * kEighth;
    }
    const double cosine = std::cos((2 * kPi * n * turns - beta) / 2);
    return 1 / std::tan((kPi + sign * beta) / (2 * n)) * diffractionTransition(kl * 2 * cosine * cosine);
}

Complex wave(double waveNumber, double distance) {
    return std::polar(1 / distance, -waveNumber * distance);
}

}  // namespace

Complex diffractionTransition(double x) {
    if (!(x > 0)) return 0;
    const double root = std::sqrt(x);
    return 2.0 * kI * root * std::polar(1.0, x) * (std::sqrt(kPi) / 2) * std::conj(kEighth) *
           complementaryError(kEighth * root);
}

double WedgePath::wayBy(double offset) const {
    const double share = sourceRadius / (sourceRadius + receiverRadius);
    return std::hypot(sourceRadius, along * share + offset) + std::hypot(receiverRadius, along * (1 - share) - offset);
}

double WedgePath::distanceAt(double angle) const {
    // Not by the cosine: of places next to each other nothing but rounding would be left.
    const double apart = sourceRadius - receiverRadius, half = std::sin(angle / 2);
    return std::sqrt(apart * apart + 4 * sourceRadius * receiverRadius * half * half + along * along);
}

WedgeField wedgeField(const WedgePath& path, double waveNumber) {
    const double n = path.opening / kPi, rs = path.sourceRadius, rr = path.receiverRadius;
    const double way = path.shortestWay(), toEdge = way * rs / (rs + rr), fromEdge = way - toEdge;
    const double sine = (rs + rr) / way;
    const double length = toEdge * fromEdge / way * sine * sine, kl = waveNumber * length;
    const double difference = path.receiverAngle - path.sourceAngle, sum = path.receiverAngle + path.sourceAngle;
    WedgeField field;
    if (std::abs(difference) < kPi) field.direct = wave(waveNumber, path.distanceAt(difference));
    if (sum < kPi) field.mirrored = wave(waveNumber, path.distanceAt(sum));
    // By the other face, whose angles count from it.
    const double other = 2 * path.opening - sum;
    if (other < kPi) field.mirrored += wave(waveNumber, path.distanceAt(other));
    const Complex strength = -std::conj(kEighth) / (2 * n * std::sqrt(2 * kPi * waveNumber) * sine) *
                             wave(waveNumber, toEdge) * std::sqrt(toEdge / (fromEdge * way)) *
                             std::polar(1.0, -waveNumber * fromEdge);
    field.besideDirect = strength * (term(n, difference, 1, kl) + term(n, difference, -1, kl));
    field.besideMirrored = strength * (term(n, sum, 1, kl) + term(n, sum, -1, kl));
    return field;
}

namespace {

/// The integrand over an edge by the length of the way, without its phase; where the way's length is complex, too.
class EdgeIntegrand {
  public:
    explicit EdgeIntegrand(const WedgePath& path)
        : index_(kPi / path.opening), twice_(2 * path.sourceRadius * path.receiverRadius) {
        square_ =
            path.sourceRadius * path.sourceRadius + path.receiverRadius * path.receiverRadius + path.along * path.along;
        const double difference = path.receiverAngle - path.sourceAngle, sum = path.receiverAngle + path.sourceAngle;
        angles_ = {index_ * (kPi + difference), index_ * (kPi - difference), index_ * (kPi + sum),
                   index_ * (kPi - sum)};
        for (std::size_t i = 0; i < 4; ++i) {
            sines_[i] = std::sin(angles_[i]);
            cosines_[i] = std::cos(angles_[i]);
        }
    }

    /// Adds it, `weight` times.
    void addAt(Complex way, Complex weight, WedgeEnd& sum) const {
        const Complex cosh = (way * way - square_) / twice_, sinh = std::sqrt(cosh - 1.0) * std::sqrt(cosh + 1.0);
        const Complex power = std::exp(index_ * std::log(cosh + sinh)), by = 0.5 * (power + quotient(1.0, power));
        const Complex factor = -index_ / (2 * kPi * twice_) * quotient(weight, sinh);
        const auto part = [&](std::size_t i) { return quotient(sines_[i], by - cosines_[i]); };
        sum.besideDirect += factor * (part(0) + part(1));
        sum.besideMirrored += factor * (part(2) + part(3));
    }

  private:
    double index_, twice_, square_ = 0;
    std::array<double, 4> angles_{}, sines_{}, cosines_{};
};

struct QuadratureNode {
    double at, weight;
};
/// Gauss and Laguerre's, of exp(-x) from 0 on, and Gauss and Legendre's, from -1 to 1.
constexpr std::array<QuadratureNode, 6> kLaguerre{{{0.22284660417926069, 0.45896467394996359},
                                                   {1.1889321016726230, 0.41700083077212099},
                                                   {2.9927363260593141, 0.11337338207404498},
                                                   {5.7751435691045105, 0.010399197453149075},
                                                   {9.8374674183825899, 0.00026101720281493206},
                                                   {15.982873980601702, 8.9854790642962124e-7}}};
constexpr std::array<QuadratureNode, 5> kLegendre{{{-0.90617984593866399, 0.23692688505618909},
                                                   {-0.53846931010568309, 0.47862867049936647},
                                                   {0, 0.56888888888888889},
                                                   {0.53846931010568309, 0.47862867049936647},
                                                   {0.90617984593866399, 0.23692688505618909}}};

}  // namespace

WedgeEnd wedgeBeyond(const WedgePath& path, double waveNumber, double way) {
    const EdgeIntegrand integrand(path);
    const Complex down = -kI / waveNumber;
    WedgeEnd sum;
    // Into complex lengths way - i p / k, along which it dies away as exp(-p) and does not turn. Nothing is singular on
    // that side; the shortest way is, and `past` says how far it is from there.
    const double past = waveNumber * std::max(0.0, way - path.shortestWay());
    if (past > 2) {
        for (const QuadratureNode& node : kLaguerre) integrand.addAt(way + down * node.at, down * node.weight, sum);
        return sum;
    }
    // By q with p = q q, and finer towards 0.
    constexpr double kEnd = 4.5, kFiner = 0.25;
    const double least = std::max(0.5 * std::sqrt(past), 1e-4);
    for (double to = kEnd; to > 0;) {
        const double from = to > least ? to * kFiner : 0;
        for (const QuadratureNode& node : kLegendre) {
            const double q = 0.5 * (from + to) + 0.5 * (to - from) * node.at;
            integrand.addAt(way + down * (q * q), down * ((to - from) * node.weight * q * std::exp(-q * q)), sum);
        }
        to = from;
    }
    return sum;
}

namespace {

/// What decides how far a wedge's transition has gone: nothing at the boundary that is nearest.
double fromBoundary(const TwoWedgePath::Wedge& wedge) {
    const double n = wedge.opening / kPi;
    double least = 2;
    for (const double beta : {wedge.out - wedge.in, wedge.out + wedge.in})
        for (const double sign : {1.0, -1.0}) {
            const double turns = std::round((beta + sign * kPi) / (2 * kPi * n));
            const double cosine = std::cos((2 * kPi * n * turns - beta) / 2);
            least = std::min(least, 2 * cosine * cosine);
        }
    return least;
}

Complex coefficient(const TwoWedgePath::Wedge& wedge, double length, double waveNumber, double mirrors) {
    const double n = wedge.opening / kPi, kl = waveNumber * length;
    const auto part = [&](double beta) { return term(n, beta, 1, kl) + term(n, beta, -1, kl); };
    return -std::conj(kEighth) / (2 * n * std::sqrt(2 * kPi * waveNumber) * wedge.sine) *
           (part(wedge.out - wedge.in) + mirrors * part(wedge.out + wedge.in));
}

}  // namespace

void setDistances(TwoWedgePath& path, double toFirst, double across, double fromSecond, double between) {
    const double a = toFirst, w = across, b = fromSecond;
    const double first = path.first.sine * path.first.sine, second = path.second.sine * path.second.sine;
    path.way = a + w + b;
    path.first.whole = a * (w + b) / path.way * first;
    path.second.whole = (a + w) * b / path.way * second;
    // How the length of the way grows with the places on both edges: second derivatives.
    const double determinant = first * (1 / a + 1 / w) * second * (1 / w + 1 / b) - between * between / (w * w);
    const double alongFirst = first * (1 / a + 1 / (w + b)), alongSecond = second * (1 / (a + w) + 1 / b);
    // Such that at the boundary of the second edge half of what the first bends is left, and the other way round.
    path.second.part = std::pow(w * b / (w + b), 2) * determinant / alongFirst;
    path.first.part = std::pow(a * w / (a + w), 2) * determinant / alongSecond;
    path.spreading = path.first.sine * path.second.sine / (a * w * b * std::sqrt(determinant));
}

Complex twoWedgeField(const TwoWedgePath& path, double waveNumber, double mirrorsFirst, double mirrorsSecond) {
    const bool bendsMore = path.first.whole * fromBoundary(path.first) >= path.second.whole * fromBoundary(path.second);
    const Complex first =
        coefficient(path.first, bendsMore ? path.first.whole : path.first.part, waveNumber, mirrorsFirst);
    const Complex second =
        coefficient(path.second, bendsMore ? path.second.part : path.second.whole, waveNumber, mirrorsSecond);
    // On a face sound and its mirror image are one: both edges have counted it twice.
    const double once = path.onOneFace ? 1 / (1 + (mirrorsFirst + mirrorsSecond) / 2) : 1;
    return once * path.spreading * std::polar(1.0, -waveNumber * path.way) * first * second;
}

}  // namespace rtsg
