// Diffraction by an edge: the field of a point source near a rigid wedge, by the uniform theory of diffraction. For an
// edge of finite length the part beyond its ends is subtracted, by the exact integral over an edge.
//
// The edge is the z axis; the faces of the wedge are at the angles 0 and `opening` of the air (2 pi: a half plane). The
// field is relative to that of the source at 1 m in a free field, with time as exp(i w t). It is continuous everywhere.
// Within about a wave length of the edge the theory is not exact (some tenths of a decibel at a third of one). Two
// edges in a row: the product of their coefficients, where the edge nearer to its boundary has the shorter distances,
// and half of it if the path between them lies on a common face. Source: Kouyoumjian and Pathak, Proc. IEEE 62 (1974),
// 1448-1461, hard boundaries; Pierce, JASA 55 (1974), 941-955; for ends Svensson, Fred and Vanderkooy, JASA 106 (1999),
// 2331-2344. Threading: pure functions.
#pragma once

#include <array>
#include <complex>
#include <limits>
#include <span>

namespace rtsg {

struct WedgePath {
    double opening = 0;                           // radians of air, above 0 to 2 pi
    double sourceRadius = 1, receiverRadius = 1;  // m from the edge
    double along = 0;                             // m between both in the edge's direction
    double sourceAngle = 0, receiverAngle = 0;    // radians from the face at 0

    /// The ends of the edge, metres from the place of the shortest way, as `along` counts.
    double from = -std::numeric_limits<double>::infinity(), to = std::numeric_limits<double>::infinity();

    /// Metres from one to the other by way of a place on the edge, `offset` metres on from where that is shortest.
    double pathLengthBy(double offset) const;
    double shortestPath() const { return pathLengthBy(0); }
    /// The length of the straight way to the receiver from the source, or from an image of it, that is seen under
    /// `angle` about the edge.
    double distanceAt(double angle) const;
};

struct WedgeField {
    /// Direct sound, and sound that either face mirrors, each exp(-i k d) / d; 0 where they do not reach.
    std::complex<double> direct, mirrored;
    /// Over the edge: the parts that make each of the above continuous.
    std::complex<double> besideDirect, besideMirrored;

    std::complex<double> total() const { return direct + mirrored + besideDirect + besideMirrored; }
};

/// `waveNumber` in 1/m. Of an edge that goes on for ever.
WedgeField wedgeField(const WedgePath& path, double waveNumber);

/// One of the four terms of the coefficient of a wedge, for all wave numbers: a cotangent times a transition.
class WedgeTerm {
  public:
    WedgeTerm() = default;
    /// The term of cot((pi + sign beta) / 2 n) for an opening of `n` pi; `sign` is 1 or -1.
    WedgeTerm(double n, double beta, double sign);
    /// `kl`: wave number times the distance that counts.
    std::complex<double> at(double kl) const;

  private:
    double cotangent_ = 0, angle_ = 0;
    double limit_ = 0, epsilon_ = 0;  // at the boundary, where the cotangent is infinite: n times a side, and radians
};

/// The parts of wedgeField() by way of the edge, of one path for many wave numbers.
class WedgeBend {
  public:
    explicit WedgeBend(const WedgePath& path);
    struct Beside {
        std::complex<double> direct, mirrored;
    };
    /// Re the phase of the shortest way: times exp(i k shortestPath()).
    Beside at(double waveNumber) const;

  private:
    std::array<WedgeTerm, 4> terms_;
    double length_ = 0;  // m that count in the transition
    double strength_ = 0;
};

/// The pressure of one side of an edge, which begins at a place where the way is `way` metres and leads away from the
/// place of the shortest way without end. It is a multiple of exp(-i k way).
struct WedgeEnd {
    std::complex<double> besideDirect, besideMirrored;
};
/// For wave numbers from `waveNumber` on, each sqrt(2) times the one before.
void wedgeBeyond(const WedgePath& path, double waveNumber, double pathLength, std::span<WedgeEnd> ends);

/// A way from a source round one edge and then another one, at the place where it is shortest.
struct TwoWedgePath {
    struct Wedge {
        double opening = 0;      // radians of air
        double in = 0, out = 0;  // radians from one face: where sound comes from, and where it goes to
        double sine = 1;         // of the angle between the way and the edge
        /// Metres that count in the transition at this edge: with the other edge a part of the straightened way, and
        /// with the wave that it bends.
        double whole = 1, part = 1;
    };
    Wedge first, second;
    double pathLength = 0;   // m
    double spreading = 0;    // of the pressure of a bent wave, 1 / m^2
    bool onOneFace = false;  // the way between the edges lies on a face of both
};
/// From the lengths of its three parts, the sines, and `between`: the cosine of the angle between both edges as seen
/// along the way, that is of their parts square to it, times both sines. Sets whole, part, way and spreading.
void setDistances(TwoWedgePath& path, double toFirst, double across, double fromSecond, double between);

/// How much nearer one is to a boundary of the second edge than to one of the first: 1 on the former, 0 on the latter.
double nearerToSecond(const TwoWedgePath& path);

/// The part of the field that both edges bend, relative to that of the source in the open at 1 m. Faces mirror these
/// shares of the pressure.
std::complex<double> twoWedgeField(const TwoWedgePath& path, double waveNumber, double mirrorsFirst = 1,
                                   double mirrorsSecond = 1);

/// Fresnel's transition function 2 i sqrt(x) exp(i x) times the integral of exp(-i t^2) from sqrt(x) on; x >= 0.
std::complex<double> diffractionTransition(double x);
/// exp(i x) erfc(sqrt(i x)): twice the share that a half plane leaves, x radians from its shadow boundary.
std::complex<double> fresnelBeyond(double x);

}  // namespace rtsg
