// The field that goes along a rigid convex surface: Pekeris's function, from the light through the shadow's boundary
// into the dark.
//
// Source: Pathak, Radio Science 14 (1979), 419-435; of what curves and how sound-hard surfaces differ from each other
// to the next order Franz and Klante, IRE Trans. AP-7 (1959), S68. Threading: pure functions.
#pragma once

#include <complex>

namespace rtsg {

/// (1 / sqrt(pi)) times the integral of (V' - q V) / (W' - q W) exp(-i xi t) over t, V and W = W2 being Fock's
/// functions of t, without its pole -1 / (2 sqrt(pi) xi): regular everywhere. `xi`: below 0 in the light. `q`, at most
/// 0, is what is left of the surface's curvature beside the first order.
std::complex<double> surfaceFunction(double xi, double q);

}  // namespace rtsg
