// Speech transmission index: the intelligibility of a source's speech at a listener, from 0 to 1.
//
// Source: IEC 60268-16:2011 (edition 4; edition 5 of 2020 has another spectrum of male speech below 500 Hz, and none of
// female speech), by its indirect method: modulation transfer from the squared impulse response (Schroeder 1981), 14
// modulation frequencies in the octaves from 125 Hz to 8 kHz, then noise, masking of each octave by the next lower one
// at its level, and the threshold of hearing (annex A). Differs: the squared response is the traced energy over time,
// so no filter smears it; the speech is omnidirectional, like sources in all other figures. Threading: pure functions.
#pragma once

#include <limits>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include <rtsg/audio/echogram.h>
#include <rtsg/core/diagnostic.h>

namespace rtsg {

struct SpeechOptions {
    bool female = false;
    double level = 60;           // dB(A) of the speech at 1 m, without the room: 60 is normal, 70 raised
    std::optional<Bands> noise;  // dB of the background noise at the listener in each octave; none: silence
};

struct SpeechEstimate {
    double sti = std::numeric_limits<double>::quiet_NaN(), ci95 = sti;  // half width of the 95 % interval
    Bands mti = allBands(sti);    // modulation transfer indices; NaN in octaves that are not used
    Bands level = allBands(sti);  // dB of the speech at the listener
};

/// The modulation transfer at one modulation frequency, Hz: the share of the modulation depth that is left; NaN without
/// energy.
double modulationTransfer(const Echogram& echogram, std::size_t band, double hz);

/// `batches`: as in estimateMetrics(). STI is NaN if no sound arrives.
SpeechEstimate estimateSpeech(std::span<const Arrival> arrivals, std::span<const EnergyHistogram> batches,
                              const SpeechOptions& options);

/// Levels of a background noise in dB: "NC35" (ANSI S12.2-2008, 15 to 70, interpolated between its curves), "NR35" (ISO
/// R 1996:1971), or octave levels separated by commas: 10 or 9 from 31.5 Hz, 8 from 63 Hz, 7 or 6 from 125 Hz; beyond
/// these the nearest level counts.
Result<Bands> noiseLevels(std::string_view text);

/// The qualification band of an index by IEC 60268-16:2011, annex F, "A+" (best) to "U"; empty for NaN.
std::string_view speechRating(double sti);

}  // namespace rtsg
