// Sound round an edge: the field of a point source beside a rigid wedge, by the uniform theory of diffraction.
//
// The edge is the z axis, the wedge's faces are at the angles 0 and `opening` of the air beside it (2 pi: a half
// plane). The field is relative to that of the source in the open at 1 m, time as exp(i w t). It is continuous
// everywhere; near enough to the edge for a wave length to matter the theory is not exact any more (some tenths of a
// decibel at a third of one). Source: Kouyoumjian and Pathak, Proc. IEEE 62 (1974), 1448-1461, hard boundaries.
// Threading: pure functions.
#pragma once

#include <complex>

namespace rtsg {

struct WedgePath {
    double opening = 0;                           // radians of air, above 0 to 2 pi
    double sourceRadius = 1, receiverRadius = 1;  // m from the edge
    double along = 0;                             // m between both in the edge's direction
    double sourceAngle = 0, receiverAngle = 0;    // radians from the face at 0
};

struct WedgeField {
    /// What comes straight, and what comes mirrored by either face; 0 where they do not reach. exp(-i k d) / d.
    std::complex<double> direct, mirrored;
    /// By way of the edge: the parts that make each of the above continuous.
    std::complex<double> besideDirect, besideMirrored;

    std::complex<double> total() const { return direct + mirrored + besideDirect + besideMirrored; }
};

/// `waveNumber` in 1/m.
WedgeField wedgeField(const WedgePath& path, double waveNumber);

/// Fresnel's transition function 2 i sqrt(x) exp(i x) times the integral of exp(-i t^2) from sqrt(x) on; x >= 0.
std::complex<double> diffractionTransition(double x);

}  // namespace rtsg
