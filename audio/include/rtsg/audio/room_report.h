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

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include <glm/glm.hpp>

#include <rtsg/audio/acoustic_geometry.h>
#include <rtsg/audio/bands.h>
#include <rtsg/audio/echogram.h>
#include <rtsg/audio/panning.h>
#include <rtsg/audio/room_metrics.h>
#include <rtsg/audio/room_openings.h>
#include <rtsg/audio/room_plan.h>
#include <rtsg/audio/room_size.h>
#include <rtsg/audio/speech_transmission.h>
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
        SpeechEstimate speech;
        double schroederHz = std::numeric_limits<double>::quiet_NaN();  // ListenReport::Source::schroederHz
    };
    /// A material of the surfaces, with the name or the line of the node that says it.
    struct Material {
        std::string name;
        double area = 0;  // m^2
        AcousticMaterial material;
    };
    /// The openings through which the sound of one source leaves the room.
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
    SpeechOptions speech;        // of the STI
    /// The room around the first source, as far as it is known; what it is made of, the largest area first; what
    /// formulas say of it, s.
    RoomSize room;
    std::vector<Material> materials;
    Bands sabine = allBands(std::numeric_limits<double>::quiet_NaN()), eyring = sabine;
    RoomPlan plan;            // at the height of the first listener
    std::uint64_t rays = 0;   // those of a source once, however many listeners share them
    double seconds = 0;       // of computing
    Diagnostics diagnostics;  // leaks and sealed sources that were not told before

    Average average() const;
    /// The most bands that rays were followed for, and that figures were worked out for, at any pair: what walls and
    /// air treat alike is computed once.
    int bandsTraced() const;
    int bandsMeasured() const;
    /// The mean of what is known of the STI; NaN of nothing.
    double meanSpeech() const;
    /// 2000 sqrt(T / V), Hz: below it single modes make the sound of the room, which rays know nothing of. Of the first
    /// pair's, or else with Sabine's T; NaN where the room is not closed.
    double schroederHz() const;
    /// The mean of the octaves of 500 and 1000 Hz.
    static double single(const Bands& figure) { return (figure[kBand1k - 1] + figure[kBand1k]) / 2; }

    std::string toText() const;
    /// {"title":…,"bands_hz":[…],"bands_computed":{"walls":…,"figures":…},"pairs":[{"source":…,"listener":…,…}],"average":{"mean":{…},"deviation":{…}},
    /// "single":{…},"room":{…},"losses":[{"source":…,"escaped":…,"openings":[{"kind":"leak","share":…,"center":[…],…}]}]};
    /// what is no number is null.
    std::string toJson() const;
    /// A page that is read on paper as well: figures with their intervals, a plan, materials, decay curves with the
    /// lines that were fitted, reflectograms and energograms, drawn in SVG. Colours say how many just noticeable
    /// differences an interval has, or a place is from the mean of all.
    std::string toHtml() const;
};

}  // namespace rtsg
