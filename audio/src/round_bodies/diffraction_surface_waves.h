// The field along a rigid convex surface: Pekeris's function, from the light across the shadow boundary into the
// shadow.
//
// Source: Pathak, Radio Science 14 (1979), 419-435. Threading: pure functions.
#pragma once

#include <complex>

namespace rtsg {

/// (1 / sqrt(pi)) times the integral of V' / W' exp(-i xi t) over t, V and W = W2 being Fock's functions of t, without
/// its pole -1 / (2 sqrt(pi) xi): regular everywhere. `xi`: below 0 in the light.
std::complex<double> surfaceFunction(double xi);

}  // namespace rtsg
