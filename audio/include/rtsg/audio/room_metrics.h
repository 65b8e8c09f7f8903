// Room-acoustic figures of an Echogram, one per octave band, with confidence intervals.
//
// Source: ISO 3382-1:2009 clauses 3, A.2 and B.1 by Schroeder backward integration: EDT, T20 and T30 are least-squares
// lines through 0..-10, -5..-25 and -5..-35 dB of the decay curve at all times, extrapolated to 60 dB. All but G count
// from the onset (A.3.4), and what comes before it is not in them: from where the energy of the last millisecond is
// first within 20 dB of the most that a millisecond brings. That is the time of an arrival if one brings it there, as
// direct sound does; within bins energy comes evenly. G is re the same source at 10 m in free field (unit power), of
// all that comes. Differs: the onset is that of each octave, not of the broadband response, as no filter delays or
// smears one; there is no background noise to correct for, so the curve is integrated from the end of the echogram. A
// figure is NaN where the band has no energy or the decay is too short for it: EDT, T20 and T30 need a curve down to
// -20, -35 and -45 dB, as there is no T30 without T20. Threading: pure functions.
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
    /// Early lateral energy fraction, A.2.4: what a figure-of-eight microphone, whose null points to the source, hears
    /// from .005 to .08 s, of all until .08 s. NaN unless directions are known, as those of the next two.
    Bands lf = allBands(std::numeric_limits<double>::quiet_NaN());
    /// Interaural cross-correlation coefficients to .08 s and from there on, B.1: see interaural.h.
    Bands iaccEarly = lf, iaccLate = lf;
};

RoomMetrics roomMetrics(const Echogram& echogram);

/// The time at which the response of one band begins, s from emission; NaN where the band has no energy.
double onset(const Echogram& echogram, std::size_t band);

/// Reverberation times, s, of a decay that is the sum of two exponentials; NaN where there are not two.
struct DecaySlopes {
    double early = std::numeric_limits<double>::quiet_NaN(), late = std::numeric_limits<double>::quiet_NaN();
};

struct MetricsEstimate {
    RoomMetrics value;
    /// Half width of the 95 % interval; 0 where there is nothing random, NaN where it cannot be had.
    RoomMetrics ci95;
    /// The number of bands whose figures were worked out; the others hold the same as one of them.
    int bandsApart = 0;
    /// The two slopes of the bands for which hasTwoSlopes() is true, as far as their decays go down to -45 dB.
    std::array<DecaySlopes, kBandCount> slopes{};
};

/// The degree of curvature of a decay, percent: 100 (T30 / T20 - 1); NaN without a T30. ISO 3382-2:2008, annex B.
Bands curvature(const RoomMetrics& metrics);
/// Whether a band decays with more than one slope, as in rooms that are coupled: by more than 10 % of curvature
/// (ibid.), whatever the 95 % intervals leave open.
bool hasTwoSlopes(const MetricsEstimate& estimate, std::size_t band);

/// `batches` are independent, equally long estimates of the late part, each on its own an unbiased one. The value is
/// that of their mean; the interval comes from the delete-one jackknife over batches with Student's t, of fewer degrees
/// of freedom where single batches stand out. The onset is that of the mean; by what it varies itself is in the
/// intervals of C50, C80, D50, Ts and LF. `across`: TraceResult::across, for LF; IACC are left out.
MetricsEstimate estimateMetrics(const std::vector<Arrival>& arrivals, std::span<const EnergyHistogram> batches,
                                const glm::dvec3& across = glm::dvec3(0));

/// Schroeder's curve of one band: decibels of the energy that comes later than k * `gridSeconds` after the
/// onset, re all from there on; down to just below -65 dB or its end. Empty where the band has no energy.
std::vector<double> decayCurveDb(const Echogram& echogram, std::size_t band, double gridSeconds);

/// The largest half width from 125 Hz to 4 kHz in just noticeable differences (EDT and T 5 %, C80 1 dB, D50 .05, G 1
/// dB) of the figures that exist.
double largestError(const MetricsEstimate& estimate);

/// A change of a figure that is just noticed, of a value in its unit: ISO 3382-1:2009, table A.1 (T, EDT 5 %; C80, G 1
/// dB; D50, LF .05; Ts .01 s) and B.1 (IACC .075); Bradley et al. 1999 for C50 (1.1 dB). NaN for what is none of them.
double noticeableDifference(Bands RoomMetrics::* figure, double value);

/// Two-sided 95 % quantile of Student's t; NaN below one degree of freedom.
double studentT95(double degreesOfFreedom);

}  // namespace rtsg
