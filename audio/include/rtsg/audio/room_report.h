// RoomReport: the figures of a room at several places, their averages, and the curves behind them, as text, JSON or one
// HTML page that needs nothing else.
//
// Source: ISO 3382-1:2009, clause 8 (spatial averages: the arithmetic mean over all pairs of source and listener) and
// table A.1 (single numbers: the mean of the octaves of 500 and 1000 Hz); ISO 3382-2:2008, annex C, for how much places
// differ. A figure that is NaN somewhere is averaged over the places that have it. Threading: a plain value.

// Example:
//     #include <rtsg/audio/room_report.h>
//     rtsg::RoomReport report;  // or SoundRenderer::survey()
//     report.title = "hall";
//     const std::string page = report.toHtml();
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <glm/glm.hpp>

#include <rtsg/audio/bands.h>
#include <rtsg/audio/echogram.h>
#include <rtsg/audio/panning.h>
#include <rtsg/audio/room_metrics.h>
#include <rtsg/audio/room_openings.h>
#include <rtsg/core/diagnostic.h>

namespace rtsg {

struct RoomReport {
    /// One source heard at one place.
    struct Pair {
        std::string source, listener;
        glm::dvec3 sourceAt{0}, listenerAt{0};
        MetricsEstimate metrics;
        Bands escaped{};  // share of the energy
        Echogram echogram;
        std::optional<Echogram> directed;  // of responses, see ListenReport::Source::directed
        int bandsTraced = 0;               // TraceResult::bandsTraced
        glm::dvec3 sourceAim{0};           // where it points, of unit length; 0 if it radiates alike to all sides
        glm::dmat3 listenerAxes{1.0};      // right, up, back
        double headRadius = kHeadRadius;   // of binaural responses
    };
    /// Where what one source emits leaves the room.
    struct Losses {
        std::string source;
        RoomOpenings openings;
    };
    struct Average {
        RoomMetrics mean, deviation;  // the latter of the sample; NaN with fewer than two places
        RoomMetrics count;            // of places that have the figure
    };

    std::string title;
    Air air;
    std::vector<Pair> pairs;
    std::vector<Losses> losses;  // a source
    std::uint64_t rays = 0;      // those of a source once, however many listeners share them
    double seconds = 0;          // of computing
    Diagnostics diagnostics;     // leaks and sealed sources that were not told before

    Average average() const;
    /// The most bands that rays were followed for, and that figures were worked out for, at any pair: what walls and
    /// air treat alike is computed once.
    int bandsTraced() const;
    int bandsMeasured() const;
    /// The mean of the octaves of 500 and 1000 Hz.
    static double single(const Bands& figure) { return (figure[kBand1k - 1] + figure[kBand1k]) / 2; }

    std::string toText() const;
    /// {"title":…,"bands_hz":[…],"bands_computed":{"walls":…,"figures":…},"pairs":[{"source":…,"listener":…,…}],"average":{"mean":{…},"deviation":{…}},
    /// "single":{…},"losses":[{"source":…,"escaped":…,"openings":[{"kind":"leak","share":…,"center":[…],…}]}]}; what is
    /// no number is null.
    std::string toJson() const;
    /// A page with tables, decay curves and energograms, drawn in SVG.
    std::string toHtml() const;
};

}  // namespace rtsg
