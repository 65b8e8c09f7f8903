// Computes the speech transmission index, its interval, and the levels of its background noise.
#include <rtsg/audio/speech_transmission.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <complex>
#include <numbers>
#include <string>

#include <fmt/format.h>

#include "batch_interval.h"

namespace rtsg {
namespace {

constexpr double kNoSpeech = -std::numeric_limits<double>::infinity();
/// The first and the last octave of speech.
constexpr std::size_t kSpeechFirst = kBand1k - 3, kSpeechBands = 7;
using SpeechBands = std::array<double, kSpeechBands>;

/// A.2.2.
constexpr std::array<double, 14> kModulationsHz{.63, .8, 1, 1.25, 1.6, 2, 2.5, 3.15, 4, 5, 6.3, 8, 10, 12.5};
/// Table A.2: the level from which on speech is heard at all, dB.
constexpr SpeechBands kThresholdDb{46, 27, 12, 6.5, 7.5, 8, 12};

/// Tables A.3 and A.4: how much octaves weigh, how much pairs of neighbours repeat each other, and levels of the
/// octaves, dB re the A-weighted level of all.
struct VoiceTable {
    SpeechBands weight, repeats, levelDb;
};
constexpr VoiceTable kMale{{.085, .127, .23, .233, .309, .224, .173},
                           {.085, .078, .065, .011, .047, .095, 0},
                           {2.9, 2.9, -.8, -6.8, -12.8, -18.8, -24.8}};
constexpr VoiceTable kFemale{{0, .117, .223, .216, .328, .25, .194},
                             {0, .099, .066, .062, .025, .076, 0},
                             {kNoSpeech, 5.3, -1.9, -9.1, -15.8, -16.7, -18}};

/// Energies of the octaves of speech, and their Fourier transforms at the modulation frequencies.
struct Modulated {
    SpeechBands energy{};
    std::array<std::array<std::complex<double>, kModulationsHz.size()>, kSpeechBands> at{};

    void add(const Bands& bands, const std::array<std::complex<double>, kModulationsHz.size()>& turned) {
        for (std::size_t k = 0; k < kSpeechBands; ++k) {
            const double e = bands[kSpeechFirst + k];
            energy[k] += e;
            for (std::size_t m = 0; m < kModulationsHz.size(); ++m) at[k][m] += e * turned[m];
        }
    }
    void add(const Modulated& other, double factor) {
        for (std::size_t k = 0; k < kSpeechBands; ++k) {
            energy[k] += factor * other.energy[k];
            for (std::size_t m = 0; m < kModulationsHz.size(); ++m) at[k][m] += factor * other.at[k][m];
        }
    }
};

/// The modulation of energy that comes evenly over `length` seconds about a time.
std::complex<double> turnedAt(double hz, double seconds, double length) {
    const double half = std::numbers::pi * hz * length;
    const double spread = half > 1e-9 ? std::sin(half) / half : 1;
    return std::polar(spread, -2 * std::numbers::pi * hz * seconds);
}

Modulated modulatedOf(std::span<const Arrival> arrivals) {
    Modulated result;
    std::array<std::complex<double>, kModulationsHz.size()> turned;
    for (const Arrival& arrival : arrivals) {
        for (std::size_t m = 0; m < turned.size(); ++m) turned[m] = turnedAt(kModulationsHz[m], arrival.seconds, 0);
        result.add(arrival.energy, turned);
    }
    return result;
}

/// The modulations of histograms whose bins lie at the same times, as those of batches do.
std::vector<Modulated> modulatedOf(std::span<const EnergyHistogram> batches) {
    std::vector<Modulated> result(batches.size());
    std::size_t longest = 0;
    for (const EnergyHistogram& batch : batches) longest = std::max(longest, batch.bins.size());
    std::array<std::complex<double>, kModulationsHz.size()> turned;
    for (std::size_t i = 0; i < longest; ++i) {
        const double length = 1 / batches.front().binsPerSecond, middle = batches.front().startOf(i) + length / 2;
        for (std::size_t m = 0; m < turned.size(); ++m) turned[m] = turnedAt(kModulationsHz[m], middle, length);
        for (std::size_t k = 0; k < batches.size(); ++k)
            if (i < batches[k].bins.size()) result[k].add(batches[k].bins[i], turned);
    }
    return result;
}

double intensityOf(double decibels) {
    return std::pow(10.0, decibels / 10);
}

/// Table A.1, A.5.3: how far an octave of this level masks the next higher one, dB relative to its own level.
double maskingDb(double level) {
    if (level < 63) return .5 * level - 65;
    if (level < 67) return 1.8 * level - 146.9;
    return level < 100 ? .5 * level - 59.8 : -10;
}

/// A.5: from the remaining modulations to the index.
SpeechEstimate indexOf(const Modulated& modulated, const SpeechOptions& options) {
    constexpr double kMaxDb = 15;  // of a ratio of signal to noise that counts
    const VoiceTable& voice = options.female ? kFemale : kMale;
    SpeechEstimate result;
    if (std::ranges::all_of(modulated.energy, [](double e) { return !(e > 0); })) return result;
    double lower = 0, sum = 0, before = 0;  // intensity and index of the octave below
    for (std::size_t k = 0; k < kSpeechBands; ++k) {
        const double decibels = options.level + voice.levelDb[k] +
                                10 * std::log10(4 * std::numbers::pi * std::max(0.0, modulated.energy[k]));
        const double speech = intensityOf(decibels);
        const double noise = options.noise ? intensityOf((*options.noise)[kSpeechFirst + k]) : 0;
        const double masked = lower > 0 ? lower * intensityOf(maskingDb(10 * std::log10(lower))) : 0;
        const double fraction = speech / (speech + noise + masked + intensityOf(kThresholdDb[k]));
        lower = speech + noise;
        if (voice.levelDb[k] == kNoSpeech) continue;
        double index = 0;
        for (const std::complex<double>& one : modulated.at[k]) {
            const double m = modulated.energy[k] > 0 ? std::abs(one) / modulated.energy[k] * fraction : 0;
            const double ratio = m <= 0 ? -kMaxDb : m >= 1 ? kMaxDb : 10 * std::log10(m / (1 - m));
            index += (std::clamp(ratio, -kMaxDb, kMaxDb) + kMaxDb) / (2 * kMaxDb) / kModulationsHz.size();
        }
        if (k > 0) sum -= voice.repeats[k - 1] * std::sqrt(before * index);
        sum += voice.weight[k] * index;
        before = index;
        result.mti[kSpeechFirst + k] = index;
        result.level[kSpeechFirst + k] = decibels;
    }
    result.sti = std::clamp(sum, 0.0, 1.0);
    return result;
}

}  // namespace

double modulationTransfer(const Echogram& echogram, std::size_t band, double hz) {
    std::complex<double> sum = 0;
    double energy = 0;
    for (const Arrival& arrival : echogram.arrivals) {
        energy += arrival.energy[band];
        sum += arrival.energy[band] * turnedAt(hz, arrival.seconds, 0);
    }
    const double length = 1 / echogram.late.binsPerSecond;
    for (std::size_t i = 0; i < echogram.late.bins.size(); ++i) {
        energy += echogram.late.bins[i][band];
        sum += echogram.late.bins[i][band] * turnedAt(hz, echogram.late.startOf(i) + length / 2, length);
    }
    return std::abs(sum) / energy;
}

SpeechEstimate estimateSpeech(std::span<const Arrival> arrivals, std::span<const EnergyHistogram> batches,
                              const SpeechOptions& options) {
    const Modulated exact = modulatedOf(arrivals);
    const auto count = static_cast<double>(batches.size());
    const std::vector<Modulated> parts = modulatedOf(batches);
    Modulated sum;
    for (const Modulated& part : parts) sum.add(part, 1);
    Modulated whole = exact;
    if (!batches.empty()) whole.add(sum, 1 / count);
    SpeechEstimate result = indexOf(whole, options);
    if (batches.empty()) result.ci95 = 0;
    if (batches.size() < 2) return result;
    std::vector<double> without;
    for (const Modulated& part : parts) {
        Modulated rest = exact;
        rest.add(sum, 1 / (count - 1));
        rest.add(part, -1 / (count - 1));
        without.push_back(indexOf(rest, options).sti);
    }
    result.ci95 = halfWidth95(without, result.sti);
    return result;
}

namespace {

/// From 63 Hz to 8 kHz, NC-15 to NC-70.
constexpr double kNoiseCriteria[12][8] = {
    {47, 36, 29, 22, 17, 14, 12, 11}, {51, 40, 33, 26, 22, 19, 17, 16}, {54, 44, 37, 31, 27, 24, 22, 21},
    {57, 48, 41, 35, 31, 29, 28, 27}, {60, 52, 45, 40, 36, 34, 33, 32}, {64, 56, 50, 45, 41, 39, 38, 37},
    {67, 60, 54, 49, 46, 44, 43, 42}, {71, 64, 58, 54, 51, 49, 48, 47}, {74, 67, 62, 58, 56, 54, 53, 52},
    {77, 71, 67, 63, 61, 59, 58, 57}, {80, 75, 71, 68, 66, 64, 63, 62}, {83, 79, 75, 72, 71, 70, 69, 68}};
/// From 31.5 Hz to 8 kHz: a curve of number N has the level a + b N.
constexpr double kNoiseRating[9][2] = {{55.4, .681}, {35.5, .79},   {22, .87},     {12, .93}, {4.8, .974},
                                       {0, 1},       {-3.5, 1.015}, {-6.1, 1.025}, {-8, 1.03}};

std::optional<double> wholeNumber(std::string_view text) {
    double value = 0;
    const auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (problem != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) return std::nullopt;
    return value;
}

/// Levels of octaves from one on as all of them.
Bands spreadOut(std::span<const double> levels, int first) {
    Bands bands;
    for (int b = 0; b < kBandCount; ++b)
        bands[static_cast<std::size_t>(b)] =
            levels[static_cast<std::size_t>(std::clamp(b - first, 0, static_cast<int>(levels.size()) - 1))];
    return bands;
}

bool isCurve(std::string_view text, char first, char second) {
    const auto upper = [](char c) { return c >= 'a' && c <= 'z' ? static_cast<char>(c - 'a' + 'A') : c; };
    return text.size() > 2 && upper(text[0]) == first && upper(text[1]) == second;
}

}  // namespace

Result<Bands> noiseLevels(std::string_view text) {
    std::string_view rest = text;
    if (isCurve(text, 'N', 'C') || isCurve(text, 'N', 'R')) {
        rest.remove_prefix(text[2] == '-' ? 3 : 2);
        const std::optional<double> number = wholeNumber(rest);
        const bool criteria = isCurve(text, 'N', 'C');
        if (!number || *number < (criteria ? 15 : 0) || *number > (criteria ? 70 : 130))
            return fail(fmt::format("there are NC15 to NC70 and NR0 to NR130, and not '{}'", text));
        std::vector<double> levels;
        if (criteria) {
            const double at = (*number - 15) / 5;
            const auto low = static_cast<std::size_t>(std::min(10.0, at));
            for (std::size_t i = 0; i < 8; ++i)
                levels.push_back(
                    std::lerp(kNoiseCriteria[low][i], kNoiseCriteria[low + 1][i], at - static_cast<double>(low)));
            return spreadOut(levels, 1);
        }
        for (const auto& [a, b] : kNoiseRating) levels.push_back(a + b * *number);
        return spreadOut(levels, 0);
    }
    std::vector<double> levels;
    for (bool more = true; more;) {
        const std::size_t comma = rest.find(',');
        more = comma != rest.npos;
        const std::optional<double> level = wholeNumber(rest.substr(0, comma));
        if (!level || std::abs(*level) > 200)
            return fail(fmt::format("'{}' is neither NC35, NR35 nor levels in dB with commas between", text));
        levels.push_back(*level);
        rest.remove_prefix(more ? comma + 1 : rest.size());
    }
    if (levels.size() < 6 || levels.size() > 10)
        return fail(
            fmt::format("levels are those of 6 or 7 octaves from 125 Hz, 8 from 63 Hz, 9 or 10 from 31.5 Hz; "
                        "here are {}",
                        levels.size()));
    return spreadOut(levels, levels.size() >= 9 ? 0 : levels.size() == 8 ? 1 : 2);
}

std::string_view speechRating(double sti) {
    constexpr std::array<std::string_view, 12> kNames{"U", "J", "I", "H", "G", "F", "E", "D", "C", "B", "A", "A+"};
    if (!std::isfinite(sti)) return "";
    // Bands of .04 whose middles are .38, .42 ... .74.
    return kNames[static_cast<std::size_t>(std::clamp(std::floor((sti - .36) / .04 + 1 + 1e-9), 0.0, 11.0))];
}

}  // namespace rtsg
