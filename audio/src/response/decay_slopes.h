// Fits two exponentials to a decay curve, as in coupled rooms. Threading: pure functions.
#pragma once

#include <span>

#include <rtsg/audio/room_metrics.h>

namespace rtsg {

/// The sum of two exponentials whose level in dB is nearest to a decay curve, from `levelDb` every `gridSeconds`: least
/// squares between -5 and -50 dB (Levenberg 1944; the model: Xiang & Goggans, JASA 110 (2001), 1415-1424). NaN where
/// there are no two, or the curve does not go on to -45 dB.
DecaySlopes fitSlopes(std::span<const double> levelDb, double gridSeconds);

}  // namespace rtsg
