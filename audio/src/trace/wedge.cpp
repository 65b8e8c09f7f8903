// The coefficients of the uniform theory of diffraction for rigid wedges.
#include <rtsg/audio/wedge.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace rtsg {
namespace {

using Complex = std::complex<double>;
constexpr double kPi = std::numbers::pi;
constexpr Complex kI(0, 1);
/// exp(i pi / 4)
const Complex kEighth(std::numbers::sqrt2 / 2, std::numbers::sqrt2 / 2);

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
    Complex fraction = z;
    for (int n = 80; n >= 1; --n) fraction = z + 0.5 * n / fraction;
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

WedgeField wedgeField(const WedgePath& path, double waveNumber) {
    const double n = path.opening / kPi, rs = path.sourceRadius, rr = path.receiverRadius;
    const double way = std::hypot(rs + rr, path.along), toEdge = way * rs / (rs + rr), fromEdge = way - toEdge;
    const double sine = (rs + rr) / way;
    const double length = toEdge * fromEdge / way * sine * sine, kl = waveNumber * length;
    const auto distance = [&](double angle) {
        return std::sqrt(rs * rs + rr * rr - 2 * rs * rr * std::cos(angle) + path.along * path.along);
    };
    const double difference = path.receiverAngle - path.sourceAngle, sum = path.receiverAngle + path.sourceAngle;
    WedgeField field;
    if (std::abs(difference) < kPi) field.direct = wave(waveNumber, distance(difference));
    if (sum < kPi) field.mirrored = wave(waveNumber, distance(sum));
    // By the other face, whose angles count from it.
    const double other = 2 * path.opening - sum;
    if (other < kPi) field.mirrored += wave(waveNumber, distance(other));
    const Complex strength = -std::conj(kEighth) / (2 * n * std::sqrt(2 * kPi * waveNumber) * sine) *
                             wave(waveNumber, toEdge) * std::sqrt(toEdge / (fromEdge * way)) *
                             std::polar(1.0, -waveNumber * fromEdge);
    field.besideDirect = strength * (term(n, difference, 1, kl) + term(n, difference, -1, kl));
    field.besideMirrored = strength * (term(n, sum, 1, kl) + term(n, sum, -1, kl));
    return field;
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
