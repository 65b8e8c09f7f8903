// Computes the figures of a source at one listener.
#include "position_figures.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace rtsg {

void setFigures(ListenReport::Source& source, const EarCorrelation& ears, const SpeechOptions& speech) {
    constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
    /// The share of the radiated energy that may still be to come; if it is more, figures of all energy are not known.
    constexpr double kMaxTruncated = 1e-2;
    /// Where more than this share escapes, what comes back may be single reflections: T20 and T30 are then figures of a
    /// decay only if rays agree about it within so much of them.
    constexpr double kMaxEscaped = 0.5, kWidest = 0.25;
    const TraceResult& trace = source.trace;
    source.metrics = trace.metrics();
    const InterauralEstimate interaural = ears.estimate(trace.arrivals, trace.batches, trace.across);
    source.metrics.value.iaccEarly = interaural.value.early;
    source.metrics.value.iaccLate = interaural.value.late;
    source.metrics.ci95.iaccEarly = interaural.ci95.early;
    source.metrics.ci95.iaccLate = interaural.ci95.late;
    RoomMetrics &value = source.metrics.value, &width = source.metrics.ci95;
    for (std::size_t b = 0; b < kBandCount; ++b)
        for (Bands RoomMetrics::* time : {&RoomMetrics::t20, &RoomMetrics::t30})
            if (trace.escaped[b] > kMaxEscaped && !((width.*time)[b] <= kWidest * (value.*time)[b]))
                (value.*time)[b] = (width.*time)[b] = kNan;
    for (std::size_t b = 0; b < kBandCount; ++b) {
        if (std::isfinite(source.metrics.ci95.lf[b])) continue;
        for (RoomMetrics* m : {&source.metrics.value, &source.metrics.ci95})
            if (m == &source.metrics.ci95 || !std::isfinite(source.metrics.value.lf[b]))
                m->iaccEarly[b] = m->iaccLate[b] = kNan;
    }
    source.speech = estimateSpeech(trace.arrivals, trace.batches, speech);
    const auto speechOctaves = std::span(trace.truncated).subspan(kBand1k - 3, 7);
    if (std::ranges::any_of(speechOctaves, [](double fraction) { return fraction > kMaxTruncated; }))
        source.speech.sti = source.speech.ci95 = kNan;
}

}  // namespace rtsg
