// Room-acoustic figures of an Echogram, one per octave band, with confidence intervals.
//
// Source: ISO 3382-1:2009 clauses 3, A.2 and B.1 by Schroeder backward integration. EDT, T20 and T30 are least-squares
// lines through 0..-10, -5..-25 and -5..-35 dB of the decay curve, extrapolated to 60 dB. All figures but G start at
// the onset (A.3.4) and ignore earlier energy. The onset is where the energy of the last millisecond is first within 20
// dB of the largest energy of a millisecond; mostly it is the time of direct sound. Inside a bin energy is spread
// evenly. G is relative to the same source at 10 m in a free field (unit power). Differs: each octave has its own
// onset, because no filter delays or smears it; there is no background noise, so the curve is integrated from the end
// of the echogram. A figure is NaN if the band has no energy or its decay is too short: EDT, T20 and T30 need a curve
// down to -20, -35 and -45 dB. Threading: pure functions.
#pragma once

#include <array>
#include <limits>
#include <span>
#include <vector>

#include <rtsg/audio/echogram.h>

namespace rtsg {

struct RoomMetrics {
    Bands edt{}, t20{}, t30{};  // s
    Bands c50{}, c80{};         // dB
    Bands d50{};                // ratio
    Bands ts{};                 // s
    Bands g{};                  // dB
    /// Early lateral energy fraction, A.2.4: the energy from .005 to .08 s in a figure-of-eight microphone whose null
    /// points to the source, divided by all energy until .08 s. This and the next two are NaN unless directions are
    /// known.
    Bands lf = allBands(std::numeric_limits<double>::quiet_NaN());
    /// Interaural cross-correlation coefficients until .08 s and after it, B.1: see response/interaural.h.
    Bands iaccEarly = lf, iaccLate = lf;
};

RoomMetrics roomMetrics(const Echogram& echogram);

/// The time at which the response of one band begins, s from emission; NaN if the band has no energy.
double onset(const Echogram& echogram, std::size_t band);

/// Reverberation times, s, of a decay that is the sum of two exponentials; NaN if there are not two.
struct DecaySlopes {
    double early = std::numeric_limits<double>::quiet_NaN(), late = std::numeric_limits<double>::quiet_NaN();
};

struct MetricsEstimate {
    RoomMetrics value;
    /// Half width of the 95 % interval; 0 if nothing is random, NaN if it cannot be estimated.
    RoomMetrics ci95;
    /// The number of bands whose figures were computed; the others are copies.
    int bandsApart = 0;
    /// The two slopes of the bands with hasTwoSlopes(), if their decays go down to -45 dB.
    std::array<DecaySlopes, kBandCount> slopes{};
};

/// The degree of curvature of a decay, percent: 100 (T30 / T20 - 1); NaN without a T30. ISO 3382-2:2008, annex B.
Bands curvature(const RoomMetrics& metrics);
/// Whether a band decays with more than one slope, as in coupled rooms: whether its curvature is surely more than 10 %
/// (ibid.), given the 95 % intervals.
bool hasTwoSlopes(const MetricsEstimate& estimate, std::size_t band);

/// `batches` are independent, unbiased estimates of the late part, of equal length. The result is computed from their
/// mean; the interval comes from the delete-one jackknife over batches with Student's t, with fewer degrees of freedom
/// if single batches stand out. The onset is that of the mean; its own variation is in the intervals of C50, C80, D50,
/// Ts and LF. `across`: TraceResult::across, for LF. IACC are left out.
MetricsEstimate estimateMetrics(const std::vector<Arrival>& arrivals, std::span<const EnergyHistogram> batches,
                                const glm::dvec3& across = glm::dvec3(0));

/// Schroeder's curve of one band: the energy that arrives later than k * `gridSeconds` after the onset, in decibels
/// relative to all energy after the onset, down to just below -65 dB or to its end. Empty if the band has no energy.
std::vector<double> decayCurveDb(const Echogram& echogram, std::size_t band, double gridSeconds);

/// The largest half width of the existing figures from 125 Hz to 4 kHz, in just noticeable differences (EDT and T 5 %,
/// C80 1 dB, D50 .05, G 1 dB).
double largestError(const MetricsEstimate& estimate);

/// The just noticeable difference of a figure at a value, in its unit: ISO 3382-1:2009, table A.1 (T, EDT 5 %; C80, G 1
/// dB; D50, LF .05; Ts .01 s) and B.1 (IACC .075); Bradley et al. 1999 for C50 (1.1 dB). NaN for anything else.
double noticeableDifference(Bands RoomMetrics::* figure, double value);

/// Two-sided 95 % quantile of Student's t; NaN below one degree of freedom.
double studentT95(double degreesOfFreedom);

}  // namespace rtsg
